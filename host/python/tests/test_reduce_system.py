"""The contact node's linear system: the paper's sizes, the input's derivative, bodies that have no such system."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray
from reduce_bodies import (
    block,
    exact_response,
    frequencies_rad_s,
    largest,
    lattice_springs,
    made_body,
    random_system,
    scene_body,
    sheet,
)

from palpate.reduce.cholesky import ShiftedCholesky
from palpate.reduce.response import box, direct_response, full_response, local_states, reduced_response
from palpate.reduce.state_space import state_space
from palpate.reduce.system import BodyError, LinearBody, contact_system, middle_of_top

# Rounding of a solve with the bodies' condition, up to some 1e5, and of the state space's eigenvectors.
SOLVED = 1e-11
DIAGONALIZED = 1e-8

PAPER_2D = {5: 76, 10: 356, 12: 524, 15: 836, 20: 1516, 25: 2396}
PAPER_3D = {4: 210, 5: 474, 6: 894, 7: 1506}


@pytest.mark.parametrize(
    ("lines", "states"),
    [(sheet(n), states) for n, states in PAPER_2D.items()] + [(block(n), states) for n, states in PAPER_3D.items()],
)
def test_states_of_the_papers_meshes(tmp_path: Path, lines: str, states: int) -> None:
    """Table 1 of Jacobs, Fu and Cavusoglu (2010), the contact node in the middle of the top."""
    body = scene_body(tmp_path, lines)
    system = contact_system(body, middle_of_top(body))
    assert system.states == states
    assert system.contact_axes == ((0, 2) if body.shape[1] == 1 else (0, 1, 2))
    bounds = np.sqrt(system.slowest_1_s2), np.sqrt(system.fastest_1_s2)
    assert 0.0 < bounds[0] < bounds[1]


@pytest.mark.parametrize("seed", range(12))
def test_the_inputs_derivative_is_in_the_states(seed: int) -> None:
    """Three ways to one response: the equations of motion with displacement and velocity of the driven node, the sparse
    one in mass-normalized coordinates, and the state space without the derivative plus the terms without states."""
    system = random_system(np.random.default_rng(seed), 5)
    frequency_rad_s = frequencies_rad_s(system, 60)
    exact = exact_response(system.body, system.contact_node, frequency_rad_s)
    size = largest(exact)
    np.testing.assert_allclose(full_response(system, frequency_rad_s), exact, rtol=0, atol=SOLVED * size)
    of_states = reduced_response(system, state_space(system), frequency_rad_s)
    np.testing.assert_allclose(of_states, exact, rtol=0, atol=DIAGONALIZED * size)
    np.testing.assert_allclose(exact, exact.transpose(0, 2, 1), rtol=0, atol=SOLVED * size)
    np.testing.assert_array_equal(system.direct_damping_N_s_m, system.direct_damping_N_s_m.T)


def test_one_free_node_has_the_response_of_its_equation() -> None:
    """A node between the contact and the ground, along z: m x'' + (b1 + b2) x' + (k1 + k2) x = b1 u' + k1 u."""
    springs = np.array([[0, 1], [1, 2]])
    k1, k2, b1, b2, m = 30.0, 70.0, 0.4, 0.1, 0.002
    body = made_body((1, 1, 3), springs, np.array([k2, k1]), np.array([b2, b1]), np.array([0]), m)
    axis = body.axis == 2  # across the chain nothing resists
    body = LinearBody(
        body.mass_kg[axis],
        body.node[axis],
        body.axis[axis],
        body.stiffness_N_m[axis][:, axis],
        body.damping_N_s_m[axis][:, axis],
        body.rest_position_m,
        body.fixed,
        body.triangles,
        body.shape,
    )
    system = contact_system(body, 2)
    assert system.states == 2
    assert system.contact_axes == (2,)
    w = np.geomspace(1.0, 1e5, 50)
    s = 1j * w
    expected = k1 + s * b1 - (k1 + s * b1) ** 2 / (m * s**2 + (b1 + b2) * s + k1 + k2)
    for given in (full_response(system, w), reduced_response(system, state_space(system), w)):
        np.testing.assert_allclose(given[:, 0, 0], expected, rtol=1e-10)


def test_bounds_on_the_eigenvalues_hold_and_are_close() -> None:
    for seed in range(20):
        system = random_system(np.random.default_rng(seed), 6)
        stiffness = np.linalg.eigvalsh(system.stiffness_1_s2.toarray())
        damping = np.linalg.eigvalsh(system.damping_1_s.toarray())
        assert 1.0 - 2e-6 < system.slowest_1_s2 / stiffness[0] < 1.0
        assert 1.0 - 2e-6 < system.damped_1_s / damping[0] < 1.0
        assert system.fastest_1_s2 == pytest.approx(stiffness[-1], rel=1e-3)


def test_local_model_is_the_body_with_all_other_nodes_fixed() -> None:
    system = random_system(np.random.default_rng(4), 5)
    nodes = np.random.default_rng(0).random(len(system.body.fixed)) < 0.5
    nodes[system.contact_node] = True
    body = system.body
    kept = nodes[body.node]
    alone = LinearBody(
        body.mass_kg[kept],
        body.node[kept],
        body.axis[kept],
        body.stiffness_N_m[kept][:, kept],
        body.damping_N_s_m[kept][:, kept],
        body.rest_position_m,
        body.fixed | ~nodes,
        body.triangles,
        body.shape,
    )
    frequency_rad_s = frequencies_rad_s(system, 30)
    expected = exact_response(alone, system.contact_node, frequency_rad_s)
    given = full_response(system, frequency_rad_s, nodes)
    np.testing.assert_allclose(given, expected, rtol=0, atol=SOLVED * largest(expected))
    free_others = kept & (body.node != system.contact_node)
    assert local_states(system, nodes) == 2 * np.count_nonzero(free_others)
    # nothing but the contact moves: springs and dampers to it, no states
    none = np.zeros(len(body.fixed), dtype=bool)
    held = full_response(system, frequency_rad_s, none)
    proper = system.input_damping.T @ system.input_damping
    np.testing.assert_allclose(held, direct_response(system, frequency_rad_s) + proper, rtol=1e-14)
    assert local_states(system, none) == 0


def lattice_of(system_body: LinearBody, chosen: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of the chosen nodes along x, y, z; fails where they are no full box."""
    places = np.array([system_body.coordinates(int(node)) for node in np.flatnonzero(chosen)])
    first, last = places.min(axis=0), places.max(axis=0)
    assert len(places) == np.prod(last - first + 1)
    return [(int(a), int(b)) for a, b in zip(first, last, strict=True)]


def test_neighbourhoods_of_the_paper(tmp_path: Path) -> None:
    """Figure 7: 4 x 2 nodes in 2D, 4 x 4 x 2 in 3D, with the contact node in the middle of the top."""
    body = scene_body(tmp_path, sheet(12))
    system = contact_system(body, middle_of_top(body))
    assert body.coordinates(system.contact_node) == (5, 0, 11)
    chosen = box(system, 4, 2)
    assert lattice_of(body, chosen) == [(3, 6), (0, 0), (10, 11)]
    assert local_states(system, chosen) == 4 * (4 * 2 - 1)
    body = scene_body(tmp_path, block(7))
    system = contact_system(body, middle_of_top(body))
    assert body.coordinates(system.contact_node) == (3, 3, 6)
    chosen = box(system, 4, 2)
    assert lattice_of(body, chosen) == [(1, 4), (1, 4), (5, 6)]
    assert local_states(system, chosen) == 6 * (4 * 4 * 2 - 1)


@pytest.mark.parametrize(
    ("contact", "along", "depth", "expected", "states"),
    [
        # at a corner and at an edge the box keeps its size
        ((6, 0, 6), 4, 2, [(3, 6), (0, 3), (5, 6)], 6 * 31),
        ((3, 6, 6), 3, 1, [(2, 4), (4, 6), (6, 6)], 6 * 8),
        # below the top: what lies above the contact belongs to it
        ((3, 3, 4), 2, 1, [(2, 3), (2, 3), (4, 6)], 6 * 11),
        # larger than the lattice: all of it, and fixed nodes have no states
        ((3, 3, 6), 9, 9, [(0, 6), (0, 6), (0, 6)], 1506),
    ],
)
def test_box_at_the_border(
    tmp_path: Path,
    contact: tuple[int, int, int],
    along: int,
    depth: int,
    expected: list[tuple[int, int]],
    states: int,
) -> None:
    body = scene_body(tmp_path, block(7))
    i, j, k = contact
    system = contact_system(body, i + 7 * (j + 7 * k))
    chosen = box(system, along, depth)
    assert lattice_of(body, chosen) == expected
    assert local_states(system, chosen) == states


def test_middle_of_top_is_the_nearest_free_node(tmp_path: Path) -> None:
    def middle(lines: str) -> tuple[int, int, int]:
        body = scene_body(tmp_path, lines)
        return body.coordinates(middle_of_top(body))

    assert middle(sheet(5)) == (2, 0, 4)
    assert middle(sheet(4)) == (1, 0, 3)
    assert middle(block(5)) == (2, 2, 4)
    assert middle(block(4)) == (1, 1, 3)
    assert middle(sheet(5) + "\nfixed_nodes = [[2, 4]]") == (1, 0, 4)
    assert middle(block(3) + "\nfixed_nodes = [[1, 1, 2], [1, 0, 2]]") == (2, 1, 2)
    with pytest.raises(BodyError, match="no node of the top face is free"):
        middle(sheet(5).replace("z-", "z+"))


SHAPES = [(5, 1, 5), (3, 3, 3), (12, 1, 12), (6, 6, 6)]


def refused(
    shape: tuple[int, int, int],
    keep: NDArray[np.bool_] | None = None,
    stiffness: dict[int, float] | None = None,
    damping: dict[int, float] | None = None,
    fixed: NDArray[np.int64] | None = None,
) -> tuple[str, int, set[tuple[int, int, int]]]:
    """What is said of a lattice held at the bottom, the contact at its last node, with all springs alike but those that
    are not kept or given here; the count of nodes, and the nodes that the message names. Fails where it is accepted."""
    springs = lattice_springs(shape)
    stiffness_N_m, damping_N_s_m = np.full(len(springs), 100.0), np.full(len(springs), 0.3)
    for values, given in ((stiffness_N_m, stiffness), (damping_N_s_m, damping)):
        for spring, value in (given or {}).items():
            values[spring] = value
    kept = np.full(len(springs), True) if keep is None else keep
    bottom = np.arange(shape[0] * shape[1])
    body = made_body(
        shape, springs[kept], stiffness_N_m[kept], damping_N_s_m[kept], bottom if fixed is None else fixed
    )
    count = len(body.fixed)
    with pytest.raises(BodyError) as error:
        contact_system(body, count - 1)
    text = str(error.value)
    assert "\n" not in text
    named = {(int(i), int(j), int(k)) for i, j, k in re.findall(r"\((\d+), (\d+), (\d+)\)", text)}
    assert named
    return text, count, named


def ends(shape: tuple[int, int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places (s, 3) of the lattice's springs' two ends."""
    i, j, k = (part.ravel(order="F") for part in np.indices(shape))
    place = np.stack([i, j, k], axis=1)
    springs = lattice_springs(shape)
    return place[springs[:, 0]], place[springs[:, 1]]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_body_that_nothing_holds(shape: tuple[int, int, int]) -> None:
    """It turns about the driven node: rounding alone gives the motion a stiffness, of either sign."""
    text, _, _ = refused(shape, fixed=np.array([], dtype=np.int64))
    assert "no spring resists" in text
    assert "the body has no fixed node" in text


@pytest.mark.parametrize("shape", [(3, 3, 3), (6, 6, 6)])
def test_a_block_hung_from_one_node(shape: tuple[int, int, int]) -> None:
    """It turns about the line from the fixed node to the contact; the node that moves most is not on it."""
    text, _, named = refused(shape, fixed=np.array([0]))
    assert "no spring resists" in text
    assert "no fixed node" not in text
    assert all(len(set(place)) > 1 for place in named)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_mechanism(shape: tuple[int, int, int]) -> None:
    """Springs along the axes alone: the lattice shears."""
    a, b = ends(shape)
    text, _, named = refused(shape, keep=np.abs(a - b).sum(axis=1) == 1)
    assert "no spring resists" in text
    assert all(place[2] > 0 for place in named)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_body_in_two_pieces(shape: tuple[int, int, int]) -> None:
    """No spring crosses from the first layer along x to the second; each piece is held at the bottom."""
    a, b = ends(shape)
    text, _, named = refused(shape, keep=(a[:, 0] == 0) == (b[:, 0] == 0))
    assert f"one of {shape[1] * (shape[2] - 1)} free nodes that no springs connect" in text
    contact = (shape[0] - 1, shape[1] - 1, shape[2] - 1)
    assert named == {(0, 0, 1), contact}


@pytest.mark.parametrize("shape", SHAPES)
def test_undamped_bodies(shape: tuple[int, int, int]) -> None:
    springs = lattice_springs(shape)
    text, count, _ = refused(shape, damping=dict.fromkeys(range(len(springs)), 0.0))
    assert "no damper resists" in text
    assert "damping_ratio" in text
    beside = np.flatnonzero(np.any(springs == count - 2, axis=1))
    text, _, named = refused(shape, damping=dict.fromkeys(beside.tolist(), 0.0))
    assert "no damper resists" in text
    assert named == {(shape[0] - 2, shape[1] - 1, shape[2] - 1)}


@pytest.mark.parametrize("shape", SHAPES)
def test_unstable_bodies(shape: tuple[int, int, int]) -> None:
    """The springs of a node push, or its dampers do; its neighbours are held by springs of their own."""
    springs = lattice_springs(shape)
    count = int(np.prod(shape))
    node = count - 1 - shape[0] * shape[1]  # below the contact
    around = dict.fromkeys(np.flatnonzero(np.any(springs == node, axis=1)).tolist(), -20.0)
    place = {(shape[0] - 1, shape[1] - 1, shape[2] - 2)}
    text, _, named = refused(shape, stiffness=around)
    assert "no spring resists" in text
    assert "unstable" in text
    assert named == place
    text, _, named = refused(shape, damping=around)
    assert "no damper resists" in text
    assert named == place


def test_contact_nodes_that_cannot_be(tmp_path: Path) -> None:
    body = scene_body(tmp_path, block(4))
    with pytest.raises(BodyError, match=re.escape("node (0, 2, 3): is fixed")):
        contact_system(body, 0 + 4 * (2 + 4 * 3))
    for node in (-1, 64):
        with pytest.raises(BodyError, match=re.escape(f"node {node}: must be in [0, 63]")):
            contact_system(body, node)
    springs = lattice_springs((2, 1, 2))
    one = np.ones(len(springs))
    alone = made_body((2, 1, 2), springs, one, one, np.arange(3))
    with pytest.raises(BodyError, match=re.escape("node (1, 0, 1): no other node is free")):
        contact_system(alone, 3)


def test_zeros_that_are_stored_do_not_matter() -> None:
    """Where stiffness and damping both store a zero, their sum stores nothing."""
    matrix = np.array([[4.0, 1.0, 0.0], [1.0, 5.0, 2.0], [0.0, 2.0, 6.0]])
    places = np.nonzero(np.ones((3, 3)))
    stored = sp.csc_matrix((matrix[places], places), shape=(3, 3))
    assert stored.nnz == 9
    solve = ShiftedCholesky(stored, 2.0 * stored).factor(1.0, 0.5, 3.0)
    right = np.array([[1.0], [2.0], [3.0]])
    np.testing.assert_allclose(solve(right), np.linalg.solve(2.0 * matrix + 3.0 * np.eye(3), right), rtol=1e-13)
    assert stored.nnz == 9
