"""Signals over ticks: held samples, jumps, and the delay between two of them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]


def held(signal: NDArray[Any], tick: NDArray[Any], rate_Hz: float) -> NDArray[Any]:
    """The signal as sampled at this rate from tick 0 on and held. signal: (n,) or (n, k); tick: (n,), in ms."""
    period_ms = 1000.0 / rate_Hz
    # The first tick at or after each sample's time.
    frame_tick = np.ceil(np.floor(tick / period_ms + 1e-9) * period_ms - 1e-9)
    return signal[np.clip(np.searchsorted(tick, frame_tick), 0, len(tick) - 1)]


def rms(values: NDArray[Any]) -> float:
    """Root mean square of the values (n,), or of the lengths of vectors (n, k); NaN without any."""
    if len(values) == 0:
        return float("nan")
    return float(np.sqrt(np.mean(np.sum(np.square(values.reshape(len(values), -1)), axis=1))))


def largest_jump(signal: NDArray[Any], reference: NDArray[Any], window: NDArray[np.bool_]) -> float:
    """Largest change of the signal from one tick to the next beyond the reference's own change, inside the window.

    signal, reference: (n, k); window: (n,); NaN where it has fewer than two ticks.
    """
    error = (signal.astype(np.float64) - reference)[window]
    if len(error) < 2:
        return float("nan")
    return float(np.linalg.norm(np.diff(error, axis=0), axis=1).max())


def delay_ticks(signal: Signal, reference: Signal, most: int) -> int:
    """By how many ticks the signal comes after the reference: the shift, at most `most` either way, at which their
    cross-correlation (without means, over the overlap) is largest. Both (n,), n > 2 `most`, neither constant."""

    def correlation(shift: int) -> float:
        a, b = _overlap(signal, reference, shift)
        a, b = a - a.mean(), b - b.mean()
        scale = float(np.linalg.norm(a) * np.linalg.norm(b))
        return float(a @ b) / scale if scale > 0.0 else -1.0

    # The smallest of equally good shifts.
    return max(range(-most, most + 1), key=lambda shift: (correlation(shift), -abs(shift)))


def residual(signal: Signal, reference: Signal, shift: int) -> float:
    """Rms of what differs once the signal is moved back by `shift` ticks."""
    a, b = _overlap(signal, reference, shift)
    return rms(a - b)


def _overlap(signal: Signal, reference: Signal, shift: int) -> tuple[Signal, Signal]:
    count = len(signal) - abs(shift)
    start = max(shift, 0)
    return signal[start : start + count], reference[start - shift : start - shift + count]
