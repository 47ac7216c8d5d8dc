"""The real core behind the command line: small scenes from file to result."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import ROOT, palpate

from palpate.scene import load_scene

PRESS = (ROOT / "scenes/press.toml").read_text("utf-8")
# Times and positions in a CSV file are rounded to 9 digits and to a double: some 1e-12 m of a path, times 1e3 N/m.
REPLAY_N = 1e-8


def run(folder: Path, command: str, text: str, *options: str, exit_code: int = 0) -> dict[str, Any]:
    """The summary of a scene's run in a folder; fails the test where the command ends with another exit code."""
    (folder / "scene.toml").write_text(text)
    done = palpate(command, "scene.toml", "--json", "--out", "out", *options, cwd=folder)
    assert done.returncode == exit_code, done.stderr
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """One run of scenes/press.toml on the native board, with its folder."""
    folder = tmp_path_factory.mktemp("press")
    return run(folder, "run", PRESS, "--board", "native"), folder / "out"


def test_run_touches_the_body(press: tuple[dict[str, Any], Path]) -> None:
    summary, folder = press
    assert summary["ticks"] == 1500
    assert summary["contact_ticks"] > 100
    assert summary["model_updates"] > 10
    assert summary["faults"] == 0
    assert summary["worst_tick_instructions"] is None
    with h5py.File(folder / "record.h5") as record:
        ticks = record["ticks"]
        assert ticks["tick"][-1] == 1499
        # the tip rests on the hand, the hand on the force: they agree at rest, at 0.9 s
        force_N, hand_N = ticks["force_N"][890], ticks["hand_force_N"][890]
        assert force_N[2] < -0.5
        np.testing.assert_allclose(hand_N[2], force_N[2], atol=0.1)


def test_two_runs_give_one_hash(press: tuple[dict[str, Any], Path], tmp_path: Path) -> None:
    again = run(tmp_path, "run", PRESS, "--board", "native")
    assert again["record_hash"] == press[0]["record_hash"]


def test_reference_is_the_simulation_of_the_recorded_path(
    press: tuple[dict[str, Any], Path], tmp_path: Path
) -> None:
    (tmp_path / "tip.csv").write_bytes((press[1] / "tip.csv").read_bytes())
    text = PRESS[: PRESS.index("[path]")].replace("duration_s = 1.5", "duration_s = 1.499")
    run(tmp_path, "simulate", text + '[path]\ncsv = "tip.csv"\n')
    with h5py.File(press[1] / "record.h5") as of_run, h5py.File(tmp_path / "out/record.h5") as of_simulation:
        reference_N = of_run["reference/force_N"][1:]
        assert np.abs(reference_N).max() > 0.5
        np.testing.assert_allclose(of_simulation["tip/force_N"][:], reference_N, atol=REPLAY_N)
        np.testing.assert_array_equal(
            of_simulation["tip/contact_mode"][:], of_run["reference/contact_mode"][1:]
        )


def test_faults_of_a_scene_happen(tmp_path: Path) -> None:
    text = PRESS + (
        "csv = false\npictures = false\n[reference]\nenabled = false\n[board.faults]\nemergency_stop_ticks = [900]\n"
        "[link.faults]\ndrop_down = [20]\ndrop_up = [100]\nflip_up = [{ frame = 120, bit = 99 }]\n"
    )
    summary = run(tmp_path, "run", text, "--board", "native", exit_code=1)
    assert summary["faults"] == 1
    # A lost frame shows by the next one of its kind: frame 20 to the board is a model, with others after it.
    assert summary["frames_lost"] == 3
    with h5py.File(tmp_path / "out/record.h5") as record:
        enabled = record["ticks/enabled"][:]
    assert enabled[899] == 1
    assert not np.any(enabled[900:])


def test_simulation_exports_nodes(tmp_path: Path) -> None:
    text = (ROOT / "scenes/wave2d.toml").read_text("utf-8")
    first = run(tmp_path, "simulate", text)
    scene = load_scene(tmp_path / "scene.toml")
    with h5py.File(tmp_path / "out/record.h5") as record:
        time_s, position_m = record["nodes/time_s"][:], record["nodes/position_m"][:]
        rest_m, velocity_m_s = record["body/rest_m"][:], record["nodes/velocity_m_s"][:]
    np.testing.assert_allclose(time_s, scene.sections.outputs.node_times_s, atol=1e-12)
    moved_m = position_m - rest_m
    expected_m = np.zeros_like(rest_m)
    for start in scene.sections.body.initial_displacements:
        i, k = start.node
        expected_m[i + 20 * k, [0, 2]] = start.displacement_m
    np.testing.assert_allclose(moved_m[0], expected_m, atol=1e-15)
    assert not np.any(velocity_m_s[0])
    assert np.abs(moved_m[1:]).max() > 1e-4
    # the edges are fixed, the sheet stays in its plane and its wave is symmetric, as its start is
    fixed = np.isin(rest_m[:, 0], rest_m[[0, 19], 0]) | (rest_m[:, 2] == rest_m[0, 2])
    assert not np.any(moved_m[:, fixed])
    assert not np.any(moved_m[..., 1])
    mirrored = moved_m.reshape(5, 20, 20, 3)[:, :, ::-1] * np.array([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(mirrored.reshape(moved_m.shape), moved_m, atol=1e-9)
    assert run(tmp_path, "simulate", text)["record_hash"] == first["record_hash"]


@pytest.mark.parametrize(
    ("command", "extra", "key"),
    [
        ("simulate", "[integrator]\nstep_s = 0.0005", "integrator.step_s = 0.0005"),
        ("run", "[integrator]\nstep_s = 0.0005", "integrator.step_s = 0.0005"),
        ("run", "[reference]\nstep_s = 0.0005", "reference.step_s = 0.0005"),
    ],
)
def test_unstable_steps_are_refused(tmp_path: Path, command: str, extra: str, key: str) -> None:
    (tmp_path / "scene.toml").write_text(f"{PRESS}\n{extra}\n")
    done = palpate(command, "scene.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    message = done.stderr.splitlines()[-1]
    # the limit of the reference material, 251 us
    assert message.startswith(f"scene.toml: {key}: must be in (0, 0.00025")


def test_a_path_out_of_reach_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(PRESS.replace("[0.002, 0.001, -0.012]", "[0.9, 0.001, -0.012]", 1))
    done = palpate("run", "scene.toml", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "outside the arm's workspace" in done.stderr.splitlines()[-1]
