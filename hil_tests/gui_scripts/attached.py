"""Beside a board that runs by itself, whose hand plays its path over and over."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

IDLE, RENDER = 1, 3


def stages(app):
    live = app.live
    assert live.is_attached
    # What its calibration is, read before the loop took the link.
    registers = {register.name: register.values for register in app.attached.registers}
    assert app.attached.trouble == "" and registers["encoder.sign"] == (1.0, 1.0, 1.0), app.attached
    # A Linux process has neither a memory of its last end nor an image with budgets.
    assert app.attached.name == "native" and app.attached.reset is None and app.budgets == []
    while live.status["board_mode"] != IDLE:
        yield
    live.arm()
    while live.status["board_mode"] != RENDER:
        yield
    while live.contact is None or live.contact.mode == "free" or -live.contact.force_N @ live.contact.normal < 0.2:
        yield
    assert not live.guide_hand([0.0, 0.0, 0.0])  # it is not ours
    app.use_mouse(False)
    # A second of lines in the plots, while it touches.
    until = live.status["tick"] + 1000
    while live.status["tick"] < until or live.contact.mode == "free":
        yield
    assert live.status["models_taken"] > 0
    assert app.message == "", app.message
    # Another start beside the same board: it is free for it, and a person has to arm again.
    app.set("friction", 0.3)
    app.apply()
    assert app.message == "" and app.live is not live, app.message
    assert app.live.scene.sections.contact.friction == 0.3
    live = app.live
    while live.status["board_mode"] != IDLE:
        yield
    live.arm()
    while live.contact is None or live.contact.mode == "free" or live.status["board_mode"] != RENDER:
        yield
    until = live.status["tick"] + 1000
    while live.status["tick"] < until or live.contact.mode == "free":
        yield


step = run(stages)
