"""Rational Krylov projection of a large body, with an error that is certified.

Galerkin's method on the free nodes' displacements: x = V y, V orthonormal, so that the small system is symmetric and
stable like the large one. V spans
- the first two terms of the full model's answer (s^2 + s B + K)^-1 (F_0 + s F_1) at infinite frequency;
- its answers at a few real s and their derivatives by s: all from one real factorization for each s;
- greedily, at the imaginary s where the residual below, sampled, is worst, the answer itself; or, where a complex
  factorization would be dear, a few steps of iteration from the small model's answer towards it, with the real
  factorization at |s| in its place. Real s alone do not do: their answers differ by rounding only, long before the
  body's ringing is known from them.
What the small model misses is, with F(s) = F_0 + s F_1 and the residual
r(s) = F(s) - (s^2 + s B + K) V y(s),

    f(s) - f_small(s) = -r(s)^T (s^2 + s B + K)^-1 r(s),

quadratic in r, since r is orthogonal to V. On the imaginary axis, with K >= slowest and B >= damped (ContactSystem), the
numerical range of i w B + K - w^2 keeps away from zero by at least max(slowest - w^2, w damped) >= gap, the same for
every w, so that

    |f - f_small| <= max_w |r(i w)|_2^2 / gap,      gap = damped w*,  w*^2 + damped w* = slowest.

r is a transfer function of the small model's states, whose H-infinity norm is an eigenvalue problem (SLICOT's AB13DD). The
bound holds for every w as far as that norm does: rounding can make AB13DD stop early, so samples back it and NORM_MARGIN is
added (state_space.py); this one step is not proven. Measurements: docs/decisions/reduction.md. Source of greedy rational
Krylov: Druskin and Simoncini (2011), Systems & Control Letters 60; of the error's form: Panzer, Wolf and Lohmann
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

# Real frequencies to begin with, spread over the body's own, and terms of the answer's series about each.
_FIRST_SHIFTS = 4
_TERMS = 5
# Frequencies added at once, where the residual has its highest separate peaks.
_SHIFTS_PER_ROUND = 4
# Samples of the residual, over the body's own frequencies and a decade to both sides.
_SAMPLES = 160
# Stiffness matrices with more entries than this have no complex factors: of a 12 x 12 x 12 block one takes ten times as
# long as a real one. Iterations towards an answer in its place.
_LARGEST_COMPLEX_FACTOR = 120_000
_ITERATIONS = 3
# Part of a direction that must be new for it to count.
_NEW = 1e-12
# Part of F_1 outside the basis that passes for rounding.
_ROUNDING = 1e-10


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
    basis = _extend(np.zeros((system.size, 0)), _unit(_at_infinity(system)))
    slowest, fastest = np.sqrt(system.slowest_1_s2), np.sqrt(system.fastest_1_s2)
    used = [complex(s) for s in np.geomspace(0.5 * slowest, 2.0 * fastest, _FIRST_SHIFTS)]
    for shift in used:
        basis = _extend(basis, solver.series(shift.real))[:, :largest]
    aim, first, before = tolerance, 0.0, 0
    while True:
        small, residual = _residual(system, basis)
        frequency_rad_s = _sample_frequencies(system, residual)
        response, missing = _sample(small, residual, frequency_rad_s)
        sampled = missing**2 / _gap(system, frequency_rad_s)
        largest_response = float(response.max())
        error = float(sampled.max()) / largest_response
        first = first or error
        _tell(progress, first, error, tolerance)
        ended = basis.shape[1] >= min(largest, system.size) or basis.shape[1] == before
        peaks = _peaks(frequency_rad_s, sampled)
        if error <= aim or ended:
            worst, worst_rad_s = residual.h_infinity()
            bound = worst**2 / _least_gap(system)
            if bound <= tolerance * largest_response or ended:
                return Projection(basis, small, bound, tuple(used))
            # Either the samples missed a narrow peak, or the bound's gap is less than that at the worst frequency.
            peaks.append(worst_rad_s)
            aim = min(aim, 0.1 * error)
        before = basis.shape[1]
        known = basis
        for peak in peaks:
            w = float(np.clip(peak, 0.1 * slowest, 10.0 * fastest))
            basis = _extend(basis, solver.towards(w, known, small))[:, :largest]
            used.append(complex(0.0, w))


def _tell(progress: Progress, first: float, error: float, tolerance: float) -> None:
    """Progress in tenths of decades of the error."""
    start = max(first, 10.0 * tolerance)
    total = np.log10(start / tolerance)
    gained = np.log10(start / max(error, np.finfo(float).tiny))
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
    """Answers of the full model."""

    def __init__(self, system: ContactSystem) -> None:
        self._system = system
        self._cholesky = ShiftedCholesky(system.stiffness_1_s2, system.damping_1_s)
        self._has_complex_factors = system.stiffness_1_s2.nnz <= _LARGEST_COMPLEX_FACTOR

    def series(self, s: float) -> Array:
        """(d, terms m), columns of length 1: the answer x at a real s in rad/s, x', x'' / 2 and so on, term by term from
        (s^2 + s B + K) x = F_0 + s F_1."""
        system = self._system
        solve = self._cholesky.factor(1.0, s, s * s)
        terms = [solve(system.forcing(s))]
        for number in range(1, _TERMS):
            right = system.input_damping if number == 1 else -terms[-2]
            terms.append(solve(right - 2.0 * s * terms[-1] - system.damping_1_s @ terms[-1]))
        return _unit(np.hstack(terms))

    def towards(self, w: float, basis: Array, small: SecondOrder) -> Array:
        """(d, columns) of length 1: what leads from the small model's answer at i w to the full model's."""
        return self._answer(w) if self._has_complex_factors else self._iterate(w, basis, small)

    def _answer(self, w: float) -> Array:
        """(d, 2 m): real and imaginary parts, by sparse LU."""
        system, s = self._system, 1j * w
        identity = scipy.sparse.eye_array(system.size, format="csc")
        matrix = (system.stiffness_1_s2 + s * system.damping_1_s + s * s * identity).tocsc()
        # The matrix is symmetric, and its real part or its imaginary part definite: pivots on the diagonal do.
        factor = scipy.sparse.linalg.splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        found = factor.solve(system.forcing(s).astype(np.complex128))
        return _unit(np.hstack([found.real, found.imag]))

    def _iterate(self, w: float, basis: Array, small: SecondOrder) -> Array:
        """(d, 2 m iterations): a Krylov space of the full model at i w, preconditioned by its Cholesky factor at w, from
        the small model's residual on."""
        system, s = self._system, 1j * w
        solve = self._cholesky.factor(1.0, w, w * w)

        def full(x: NDArray[np.complex128]) -> NDArray[np.complex128]:
            return np.asarray(system.stiffness_1_s2 @ x + s * (system.damping_1_s @ x) + s * s * x)

        matrix = small.stiffness_1_s2 + s * small.damping_1_s + s * s * np.eye(small.size)
        right = system.forcing(s) - full(basis @ np.linalg.solve(matrix, small.forcing(s)))
        found = []
        for _ in range(_ITERATIONS):
            parts = solve(np.hstack([right.real, right.imag]))
            found.append(_unit(parts))
            real, imaginary = np.hsplit(parts / np.linalg.norm(parts), 2)
            right = full(real + 1j * imaginary)
        return np.hstack(found)


def _unit(columns: Array) -> Array:
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny))


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
    """The small system, and the residual as a transfer function of its states, in coordinates that keep its length.
    ArithmeticError: where F_1 is not in the basis."""
    first = system.input_damping
    outside = first - basis @ (basis.T @ first)
    if np.linalg.norm(outside) > _ROUNDING * np.linalg.norm(first):
        raise ArithmeticError("the basis lacks the body's answer at infinite frequency: no bound for this projection")
    stiff, damped = system.stiffness_1_s2 @ basis, system.damping_1_s @ basis
    small = SecondOrder(
        _symmetric(basis.T @ stiff),
        _symmetric(basis.T @ damped),
        basis.T @ system.input_stiffness,
        basis.T @ system.input_damping,
    )
    parts = np.hstack([stiff, damped, system.input_stiffness])
    parts = parts - basis @ (basis.T @ parts)
    parts = parts - basis @ (basis.T @ parts)
    upper = scipy.linalg.qr(parts, mode="r")[0][: parts.shape[1]]
    q = small.size
    stiff, damped, force = upper[:, :q], upper[:, q : 2 * q], upper[:, 2 * q :]
    # x = V z with z from the state space, whose velocities are x' = w - F_1 u.
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
