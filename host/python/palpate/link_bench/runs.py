"""One run of the bench's scene over a medium, and the highest update rate that the medium holds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate import experiment
from palpate.scene import Scene, load_scene

# Of a scene's link.
MEDIA: dict[str, dict[str, Any]] = {
    "uart 921,600": {"link.medium": "uart", "link.baud": 921_600},
    "uart 3,000,000": {"link.medium": "uart", "link.baud": 3_000_000},
    "can 1M": {"link.medium": "can"},
    "canfd 1M/5M": {"link.medium": "canfd"},
    "usb full speed": {"link.medium": "usb"},
}
MODELS: dict[str, dict[str, Any]] = {
    "hybrid": {"model.builder": "hybrid"},
    "patch": {"model.builder": "patch"},
    "krylov": {"model.builder": "krylov", "model.tangent": "frame"},
}
USUAL_HZ = 30
MOST_HZ = 250  # of rates.model_update_Hz
NEVER_HEARD = 0xFFFFFFFF
_TICKS_PER_SECOND = 1000
# Behind the first model in use: what its basis kept waiting has crossed.
_SETTLING_TICKS = 200
# Models that are due at both ends of the time that is counted.
_SPARE_MODELS = 2


@dataclass(frozen=True)
class LinkRun:
    """A run at a rate. Latencies in ticks: tip_ticks from the tick of a tip's sample to that at which the host has it;
    model_ticks from a state's hand-over to the link to the tick from which it is rendered. problems: why the rate is not held."""

    medium: str
    model: str
    rate_Hz: int
    counted_ticks: int
    models_taken: int
    models_due: int
    state_bytes: float
    basis_bytes: float
    busy_share: float
    bytes_per_s: Mapping[str, float]
    tip_ticks: NDArray[np.int64]
    model_ticks: NDArray[np.int64]
    problems: tuple[str, ...]

    @property
    def held(self) -> bool:
        return not self.problems


def scene_of(file: Path, medium: str, model: str, rate_Hz: int, overrides: Mapping[str, Any], board: str | None) -> Scene:
    """The bench's scene with this link and these models. Raises SceneError."""
    keys = {**MEDIA[medium], **MODELS[model], "rates.model_update_Hz": float(rate_Hz), **overrides}
    return load_scene(file, keys, board)


def run(core: Any, scene: Scene, medium: str, model: str, rate_Hz: int) -> LinkRun:
    """Raises hil.BoardError, or what the core raises."""
    path = scene.require_path()
    done = experiment.run_firmware(core, scene, scene.to_dict(), path.position_m[0], experiment.no_progress)
    return judge(done.values, done.counters, done.link, scene, medium, model, rate_Hz)


def judge(
    values: Mapping[str, NDArray[Any]],
    counters: Mapping[str, int | float],
    link: Mapping[str, Any],
    scene: Scene,
    medium: str,
    model: str,
    rate_Hz: int,
) -> LinkRun:
    """What a run was: held is a rate at which, from the first model in use on, every model that is due is taken over, none later
    than a period behind its hand-over, nothing is lost or refused, and what the host hears is not delayed by more than a period."""
    ticks = values["ticks/tick"].astype(np.int64)
    sent, swap = (values[f"updates/{name}"].astype(np.int64) for name in ("sent_tick", "swap_tick"))
    taken = values["updates/status"] == 0
    duration = int(ticks[-1]) + 1
    first = int(swap[taken][0]) + _SETTLING_TICKS if np.any(taken) else duration
    period = _TICKS_PER_SECOND / rate_Hz
    # Whose swap could be heard of before the end.
    counted = (sent >= first) & (sent < duration - 2.0 * period)
    late = (swap - sent)[counted & taken]
    window = max(0.0, duration - 2.0 * period - first)
    due = int(window / period)
    heard = link["heard_ticks"].astype(np.int64)
    in_time = (ticks >= first) & (heard != NEVER_HEARD)
    # What the medium carried, over the whole run: bases are in it.
    busy = [link[way]["busy_ticks"] / duration for way in ("down", "up")]
    share = max(busy) if scene.sections.link.medium == "uart" else sum(busy)
    tip = (heard - ticks)[in_time]
    problems = []
    if due == 0:
        problems.append("no model is in use in time")
    if np.count_nonzero(counted & taken) < due - _SPARE_MODELS:
        problems.append(f"{np.count_nonzero(counted & taken)} of {due} models are taken over")
    if np.any(counted & ~taken):
        problems.append(f"{np.count_nonzero(counted & ~taken)} models are not taken over")
    if len(late) and late.max() > period:
        problems.append(f"a model is {late.max()} ticks late, of {period:.0f}")
    if len(tip) and tip.max() > max(period, scene.sections.link.trace_ticks + 1):
        problems.append(f"the tip is heard {tip.max()} ticks late, of {period:.0f}")
    lost = int(counters["frames_lost_down"] + counters["frames_lost_up"] + link["down"]["submissions_dropped"])
    if lost:
        problems.append(f"{lost} frames are lost")
    return LinkRun(
        medium, model, rate_Hz, round(window), int(np.count_nonzero(counted & taken)), due,
        _median(values["updates/bytes"][counted]), _mean(values["updates/basis_bytes"][counted]), share,
        {way: link[way]["bytes_delivered"] * _TICKS_PER_SECOND / duration for way in ("down", "up")},
        tip, late, tuple(problems),
    )  # fmt: skip


def _median(values: NDArray[Any]) -> float:
    return float(np.median(values)) if len(values) else 0.0


def _mean(values: NDArray[Any]) -> float:
    return float(np.mean(values)) if len(values) else 0.0


def highest_held(measure: Callable[[int], LinkRun], most_Hz: int = MOST_HZ) -> LinkRun | None:
    """By bisection, in whole Hz and to 5 %; None: not even 1 Hz. What comes out is held, and a rate at most 5 % or 1 Hz above it
    is not, or it is `most_Hz`."""
    low, high = 0, most_Hz + 1
    best: LinkRun | None = None
    while high - low > max(1, low // 20):
        rate_Hz = min(USUAL_HZ, most_Hz) if (low, high) == (0, most_Hz + 1) else (low + high) // 2
        found = measure(rate_Hz)
        if found.held:
            low, best = rate_Hz, found
        else:
            high = rate_Hz
    return best


def to_dict(done: LinkRun) -> dict[str, Any]:
    """For JSON: numbers, and histograms as {ticks: count}."""
    plain = {
        name: getattr(done, name)
        for name in ("medium", "model", "rate_Hz", "counted_ticks", "models_taken", "models_due", "state_bytes", "basis_bytes", "busy_share")
    }
    return {
        **plain,
        "bytes_per_s": dict(done.bytes_per_s),
        "held": done.held,
        "problems": list(done.problems),
        "tip_to_host_ticks": histogram(done.tip_ticks),
        "host_to_model_active_ticks": histogram(done.model_ticks),
    }


def histogram(ticks: NDArray[np.int64]) -> dict[str, int]:
    """How often each whole number of ticks."""
    values, counts = np.unique(ticks, return_counts=True)
    return {str(value): int(count) for value, count in zip(values, counts, strict=True)}


