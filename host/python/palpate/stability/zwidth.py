"""The stiffest virtual wall by damping, for servo rates, delays and encoders, with and without the passivity controller."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from palpate.experiment import ProgressBar

# As in host/bench/virtual_wall.hpp: the axis of a PHANTOM 1.5-class device.
DEVICE = {"mass_kg": 0.05, "viscosity_N_s_m": 0.005, "friction_N": 0.04, "most_force_N": 8.5}
# More than this given to the hand is not passive (docs/stability.md).
MOST_J = 1e-3
DAMPINGS_N_s_m = (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
_DURATION_s, _QUICK_DURATION_s = 3.0, 1.0
_THREADS = 2


@dataclass(frozen=True)
class Servo:
    """What a wall is rendered by. The fields' defaults are the board's; one of them is varied at a time."""

    rate_Hz: float = 1000.0
    delay_ticks: int = 0
    count_m: float = 30e-6


SWEEPS: dict[str, tuple[Servo, ...]] = {
    "rate_Hz": tuple(Servo(rate_Hz=rate) for rate in (250.0, 500.0, 1000.0, 2000.0, 4000.0)),
    "delay_ticks": tuple(Servo(delay_ticks=delay) for delay in (0, 1, 2, 4, 8)),
    "count_m": tuple(Servo(count_m=count) for count in (0.0, 3e-6, 30e-6, 100e-6, 300e-6)),
}
QUICK_SWEEPS = {"rate_Hz": SWEEPS["rate_Hz"][1:4]}
_QUICK_DAMPINGS_N_s_m = (0.0, 2.0)


def colgate_N_m(servo: Servo) -> float:
    """Stiffest wall without damping that is passive with any hand: b > K T / 2 (Colgate & Schenkel 1997), b of the device."""
    return 2.0 * DEVICE["viscosity_N_s_m"] * servo.rate_Hz


def quantization_N_m(servo: Servo) -> float | None:
    """Stiffest wall at which friction takes what a count gives: K < 2 fc / Delta (Abbott & Okamura 2005); None without
    counts."""
    return 2.0 * DEVICE["friction_N"] / servo.count_m if servo.count_m > 0.0 else None


def measure(core: Any, quick: bool, bar: ProgressBar) -> list[dict[str, Any]]:
    """A row for each servo, damping and controller (off, on): the keys of Servo, damping_N_s_m, is_controlled, stiffest_N_m
    (None: not even 10 N/m), colgate_N_m, quantization_N_m."""
    servos = dict.fromkeys(servo for sweep in (QUICK_SWEEPS if quick else SWEEPS).values() for servo in sweep)
    dampings = _QUICK_DAMPINGS_N_s_m if quick else DAMPINGS_N_s_m
    asked = [(servo, damping, on) for servo in servos for damping in dampings for on in (False, True)]
    duration_s = _QUICK_DURATION_s if quick else _DURATION_s

    def one(case: tuple[Servo, float, bool]) -> dict[str, Any]:
        servo, damping_N_s_m, is_controlled = case
        stiffest = core.stiffest_wall_N_m(
            DEVICE, servo.rate_Hz, servo.delay_ticks, servo.count_m, is_controlled, damping_N_s_m, duration_s, MOST_J
        )
        return {
            **vars(servo),
            "damping_N_s_m": damping_N_s_m,
            "is_controlled": is_controlled,
            "stiffest_N_m": stiffest,
            "colgate_N_m": colgate_N_m(servo),
            "quantization_N_m": quantization_N_m(servo),
        }

    rows = []
    with ThreadPoolExecutor(_THREADS) as threads:
        for row in threads.map(one, asked):
            rows.append(row)
            bar(len(rows), len(asked))
    return rows


def of(rows: Sequence[dict[str, Any]], servo: Servo, is_controlled: bool) -> list[dict[str, Any]]:
    """The rows of a servo by rising damping."""
    its = [row for row in rows if all(row[key] == value for key, value in vars(servo).items())]
    return sorted((row for row in its if row["is_controlled"] == is_controlled), key=lambda row: row["damping_N_s_m"])
