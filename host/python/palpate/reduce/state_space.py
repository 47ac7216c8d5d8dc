"""State space systems, their H-infinity norm and frequency response."""

from dataclasses import dataclass

import numpy as np
import slycot
from numpy.typing import NDArray

from palpate.reduce.system import SecondOrder

Array = NDArray[np.float64]

# Relative accuracy asked of the H-infinity norm.
NORM_TOLERANCE = 1e-3
# Relative room above the norm that was found, where a bound above it is wanted. AB13DD has stopped 0.5 % low.
NORM_MARGIN = 0.01
# Samples that the norm is checked with: spread over two decades beyond the poles; the highest peaks; in a peak, each time
# it is enlarged.
_SPREAD, _PEAKS, _IN_PEAK, _ENLARGED = 200, 5, 33, 2


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
        return self._diagonal().response(frequency_rad_s)

    def h_infinity(self) -> tuple[float, float]:
        """A bound above the H-infinity norm and the frequency in rad/s where the norm is reached: the largest value found and
        NORM_MARGIN of it, so that the bound over 1 + NORM_MARGIN is a lower one. The system must be stable. Source:
        Bruinsma and Steinbuch (1990), as SLICOT's AB13DD computes it, to NORM_TOLERANCE. Where the norm is small against
        those of b and c, rounding makes AB13DD stop early, 0.5 % too low in one of the tests: the response is sampled too,
        about the poles and finely about its highest peaks, and the larger one taken. That is no proof: a peak that both
        miss by more than the margin would go unseen."""
        if not (self.b.any() and self.c.any()):
            return float(np.linalg.norm(self.d, 2)) * (1.0 + NORM_MARGIN), 0.0
        outputs, inputs = self.d.shape
        peak, frequency_rad_s = slycot.ab13dd(
            "C", "I", "S", "D", self.order, inputs, outputs, self.a, np.eye(self.order), self.b, self.c, self.d,
            NORM_TOLERANCE,
        )  # fmt: skip
        sampled, at_rad_s = self._diagonal().highest()
        if sampled > peak:
            peak, frequency_rad_s = sampled, at_rad_s
        return float(peak) * (1.0 + NORM_MARGIN), float(frequency_rad_s)

    def _diagonal(self) -> "_Diagonal":
        values, vectors = np.linalg.eig(self.a)
        return _Diagonal(values, np.linalg.solve(vectors, self.b.astype(np.complex128)), self.c @ vectors, self.d)


@dataclass(frozen=True)
class _Diagonal:
    """A state space in the coordinates of its poles (n,)."""

    poles: NDArray[np.complex128]
    b: NDArray[np.complex128]
    c: NDArray[np.complex128]
    d: Array

    def response(self, frequency_rad_s: Array) -> NDArray[np.complex128]:
        """(w, p, m)."""
        states = self.b[:, None, :] / (1j * frequency_rad_s[None, :] - self.poles[:, None])[:, :, None]
        count, inputs = len(frequency_rad_s), self.b.shape[1]
        outputs = (self.c @ states.reshape(-1, count * inputs)).reshape(-1, count, inputs)
        return np.asarray(outputs.transpose(1, 0, 2) + self.d)

    def highest(self) -> tuple[float, float]:
        """The largest 2-norm of the response that sampling finds, and its frequency."""
        sizes = np.abs(self.poles)
        spread = np.geomspace(0.1 * sizes.min(), 10.0 * sizes.max(), _SPREAD)
        at = np.unique(np.concatenate([[0.0], spread, sizes, np.abs(self.poles.imag)]))
        gain = self._gain(at)
        inner = np.arange(1, len(at) - 1)
        local = inner[(gain[inner] >= gain[inner - 1]) & (gain[inner] >= gain[inner + 1])]
        best, where = float(gain.max()), float(at[gain.argmax()])
        for peak in local[np.argsort(-gain[local])][:_PEAKS]:
            low, high = at[peak - 1], at[peak + 1]
            for _ in range(_ENLARGED):
                finer = np.linspace(low, high, _IN_PEAK)
                values = self._gain(finer)
                top = int(values.argmax())
                if values[top] > best:
                    best, where = float(values[top]), float(finer[top])
                low, high = finer[max(top - 1, 0)], finer[min(top + 1, _IN_PEAK - 1)]
        return best, where

    def _gain(self, frequency_rad_s: Array) -> Array:
        return np.asarray(np.linalg.norm(self.response(frequency_rad_s), 2, axis=(1, 2)))


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
