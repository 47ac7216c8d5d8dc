"""`palpate gui`: opens the window, runs a script in it if there is one, and says at the end how it went."""

import runpy
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np

from palpate.gui.settings import Settings


class GuiError(RuntimeError):
    """The window cannot be opened, or the loop in it has failed."""


@dataclass(frozen=True)
class Options:
    """of the command. script: a Python file with `step(app, time_s)`, called before each frame with the `App` and the
    wall-clock time since the start in s; it ends the window by returning False. duration_s: ends it then; None: never."""

    settings: Settings
    out: Path
    script: Path | None = None
    duration_s: float | None = None
    screenshot: Path | None = None


def run(options: Options) -> dict[str, Any]:
    """Returns what `--json` prints (docs/gui.md). Raises SceneError, BoardError, GuiError, OSError for files."""
    try:
        from palpate.gui.app import App
    except ImportError as error:
        raise GuiError(f"the window needs the Python package polyscope ({error})") from None
    step = _load_script(options.script)
    try:
        app = App(options.settings, options.out)
        app.__enter__()
    except RuntimeError as error:
        if "board" in str(error):
            raise
        raise GuiError(
            f"no window can be opened: {error}; start it on a desktop, or under xvfb-run"
        ) from None
    frames_s = []
    with app:
        began_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            if options.duration_s is not None and now_s - began_s >= options.duration_s:
                break
            if step is not None and step(app, now_s - began_s) is False:
                break
            if not app.frame():
                break
            frames_s.append(time.monotonic() - now_s)
        if options.screenshot is not None:
            options.screenshot.parent.mkdir(parents=True, exist_ok=True)
            matplotlib.image.imsave(options.screenshot, app.screenshot())
        elapsed_s = time.monotonic() - began_s
        status = app.live.status
        problem = app.live.problem
    if problem:
        raise GuiError(problem)
    return {
        "board": options.settings.board,
        "scene": str(options.settings.file),
        "frames": len(frames_s),
        "frames_per_s_median": 1.0 / float(np.median(frames_s)) if frames_s else 0.0,
        "elapsed_s": elapsed_s,
        "ticks": status["tick"],
        "slipped_s": status["slipped_s"],
        "models_sent": status["models_sent"],
        "models_taken": status["models_taken"],
        "frames_lost_down": status["frames_lost_down"],
        "frames_lost_up": status["frames_lost_up"],
        "screenshot": None if options.screenshot is None else str(options.screenshot),
    }


def _load_script(file: Path | None) -> Callable[[Any, float], object] | None:
    if file is None:
        return None
    if not file.is_file():
        raise FileNotFoundError(f"{file}: no such file: must be a Python script with step(app, time_s)")
    step = runpy.run_path(str(file)).get("step")
    if not callable(step):
        raise ValueError(f"{file}: has no function step(app, time_s)")
    return step
