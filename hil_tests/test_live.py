"""palpate.Live: the loop in real time from Python, without a window."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from palpate import record
from palpate.hil import BoardError
from palpate.live import COLUMNS, Live
from palpate.scene import SceneError, load_scene

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT / "scenes"
SMALL = {"body.nodes": [8, 8, 8], "body.origin_m": [-0.035, -0.035, -0.09], "contact.friction": 0.4}
RENDER, FAULT = 3, 4
DEADLINE_S = 100.0


def wait(live: Live, done: Callable[[], bool]) -> None:
    """Until it is so; the loop goes on meanwhile."""
    latest_s = time.monotonic() + DEADLINE_S
    while not done():
        assert live.poll(), live.problem
        assert time.monotonic() < latest_s, live.status
        time.sleep(0.005)


def armed(live: Live) -> None:
    wait(live, lambda: live.status["board_mode"] == 1)
    live.arm()
    wait(live, lambda: live.status["board_mode"] == RENDER)


@pytest.mark.parametrize("board", ["native", "mps2_an386"])
def test_touch_in_real_time_and_record(tmp_path: Path, board: str) -> None:
    file = tmp_path / "live.h5"
    with Live(load_scene(SCENES / "demo.toml", SMALL), board) as live:
        armed(live)
        live.record(file)
        assert live.guide_hand([0.0, 0.0, -0.024])
        wait(live, lambda: live.contact is not None and live.contact.mode != "free")
        began = live.status["tick"]
        wait(live, lambda: live.status["tick"] > began + 300)
        contact = live.contact
        assert contact is not None and contact.friction == 0.4
        pressing_N = -float(contact.force_N @ contact.normal)
        assert pressing_N > 0.1
        assert live.picture is not None and live.picture.position_m.shape == (512, 3)
        # Where it is pressed, it gives way.
        rest = live.picture.position_m[:, 2].max()
        assert live.picture.position_m[:, 2].min() < rest
        assert {name: len(live.history[name]) for name in COLUMNS} == dict.fromkeys(COLUMNS, len(live.history))
        assert live.history["absorbed_J"][-1] > 0.0  # pressing in takes work
        assert not live.guide_hand([9.0, 0.0, 0.0])
        live.stop_recording()
        recorded = live.recorded_ticks
    values = record.load(file).values
    assert len(values["ticks/tick"]) == recorded > 300
    np.testing.assert_array_equal(np.diff(values["ticks/tick"]), 1)
    assert np.any(values["ticks/contact_mode"] > 0)


def test_a_fault_is_latched_and_told() -> None:
    with Live(load_scene(SCENES / "demo.toml", SMALL)) as live:
        armed(live)
        live.set_emergency_stop(True)
        wait(live, lambda: live.status["board_mode"] == FAULT)
        assert live.status["board_faults"] & 1
        live.set_emergency_stop(False)
        live.command("clear_fault")
        wait(live, lambda: live.status["board_mode"] == 1)
        live.arm()
        wait(live, lambda: live.status["board_mode"] == RENDER)


def test_a_scene_without_a_path_begins_above_its_body(tmp_path: Path) -> None:
    scene = tmp_path / "still.toml"
    scene.write_text(
        'duration_s = 1.0\n[body]\nnodes = [6, 6, 6]\nspacing_m = 0.01\norigin_m = [-0.025, -0.025, -0.07]\n'
        'mass_kg = 0.001\nstiffness_N_m = 100.0\nfixed_faces = ["z-"]\n'
    )
    with Live(load_scene(scene)) as live:
        wait(live, lambda: live.contact is not None)
        assert live.contact is not None
        np.testing.assert_allclose(live.contact.hand_m, [0.0, 0.0, -0.005], atol=1e-6)


def test_what_cannot_be_touched_or_started_is_refused() -> None:
    with pytest.raises(SceneError, match="body.dimension = 2"):
        Live(load_scene(SCENES / "wave2d.toml"))
    with pytest.raises(BoardError, match="must be one of"):
        Live(load_scene(SCENES / "demo.toml"), "no_such_board")
    with Live(load_scene(SCENES / "demo.toml", SMALL)) as live, pytest.raises(ValueError, match="grip is 2"):
        live.set_grip(2.0)
