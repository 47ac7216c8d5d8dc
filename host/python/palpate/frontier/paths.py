"""Tip paths of the experiments: pokes with least jerk, drags at constant speed. `python -m palpate.frontier.paths` writes
them beside the scene, as CSV."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.paths import SCENES

Array = NDArray[np.float64]

FOLDER = SCENES / "frontier"
TOP_M = -0.02
# Rows this far apart; the tip moves straight between them.
_STEP_S = 0.002
# The tip waits here above the surface until the board renders.
_ABOVE_M = 0.0015
_RAMP_S = 0.05
# Places on the top (x, y): no node, edge or middle of a triangle; a node is at (0.005, 0.005).
_POKE_AT_M = (0.0035, 0.0042)
_DRAG_FROM_M = (-0.0147, 0.0023)


def minimum_jerk(fraction: Array) -> Array:
    """Way (0 to 1) after this fraction of the time, from rest to rest with least jerk."""
    f = np.clip(fraction, 0.0, 1.0)
    return np.asarray(f**3 * (10.0 - 15.0 * f + 6.0 * f**2))


def constant_speed(time_s: Array, length_m: float, speed_m_s: float) -> Array:
    """Way (m) after these times from the start: constant speed between ramps of 50 ms in which it goes as a cosine."""
    duration_s = length_m / speed_m_s + _RAMP_S  # each ramp covers half of what full speed would

    def ramped(t: Array) -> Array:
        t = np.clip(t, 0.0, None)
        in_ramp = 0.5 * (t - _RAMP_S / np.pi * np.sin(np.pi * t / _RAMP_S))
        return speed_m_s * np.where(t < _RAMP_S, in_ramp, t - 0.5 * _RAMP_S)

    return np.asarray(ramped(time_s) - ramped(time_s - (duration_s - _RAMP_S)))


def poke(depth_m: float, pull_m: float, start_s: float, duration_s: float) -> Array:
    """In, sideways, back and out (n, 4: s, m). The tip sets out at start_s and is back after duration_s: a quarter of it
    going in, a fifth pulling, 3/20 back, a fifth out, and rests between."""
    time_s = np.arange(0.0, start_s + duration_s + _STEP_S, _STEP_S)
    f = (time_s - start_s) / duration_s
    down = minimum_jerk(f / 0.25) - minimum_jerk((f - 0.8) / 0.2)
    side = minimum_jerk((f - 0.3) / 0.2) - minimum_jerk((f - 0.6) / 0.15)
    x, y = _POKE_AT_M
    z_m = TOP_M + _ABOVE_M - (depth_m + _ABOVE_M) * down
    return np.column_stack([time_s, x + pull_m * side, np.full_like(time_s, y), z_m])


def drag(depth_m: float, length_m: float, speed_m_s: float) -> Array:
    """In, along x at constant speed, out (n, 4: s, m)."""
    begin_s, press_s, rest_s = 0.4, 0.3, 0.1
    drag_s = begin_s + press_s + rest_s
    lift_s = drag_s + length_m / speed_m_s + _RAMP_S + rest_s
    time_s = np.arange(0.0, lift_s + press_s + _STEP_S, _STEP_S)
    down = minimum_jerk((time_s - begin_s) / press_s) - minimum_jerk((time_s - lift_s) / press_s)
    x, y = _DRAG_FROM_M
    x_m = x + constant_speed(time_s - drag_s, length_m, speed_m_s)
    return np.column_stack([time_s, x_m, np.full_like(time_s, y), TOP_M + _ABOVE_M - (depth_m + _ABOVE_M) * down])


PATHS: dict[str, Callable[[], Array]] = {
    "poke_5mm.csv": lambda: poke(0.005, 0.005, 0.4, 1.0),
    "poke_8mm.csv": lambda: poke(0.008, 0.005, 0.4, 1.0),
    # Between an update at 1 s, taken over 50 ms later, and the next one.
    "poke_5mm_alone.csv": lambda: poke(0.005, 0.005, 1.06, 0.9),
    # A body of 1e4 N/m answers with up to 5 N, those of 100 N/m at 10 mm.
    "poke_0.1mm.csv": lambda: poke(0.0001, 0.0001, 0.4, 1.0),
    "drag_3cm_s.csv": lambda: drag(0.005, 0.03, 0.03),
    "drag_10cm_s.csv": lambda: drag(0.005, 0.03, 0.1),
}


def format_csv(rows: Array) -> str:
    """The file's text: rows in which the tip does not move are left out but the first and the last."""
    moves = np.any(np.abs(np.diff(rows[:, 1:], axis=0)) > 1e-9, axis=1)
    kept = np.concatenate([[True], moves]) | np.concatenate([moves, [True]])
    lines = ["time_s,x_m,y_m,z_m"]
    lines += [f"{t:.3f},{x:.7g},{y:.7g},{z:.7g}" for t, x, y, z in rows[kept].tolist()]
    return "\n".join(lines) + "\n"


def write_all(folder: Path) -> None:
    """Writes every path."""
    for name, make in PATHS.items():
        (folder / name).write_text(format_csv(make()), encoding="utf-8")


if __name__ == "__main__":
    write_all(FOLDER)
