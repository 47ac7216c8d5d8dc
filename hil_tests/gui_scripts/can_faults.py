"""Faults of a CAN bus from the window: lost frames, errors and bus-off, a babbling node, an emergency stop."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

RENDER, FAULT, IDLE = 3, 4, 1
EMERGENCY_STOP = 1
BUS_OFF_ERRORS = 32  # in a row


def wait(condition):
    while not condition():
        yield


def stages(app):
    live = app.live
    assert live.is_on_can and "truncate" not in live.fault_kinds

    assert "link.faults are not injected here" in app.message  # those of the scene

    def mode():
        return live.status["board_mode"]

    yield from wait(lambda: mode() == IDLE)
    live.arm()
    yield from wait(lambda: mode() == RENDER)
    app.guide_hand(np.array([0.0, 0.0, app.view.top_m - 0.003]))
    yield from wait(lambda: live.contact.mode != "free")

    # Lost frames are counted as such, and shown.
    live.add_faults("up", "drop", 30)
    yield from wait(lambda: live.status["frames_lost_up"] > 0 and live.status["troubles"]["up"]["dropped"] == 30)
    yield from wait(lambda: live.history["frames_lost"][-1] > 0.0)

    # Errors cost an attempt each and no frame; enough in a row are a bus-off, and the board renders on.
    lost = live.status["frames_lost_down"]
    live.add_faults("down", "flip_bit", BUS_OFF_ERRORS + 1)
    yield from wait(lambda: live.status["down"]["attempts_failed"] == BUS_OFF_ERRORS + 1)
    assert live.status["down"]["bus_offs"] == 1 and live.status["up"]["bus_offs"] == 0, live.status
    assert live.status["frames_lost_down"] == lost and mode() == RENDER

    # What a bus does not do is told.
    app.later(lambda: live.add_faults("up", "truncate", 1))
    yield
    yield
    assert "cut short" in app.message, app.message

    # Behind a babbling node nothing is heard; then it goes on by itself.
    app.set_babbling(True)
    yield from wait(lambda: live.silence_s > 0.8)
    app.set_babbling(False)
    yield from wait(lambda: live.silence_s < 0.2)
    assert live.status["troubles"]["foreign_frames"] > 0
    taken = live.status["models_taken"]
    yield from wait(lambda: mode() == RENDER and live.status["models_taken"] > taken)

    app.set_emergency_stop(True)
    yield from wait(lambda: mode() == FAULT)
    assert live.status["board_faults"] & EMERGENCY_STOP
    # For the picture.
    app.plots.shown[:] = ["forces and cone", "link", "losses", "model age"]
    shown = live.status["tick"] + 300
    yield from wait(lambda: live.status["tick"] > shown)
    yield


step = run(stages)
