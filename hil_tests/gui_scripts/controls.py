"""Changes every kind of control and looks at what came of it."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

from palpate import record  # noqa: E402
from palpate.gui.board_lines import tick_lines  # noqa: E402
from palpate.gui.body_view import COLOURINGS  # noqa: E402
from palpate.paths import SCENES  # noqa: E402

RENDER, FAULT, IDLE = 3, 4, 1
LINK_LOST = 1 << 9


def wait_for_mode(app, mode):
    while app.live.status["board_mode"] != mode:
        yield


def wait_ticks(app, ticks):
    until = app.live.status["tick"] + ticks
    while app.live.status["tick"] < until:
        yield


def stages(app):
    # New values count after apply, and stand in the scene then.
    app.set("friction", 0.25)
    app.set("stiffness_N_m", 150.0)
    app.set("builder", "krylov")
    assert app.live.scene.sections.contact.friction == 1.0
    app.apply()
    assert app.live.scene.sections.contact.friction == 0.25
    assert app.shown["stiffness_N_m"] == 150.0 and app.shown["builder"] == "krylov"
    assert not app.pending

    # A value out of range is told, and the loop of before goes on.
    app.set("friction", 50.0)
    app.apply()
    assert "contact.friction" in app.message, app.message
    assert app.live.status["running"] and app.live.scene.sections.contact.friction == 0.25
    assert app.pending
    app.pending.clear()

    # So it does where the core refuses, after the board has started.
    yield from wait_for_mode(app, IDLE)
    live = app.live
    app.set("stiffness_N_m", 1000.0)
    app.apply()
    assert "step_s" in app.message and app.pending == {"stiffness_N_m": 1000.0}, app.message
    yield from wait_ticks(app, 20)
    assert app.live is live and live.status["running"] and live.status["board_mode"] == IDLE
    app.pending.clear()

    # What a control may not do is told, and the window goes on.
    app.later(lambda: app.live.set_grip(2.0))
    yield
    yield
    assert "grip is 2" in app.message

    # Touching with the hand; a recording.
    yield from wait_for_mode(app, IDLE)
    app.live.arm()
    yield from wait_for_mode(app, RENDER)
    app.record()
    assert app.live.recording is not None, app.message
    app.guide_hand(np.array([0.0, 0.0, app.view.top_m - 0.004]))
    while app.live.contact.mode == "free":
        yield
    yield from wait_ticks(app, 300)
    app.guide_hand(np.array([5.0, 0.0, 0.0]))
    assert "reach" in app.message
    # A restart closes the recording; an open emergency stop stays open, and a replay does not arm then.
    app.set_emergency_stop(True)
    app.set("friction", 0.3)
    app.apply()
    assert app.emergency_stop and app.live.scene.sections.contact.friction == 0.3
    assert app.last_recording is not None
    yield from wait_for_mode(app, FAULT)
    app.replay_last()
    # With the values of then.
    assert "not armed" in app.message and app.live.scene.sections.contact.friction == 0.25
    yield from wait_for_mode(app, FAULT)
    app.set_emergency_stop(False)
    yield from wait_ticks(app, 50)
    app.live.command("clear_fault")
    yield from wait_for_mode(app, IDLE)
    values = record.load(app.last_recording).values
    assert len(values["ticks/tick"]) >= 300 and np.any(values["ticks/contact_mode"] > 0)

    # Every colouring draws, in a loop that is paused as well.
    app.view.colouring = "nothing"
    app.live.set_speed(0.0)
    yield
    yield
    for colouring in COLOURINGS:
        app.view.colouring = colouring
        assert app.view.range == (0.0, "")
        yield
        yield
        assert (app.view.range[0] > 0.0) == (colouring != "nothing")

    app.live.set_speed(1.0)

    # Faults of the link are counted; the chain of the emergency stop latches.
    app.live.add_faults("up", "drop", 30)
    yield from wait_ticks(app, 700)
    assert app.live.status["frames_lost_up"] > 0
    app.plots.shown.append("losses")
    yield from wait_ticks(app, 50)
    assert app.live.history["frames_lost"][-1] > 0.0
    app.set_emergency_stop(True)
    yield from wait_for_mode(app, FAULT)
    app.set_emergency_stop(False)
    yield from wait_ticks(app, 50)
    app.live.command("clear_fault")
    yield from wait_for_mode(app, IDLE)

    # The cable out: the board is silent, and renders again by itself when it is in again, but not after 10 s.
    app.live.arm()
    yield from wait_for_mode(app, RENDER)
    for out_s, mode in ((2.0, RENDER), (12.0, FAULT)):
        app.set_unplugged(True)
        while app.live.silence_s < out_s:
            yield
        assert app.live.status["board_mode"] == RENDER  # when it was last heard
        app.set_unplugged(False)
        while app.live.silence_s > 0.2:
            yield
        yield from wait_for_mode(app, mode)
    assert app.live.status["board_faults"] == LINK_LOST
    app.live.command("clear_fault")
    yield from wait_for_mode(app, IDLE)

    # The recording moves the hand again: to where it was.
    deepest_m = float(values["ticks/hand_target_m"][:, 2].min())
    app.replay_last()
    while app.live.history["tip_z_m"].min(initial=1.0) > deepest_m + 0.002:
        yield
    assert app.live.status["board_mode"] == RENDER

    # A second recording within the second gets a name of its own; one without ticks cannot be replayed.
    app.record()
    app.stop_recording()
    kept = app.last_recording
    app.record()
    app.stop_recording()
    assert app.last_recording != kept and kept.is_file()
    live = app.live
    app.replay_last()
    assert "2 or more" in app.message and app.live is live, app.message

    # Another scene, and the board in QEMU.
    app.open(SCENES / "press.toml")
    assert app.settings.file.stem == "press" and app.shown["builder"] == "patch"
    assert app.budgets == []  # of a Linux process
    app.choose_board("mps2_an386")
    assert app.live.board_name == "mps2_an386", app.message
    yield from wait_for_mode(app, IDLE)
    # The image's budgets, and the longest tick as the board says it.
    assert [row.what for row in app.budgets[0].rows] == ["flash", "RAM, stack included", "deepest stack"], app.budgets
    while app.live.status["board_worst_tick_count"] == 0:
        yield
    assert "of 125,000 instructions" in tick_lines("mps2_an386", app.live.status)[0][0]


step = run(stages, 200.0)
