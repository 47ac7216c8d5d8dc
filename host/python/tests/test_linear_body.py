"""`_core.linear_body`: a body's linear system against its assembly spring by spring, and the paper's sizes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import ROOT
from numpy.typing import NDArray
from scipy import sparse

from palpate import _core, scene_checks
from palpate.scene import load_scene

Bodies = Callable[[str], dict[str, Any]]

# Some 26 springs add up in an entry, each with the rounding of its direction.
ROUNDING = 1e-13


@pytest.fixture
def linear_body(tmp_path: Path) -> Bodies:
    """Builds the linear system of a scene with these lines of [body]."""

    def build(lines: str) -> dict[str, Any]:
        file = tmp_path / "scene.toml"
        file.write_text(f"duration_s = 1.0\n[body]\n{lines}\n")
        return _core.linear_body(load_scene(file).to_dict())

    return build


def matrix(body: dict[str, Any], name: str) -> NDArray[np.float64]:
    """`stiffness` or `damping` as a full (d, d) matrix."""
    part, size = body[name], len(body["mass_kg"])
    given = sparse.csc_array((part["data"], part["indices"], part["indptr"]), shape=(size, size))
    assert given.has_sorted_indices
    assert np.all(given.data != 0.0)
    full: NDArray[np.float64] = given.toarray()
    return full


def assembled(body: dict[str, Any], constant: str) -> NDArray[np.float64]:
    """The sum over springs of constant n n' (e_i - e_j)(e_i - e_j)', free degrees of freedom only."""
    rest_m = body["rest_position_m"]
    full = np.zeros((3 * len(rest_m),) * 2)
    for (i, j), value in zip(body["springs"], body[constant], strict=True):
        direction = (rest_m[j] - rest_m[i]) / np.linalg.norm(rest_m[j] - rest_m[i])
        difference = np.zeros(3 * len(rest_m))
        difference[3 * i : 3 * i + 3], difference[3 * j : 3 * j + 3] = direction, -direction
        full += value * np.outer(difference, difference)
    free = 3 * body["node"] + body["axis"]
    return full[np.ix_(free, free)]


SHEET = 'dimension = 2\nnodes = [4, 3]\nfixed_faces = ["z-"]\nstiffness_N_m = 80.0\ndamping_ratio = 0.5'
BLOCK = (
    'nodes = [4, 3, 5]\nfixed_faces = ["z-"]\nfixed_nodes = [[3, 2, 4]]\norigin_m = [0.1, -0.3, 0.7]\n'
    "spacing_m = 0.007\nstiffness_N_m = 300.0\ndamping_N_s_m = 0.2\nmass_kg = 0.002"
)


@pytest.mark.parametrize("neighbours", ["axis", "edge", "full"])
@pytest.mark.parametrize("lines", [SHEET, BLOCK], ids=["sheet", "block"])
def test_matrices_are_the_sums_over_springs(linear_body: Bodies, lines: str, neighbours: str) -> None:
    body = linear_body(f'{lines}\nneighbours = "{neighbours}"')
    for name, constant in (("stiffness", "spring_stiffness_N_m"), ("damping", "spring_damping_N_s_m")):
        given, expected = matrix(body, name), assembled(body, constant)
        np.testing.assert_array_equal(given, given.T)
        np.testing.assert_allclose(given, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
        smallest = np.linalg.eigvalsh(given)[0] / np.abs(given).max()
        if neighbours == "full":
            assert smallest > 1e-3  # a lattice with its diagonals, fixed at a face, has no mechanism
        else:
            assert smallest > -ROUNDING


def test_degrees_of_freedom_are_those_of_the_free_nodes(linear_body: Bodies) -> None:
    body = linear_body(BLOCK)
    assert body["nodes"].tolist() == [4, 3, 5]
    assert body["spacing_m"] == 0.007
    i, j, k = np.unravel_index(np.arange(60), (4, 3, 5), order="F")
    np.testing.assert_allclose(
        body["rest_position_m"], [0.1, -0.3, 0.7] + 0.007 * np.stack([i, j, k], axis=1), atol=1e-15
    )
    np.testing.assert_array_equal(body["fixed"], (k == 0) | (np.arange(60) == 59))
    free = np.flatnonzero(~body["fixed"])
    np.testing.assert_array_equal(body["node"], np.repeat(free, 3))
    np.testing.assert_array_equal(body["axis"], np.tile([0, 1, 2], len(free)))
    np.testing.assert_array_equal(body["mass_kg"], np.full(3 * len(free), 0.002))
    np.testing.assert_array_equal(body["node_mass_kg"], np.full(60, 0.002))
    assert np.all(body["spring_stiffness_N_m"] == 300.0)
    assert np.all(body["spring_damping_N_s_m"] == 0.2)
    # 2 triangles per cell face on the six sides
    assert body["triangles"].shape == (2 * 2 * (3 * 2 + 3 * 4 + 2 * 4), 3)


LAYERS = """
[[body.regions]]
from_node = [0, 0, 4]
to_node = [3, 2, 4]
stiffness_N_m = 30000.0
mass_kg = 0.003
[[body.regions]]
from_node = [1, 0, 1]
to_node = [2, 1, 4]
stiffness_N_m = 10.0
damping_ratio = 0.5
"""


def test_regions_have_their_own_material(linear_body: Bodies) -> None:
    body = linear_body(BLOCK + LAYERS)
    for name, constant in (("stiffness", "spring_stiffness_N_m"), ("damping", "spring_damping_N_s_m")):
        given, expected = matrix(body, name), assembled(body, constant)
        np.testing.assert_array_equal(given, given.T)
        np.testing.assert_allclose(given, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    i, j, k = np.unravel_index(np.arange(60), (4, 3, 5), order="F")
    top, core = k == 4, (i >= 1) & (i <= 2) & (j <= 1) & (k >= 1)
    np.testing.assert_array_equal(body["node_mass_kg"], np.where(top & ~core, 0.003, 0.002))
    np.testing.assert_array_equal(body["mass_kg"], body["node_mass_kg"][body["node"]])
    in_top, in_core = (np.all(part[body["springs"]], axis=1) for part in (top, core))
    np.testing.assert_array_equal(
        body["spring_stiffness_N_m"], np.where(in_core, 10.0, np.where(in_top, 30000.0, 300.0))
    )
    # the body has no ratio: what gives none itself has the body's damping
    core_N_s_m = 0.5 * np.sqrt(2 * 0.002 * 10.0)
    np.testing.assert_allclose(body["spring_damping_N_s_m"], np.where(in_core, core_N_s_m, 0.2), rtol=1e-15)


def test_a_sheet_moves_in_its_plane(linear_body: Bodies) -> None:
    body = linear_body(SHEET)
    assert body["nodes"].tolist() == [4, 1, 3]
    assert set(body["axis"].tolist()) == {0, 2}
    assert body["triangles"].shape == (0, 3)
    damping_N_s_m = 0.5 * np.sqrt(2 * 0.001 * 80.0)
    np.testing.assert_allclose(body["spring_damping_N_s_m"], damping_N_s_m, rtol=1e-15)


def test_load_and_start_do_not_matter(linear_body: Bodies) -> None:
    moved = BLOCK + (
        "\ngravity_m_s2 = [0.0, 0.0, -9.81]\n"
        "initial_displacements = [{ node = [1, 1, 3], displacement_m = [0.001, 0.0, 0.0] }]"
    )
    for name in ("stiffness", "damping"):
        np.testing.assert_array_equal(matrix(linear_body(moved), name), matrix(linear_body(BLOCK), name))


@pytest.mark.parametrize("name", ["stiffness", "damping"])
def test_a_translation_stretches_only_springs_to_fixed_nodes(linear_body: Bodies, name: str) -> None:
    body = linear_body(BLOCK)
    given = matrix(body, name)
    fixed = body["fixed"]
    held = {int(n) for ends in body["springs"] if np.any(fixed[ends]) for n in ends}
    inside = ~np.isin(body["node"], list(held))
    assert np.any(inside)
    for axis in (0, 1, 2):
        row_sums = given @ (body["axis"] == axis).astype(float)
        assert np.abs(row_sums[inside]).max() < ROUNDING * np.abs(given).max()
    assert np.abs(given.sum(axis=1)[~inside]).max() > 0.1 * np.abs(given).max()


@pytest.mark.parametrize(("n", "states"), [(5, 76), (10, 356), (12, 524), (15, 836), (20, 1516), (25, 2396)])
def test_sheets_have_the_papers_states(linear_body: Bodies, n: int, states: int) -> None:
    """Table 1 of Jacobs, Fu and Cavusoglu (2010): the contact node's two degrees of freedom are the input."""
    body = linear_body(f'dimension = 2\nnodes = [{n}, {n}]\nfixed_faces = ["z-"]')
    assert 2 * (len(body["mass_kg"]) - 2) == states


@pytest.mark.parametrize(("n", "states"), [(4, 210), (5, 474), (6, 894), (7, 1506)])
def test_blocks_have_the_papers_states(linear_body: Bodies, n: int, states: int) -> None:
    """Table 1, with two adjacent faces fixed: the contact node's three degrees of freedom are the input."""
    body = linear_body(f'nodes = [{n}, {n}, {n}]\nfixed_faces = ["z-", "x-"]')
    assert 2 * (len(body["mass_kg"]) - 3) == states


@pytest.mark.parametrize(
    ("name", "springs"),
    [
        ("homogeneous", {100.0: 18788}),
        # two directions of 11 x 12 and two of 11 x 11 springs in the top layer
        ("stiff_skin", {100.0: 18788 - 506, 10000.0: 506}),
        # a core of 8 x 8 x 8 nodes: 3 directions of 7 x 8 x 8, 6 of 7 x 7 x 8 and 4 of 7 x 7 x 7
        ("soft_core", {100.0: 18788 - 5068, 100.0 / 30.0: 5068}),
    ],
)
def test_bodies_of_the_reduction_study(name: str, springs: dict[float, int]) -> None:
    body = _core.linear_body(load_scene(ROOT / f"scenes/reduce/{name}.toml").to_dict())
    values, counts = np.unique(body["spring_stiffness_N_m"], return_counts=True)
    assert dict(zip(values.tolist(), counts.tolist(), strict=True)) == springs
    assert len(body["mass_kg"]) == 3 * 12 * 11 * 11
    np.testing.assert_allclose(
        body["spring_damping_N_s_m"], np.sqrt(2 * 0.001 * body["spring_stiffness_N_m"]), rtol=1e-15
    )
    np.linalg.cholesky(matrix(body, "stiffness"))  # raises where the body is not held in every way


def test_scenes_know_the_boards_modes() -> None:
    # The scene's checks do without the core; the numbers are written twice.
    assert scene_checks.MAX_MODES == _core.MAX_MODES
    assert scene_checks.MAX_HYBRID_MODES == _core.MAX_HYBRID_MODES
