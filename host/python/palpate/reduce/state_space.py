"""State space systems, their H-infinity norm and frequency response."""

from dataclasses import dataclass

import numpy as np
import slycot
from numpy.typing import NDArray

from palpate.reduce.system import SecondOrder

Array = NDArray[np.float64]

# Relative accuracy asked of the H-infinity norm.
NORM_TOLERANCE = 1e-3


@dataclass(frozen=True)
class StateSpace:
    """z' = a z + b u, y = c z + d u with n states, m inputs and p outputs: a (n, n), b (n, m), c (p, n), d (p, m)."""

    a: Array
    b: Array
    c: Array
    d: Array

    @property
    def order(self) -> int:
        """The number of states."""
        return int(self.a.shape[0])

    def minus(self, other: "StateSpace") -> "StateSpace":
        """The difference of two systems with the same inputs and outputs."""
        a = np.zeros((self.order + other.order,) * 2)
        a[: self.order, : self.order], a[self.order :, self.order :] = self.a, other.a
        return StateSpace(a, np.vstack([self.b, other.b]), np.hstack([self.c, -other.c]), self.d - other.d)

    def response(self, frequency_rad_s: Array) -> NDArray[np.complex128]:
        """(w, p, m): the transfer function at i times these frequencies (w,)."""
        values, vectors = np.linalg.eig(self.a)
        b = np.linalg.solve(vectors, self.b.astype(np.complex128))
        c = self.c @ vectors
        denominator = 1j * frequency_rad_s[:, None] - values[None, :]
        return np.asarray(np.einsum("pn,wn,nm->wpm", c, 1.0 / denominator, b) + self.d)

    def h_infinity(self) -> tuple[float, float]:
        """A bound above the H-infinity norm, at most 2 NORM_TOLERANCE too high, and the frequency in rad/s where the norm
        is reached. The system must be stable. Source: Bruinsma and Steinbuch (1990), as SLICOT's AB13DD computes it."""
        if not (self.b.any() and self.c.any()):
            return float(np.linalg.norm(self.d, 2)), 0.0
        outputs, inputs = self.d.shape
        peak, frequency_rad_s = slycot.ab13dd(
            "C", "I", "S", "D", self.order, inputs, outputs, self.a, np.eye(self.order), self.b, self.c, self.d,
            NORM_TOLERANCE,
        )  # fmt: skip
        return float(peak) * (1.0 + NORM_TOLERANCE), float(frequency_rad_s)


def time_scale_rad_s(system: SecondOrder) -> float:
    """A frequency in the middle of the system's own: displacements times it are as large as velocities."""
    trace = system.stiffness_1_s2.diagonal().sum() / system.size
    return float(np.sqrt(trace))


def state_space(system: SecondOrder) -> StateSpace:
    """The strictly proper part, dense: states are displacements, times `time_scale_rad_s`, and the velocities less what
    the input's derivative gives them (palpate.reduce.system)."""
    dense = [m.toarray() if hasattr(m, "toarray") else m for m in (system.stiffness_1_s2, system.damping_1_s)]
    stiffness, damping = dense
    d, scale = system.size, time_scale_rad_s(system)
    a = np.zeros((2 * d, 2 * d))
    a[:d, d:] = scale * np.eye(d)
    a[d:, :d] = -stiffness / scale
    a[d:, d:] = -damping
    b = np.vstack([-scale * system.input_damping, damping @ system.input_damping - system.input_stiffness])
    c = np.hstack([system.input_stiffness.T / scale, system.input_damping.T])
    inputs = system.input_stiffness.shape[1]
    return StateSpace(a, b, c, np.zeros((inputs, inputs)))
