"""`palpate gui`: opens the window, runs a script in it if there is one, and says at the end how it went."""

import math
import os
import re
import runpy
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.image

from palpate.doctor import check_display
from palpate.gui.settings import Settings
from palpate.live import Live
from palpate.scene import SceneError


class GuiError(RuntimeError):
    """The window cannot be opened, or the loop in it has failed."""


@dataclass(frozen=True)
class Options:
    """Of the command. script: a Python file with `step(app, time_s)`, called before each frame with the `App` and the
    wall-clock time since the start in s; it ends the window by returning False. duration_s: ends it then; None: never."""

    settings: Settings
    out: Path
    script: Path | None = None
    duration_s: float | None = None
    screenshot: Path | None = None
    size: tuple[int, int] = (1280, 800)


def parse_size(text: str) -> tuple[int, int]:
    """Of "1280x800". Raises SceneError beyond what the panels fit in."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (800 <= size[0] <= 8000 and 500 <= size[1] <= 8000):
        raise SceneError(f"--size = {text}: must be WIDTHxHEIGHT from 800x500 to 8000x8000 pixels")
    return size


def run_window(options: Options) -> dict[str, Any]:
    """Returns what `--json` prints (docs/gui.md). Raises SceneError, BoardError, GuiError, RecordError, OSError for files.

    What is wrong in the options is told before what is wrong with the display.
    """
    _check(options)
    step = _load_script(options.script)
    display = check_display(dict(os.environ))
    if not display.ok:
        raise GuiError(f"no window can be opened: {display.found}; start it on a desktop, or under xvfb-run")
    try:
        from palpate.gui.app import App
    except ImportError as error:
        raise GuiError(f"the window needs the Python package polyscope ({error})") from None
    with App(options.settings, options.out, options.size) as app:
        began_s = time.monotonic()
        while True:
            now_s = time.monotonic()
            if options.duration_s is not None and now_s - began_s >= options.duration_s:
                break
            if step is not None and step(app, now_s - began_s) is False:
                break
            if not app.frame():
                break
        frames, frames_per_s = app.frames, app.frames_per_s
        if options.screenshot is not None:
            options.screenshot.parent.mkdir(parents=True, exist_ok=True)
            matplotlib.image.imsave(options.screenshot, app.screenshot())
        elapsed_s = time.monotonic() - began_s
        status = app.live.status
        problem, settings = app.live.problem, app.settings
    if problem:
        raise GuiError(problem)
    return {
        "board": settings.board,
        "scene": str(settings.file),
        "frames": frames,
        "frames_per_s_median": frames_per_s,
        "elapsed_s": elapsed_s,
        "ticks": status["tick"],
        "slipped_s": status["slipped_s"],
        "models_sent": status["models_sent"],
        "models_taken": status["models_taken"],
        "frames_lost_down": status["frames_lost_down"],
        "frames_lost_up": status["frames_lost_up"],
        "screenshot": None if options.screenshot is None else str(options.screenshot),
    }


def _check(options: Options) -> None:
    duration_s = options.duration_s
    if duration_s is not None and not (math.isfinite(duration_s) and duration_s > 0.0):
        raise SceneError(f"--duration = {duration_s:g}: must be greater than 0 s, and finite")
    if options.screenshot is not None and options.screenshot.suffix != ".png":
        raise SceneError(f"--screenshot = {options.screenshot}: must end in .png")
    Live(options.settings.scene(), options.settings.board)  # can it be touched? Nothing is opened yet


def _load_script(file: Path | None) -> Callable[[Any, float], object] | None:
    if file is None:
        return None
    if not file.is_file():
        raise SceneError(f"{file}: no such file: must be a Python script with step(app, time_s)")
    try:
        step: Callable[[Any, float], object] | None = runpy.run_path(str(file)).get("step")
    except SyntaxError as error:
        raise SceneError(f"{error.filename}:{error.lineno}: {error.msg}") from None
    if not callable(step):
        raise SceneError(f"{file}: has no function step(app, time_s)")
    return step
