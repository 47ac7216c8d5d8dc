"""Hankel singular values and balanced truncation against SLICOT's AB09AD, dense and by projection."""

from pathlib import Path

import numpy as np
import pytest
import slycot
from numpy.typing import NDArray
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

from palpate.reduce.balance import balance, controllability_factor
from palpate.reduce.state_space import StateSpace, state_space
from palpate.reduce.study import LARGEST_DENSE, Reduction, reduce_system
from palpate.reduce.system import ContactSystem, contact_system, middle_of_top

Array = NDArray[np.float64]

# The bound on singular values, of the largest one.
HANKEL = 1e-8
# Certified error of the projection here: it moves a singular value by as much at most.
PROJECTION = 1e-9
# Two truncations of nearly the same system, at an order where the values fall by half or more: each keeps a subspace that
# moves by the projection's error over the gap.
TRUNCATED = 1e-6

SCENES = [sheet(5, ratio) for ratio in (0.01, 0.1, 1.0, 2.0)] + [
    sheet(8, 0.05),
    sheet(8, 1.0),
    sheet(8) + '\nneighbours = "edge"\nstiffness_N_m = 3000.0',
    block(4, 0.01),
    block(4, 0.3),
    block(4, 2.0),
    # the same along x and y: singular values in pairs
    block(4).replace(', "x-"', ""),
    "nodes = [3, 4, 5]\nfixed_faces = ['z-']\n[[body.regions]]\nfrom_node = [0, 0, 3]\nto_node = [2, 3, 4]\n"
    "stiffness_N_m = 3000.0\ndamping_ratio = 0.05\nmass_kg = 0.003",
]


def system_of(folder: Path, lines: str) -> ContactSystem:
    body = scene_body(folder, lines)
    return contact_system(body, middle_of_top(body))


def ab09ad(system: StateSpace, order: int) -> tuple[Array, StateSpace]:
    """SLICOT's Hankel singular values, and its system of `order` states by the square-root method."""
    inputs, outputs = system.b.shape[1], system.c.shape[0]
    kept, a, b, c, hankel = slycot.ab09ad(
        "C", "B", "N", system.order, inputs, outputs, system.a.copy(), system.b.copy(), system.c.copy(), order
    )
    assert kept == order
    return hankel, StateSpace(a[:order, :order], b[:order], c[:, :order], system.d)


def compared(system: ContactSystem, given: Reduction, hankel: Array, reference: StateSpace, tolerance: float) -> None:
    """Singular values and transfer function of a reduction against SLICOT's of the same order."""
    count = min(len(hankel), len(given.hankel_N_m))
    np.testing.assert_allclose(given.hankel_N_m[:count], hankel[:count], rtol=0, atol=HANKEL * hankel[0])
    assert np.all(hankel[count:] <= HANKEL * hankel[0])
    assert given.order == reference.order
    frequency_rad_s = frequencies_rad_s(system, 100)
    expected = reference.response(frequency_rad_s)
    atol = tolerance * largest(expected)
    np.testing.assert_allclose(given.reduced.response(frequency_rad_s), expected, rtol=0, atol=atol)


def falling_order(hankel: Array) -> int:
    """The order from 8 to 24 at which the values fall most, by half at least: truncation there is well posed."""
    order = max(range(8, min(25, len(hankel))), key=lambda i: float(hankel[i - 1] / hankel[i]))
    return order


@pytest.mark.parametrize("lines", SCENES)
def test_lattices_against_slicot(tmp_path: Path, lines: str) -> None:
    system = system_of(tmp_path, lines)
    full = state_space(system)
    order = falling_order(ab09ad(full, 1)[0])
    hankel, reference = ab09ad(full, order)
    dense = reduce_system(system, order, dense=True)
    assert dense.projection_error == 0.0
    compared(system, dense, hankel, reference, 1e-9)
    krylov = reduce_system(system, order, tolerance=PROJECTION)
    assert krylov.projection_error <= PROJECTION
    compared(system, krylov, hankel, reference, TRUNCATED)


@pytest.mark.parametrize("seed", range(100, 112))
def test_random_bodies_against_slicot(seed: int) -> None:
    """Damping that is not proportional: no modes of their own to fall back on."""
    system = random_system(np.random.default_rng(seed), 5)
    full = state_space(system)
    order = falling_order(ab09ad(full, 1)[0])
    hankel, reference = ab09ad(full, order)
    compared(system, reduce_system(system, order, dense=True), hankel, reference, 1e-9)
    compared(system, reduce_system(system, order, tolerance=PROJECTION), hankel, reference, TRUNCATED)


def test_the_symmetry_that_saves_the_second_gramian(tmp_path: Path) -> None:
    """The module's T: T A = A^T T, T b = -c^T, and T P T solves the observability equation."""
    for system in (system_of(tmp_path, block(3)), random_system(np.random.default_rng(3), 5)):
        full, d = state_space(system), system.size
        scale = full.a[0, d]
        symmetry = np.zeros((2 * d, 2 * d))
        symmetry[:d, :d] = system.damping_1_s.toarray() / scale**2
        symmetry[:d, d:] = symmetry[d:, :d] = np.eye(d) / scale
        np.testing.assert_allclose(symmetry @ full.a, full.a.T @ symmetry, atol=1e-10 * np.abs(full.a).max() / scale)
        np.testing.assert_allclose(symmetry @ full.b, -full.c.T, atol=1e-12 * np.abs(full.c).max())
        factor = controllability_factor(full)
        gramian = factor @ factor.T
        right = full.b @ full.b.T
        left = full.a @ gramian + gramian @ full.a.T
        np.testing.assert_allclose(left, -right, atol=1e-11 * np.abs(right).max())
        observed = symmetry @ gramian @ symmetry
        right = full.c.T @ full.c
        left = full.a.T @ observed + observed @ full.a
        np.testing.assert_allclose(left, -right, atol=1e-10 * np.abs(right).max())


def test_balanced_coordinates(tmp_path: Path) -> None:
    """Both Gramians of the truncated system are the diagonal of the singular values kept, up to the order's error."""
    system = system_of(tmp_path, block(4))
    balanced = balance(system)
    np.testing.assert_allclose(
        balanced.left[:, :20].T @ balanced.right[:, :20], np.eye(20), atol=1e-9
    )
    reduced = balanced.truncate(20)
    values = balanced.hankel[:20]
    right = reduced.a * values + (reduced.a * values).T + reduced.b @ reduced.b.T
    np.testing.assert_allclose(right, 0.0, atol=1e-10 * np.abs(reduced.b @ reduced.b.T).max())
    right = reduced.a.T * values + (reduced.a.T * values).T + reduced.c.T @ reduced.c
    np.testing.assert_allclose(right, 0.0, atol=1e-10 * np.abs(reduced.c.T @ reduced.c).max())
    assert np.all(np.diff(balanced.hankel) <= 0.0)


@pytest.mark.parametrize("lines", [sheet(6), block(3).replace(', "x-"', ""), sheet(6, 0.05)])
def test_every_order_is_stable_and_within_its_bounds(tmp_path: Path, lines: str) -> None:
    """Also where a pair of equal singular values is cut in two."""
    system = system_of(tmp_path, lines)
    frequency_rad_s = frequencies_rad_s(system, 100)
    exact = exact_strictly_proper(system, frequency_rad_s)
    size = h_infinity_N_m(state_space(system))
    for order in (1, 2, 3, 7, 8, 14, 15, 22):
        reduction = reduce_system(system, order, dense=True)
        assert reduction.order == order
        assert np.linalg.eigvals(reduction.reduced.a).real.max() < 0.0
        error = largest(exact - reduction.reduced.response(frequency_rad_s)) / size
        assert error <= reduction.certified_error <= reduction.a_priori_bound
        assert reduction.next_singular_value <= reduction.certified_error * reduction.norm_N_m / reduction.hankel_N_m[0]


def test_the_order_that_is_chosen_keeps_the_bound(tmp_path: Path) -> None:
    system = system_of(tmp_path, sheet(8))
    chosen = reduce_system(system, dense=True)
    assert chosen.a_priori_bound <= 0.01
    assert reduce_system(system, chosen.order - 1, dense=True).a_priori_bound > 0.01


def test_orders_beyond_rounding_keep_what_is_more(tmp_path: Path) -> None:
    system = system_of(tmp_path, sheet(4))
    reduction = reduce_system(system, 10_000, dense=True)
    assert reduction.order == reduction.balanced.largest_order < system.states
    assert reduction.certified_error < 1e-9


def test_dense_has_a_limit(tmp_path: Path) -> None:
    system = system_of(tmp_path, sheet(22))
    assert system.states > LARGEST_DENSE
    with pytest.raises(ValueError, match=f"{system.states} states: the dense method takes at most {LARGEST_DENSE}"):
        reduce_system(system, 10, dense=True)


def test_states_have_shapes_on_the_mesh(tmp_path: Path) -> None:
    """The displacements of a state's direction do not depend on the projection, up to the state's sign and length."""
    system = system_of(tmp_path, sheet(8))
    dense = reduce_system(system, 6, dense=True).shapes()
    krylov = reduce_system(system, 6, tolerance=PROJECTION).shapes()
    assert dense.shape == krylov.shape == (system.size, 6)
    for a, b in zip(dense.T, krylov.T, strict=True):
        sign = np.sign(a @ b)
        np.testing.assert_allclose(sign * b, a, atol=1e-5 * np.abs(a).max())
