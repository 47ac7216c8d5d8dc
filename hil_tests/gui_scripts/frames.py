"""Each step is a frame that is drawn, on a computer that could draw many more."""

import polyscope as ps

FRAMES = 12
_calls = 0


def step(app, time_s):
    global _calls
    if _calls == 0:
        ps.set_max_fps(4)  # far below what any computer draws
    assert app.frames == _calls, (app.frames, _calls)
    _calls += 1
    return _calls <= FRAMES
