"""Real events of X: the mouse moves the hand, the space bar is the emergency stop."""

import subprocess
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

RENDER, FAULT = 3, 4
AWAY_m = np.array([0.01, 0.01, 0.004])


def xdotool(*words):
    subprocess.run(["xdotool", *map(str, words)], check=True)


def stages(app):
    while app.live.status["tick"] < 200:
        yield
    app.live.arm()
    while app.live.status["board_mode"] != RENDER:
        yield
    # A script, or a path, has moved the hand before.
    app.live.guide_hand(AWAY_m)
    while np.linalg.norm(app.live.contact.hand_m - AWAY_m) > 2e-4:
        yield
    xdotool("mousemove", 600, 300)
    yield
    xdotool("key", "h")
    while not app.hand.enabled:
        yield
    before_m = app.hand.target_m.copy()
    # From where the hand is, not from where the window believed it to be.
    assert np.linalg.norm(before_m - app.live.contact.hand_m) < 1e-4, (before_m, app.live.contact.hand_m)
    assert np.linalg.norm(before_m - AWAY_m) < 1e-3, before_m
    for x in range(604, 644, 4):  # to the right: +x, for the camera looks along +y
        xdotool("mousemove", x, 300)
        yield
        yield
    level_m = app.hand.target_m.copy()
    assert level_m[0] - before_m[0] > 0.002, (before_m, level_m)
    assert level_m[2] == before_m[2]
    for _ in range(3):
        xdotool("click", 5)  # the wheel, down
        yield
        yield
    while app.hand.target_m[2] > before_m[2] - 0.0025:
        yield
    while np.linalg.norm(app.live.contact.hand_m - app.hand.target_m) > 2e-4:
        yield
    xdotool("key", "space")
    while app.live.status["board_mode"] != FAULT:
        yield
    assert app.emergency_stop
    # Twice is not back.
    xdotool("key", "space")
    for _ in range(5):
        yield
    assert app.emergency_stop


step = run(stages)
