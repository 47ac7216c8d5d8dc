"""The certified error against the true one: random bodies, and projections stopped early."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from reduce_bodies import (
    block,
    exact_strictly_proper,
    frequencies_rad_s,
    h_infinity_N_m,
    largest,
    random_system,
    scene_body,
    sheet,
)
from threadpoolctl import threadpool_limits

from palpate.reduce.projection import project
from palpate.reduce.state_space import NORM_MARGIN, NORM_TOLERANCE, StateSpace, state_space
from palpate.reduce.study import reduce_system
from palpate.reduce.system import ContactSystem, contact_system, middle_of_top

# Bounds hold but for rounding, here relative to the norm: of the reference's solves and of the states' diagonalization.
ROUNDING = 1e-10
BODIES, PER_TEST = 200, 10


@pytest.fixture(scope="module", autouse=True)
def one_core() -> Iterator[None]:
    """The matrices are small: more threads would take more time."""
    with threadpool_limits(1):
        yield


class Truth:
    """The exact response of a body at some frequencies, its norm, and the errors of other systems."""

    def __init__(self, system: ContactSystem, count: int) -> None:
        self.frequency_rad_s = frequencies_rad_s(system, count)
        self.exact = exact_strictly_proper(system, self.frequency_rad_s)
        self.full = state_space(system)

    @cached_property
    def norm_N_m(self) -> float:
        """H-infinity, dense."""
        return h_infinity_N_m(self.full)

    def error_N_m(self, other: StateSpace) -> float:
        """The largest at the sampled frequencies."""
        return largest(self.exact - other.response(self.frequency_rad_s))

    def error_at_any_frequency_N_m(self, other: StateSpace) -> float:
        """H-infinity norm of the difference, dense."""
        return h_infinity_N_m(self.full.minus(other))


def body_of(number: int, longest: int) -> tuple[np.random.Generator, ContactSystem]:
    """The random body of a number, and the generator for what is done with it."""
    rng = np.random.default_rng(number)
    return rng, random_system(rng, longest)


@pytest.fixture(scope="module")
def kept() -> list[float]:
    """Of each random body, the part of its degrees of freedom that the projection kept."""
    return []


@pytest.mark.parametrize("first", range(0, BODIES, PER_TEST))
def test_bounds_hold_for_random_bodies(first: int, kept: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Against the dense norm of the difference. The bodies are small, so the projection is kept smaller than they are."""
    for number in range(first, first + PER_TEST):
        rng, system = body_of(number, 4 if number % 8 == 0 else 3)
        truth = Truth(system, 90)
        most = max(2 * len(system.contact_axes), system.size - int(rng.integers(1, 3 + system.size // 8)))
        monkeypatch.setattr("palpate.reduce.study.LARGEST_PROJECTION", most)
        order, tolerance = int(rng.integers(1, 21)), float(10.0 ** rng.uniform(-4, -1))
        reduction = reduce_system(system, order, tolerance=tolerance)
        kept.append(reduction.projected.size / system.size)

        def error_of(reduced: StateSpace, truth: Truth = truth) -> float:
            return max(truth.error_N_m(reduced), truth.error_at_any_frequency_N_m(reduced)) / truth.norm_N_m

        part = reduction.projection_error
        of_projection = error_of(state_space(reduction.projected))
        assert of_projection * truth.norm_N_m <= part * reduction.norm_N_m + ROUNDING * truth.norm_N_m, f"body {number}"
        assert abs(reduction.norm_N_m / truth.norm_N_m - 1.0) <= of_projection + 2.0 * NORM_TOLERANCE, f"body {number}"
        error = error_of(reduction.reduced)
        assert error <= reduction.certified_error + ROUNDING, f"body {number}"
        assert error <= reduction.a_priori_bound + ROUNDING, f"body {number}"
        # Not more than it must be: the truncated system's own norm is computed, only the projection's part is a bound.
        if part < 1.0:
            truncated = error * (1.0 + part) + part
            allowed = ((1.0 + 2.0 * NORM_MARGIN) * truncated + part) / (1.0 - part)
            assert reduction.certified_error <= allowed + ROUNDING, f"body {number}"
        else:
            assert reduction.certified_error == np.inf


def test_most_random_bodies_are_larger_than_their_projections(kept: list[float]) -> None:
    if len(kept) < BODIES:
        pytest.skip("only some of the random bodies were asked for")
    assert np.mean(np.array(kept) < 1.0) > 0.7


@pytest.mark.parametrize("first", range(0, BODIES // 2, PER_TEST))
def test_the_projections_part_holds_where_it_stops_early(first: int) -> None:
    """From the two terms at infinite frequency alone to all degrees of freedom."""
    for number in range(first, first + PER_TEST):
        rng, system = body_of(1000 + number, 4)
        truth = Truth(system, 40)
        most = int(rng.integers(2 * len(system.contact_axes), system.size // 2 + 1))
        projection = project(system, float(10.0 ** rng.uniform(-6, -0.5)), most)
        error_N_m = truth.error_N_m(state_space(projection.small))
        assert error_N_m <= projection.error_N_m + ROUNDING * largest(truth.exact), f"body {number}"
        assert projection.small.size <= most


@pytest.mark.parametrize("lines", [sheet(7, 0.3), block(4, 1.0)])
def test_bounds_of_a_coarse_projection(tmp_path: Path, lines: str) -> None:
    """A projection as bad as the truncation: the bound has both parts, over the full body's norm, not the projection's."""
    body = scene_body(tmp_path, lines)
    system = contact_system(body, middle_of_top(body))
    truth = Truth(system, 90)
    for tolerance in (0.3, 0.03, 0.003):
        reduction = reduce_system(system, 20, tolerance=tolerance)
        error = truth.error_at_any_frequency_N_m(reduction.reduced) / truth.norm_N_m
        assert error <= reduction.certified_error <= reduction.a_priori_bound
        of_norm = (1.0 - reduction.projection_error) * reduction.norm_N_m
        assert of_norm <= truth.norm_N_m


def test_a_projection_that_says_nothing_has_no_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = scene_body(tmp_path, sheet(8, 0.01))
    system = contact_system(body, middle_of_top(body))
    monkeypatch.setattr("palpate.reduce.study.LARGEST_PROJECTION", 8)
    reduction = reduce_system(system, 4)
    assert reduction.projection_error > 1.0
    assert reduction.certified_error == reduction.a_priori_bound == np.inf
    printed = reduction.to_dict()["error"]
    assert printed["certified"] is printed["a_priori_bound"] is None


@pytest.mark.parametrize("complex_factors", [True, False], ids=["factors", "iterations"])
@pytest.mark.parametrize(
    "lines", [sheet(12), sheet(10, 0.1), sheet(8, 0.02), block(5), sheet(9) + '\nneighbours = "edge"']
)
def test_projection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: str, complex_factors: bool
) -> None:
    """Without complex factors as large bodies are projected."""
    if not complex_factors:
        monkeypatch.setattr("palpate.reduce.projection._LARGEST_COMPLEX_FACTOR", 0)
    body = scene_body(tmp_path, lines)
    system = contact_system(body, middle_of_top(body))
    told: list[tuple[int, int]] = []
    tolerance = 1e-7
    projection = project(system, tolerance, 1000, lambda done, total: told.append((done, total)))
    basis, small = projection.basis, projection.small
    assert small.size == basis.shape[1] <= system.size
    np.testing.assert_allclose(basis.T @ basis, np.eye(small.size), atol=1e-13)
    np.testing.assert_allclose(small.stiffness_1_s2, basis.T @ (system.stiffness_1_s2 @ basis), atol=1e-6)
    np.testing.assert_array_equal(small.stiffness_1_s2, small.stiffness_1_s2.T)
    np.testing.assert_array_equal(small.damping_1_s, small.damping_1_s.T)
    # stable like the full one: its stiffness and damping are of the same range, and so are its poles
    assert np.linalg.eigvalsh(small.stiffness_1_s2)[0] >= system.slowest_1_s2
    assert np.linalg.eigvalsh(small.damping_1_s)[0] >= system.damped_1_s
    assert np.linalg.eigvals(state_space(small).a).real.max() < 0.0
    # the terms at infinite frequency are in the basis, otherwise the small system would miss a constant
    first = system.input_damping
    np.testing.assert_allclose(basis @ (basis.T @ first), first, rtol=0, atol=1e-11 * np.abs(first).max())
    truth = Truth(system, 40)
    size_N_m = largest(truth.exact)
    assert projection.error_N_m <= 1.05 * tolerance * size_N_m  # the norm is more than the largest of some samples
    assert truth.error_N_m(state_space(small)) <= projection.error_N_m + ROUNDING * size_N_m
    assert all(0 <= done <= total for done, total in told)
    assert told[-1][0] == told[-1][1]
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert all(shift.real >= 0.0 and shift.imag >= 0.0 for shift in projection.shifts_rad_s)


def test_a_projection_keeps_to_its_limit(tmp_path: Path) -> None:
    body = scene_body(tmp_path, block(5, 0.05))
    system = contact_system(body, middle_of_top(body))
    errors_N_m = []
    for most in (6, 7, 20, 50, 90):
        projection = project(system, 1e-12, most)
        assert projection.small.size == most
        errors_N_m.append(projection.error_N_m)
    assert errors_N_m[-1] < 1e-3 * errors_N_m[0]
    with pytest.raises(ValueError, match="5 degrees of freedom: at least twice the number of inputs"):
        project(system, 1e-12, 5)


def test_a_basis_without_the_answer_at_infinity_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its residual would grow with the frequency, and the bound leaves that out."""
    body = scene_body(tmp_path, block(5, 0.05))
    system = contact_system(body, middle_of_top(body))
    monkeypatch.setattr(
        "palpate.reduce.projection._at_infinity", lambda system: system.input_stiffness[:, :1] + 0.0
    )
    with pytest.raises(ArithmeticError, match="the basis lacks the body's answer at infinite frequency"):
        project(system, 1e-3, 8)
