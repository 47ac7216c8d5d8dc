"""palpate.Live: the loop in real time from Python, without a window."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from palpate import record
from palpate.hil import BoardError
from palpate.live import COLUMNS, Live
from palpate.record import RecordError
from palpate.scene import SceneError, load_recorded_scene, load_scene
from palpate.tip_path import TipPath

pytestmark = pytest.mark.real_time
ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT / "scenes"
SMALL = {"body.nodes": [8, 8, 8], "body.origin_m": [-0.035, -0.035, -0.09], "contact.friction": 0.4}
RENDER, FAULT = 3, 4
DEADLINE_S = 100.0
# Three looks of Live's thread at the tick; a busy machine may miss some.
WATCHDOG_S = 4.0


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
    kept = record.load(file)
    values = kept.values
    assert kept.attributes["models_taken"] > 0 and kept.attributes["frames_lost_up"] == 0
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


def test_a_board_that_hangs_is_told() -> None:
    with Live(load_scene(SCENES / "demo.toml", SMALL), watchdog_s=WATCHDOG_S) as live:
        wait(live, lambda: live.status["tick"] > 100)
        os.kill(live._board._process.pid, signal.SIGSTOP)
        latest_s = time.monotonic() + DEADLINE_S
        while live.poll():
            assert time.monotonic() < latest_s, live.status
            time.sleep(0.05)
        assert live.problem is not None and "gave no tick for 4 s" in live.problem


def test_nobody_polls_for_long(tmp_path: Path) -> None:
    """The watchdog does not bite; the recording says how many ticks it lacks."""
    file = tmp_path / "seldom.h5"
    with Live(load_scene(SCENES / "demo.toml", SMALL), watchdog_s=WATCHDOG_S) as live:
        wait(live, lambda: live.status["tick"] > 100)
        live.record(file)
        began = live.status["tick"]
        latest_s = time.monotonic() + DEADLINE_S
        # The loop keeps 4000 ticks for those who poll.
        while live._loop.status["tick"] < began + 6000:
            assert time.monotonic() < latest_s
            time.sleep(0.5)
        assert live.poll(), live.problem
        live.stop_recording()
        recorded = live.recorded_ticks
    kept = record.load(file)
    unseen = kept.attributes["ticks_unseen"]
    assert unseen > 1500
    first, last = kept.values["ticks/tick"][[0, -1]]
    assert len(kept.values["ticks/tick"]) == recorded
    assert last - first + 1 == recorded  # what was missed lies before the first: the loop keeps the newest
    assert first >= began + unseen


def test_the_energy_begins_anew_after_unseen_ticks() -> None:
    live = Live(load_scene(SCENES / "demo.toml", SMALL))

    def block(first_tick: int, tip_z_m: list[float]) -> dict[str, np.ndarray]:
        rows = len(tip_z_m)
        zeros = np.zeros(rows)
        return {
            "ticks/tick": np.arange(first_tick, first_tick + rows),
            "ticks/force_N": np.tile([0.0, 0.0, -2.0], (rows, 1)),
            "ticks/normal": np.tile([0.0, 0.0, 1.0], (rows, 1)),
            "ticks/tip_m": np.column_stack([zeros, zeros, tip_z_m]),
            "ticks/contact_mode": np.ones(rows, dtype=np.uint8),
            "ticks/triangle": np.zeros(rows, dtype=np.uint32),
            **{f"ticks/{name}": np.zeros((rows, 3)) for name in ("hand_force_N", "hand_target_m")},
            **{
                f"ticks/{name}": zeros
                for name in ("tick_count", "busy_count", "model_age_ticks", "link_up_bytes", "link_down_bytes")
            },
            "wall/late_s": zeros,
            "wall/took_s": zeros,
        }

    live._remember(block(0, [0.0, -0.001]))
    live._remember(block(2, [-0.002]))
    live._remember(block(100, [-0.012, -0.013]))
    np.testing.assert_allclose(live.history["absorbed_J"], [0.0, 0.002, 0.004, 0.0, 0.002], atol=1e-12)


def test_a_recording_that_fails_is_told_and_let_go(tmp_path: Path) -> None:
    with Live(load_scene(SCENES / "demo.toml", SMALL)) as live:
        wait(live, lambda: live.status["tick"] > 100)
        live.record(tmp_path / "killed.h5")
        assert live._recorder is not None
        os.kill(live._recorder.process_id, signal.SIGKILL)
        wait(live, lambda: live.recording_problem is not None)
        with pytest.raises(RecordError, match=r"killed\.h5"):
            live.stop_recording()
        assert live.recording is None
        live.record(tmp_path / "next.h5")
        wait(live, lambda: live.recorded_ticks > 100)
    assert record.load(tmp_path / "next.h5").closed


def test_a_recording_says_that_its_hand_was_a_person(tmp_path: Path) -> None:
    file = tmp_path / "live.h5"
    scripted = load_scene(SCENES / "frontier" / "reference.toml", {"path.csv": "poke_0.1mm.csv"})
    assert scripted.sections.hand.kind == "scripted"
    with Live(scripted) as live:
        live.record(file)
        wait(live, lambda: live.recorded_ticks > 100)
    kept = record.load(file)
    path = TipPath(np.zeros(1), kept.values["ticks/true_tip_m"][:1], "linear")
    assert load_recorded_scene(file, kept.scene_text, {}, path).sections.hand.kind == "impedance"
