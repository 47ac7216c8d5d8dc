"""Rational Krylov projection of a large body, with an error that is certified.

Galerkin's method on the free nodes' displacements: x = V y, V orthonormal, so that the small system is symmetric and
stable like the large one. V spans the full model's answers (s^2 + s B + K)^-1 (F_0 + s F_1) at some complex frequencies s,
and the first two terms of its answer at infinite frequency. What the small model misses is, with F(s) = F_0 + s F_1 and the residual
r(s) = F(s) - (s^2 + s B + K) V y(s),

    f(s) - f_small(s) = -r(s)^T (s^2 + s B + K)^-1 r(s),

quadratic in r, since r is orthogonal to V. On the imaginary axis, with K >= slowest and B >= damped (ContactSystem), the
numerical range of i w B + K - w^2 keeps away from zero by at least max(slowest - w^2, w damped) >= gap, the same for
every w, so that

    |f - f_small| <= max_w |r(i w)|_2^2 / gap,      gap = damped w*,  w*^2 + damped w* = slowest.

r is a transfer function of the small model's states: its H-infinity norm is computed, not sampled. The bound holds for
every w but for rounding. The frequencies are chosen greedily where the residual, sampled, is worst. Source of greedy
rational Krylov: Druskin and Simoncini (2011), Systems & Control Letters 60; of the error's form: Panzer, Wolf and Lohmann
(2013), European Control Conference.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from numpy.typing import NDArray

from palpate.reduce.cholesky import ShiftedCholesky
from palpate.reduce.state_space import StateSpace, state_space
from palpate.reduce.system import ContactSystem, SecondOrder

Array = NDArray[np.float64]

# Told of progress: (decades of error gained, decades to gain).
Progress = Callable[[int, int], object]

# Real frequencies to begin with, spread over the body's own.
_FIRST_SHIFTS = 8
# Frequencies added at once, where the residual has its highest separate peaks.
_SHIFTS_PER_ROUND = 4
# Samples of the residual, over the body's own frequencies and a decade to both sides.
_SAMPLES = 160
# A motion at w with less than this damping ratio rings: only a frequency on the imaginary axis catches it. Complex factors
# cost about ten times the real ones, and are left out for bodies with more degrees of freedom than the limit.
_RINGING_RATIO = 0.7
_LARGEST_COMPLEX_FACTOR = 6000
# Real frequencies closer than this, as a logarithm, give nearly the same answer.
_NEAR = 0.2
# Part of a direction that must be new for it to count.
_NEW = 1e-12


@dataclass(frozen=True)
class Projection:
    """basis (d, q): orthonormal; small: the system of q degrees of freedom; error_N_m: a bound on the 2-norm of what its
    transfer function misses at any frequency; shifts_rad_s: the complex frequencies used."""

    basis: Array
    small: SecondOrder
    error_N_m: float
    shifts_rad_s: tuple[complex, ...]


def project(
    system: ContactSystem,
    tolerance: float,
    largest: int,
    progress: Progress = lambda done, total: None,
) -> Projection:
    """A small system whose certified error is at most `tolerance` times the largest response of the strictly proper part,
    or, where that takes more than `largest` degrees of freedom, the one that has as many; error_N_m tells. ValueError: from
    a `largest` below twice the number of inputs."""
    if largest < 2 * system.input_stiffness.shape[1]:
        raise ValueError(f"{largest} degrees of freedom: at least twice the number of inputs are needed")
    solver = _Solver(system)
    basis = _extend(np.zeros((system.size, 0)), _at_infinity(system))
    slowest, fastest = np.sqrt(system.slowest_1_s2), np.sqrt(system.fastest_1_s2)
    shifts = [complex(s) for s in np.geomspace(0.5 * slowest, 2.0 * fastest, _FIRST_SHIFTS)]
    used: list[complex] = []
    aim, first = tolerance, 0.0
    while True:
        before = basis.shape[1]
        for shift in shifts:
            if basis.shape[1] < largest:
                basis = _extend(basis, solver.answer(shift))[:, :largest]
                used.append(shift)
        small, residual = _residual(system, basis)
        frequency_rad_s = _sample_frequencies(system, residual)
        response, missing = _sample(small, residual, frequency_rad_s)
        sampled = missing**2 / _gap(system, frequency_rad_s)
        largest_response = float(response.max())
        error = float(sampled.max()) / largest_response
        first = first or error
        _tell(progress, first, error, tolerance)
        ended = basis.shape[1] >= min(largest, system.size) or basis.shape[1] == before
        shifts = [solver.choose(w) for w in _peaks(frequency_rad_s, sampled)]
        if error <= aim or ended:
            worst, worst_rad_s = residual.h_infinity()
            bound = worst**2 / _least_gap(system)
            if bound <= tolerance * largest_response or ended:
                return Projection(basis, small, bound, tuple(used))
            # Either the samples missed a narrow peak, or the bound's gap is less than that at the worst frequency.
            shifts.append(solver.choose(worst_rad_s))
            aim = min(aim, 0.1 * error)


def _tell(progress: Progress, first: float, error: float, tolerance: float) -> None:
    """Progress in tenths of decades of the error."""
    total = np.log10(max(first, 10.0 * tolerance) / tolerance)
    gained = np.log10(first / max(error, np.finfo(float).tiny))
    progress(int(np.clip(10 * gained, 0, 10 * total)), int(10 * total))


def _sample_frequencies(system: ContactSystem, small: StateSpace) -> Array:
    """Spread over the body's own frequencies and a decade to both sides, and those of the small model's own motions."""
    slowest, fastest = np.sqrt(system.slowest_1_s2), np.sqrt(system.fastest_1_s2)
    spread = np.geomspace(0.1 * slowest, 10.0 * fastest, _SAMPLES)
    return np.unique(np.concatenate([spread, np.abs(np.linalg.eigvals(small.a))]))


def _gap(system: ContactSystem, frequency_rad_s: Array) -> Array:
    """How far from zero the numerical range of the full model keeps at each frequency, 1/s^2."""
    return np.asarray(np.maximum(system.slowest_1_s2 - frequency_rad_s**2, system.damped_1_s * frequency_rad_s))


def _least_gap(system: ContactSystem) -> float:
    half = 0.5 * system.damped_1_s
    crossing = system.slowest_1_s2 / (half + np.hypot(half, np.sqrt(system.slowest_1_s2)))
    return float(system.damped_1_s * crossing)


def _at_infinity(system: ContactSystem) -> Array:
    """The first two terms of the answer at high frequency; with them in the basis the residual vanishes there."""
    first = system.input_damping
    return np.hstack([first, system.input_stiffness - system.damping_1_s @ first])


class _Solver:
    """Answers of the full model at a complex frequency: real ones by sparse Cholesky, others by sparse LU."""

    def __init__(self, system: ContactSystem) -> None:
        self._system = system
        self._range_rad_s = 0.1 * np.sqrt(system.slowest_1_s2), 10.0 * np.sqrt(system.fastest_1_s2)
        self._real: list[float] = []
        self._cholesky = ShiftedCholesky(system.stiffness_1_s2, system.damping_1_s)

    def choose(self, frequency_rad_s: float) -> complex:
        """The frequency at which the full model's answer mends a residual at this one: the real one where it is new and
        motion does not ring, the imaginary one otherwise."""
        system = self._system
        w = float(np.clip(frequency_rad_s, *self._range_rad_s))
        new = all(abs(np.log(w / real)) > _NEAR for real in self._real)
        ratio = 0.5 * w * system.damped_1_s / system.slowest_1_s2
        if (new and ratio >= _RINGING_RATIO) or system.size > _LARGEST_COMPLEX_FACTOR:
            self._real.append(w)
            return complex(w)
        return complex(0.0, w)

    def answer(self, s: complex) -> Array:
        """(d, m), or (d, 2 m) with real and imaginary parts, each column of length 1."""
        system = self._system
        if s.imag == 0.0:
            found = self._cholesky.factor(1.0, s.real, s.real**2)(system.forcing(s.real))
        else:
            identity = scipy.sparse.eye_array(system.size, format="csc")
            matrix = (system.stiffness_1_s2 + s * system.damping_1_s + s * s * identity).tocsc()
            # The matrix is symmetric, and its real part or its imaginary part definite: pivots on the diagonal do.
            factor = scipy.sparse.linalg.splu(
                matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
            complex_answer = factor.solve(system.forcing(s).astype(np.complex128))
            found = np.hstack([complex_answer.real, complex_answer.imag])
        return np.asarray(found / np.maximum(np.linalg.norm(found, axis=0), np.finfo(float).tiny))


def _extend(basis: Array, columns: Array) -> Array:
    """The orthonormal basis with what the columns have beyond it."""
    length = max(float(np.linalg.norm(columns, 2)), np.finfo(float).tiny)
    new = columns / length
    for _ in range(2):
        new = new - basis @ (basis.T @ new)
    vectors, values, _ = scipy.linalg.svd(new, full_matrices=False)
    new = vectors[:, values > _NEW]
    new = new - basis @ (basis.T @ new)  # what rounding left of the basis in a small remainder
    return np.hstack([basis, scipy.linalg.qr(new, mode="economic")[0]])


def _residual(system: ContactSystem, basis: Array) -> tuple[SecondOrder, StateSpace]:
    """The small system, and the residual as a transfer function of its states, in coordinates that keep its length."""
    stiff, damped = system.stiffness_1_s2 @ basis, system.damping_1_s @ basis
    small = SecondOrder(
        _symmetric(basis.T @ stiff),
        _symmetric(basis.T @ damped),
        basis.T @ system.input_stiffness,
        basis.T @ system.input_damping,
    )
    parts = np.hstack([stiff, damped, system.input_stiffness, system.input_damping])
    parts = parts - basis @ (basis.T @ parts)
    parts = parts - basis @ (basis.T @ parts)
    upper = scipy.linalg.qr(parts, mode="r")[0][: parts.shape[1]]
    q, m = small.size, system.input_stiffness.shape[1]
    stiff, damped, force = upper[:, :q], upper[:, q : 2 * q], upper[:, 2 * q : 2 * q + m]
    # x = V z with z from the state space, whose velocities are x' = w - F_1 u. F_1 itself lies in the basis, but for
    # rounding.
    states = state_space(small)
    scale = states.a[0, q]
    output = np.hstack([stiff / scale, damped])
    return small, StateSpace(states.a, states.b, output, force - damped @ small.input_damping)


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))


def _sample(small: SecondOrder, residual: StateSpace, frequency_rad_s: Array) -> tuple[Array, Array]:
    """2-norms of the small system's strictly proper part and of the residual at these frequencies."""
    strictly_proper = state_space(small)
    both = StateSpace(
        residual.a,
        residual.b,
        np.vstack([strictly_proper.c, residual.c]),
        np.vstack([strictly_proper.d, residual.d]),
    )
    values = both.response(frequency_rad_s)
    outputs = strictly_proper.c.shape[0]

    def norm(part: NDArray[np.complex128]) -> Array:
        return np.asarray(np.linalg.norm(part, 2, axis=(1, 2)))

    return norm(values[:, :outputs]), norm(values[:, outputs:])


def _peaks(frequency_rad_s: Array, error: Array) -> list[float]:
    """The frequencies of the highest local maxima, a fifth of the largest or more."""
    padded = np.concatenate([[0.0], error, [0.0]])
    local = np.flatnonzero((error >= padded[:-2]) & (error >= padded[2:]))
    best = local[np.argsort(-error[local])][:_SHIFTS_PER_ROUND]
    return [float(frequency_rad_s[i]) for i in best if error[i] >= 0.05 * error[best[0]]]
