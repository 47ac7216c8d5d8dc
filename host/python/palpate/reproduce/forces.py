"""Forces of a record, split in the normal that the board used."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.figures import split_force
from palpate.reproduce.figure import Record
from palpate.scene_sections import TICK_S

FREE, STICK, SLIP = 0, 1, 2
# The hand counts as dragging while its target moves sideways faster than this: far below the 5 to 20 mm/s of a drag.
_DRAG_SPEED_M_S = 1e-3
# The board's limit for the change of its force (firmware/core/supervisor.hpp, Limits::force_step_N), but for rounding.
_RAMP_N = 0.5 * (1.0 - 1e-3)


@dataclass(frozen=True)
class ContactForces:
    """Per tick: time, contact mode, pressing part of the force and length of the tangential part; whether the board's limit
    for the change of force has held it back, so that it is not that of the contact. All (n,)."""

    time_s: NDArray[np.float64]
    mode: NDArray[Any]
    normal_N: NDArray[np.float64]
    tangential_N: NDArray[np.float64]
    ramped: NDArray[np.bool_]

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Ticks with contact."""
        return self.mode != FREE


def contact_forces(record: Record) -> ContactForces:
    """The rendered force of each tick, normal and tangential in the contact normal that the board used."""
    mode = record["ticks/contact_mode"]
    force_N = record["ticks/force_N"].astype(np.float64)
    normal_N, tangential_N = split_force(force_N, record["ticks/normal"].astype(np.float64))
    ramped = np.linalg.norm(np.diff(force_N, axis=0, prepend=force_N[:1]), axis=1) > _RAMP_N
    return ContactForces(time_s(record), mode, normal_N, tangential_N, ramped)


def time_s(record: Record) -> NDArray[np.float64]:
    """Virtual time of each tick."""
    times: NDArray[np.float64] = record["ticks/tick"].astype(np.float64) * TICK_S
    return times


def largest_ratio(numerator: NDArray[np.float64], denominator: NDArray[np.float64]) -> float:
    """Largest quotient; 0 / 0 counts as 0, anything else over 0 as infinite. 0 for empty arrays."""
    ratio = np.divide(
        numerator, denominator, out=np.where(numerator > 0.0, np.inf, 0.0), where=denominator > 0.0
    )
    return float(ratio.max(initial=0.0))


def dragging(record: Record) -> NDArray[np.bool_]:
    """Ticks in which the hand means to move sideways. (n,)"""
    target_m = record["ticks/hand_target_m"][:, :2]
    step_m = np.diff(target_m, axis=0, prepend=target_m[:1])
    return np.asarray(np.linalg.norm(step_m, axis=1) > _DRAG_SPEED_M_S * TICK_S)
