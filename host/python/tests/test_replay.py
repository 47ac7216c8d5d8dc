"""What a replay makes of a record, and which records and changes it refuses. hil_tests/test_loop_replay.py runs the firmware."""

import json
import sys
from pathlib import Path
from typing import Any

import fake_core
import numpy as np
import pytest
from command import ROOT
from synthetic import run_values, simulate_values

from palpate import cli, hil, record, record_layout, replay, summary
from palpate.record import BadRecord
from palpate.scene import SceneError

SCENE_TEXT = (ROOT / "scenes/press.toml").read_text("utf-8")
TICKS = fake_core.TICKS


def write(file: Path, change: dict[str, Any] | None = None, text: str = SCENE_TEXT) -> Path:
    """A made-up record of the fake core's run."""
    values, counters = run_values(ticks=TICKS)
    record.write_record(
        file, record_layout.RUN, {**values, **(change or {})}, text, {"board": "mps2_an386", "record_hash": "abc", **counters}
    )
    return file


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The made-up core and board in place of the real ones, in an empty working directory; a record.h5 in it."""
    import palpate

    monkeypatch.setitem(sys.modules, "palpate._core", fake_core)
    monkeypatch.setattr(palpate, "_core", fake_core, raising=False)
    for name in hil.BOARDS:
        monkeypatch.setitem(hil.BOARDS, name, fake_core.board())
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "record.h5")


def test_motion_fills_gaps_and_follows_counters_around() -> None:
    ticks = np.array([5, 6, 9], dtype=np.uint32)
    counts = np.array([[2**31 - 2, 0, 10], [2**31 - 1, 0, 20], [-(2**31) + 2, -3, 50]], dtype=np.int32)
    tip_m = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.4, 0, 3.0]])
    motion = replay.motion_of({"ticks/tick": ticks, "ticks/encoder_count": counts, "ticks/true_tip_m": tip_m})
    assert motion.first_tick == 5
    np.testing.assert_array_equal(motion.known, [True, True, False, False, True])
    np.testing.assert_array_equal(motion.encoder_count[:, 0], [2**31 - 2, 2**31 - 1, -(2**31), -(2**31) + 1, -(2**31) + 2])
    np.testing.assert_array_equal(motion.encoder_count[:, 1], [0, 0, -1, -2, -3])
    np.testing.assert_array_equal(motion.encoder_count[:, 2], [10, 20, 30, 40, 50])
    np.testing.assert_allclose(motion.tip_m[:, 0], [0.0, 0.1, 0.2, 0.3, 0.4], atol=1e-15)
    assert motion.encoder_count.dtype == np.int32


def test_comparison_of_two_runs() -> None:
    old = record.conform(record_layout.TICKS, {p: a for p, a in run_values(ticks=4)[0].items() if p.startswith("ticks/")})
    same = summary.compare_runs(old, old)
    assert same["identical"] is True and same["rms_force_difference_N"] == same["peak_force_difference_N"] == 0.0
    force_N = np.array([[0, 0, 0], [0, 0, -3.0], [0, 0, -3.0], [0, 4.0, 0]], dtype=np.float32)
    again_N = np.array([[0, 0, 0], [0, 0, -3.0], [0, 3.0, -3.0], [0, 0, 0]], dtype=np.float32)
    old |= {
        "ticks/force_N": force_N,
        "ticks/contact_mode": np.array([0, 1, 1, 2], dtype=np.uint8),
        "ticks/model_sequence": np.array([0, 0, 1, 1], dtype=np.uint32),
    }
    new = {
        **old,
        "ticks/force_N": again_N,
        "ticks/contact_mode": np.array([0, 1, 2, 0], dtype=np.uint8),
        "ticks/tip_m": old["ticks/tip_m"] + np.float32(0.25) * np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0]]),
    }
    compared = summary.compare_runs(old, new)
    assert compared["compared_ticks"] == 4 and compared["identical"] is False
    assert compared["peak_force_difference_N"] == 4.0
    assert compared["rms_force_difference_N"] == np.sqrt((9 + 16) / 4)
    assert compared["rms_force_difference_percent"] == pytest.approx(100 * np.sqrt(25 / 34), rel=1e-12)
    assert compared["source_peak_force_N"] == 4.0
    assert compared["equal_contact_modes_percent"] == pytest.approx(100 / 3)
    assert compared["largest_tip_difference_m"] == pytest.approx(0.25, rel=1e-6)
    assert compared["largest_swap_step_N"] == {"source": 0.0, "replay": 3.0}
    assert set(compared) <= {key.name for key in summary.REPLAY_KEYS}


def test_every_key_is_declared(fake: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["replay", "record.h5", "--out", "again", "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    files = numbers.pop("files")
    declared = [key.name for key in (*summary.RUN_KEYS, *summary.REPLAY_KEYS)]
    assert list(numbers) == declared
    assert numbers == json.loads(Path(files["summary.json"]).read_text())
    assert set(files) == {"record.h5", "tip.csv", "console.txt", "forces.png", "body.png", "replay.png", "summary.json"}
    assert record.load(Path("again/record.h5")).attributes["replay_of"] == "abc"


def test_tolerance_decides_on_the_exit_code(
    fake: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["replay", "record.h5", "--out", "again", "--tolerance-N", "0"]) == 0
    original = fake_core.run_closed_loop

    def stronger(*arguments: Any) -> dict[str, Any]:
        results = original(*arguments)
        results["ticks/force_N"] = results["ticks/force_N"] + [0.0, 0.0, 0.25]
        return results

    monkeypatch.setattr(fake_core, "run_closed_loop", stronger)
    assert cli.main(["replay", "record.h5", "--out", "again", "--tolerance-N", "0.26"]) == 0
    assert cli.main(["replay", "record.h5", "--out", "again"]) == 0
    capsys.readouterr()
    assert cli.main(["replay", "record.h5", "--out", "again", "--tolerance-N", "0.24"]) == 1
    assert "palpate replay: peak_force_difference_N = 0.25: must be at most 0.24\n" in capsys.readouterr().err


def test_the_board_gets_the_recorded_counts(fake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[dict[str, Any]] = []
    original = fake_core.run_closed_loop

    def noting(scene: dict[str, Any], *arguments: Any) -> dict[str, Any]:
        given.append(scene)
        return original(scene, *arguments)

    monkeypatch.setattr(fake_core, "run_closed_loop", noting)
    assert cli.main(["replay", "record.h5", "--out", "again", "--set", "contact.friction=0.125"]) == 0
    values = record.load(fake).values
    np.testing.assert_array_equal(given[0]["recorded"]["encoder_count"], values["ticks/encoder_count"])
    np.testing.assert_array_equal(given[0]["recorded"]["tip_m"], values["ticks/true_tip_m"])
    assert given[0]["duration_ticks"] == TICKS
    assert given[0]["contact"]["static_friction"] == 0.125


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.h5"], "none.h5: no such file: must be a record (docs/records.md)"),
        (["scene.toml"], "scene.toml: not HDF5: must be a record (docs/records.md)"),
        (["simulation.h5"], "simulation.h5: a record of `simulate`, without encoder counts"),
        (["short.h5"], "short.h5: /ticks has 1 rows: must be at least 2"),
        (["backwards.h5"], "backwards.h5: /ticks/tick does not increase: damaged"),
        (["nan.h5"], "nan.h5: /ticks/true_tip_m has numbers that are not finite"),
        (["text.h5"], "text.h5:1: not TOML"),
        (["record.h5", "--set", "path.csv='x.csv'"], "--set path.csv=\"x.csv\": not in a replay"),
        (["record.h5", "--set", "duration_s=1"], "--set duration_s=1: not in a replay"),
        (["record.h5", "--set", "contact.frction=1"], "record.h5: contact.frction"),
        (["record.h5", "--tolerance-N", "-1"], "--tolerance-N = -1: must be in [0, 100] N"),
        (["record.h5", "--out", "."], "--out = .: has the record that is replayed: must be another folder"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input_is_refused_on_one_line(
    fake: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    Path("scene.toml").write_text("title = 'x'\n")
    record.write_record(Path("simulation.h5"), record_layout.SIMULATE, simulate_values(), SCENE_TEXT, {})
    short, _ = run_values(ticks=1)
    record.write_record(Path("short.h5"), record_layout.RUN, short, SCENE_TEXT, {})
    write(Path("backwards.h5"), {"ticks/tick": np.arange(TICKS)[::-1]})
    write(Path("nan.h5"), {"ticks/true_tip_m": np.full((TICKS, 3), np.nan)})
    write(Path("text.h5"), text="what is this")
    before = fake.read_bytes()
    assert cli.main(["replay", *arguments]) == 2
    printed = capsys.readouterr()
    assert message in printed.err and printed.err.count("\n") == 1 and printed.out == ""
    assert fake.read_bytes() == before


def test_sources_know_what_changes(fake: Path) -> None:
    assert replay.load_source(fake, {}, None).changes == ()
    assert replay.load_source(fake, {"contact.friction": 0.6}, None).changes == ("contact.friction=0.6",)
    assert replay.load_source(fake, {}, "native").changes == ('board.name="native"',)
    assert replay.load_source(fake, {"board.name": "native"}, None).changes == ('board.name="native"',)
    assert replay.load_source(fake, {}, "native").scene.sections.board.name == "native"
    assert replay.load_source(fake, {}, "mps2_an386").changes == ()
    with pytest.raises(SceneError, match=r"record.h5: contact\.friction = -1"):
        replay.load_source(fake, {"contact.friction": -1}, None)
    with pytest.raises(BadRecord):
        replay.load_source(fake.parent, {}, None)
