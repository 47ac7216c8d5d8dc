"""Steps of a script as a generator: each yield is a frame."""


def run(stages, deadline_s=90.0):
    """The function `step` for `palpate gui --script`."""
    running = None

    def step(app, time_s):
        nonlocal running
        assert time_s < deadline_s, f"not done after {deadline_s:g} s; {app.message} {app.live.status}"
        if running is None:
            running = stages(app)
        return next(running, "done") != "done"

    return step
