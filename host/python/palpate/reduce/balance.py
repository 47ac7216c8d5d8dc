"""Balanced truncation of a symmetric second-order system, dense.

The strictly proper part (palpate.reduce.system) is symmetric: with T = [[B, I], [I, 0]] in displacements and
velocities, T A = A^T T and T b = -c^T. So the observability Gramian is T P T, and one Lyapunov equation is enough: with
P = Z Z^T the Hankel singular values are the magnitudes of the eigenvalues of the symmetric Z^T T Z, and its eigenvectors
give the balancing projection. SLICOT's SB03OD finds the factor Z itself (Hammarling 1982), which keeps small values
accurate. Source: Zhou, Doyle and Glover (1996), sections 3.9 and 7.1, 8.1 (error bound: twice the sum of the singular
values left out).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import slycot
from numpy.typing import NDArray

from palpate.reduce.state_space import StateSpace, state_space, time_scale_rad_s
from palpate.reduce.system import SecondOrder

Array = NDArray[np.float64]

# Below this part of the largest one, a singular value is rounding: no state is kept for it.
_SMALLEST_KEPT = 1e-14


@dataclass(frozen=True)
class Balanced:
    """A balanced system of 2 d states. hankel (2 d,): Hankel singular values in N/m, descending; right (2 d, k), left
    (2 d, k): columns i of the balancing transformation and its inverse's rows, for the k singular values that are more than
    rounding; full: the system they apply to, its states displacements times `scale_rad_s`, and velocities."""

    hankel: Array
    right: Array
    left: Array
    full: StateSpace
    scale_rad_s: float

    @property
    def largest_order(self) -> int:
        """The most states that `truncate` keeps."""
        return int(self.right.shape[1])

    def truncate(self, order: int) -> StateSpace:
        """The reduced system of `order` states, or of `largest_order` if that is less."""
        right, left = self.right[:, :order], self.left[:, :order]
        return StateSpace(left.T @ self.full.a @ right, left.T @ self.full.b, self.full.c @ right, self.full.d)


def balance(system: SecondOrder) -> Balanced:
    """Balances the strictly proper part. The system must be stable."""
    full, d, scale = state_space(system), system.size, time_scale_rad_s(system)
    factor = controllability_factor(full)
    damping = system.damping_1_s.toarray() if hasattr(system.damping_1_s, "toarray") else system.damping_1_s
    symmetry = np.zeros((2 * d, 2 * d))
    symmetry[:d, :d] = damping / scale**2
    symmetry[:d, d:] = symmetry[d:, :d] = np.eye(d) / scale
    values, vectors = scipy.linalg.eigh(factor.T @ symmetry @ factor)
    descending = np.argsort(-np.abs(values))
    values, vectors = values[descending], vectors[:, descending]
    hankel = np.abs(values)
    kept = int(np.count_nonzero(hankel > _SMALLEST_KEPT * hankel[0]))
    right = factor @ (vectors[:, :kept] / np.sqrt(hankel[:kept]))
    left = (symmetry @ right) * np.sign(values[:kept])
    return Balanced(hankel, right, left, full, scale)


def controllability_factor(system: StateSpace) -> Array:
    """Z (n, n) with a Z Z^T + Z Z^T a^T + b b^T = 0."""
    n, m = system.b.shape
    # SLICOT wants the right side with as many rows as columns or fewer: b^T is (m, n) in the transposed equation.
    factor, scale, _ = slycot.sb03od(n, m, system.a.copy(), np.zeros((n, n)), _padded(system.b), "C", "N", "T")
    return np.asarray(np.triu(factor[:n, :n]) / scale)


def _padded(b: Array) -> Array:
    n, m = b.shape
    padded = np.zeros((n, max(n, m)), order="F")
    padded[:, :m] = b
    return padded
