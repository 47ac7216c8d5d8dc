"""The schemes of feedback of Jacobs, Fu, Cavusoglu 2010, section 3, against each other on the real core and the native
board."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import palpate
from numpy.typing import NDArray

# A scripted drag of 12 mm in half a second, 3 mm deep; node [4, 4, 7] lies below its middle.
SCENE = """
duration_s = 0.9
[body]
nodes = [8, 8, 8]
origin_m = [-0.035, -0.035, -0.09]
fixed_faces = ["z-"]
[contact]
friction = 0.6
[path]
waypoints = [
  { time_s = 0.1, position_m = [-0.006, 0.002, -0.0195] },
  { time_s = 0.3, position_m = [-0.006, 0.002, -0.023] },
  { time_s = 0.8, position_m = [0.006, 0.003, -0.023] },
]
[hand]
kind = "scripted"
[board]
name = "native"
[outputs]
csv = false
pictures = false
probe_node = [4, 4, 7]
[model]
feedback = """
SCHEMES = ("exact", "paper", "discard", "hold")

Run = tuple[dict[str, Any], dict[str, NDArray[Any]]]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    """Summary and record of the scene with each scheme."""
    results = {}
    for scheme in SCHEMES:
        folder = tmp_path_factory.mktemp(scheme)
        (folder / "scene.toml").write_text(f'{SCENE}"{scheme}"\n')
        done = palpate("run", "scene.toml", "--json", "--out", "out", cwd=folder)
        assert done.returncode == 0, done.stderr
        with h5py.File(folder / "out/record.h5") as file:
            names = (
                "force_N",
                "contact_mode",
                "model_sequence",
                "enabled",
                "triangle",
            )
            values = {name: file[f"ticks/{name}"][:] for name in names}
            values |= {
                "replayed_N": file["probe/force_N"][:],
                "reference_N": file["reference/force_N"][:],
                "rendered_m": file["probe/rendered_m"][:],
                "modes": file["updates/modes"][:],
            }
        results[scheme] = (json.loads(done.stdout), values)
    return results


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_renders_the_drag(runs: dict[str, Run], scheme: str) -> None:
    summary, values = runs[scheme]
    assert summary["faults"] == 0
    assert summary["models_refused"] == 0
    assert summary["model_updates"] >= 20
    assert summary["contact_ticks"] > 550
    assert np.all((values["modes"] == 0) == (scheme == "hold"))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_replay_on_the_host_is_the_board(runs: dict[str, Run], scheme: str) -> None:
    """To the bit, but where the board limits the change of force to 0.5 N a tick."""
    _, values = runs[scheme]
    force_N, replayed_N = values["force_N"], values["replayed_N"]
    differ = np.any(force_N != replayed_N, axis=1)
    limited = np.linalg.norm(np.diff(force_N, axis=0, prepend=0), axis=1) > 0.499
    # A limited force takes some ticks to arrive.
    near_limit = np.convolve(limited, np.ones(9), "same") > 0
    assert np.all(near_limit[differ])
    if scheme in ("exact", "paper"):
        assert not np.any(differ)
    assert np.any(np.isfinite(values["rendered_m"])) == (scheme != "hold")


def test_a_held_force_changes_with_the_models_only(runs: dict[str, Run]) -> None:
    _, values = runs["hold"]
    changes = np.any(np.diff(values["replayed_N"], axis=0) != 0, axis=1)
    swaps = np.diff(values["model_sequence"].astype(int)) != 0
    assert np.count_nonzero(changes) >= 10
    assert np.all(swaps[changes])


def test_geometry_fed_back_takes_the_jumps_out(runs: dict[str, Run]) -> None:
    """What section 3 of the paper argues: without the local model's deformations, or without a local model, the force
    jumps at the updates."""
    jump_N = {scheme: runs[scheme][0]["largest_force_jump_N"] for scheme in SCHEMES}
    # Measured: 0.26 and 0.19 N with the feedback, 1.01 and 0.49 N without. A tick in which the tip begins to slip may
    # fall on a change of model, hence the room.
    assert max(jump_N["exact"], jump_N["paper"]) < 0.75 * min(jump_N["discard"], jump_N["hold"]), jump_N


def test_errors_of_the_schemes(runs: dict[str, Run]) -> None:
    """On average exact and discard are closest, for their bodies have the right contact at each update. A held force is
    late by one; the paper's own feedback lets the full body spring back between two updates."""
    error = {scheme: runs[scheme][0]["rms_force_error_percent"] for scheme in SCHEMES}
    # Measured: 9.2, 9.5, 12.3 and 29.3 %.
    assert max(error["exact"], error["discard"]) < 0.85 * error["hold"], error
    assert error["hold"] < 0.75 * error["paper"], error


# Without them there is no news at one update, and no trace of the gap is sent again before the next.
LOST_TRACES = "[link.faults]\ndrop_up = [40, 41, 42, 43, 44, 60, 72]\n"


@pytest.mark.parametrize("scheme", SCHEMES)
def test_lost_traces_do_not_end_a_run(tmp_path: Path, scheme: str) -> None:
    (tmp_path / "scene.toml").write_text(f'{SCENE}"{scheme}"\n{LOST_TRACES}')
    done = palpate("run", "scene.toml", "--json", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["frames_lost"] >= 7
    assert summary["faults"] == summary["models_refused"] == 0
    assert summary["contact_ticks"] > 550
    assert summary["model_updates"] >= 15
