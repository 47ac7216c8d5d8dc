"""Prints as JSON how much the board's force jumps at the edges of triangles, flat against smooth, from one local model
to the next; away from changes of model and at them (docs/decisions/smooth_normals.md).

    PYTHONPATH=host/python python host/bench/edge_jumps_board.py

The closed loop with the firmware on the native board: a scripted tip 5 mm deep, dragged 7 cells obliquely at 0.09 m/s.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np

SCENE = """
title = "Edges"
duration_s = 2.2
[body]
nodes = [14, 12, 10]
origin_m = [-0.065, -0.055, -0.11]
fixed_faces = ["z-"]
[contact]
friction = {friction}
surface = "{surface}"
[coupling]
kind = "kinematic"
[hand]
kind = "scripted"
[path]
waypoints = [
  {{ time_s = 0.2, position_m = [-0.0347, -0.009, -0.018] }},
  {{ time_s = 0.7, position_m = [-0.0347, -0.009, -0.025] }},
  {{ time_s = 1.5, position_m = [0.0353, 0.0043, -0.025] }},
  {{ time_s = 2.1, position_m = [0.0353, 0.0043, -0.015] }},
]
[board]
name = "native"
[outputs]
csv = false
pictures = false
"""
DRAG = slice(720, 1480)  # ticks
AROUND_CHANGE = range(-2, 4)  # ticks that a change of model is given


def measure(surface: str, friction: float) -> dict[str, float]:
    """Of one run; or that the board has stopped it."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "edges.toml")
        scene.write_text(SCENE.format(surface=surface, friction=friction))
        command = [sys.executable, "-m", "palpate", "run", str(scene), "--out", folder]
        if subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode != 0:
            return {"stopped": True}  # why stands on the standard error output
        error_percent = json.loads(Path(folder, "summary.json").read_text())["rms_force_error_percent"]
        with h5py.File(Path(folder, "record.h5")) as record:
            ticks = record["ticks"]
            force_N = ticks["force_N"][:].astype(float)
            triangle, sequence = ticks["triangle"][:], ticks["model_sequence"][:]
            free = ticks["contact_mode"][:] == 0
    change_N = np.diff(force_N, axis=0, prepend=force_N[:1])
    around_N = (np.roll(change_N, 1, axis=0) + np.roll(change_N, -1, axis=0)) / 2
    jump_N = np.linalg.norm(change_N - around_N, axis=1)[DRAG]
    crossed = (triangle != np.roll(triangle, 1)) | free | np.roll(free, 1)
    edge = (crossed | np.roll(crossed, 1))[DRAG]
    changed = sequence != np.roll(sequence, 1)
    near = np.any([np.roll(changed, by) for by in AROUND_CHANGE], axis=0)[DRAG]
    return {
        "crossings": int(crossed[DRAG].sum()),
        "free_ticks": int(free[DRAG].sum()),
        "jump_N": float(jump_N[edge & ~near].max()),
        "jump_at_model_changes_N": float(jump_N[near].max()),
        "rms_force_error_percent": error_percent,
    }


def main() -> None:
    rows: list[dict[str, Any]] = [
        {"friction": friction} | {surface: measure(surface, friction) for surface in ("flat", "smooth")}
        for friction in (0.0, 0.3, 1.0)
    ]
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
