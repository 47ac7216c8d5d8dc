"""`palpate plot`: pictures of whole and interrupted records, with something on them, and what it refuses."""

import json
from pathlib import Path
from typing import Any

import h5py
import matplotlib.image
import numpy as np
import pytest
from command import ROOT, palpate
from synthetic import run_values, sheet_values, simulate_values

from palpate import cli, plot, record, record_layout, summary
from palpate.record_figures import LinkTrace, _rates
from palpate.recorder import Recorder

SCENE_TEXT = (ROOT / "scenes/press.toml").read_text("utf-8")
COUNTERS = {"clock_Hz": 25_000_000, "frames_lost_down": 2, "frames_lost_up": 1}
# A picture without its curves has fewer pixels that are not white.
INK_FRACTION = 0.015


def picture(file: Path) -> Any:
    return matplotlib.image.imread(file)[..., :3]


def ink(file: str) -> float:
    return float(np.mean(np.any(picture(Path(file)) < 0.99, axis=-1)))


def write_run(file: Path, board: str = "mps2_an386", ticks: int = 1000) -> Path:
    values, _ = run_values(ticks=ticks)
    record.write_record(file, record_layout.RUN, values, SCENE_TEXT, {"board": board, **COUNTERS})
    return file


def write_interrupted(file: Path) -> Path:
    """As a session leaves it whose program died: without a body, and 300 ticks that the disk was too slow for."""
    values = {p: np.asarray(a) for p, a in run_values(ticks=1000)[0].items()}
    with Recorder(file, record_layout.RUN, {"board": "native"}, scene_text=SCENE_TEXT) as recorder:
        for rows in (slice(0, 400), slice(700, 1000)):
            recorder.append({p: a[rows] for p, a in values.items() if p.startswith("ticks/")})
        recorder.append({p: a for p, a in values.items() if p.startswith("updates/")})
    with h5py.File(file, "r+") as h5:
        h5.attrs.update({"closed": np.uint8(0), "dropped_ticks": 300})
    return file


def drawn(
    file: Path, folder: Path, what: list[str] | None = None, from_s: float | None = None, to_s: float | None = None
) -> dict[str, Any]:
    values = plot.plot(file, what, from_s, to_s, folder)
    assert list(values) == [key.name for key in summary.PLOT_KEYS]
    for name in values["files"].values():
        assert ink(name) > INK_FRACTION, name
    return values


def test_a_run(tmp_path: Path) -> None:
    values = drawn(write_run(tmp_path / "record.h5"), tmp_path / "out")
    assert list(values["files"]) == ["forces.png", "path.png", "link.png", "timing.png"]
    assert (values["kind"], values["closed"], values["ticks"], values["from_s"], values["to_s"]) == ("run", True, 1000, 0.0, 0.999)


@pytest.mark.parametrize("board", ["native", "mine"])
def test_boards_without_an_instruction_count(tmp_path: Path, board: str) -> None:
    drawn(write_run(tmp_path / "record.h5", board), tmp_path / "out", ["timing"])


def test_a_simulation(tmp_path: Path) -> None:
    record.write_record(tmp_path / "record.h5", record_layout.SIMULATE, simulate_values(), SCENE_TEXT, {})
    values = drawn(tmp_path / "record.h5", tmp_path / "out")
    assert list(values["files"]) == ["forces.png", "path.png"]
    assert (values["kind"], values["ticks"]) == ("simulate", 300)


def test_an_interrupted_recording(tmp_path: Path) -> None:
    values = drawn(write_interrupted(tmp_path / "record.h5"), tmp_path / "out")
    assert (values["closed"], values["ticks"], values["dropped_ticks"]) == (False, 700, 300)
    assert list(values["files"]) == ["forces.png", "path.png", "link.png", "timing.png"]
    table = dict(plot.format_table(values))
    assert table["ticks lost while recording"] == "300" and "interrupted" in table


def test_a_part(tmp_path: Path) -> None:
    file = write_run(tmp_path / "record.h5")
    values = drawn(file, tmp_path / "out", ["path", "forces"], 0.25, 0.5)
    assert list(values["files"]) == ["path.png", "forces.png"]
    assert (values["ticks"], values["from_s"], values["to_s"]) == (251, 0.25, 0.5)
    assert drawn(file, tmp_path / "out", ["timing"], None, 0.1)["ticks"] == 101
    assert drawn(file, tmp_path / "out", ["link"], 0.998, 7.0)["ticks"] == 2


def test_pictures_show_what_differs(tmp_path: Path) -> None:
    values, _ = run_values(ticks=1000)
    changes = {
        "forces": {"ticks/force_N": 0.5 * values["ticks/force_N"]},
        "path": {"ticks/tip_m": values["ticks/tip_m"][:, [1, 0, 2]]},
        "link": {"updates/status": np.full(len(values["updates/status"]), 3)},
        "timing": {"ticks/tick_count": values["ticks/tick_count"] * 3},
    }
    plain = drawn(write_run(tmp_path / "plain.h5"), tmp_path / "plain")["files"]
    for name, change in changes.items():
        record.write_record(
            tmp_path / "changed.h5", record_layout.RUN, {**values, **change}, SCENE_TEXT, {"board": "mps2_an386", **COUNTERS}
        )
        changed = drawn(tmp_path / "changed.h5", tmp_path / "changed", [name])["files"][f"{name}.png"]
        assert picture(Path(changed)).shape != picture(Path(plain[f"{name}.png"])).shape or not np.array_equal(
            picture(Path(changed)), picture(Path(plain[f"{name}.png"]))
        )


def test_rates_are_bytes_by_time_that_the_record_has() -> None:
    time_s = 1e-3 * np.array([*range(100), *range(250, 300)])
    none = np.zeros(0)
    trace = LinkTrace(time_s, np.full(150, 40), np.full(150, 700), none, none, none, none, none, none, "")
    bin_s, edges_s, (down_kB_s, up_kB_s) = _rates(trace)
    assert bin_s == 0.1
    np.testing.assert_allclose(edges_s, [0.0, 0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(down_kB_s, [700.0, np.nan, 700.0], rtol=1e-12)
    np.testing.assert_allclose(up_kB_s, [40.0, np.nan, 40.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.h5"], "none.h5: no such file: must be a record (docs/records.md)"),
        (["/dev/null"], "/dev/null: no regular file: must be a record (docs/records.md)"),
        (["text.h5"], "text.h5: not HDF5: must be a record (docs/records.md)"),
        (["cut.h5"], "cut.h5: HDF5 that cannot be opened: "),
        (["still.h5"], "still.h5: a simulation without a tip: has nothing to draw over time"),
        (["record.h5", "--what", "forces,smell"], "--what smell: must be some of forces, path, link, timing"),
        (["simulation.h5", "--what", "link"], "--what link: a record of `simulate` has forces, path only"),
        (["record.h5", "--from", "2"], "--from 2 --to 0.999: has 0 ticks of record.h5, which goes from 0 to 0.999 s"),
        (["record.h5", "--from", "0.5", "--to", "0.4"], "--from 0.5 --to 0.4: has 0 ticks"),
        (["record.h5", "--out", "text.h5"], "--out = text.h5: must be a folder"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_refused_on_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = write_run(Path("record.h5")).read_bytes()
    Path("cut.h5").write_bytes(whole[: len(whole) // 2])
    Path("text.h5").write_text("no")
    record.write_record(Path("still.h5"), record_layout.SIMULATE, sheet_values(), "", {})
    record.write_record(Path("simulation.h5"), record_layout.SIMULATE, simulate_values(), "", {})
    assert cli.main(["plot", *arguments, "--json"]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith(message) and printed.err.count("\n") == 1
    assert json.loads(printed.out)["error"] == printed.err.strip()


def test_the_command_line(tmp_path: Path) -> None:
    write_run(tmp_path / "record.h5")
    done = palpate("plot", "record.h5", "--out", "here", "--what", "timing", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    values = json.loads(done.stdout)
    assert values["files"] == {"timing.png": "here/timing.png"} and (tmp_path / "here/timing.png").exists()
    assert "here/timing.png" in done.stderr
    assert palpate("plot", "record.h5", "--from", "soon", cwd=tmp_path).returncode == 2
