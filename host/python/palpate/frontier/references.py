"""The full non-linear body with contact along a tip path, computed once for each path and step, and kept."""

import hashlib
import json
import threading
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.frontier.metrics import Record
from palpate.scene import Scene
from palpate.summary import relative_rms_percent

# Steps of the body, and of the contact with it, in the converged reference of the reference material; the last is what
# errors are against. Other materials: in the same ratio to their integrator's step.
STEPS_S = (1e-4, 5e-5, 2.5e-5)
_OF_THE_REFERENCE = ("body", "contact", "coupling", "tool", "duration_ticks")
_KEPT = ("reference/force_N", "reference/contact_mode")
_TICK_S = 1e-3


def digest(value: Any) -> str:
    """Of anything made of dictionaries, lists, numbers, texts and arrays."""

    def plain(item: Any) -> Any:
        if isinstance(item, np.ndarray):
            return hashlib.sha256(np.ascontiguousarray(item).tobytes()).hexdigest()
        raise TypeError(type(item).__name__)

    return hashlib.sha256(json.dumps(value, sort_keys=True, default=plain).encode()).hexdigest()


class References:
    """Thread-safe; a path that two ask for at once is computed once. folder: where they are kept, by digest of what they
    depend on and of the core; version: of the program."""

    def __init__(self, core: Any, folder: Path, version: str) -> None:
        self._core = core
        self._folder = folder
        self._version = version
        self._locks: dict[str, threading.Lock] = defaultdict(threading.Lock)
        self._guard = threading.Lock()

    def along(self, scene: Scene, tick: NDArray[Any], tip_m: NDArray[Any], step_s: float, go_on: Callable[[], None]) -> Record:
        """`reference/force_N` (n, 3) and `reference/contact_mode` (n,) of these ticks. go_on: called now and then; what it
        raises ends the work. Raises what the core raises."""
        sections = replace(scene.sections, reference=replace(scene.sections.reference, step_s=step_s))
        given = replace(scene, sections=sections).to_dict()
        key = digest(
            [{name: given[name] for name in _OF_THE_REFERENCE}, given["reference"], tick, tip_m, self._version]
        )
        with self._guard:
            lock = self._locks[key]
        with lock:
            file = self._folder / f"{key[:32]}.npz"
            if file.exists():
                with np.load(file) as archive:
                    return {name: archive[name.replace("/", ".")] for name in _KEPT}

            def report(done: int, total: int) -> bool:
                go_on()
                return True

            time_s = tick.astype(np.float64) * _TICK_S
            found = self._core.reference(given, time_s, np.asarray(tip_m, dtype=np.float64), report)
            values = {name: np.asarray(found[name]) for name in _KEPT}
            self._folder.mkdir(parents=True, exist_ok=True)
            partial = file.with_suffix(".part.npz")
            kept = {name.replace("/", "."): value for name, value in values.items()}
            np.savez_compressed(partial, allow_pickle=False, **kept)
            partial.rename(file)  # where it stands it is whole
            return values


def steps_s(scene: Scene) -> tuple[float, ...]:
    """The three steps for this scene's material: STEPS_S, or shorter as its integrator's is."""
    factor = min(1.0, scene.sections.integrator.step_s / STEPS_S[0])
    return tuple(factor * step for step in STEPS_S)


def differences(records: dict[float, Record]) -> list[dict[str, float | None]]:
    """How far each step's force is from that of the finest, and in how many ticks its mode is another."""
    finest = records[min(records)]
    rows: list[dict[str, float | None]] = []
    for step in sorted(records, reverse=True)[:-1]:
        force_N, mode = records[step]["reference/force_N"], records[step]["reference/contact_mode"]
        rows.append(
            {
                "step_s": step,
                "difference_percent": relative_rms_percent(force_N, finest["reference/force_N"]),
                "other_mode_ticks": int(np.count_nonzero(mode != finest["reference/contact_mode"])),
            }
        )
    return rows
