"""Short scenes for tests of the closed loop, and what came out of them."""

import contextlib
import os
import pathlib
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from palpate import _core, experiment
from palpate.scene import load_scene

ROOT = pathlib.Path(__file__).resolve().parent.parent
FREE, STICK, SLIP = 0, 1, 2
MODE_RENDER, MODE_FAULT = 3, 4
STATUS_UNKNOWN = 255

# A block of 6 x 6 x 6 nodes, its top at z = -20 mm; the waypoints are the hand's, the tip stays behind by 0.5 mm a newton.
BODY = """
[body]
nodes = [6, 6, 6]
origin_m = [-0.025, -0.025, -0.07]
fixed_faces = ["z-"]
"""
# Down 3 mm by 0.35 s, 6 mm aside by 0.65 s, up again.
PRESS_AND_DRAG = """
[path]
waypoints = [
  { time_s = 0.1, position_m = [-0.004, 0.002, -0.0195] },
  { time_s = 0.3, position_m = [-0.004, 0.002, -0.023] },
  { time_s = 0.35, position_m = [-0.004, 0.002, -0.023] },
  { time_s = 0.65, position_m = [0.002, 0.002, -0.023] },
  { time_s = 0.75, position_m = [0.002, 0.002, -0.016] },
]
"""


def scene(extra: str = "", *, duration_s: float = 0.8, body: str = BODY, path: str = PRESS_AND_DRAG,
          friction: float = 0.6, reference: bool = False, board: str = "mps2_an386") -> str:
    """The text of a scene. extra: further sections, but [contact], [board], [reference] and [outputs]."""
    return (f"duration_s = {duration_s}\n{body}\n[contact]\nfriction = {friction}\n{path}\n[board]\nname = \"{board}\"\n"
            f"[reference]\nenabled = {str(reference).lower()}\n[outputs]\ncsv = false\npictures = false\n{extra}\n")


@dataclass(frozen=True)
class Run:
    """A run's summary.json and the datasets of its record by path."""

    summary: dict[str, Any]
    record: dict[str, np.ndarray]

    def __getitem__(self, path: str) -> np.ndarray:
        return self.record[path]

    def row_of(self, tick: int) -> int:
        """The row of /ticks of a servo tick that the board computed."""
        (row,) = np.flatnonzero(self["ticks/tick"] == tick)
        return int(row)

    @property
    def force_N(self) -> np.ndarray:
        """(ticks,): magnitude of the rendered force."""
        return np.linalg.norm(self["ticks/force_N"], axis=1)


def read_record(file: pathlib.Path) -> dict[str, np.ndarray]:
    """All numbers of a record.h5."""
    datasets: dict[str, np.ndarray] = {}

    def take(path: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.shape != ():
            datasets[path] = item[()]

    with h5py.File(file) as record:
        record.visititems(take)
    return datasets


@contextlib.contextmanager
def no_progress(label: str, unit: str) -> Iterator[Any]:
    yield lambda done, total: True


def run(folder: pathlib.Path, text: str) -> Run:
    """Runs a scene, its firmware on the scene's board."""
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(text)
    outcome = experiment.run(_core, load_scene(folder / "scene.toml"), "run", folder / "out", no_progress)
    return Run(outcome.summary, read_record(outcome.files["record.h5"]))


def command_line(folder: pathlib.Path, command: str, text: str, *options: str, argument: str = "scene.toml",
                 out: str = "out") -> subprocess.CompletedProcess:
    """`palpate run|simulate scene.toml --out out --json` in a process of its own, in that folder."""
    (folder / "scene.toml").write_text(text)
    return subprocess.run(
        [sys.executable, "-m", "palpate", command, argument, "--out", out, "--json", *options],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT / "host/python"), "MPLBACKEND": "Agg"},
        capture_output=True, text=True, timeout=300, check=False)
