"""Balanced truncation of a body's contact system, with its errors."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from palpate.reduce.balance import Balanced, balance
from palpate.reduce.projection import project
from palpate.reduce.state_space import NORM_MARGIN, StateSpace, state_space
from palpate.reduce.system import ContactSystem, SecondOrder

Array = NDArray[np.float64]
Progress = Callable[[int, int], object]

# Certified error of the projection before balancing, relative to the largest response.
DEFAULT_TOLERANCE = 1e-6
# Degrees of freedom of the projected system at which it stops.
LARGEST_PROJECTION = 300
# Error bound that the order is chosen for where none is given.
DEFAULT_ERROR = 0.01
# Densely, the whole system is balanced up to this many states.
LARGEST_DENSE = 1600


@dataclass(frozen=True)
class Reduction:
    """A reduced contact system and what is known of its error.

    order: states kept, fewer than asked for where the rest is rounding. hankel_N_m: Hankel singular values of the strictly
    proper part, descending. Errors are relative. certified_error: of the strictly proper part's H-infinity norm, an upper
    bound that includes NORM_MARGIN and the projection's; relative_h_infinity: as found, without these two;
    next_singular_value: the first one left out over the largest; tail_sum: the sum of those left out over the sum of all;
    a_priori_bound: the upper bound that is known before truncation, twice the sum of those left out and the projection's.
    Both bounds are infinite where the projection's error is as large as its norm. projection_error: certified, over
    norm_N_m, 0 for the dense method; projected: degrees of freedom that were balanced, basis (d, projected) theirs or None
    for all. norm_N_m: H-infinity norm of their strictly proper part as found, so not too high. reduce_time_s: wall clock of
    one core, without the system's own (ContactSystem.time_s); time_s: of both.
    """

    system: ContactSystem
    projected: SecondOrder
    basis: Array | None
    balanced: Balanced
    reduced: StateSpace
    shifts_rad_s: tuple[complex, ...]
    norm_N_m: float
    projection_error: float
    relative_h_infinity: float
    reduce_time_s: float

    @property
    def order(self) -> int:
        """States kept."""
        return self.reduced.order

    @property
    def time_s(self) -> float:
        """Wall clock from the body's matrices to the errors."""
        return self.system.time_s + self.reduce_time_s

    @property
    def hankel_N_m(self) -> Array:
        """Hankel singular values, descending."""
        return self.balanced.hankel

    @property
    def next_singular_value(self) -> float:
        """The first singular value left out over the largest."""
        left = self.hankel_N_m[self.order :]
        return float(left[0] / self.hankel_N_m[0]) if len(left) else 0.0

    @property
    def tail_sum(self) -> float:
        """The sum of the singular values left out over the sum of all."""
        return float(self.hankel_N_m[self.order :].sum() / self.hankel_N_m.sum())

    @property
    def a_priori_bound(self) -> float:
        """Twice the sum of the singular values left out, over the norm, and the projection's error."""
        return self._of_full_norm(self._twice_left_out)

    @property
    def certified_error(self) -> float:
        """An upper bound on the relative error of the strictly proper part at any frequency, over its largest response."""
        return self._of_full_norm(min((1.0 + NORM_MARGIN) * self.relative_h_infinity, self._twice_left_out))

    @property
    def _twice_left_out(self) -> float:
        return float(2.0 * self.hankel_N_m[self.order :].sum() / self.norm_N_m)

    def _of_full_norm(self, error: float) -> float:
        """From an error against the projected system, over its norm, to one against the full one, over its own."""
        if self.projection_error >= 1.0:
            return math.inf
        return (error + self.projection_error) / (1.0 - self.projection_error)

    def at_order(self, order: int) -> "Reduction":
        """The same projection and balancing, truncated to another order; time_s stays that of this one."""
        with threadpool_limits(1):
            reduced = self.balanced.truncate(order)
            missing_N_m = _norm_N_m(state_space(self.projected).minus(reduced))
        return replace(self, reduced=reduced, relative_h_infinity=missing_N_m / self.norm_N_m)

    def shapes(self) -> Array:
        """(d, order): displacements of the free nodes in each reduced state's direction, mass-normalized."""
        right = self.balanced.right[: self.projected.size, : self.order] / self.balanced.scale_rad_s
        return right if self.basis is None else np.asarray(self.basis @ right)

    def to_dict(self) -> dict[str, Any]:
        """What `palpate reduce --json` prints of it; a bound that is infinite is None."""
        return {
            "states": self.system.states,
            "order": self.order,
            "method": "dense" if self.basis is None else "krylov",
            "hankel_singular_values_N_m": [float(value) for value in self.hankel_N_m],
            "norm_N_m": self.norm_N_m,
            "error": {
                "certified": finite(self.certified_error),
                "relative_h_infinity": self.relative_h_infinity,
                "next_singular_value": self.next_singular_value,
                "tail_sum": self.tail_sum,
                "a_priori_bound": finite(self.a_priori_bound),
                "projection": self.projection_error,
            },
            "projected_states": 2 * self.projected.size,
            "shifts_rad_s": [[shift.real, shift.imag] for shift in self.shifts_rad_s],
            "time_s": self.time_s,
            "system_time_s": self.system.time_s,
        }


def reduce_system(
    system: ContactSystem,
    order: int | None = None,
    *,
    dense: bool = False,
    tolerance: float = DEFAULT_TOLERANCE,
    progress: Progress = lambda done, total: None,
) -> Reduction:
    """Reduces to `order` states, or to as few as keep the a-priori bound at DEFAULT_ERROR. dense: balances the whole system
    (at most LARGEST_DENSE states, ValueError otherwise) instead of a projection of it. Runs on one core. progress: (done,
    total) in tenths of decades of the projection's error."""
    if dense and system.states > LARGEST_DENSE:
        raise ValueError(f"{system.states} states: the dense method takes at most {LARGEST_DENSE}")
    with threadpool_limits(1):
        start_s = time.perf_counter()
        small: SecondOrder = system
        basis, error_N_m, shifts = None, 0.0, ()
        if not dense:
            projection = project(system, tolerance, LARGEST_PROJECTION, progress)
            small, basis = projection.small, projection.basis
            error_N_m, shifts = projection.error_N_m, projection.shifts_rad_s
        balanced = balance(small)
        strictly_proper = state_space(small)
        norm_N_m = _norm_N_m(strictly_proper)
        reduced = balanced.truncate(_order(balanced.hankel, norm_N_m) if order is None else order)
        missing_N_m = _norm_N_m(strictly_proper.minus(reduced))
        time_s = time.perf_counter() - start_s
    return Reduction(
        system,
        small,
        basis,
        balanced,
        reduced,
        shifts,
        norm_N_m,
        error_N_m / norm_N_m,
        missing_N_m / norm_N_m,
        time_s,
    )


def _norm_N_m(system: StateSpace) -> float:
    """The H-infinity norm as found: a lower bound, without the margin."""
    return system.h_infinity()[0] / (1.0 + NORM_MARGIN)


def finite(bound: float) -> float | None:
    """The bound, or None where it is infinite and says nothing: JSON knows no infinity."""
    return bound if math.isfinite(bound) else None


def _order(hankel: Array, norm_N_m: float) -> int:
    """The fewest states with which twice the sum of the singular values left out is at most DEFAULT_ERROR of the norm."""
    left_out = 2.0 * np.concatenate([np.cumsum(hankel[::-1])[::-1], [0.0]])
    return max(1, int(np.argmax(left_out <= DEFAULT_ERROR * norm_N_m)))
