"""Arms, plays the scene's path, and ends in the middle of the drag."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from stages import run  # noqa: E402


def stages(app):
    while app.live.status["tick"] < 200:
        yield
    app.live.arm()
    while app.live.status["board_mode"] != 3:
        yield
    app.play_path()
    while app.live.contact.mode == "free" or app.live.contact.tip_m[0] < -0.003:
        yield
    assert app.live.history["force_normal_N"].max() > 1.0
    assert app.live.status["models_taken"] > 0


step = run(stages)
