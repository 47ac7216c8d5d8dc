"""Stands in for `palpate._core` and for a board, to test what starts, feeds and watches them.

The fake exchange has one byte per tick in each direction instead of frames.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from synthetic import run_values, sheet_values, simulate_values

from palpate.hil import BoardType

Progress = Callable[[int, int], bool]

TICKS = 400
_HIT = {"dropped": 2, "flipped": 0, "truncated": 0, "duplicated": 0, "reordered": 0, "delayed": 0, "cut": 0}
RENDERER_BYTES = 12345


def _side(scene: dict[str, Any]) -> int:
    """Nodes along the edge of the scene's cube; an empty scene has 8."""
    side: int = scene["body"]["nodes"][0] if scene else 8
    return side


def run_closed_loop(
    scene: dict[str, Any], actuator_fd: int, sensor_fd: int, progress: Progress, cache_folder: str
) -> dict[str, Any]:
    """Exchanges a byte per tick with the fake board; returns made-up results."""
    for tick in range(TICKS):
        os.write(sensor_fd, b"s")
        if os.read(actuator_fd, 1) != b"a":
            raise RuntimeError("the board closed its stream")
        if not progress(tick + 1, TICKS):
            raise RuntimeError("stopped")
    os.write(sensor_fd, b"q")
    values, counters = run_values(ticks=TICKS, nodes=_side(scene))
    return {
        **{path: array for path, array in values.items() if not path.startswith("reference/")},
        **counters,
        "basis_problem": "",
        "link": {
            **{way: {"busy_ticks": 0.25 * TICKS, "attempts_failed": 0, "bus_offs": 0} for way in ("down", "up")},
            **{f"frames_removed_{way}": 2 for way in ("down", "up")},
            "troubles": {"down": {"frames": 9, **_HIT}, "up": {"frames": 9, **_HIT}, "foreign_frames": 0},
            "bytes_per_tick": 1200.0,
            "heard_ticks": np.arange(TICKS) + 1,
        },
    }


def reference(scene: dict[str, Any], time_s: Any, tip_m: Any, progress: Progress) -> dict[str, Any]:
    """Made-up results."""
    progress(len(time_s), len(time_s))
    values, _ = run_values(ticks=TICKS)
    return {path: array[: len(time_s)] for path, array in values.items() if path.startswith("reference/")}


def model_cost(scene: dict[str, Any], rounds: int) -> dict[str, float]:
    """Made-up results."""
    return {"kernel_s": 1e-3, "model_s": 2e-3, "first_s": 5e-2}


def compliance_errors(
    scene: dict[str, Any], node: int, models: list[dict[str, Any]], press_m: float, progress: Progress
) -> dict[str, Any]:
    """Made-up results: 3 % at most."""
    return {"models": [{"at_node": [0.01, 0.03, 0.02]} for _ in models]}


def simulate(scene: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """Made-up results."""
    progress(scene["duration_ticks"], scene["duration_ticks"])
    return sheet_values() if scene["path"] is None else simulate_values()


_BOARD = """
import os, signal, sys, time
actuators = os.open("act.fifo", os.O_WRONLY)
sensors = os.open("sen.fifo", os.O_RDONLY)
print("hello from the board", flush=True)
tick = 0
while True:
    byte = os.read(sensors, 1)
    if byte == b"q":
        sys.exit(0)
    if not byte:
        sys.exit(3)
    {behaviour}
    os.write(actuators, b"a")
    tick += 1
"""


def board(behaviour: str = "pass", image: Path = Path(sys.executable)) -> BoardType:
    """A board that runs a Python script, with one more statement in each tick."""
    script = _BOARD.replace("{behaviour}", behaviour)
    identify = [sys.executable, "-c", "print('palpate fake 0.1 schema 0123456789abcdef')"]
    return BoardType("fake", image, lambda _: [sys.executable, "-c", script], 5, lambda _: identify)
