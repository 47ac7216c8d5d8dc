"""The same picture of a body that is pressed, coloured by displacement and not at all."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402

# Of the part of the window between the panels: the body covers more than twice as much.
CHANGED_SHARE = 0.10
# Of a colour channel, 0 to 255: more than smoothing of edges between two like colours.
CHANGED = 40


def stages(app):
    while app.live.status["tick"] < 200:
        yield
    app.live.arm()
    app.guide_hand(np.array([0.0, 0.0, app.view.top_m - 0.008]))
    while app.live.contact.mode == "free" or app.live.history["force_normal_N"][-1] < 0.5:
        yield
    app.live.set_speed(0.0)
    scenes = {}
    for colouring in ("displacement", "nothing"):
        app.view.colouring = colouring
        yield
        yield
        scenes[colouring] = app.screenshot()[:, 290:900, :3].astype(int)
    changed = np.abs(scenes["displacement"] - scenes["nothing"]).max(axis=-1) > CHANGED
    assert changed.mean() > CHANGED_SHARE, changed.mean()


step = run(stages)
