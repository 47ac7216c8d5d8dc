"""The full body against independent computations: SciPy's DOP853 for its motion, a sparse solver for its statics.

The lattice, its forces and its stiffness matrix are written here anew, from the equations (1)-(3) of Jacobs, Fu and
Cavusoglu (2010); of the core only `simulate` is called, through scene files.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import splu

from palpate import _core
from palpate.scene import load_scene

Array = NDArray[np.float64]

MASS_KG, STIFFNESS_N_M, SPACING_M = 1e-3, 100.0, 0.01
EXPORT_MS = (4, 10, 20)
# Steps of 2 and 1 us, extrapolated: an error of order h^2, relative to the largest displacement or velocity; 1.5e-6 was
# seen, on the block without dampers.
EXTRAPOLATED_ERROR = 1e-5
ORDER_BAND = 0.15
# Steps per tick: halved three times.
ORDER_STEPS = (16, 32, 64, 128)
# The press is 0.5 % of the spacing deep, and the springs at the contact then pull by so much off their directions at
# rest: 0.18-0.30 % of the force were seen.
PRESS_DEPTH_M = 5e-5
PRESS_ERROR = 0.006
# A node amid the top, pressed down: 318 N/m are quoted without saying which; they differ by some percent.
QUOTED_N_M, QUOTED_ERROR = 318.0, 0.03


@dataclass(frozen=True)
class Lattice:
    """A body as the tests understand it. counts: (nx, ny, nz), ny = 1 for a sheet."""

    counts: tuple[int, int, int]
    reach: int  # how many indices two neighbours may differ in, each by one
    damping_N_s_m: float
    fixed: tuple[int, ...]
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rest_m: Array = field(init=False)
    pairs: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        nx, ny, nz = self.counts
        index = [(i, j, k) for k in range(nz) for j in range(ny) for i in range(nx)]
        number = {node: n for n, node in enumerate(index)}
        pairs = [
            (n, number[node[0] + step[0], node[1] + step[1], node[2] + step[2]])
            for n, node in enumerate(index)
            for step in product((-1, 0, 1), repeat=3)
            if 0 < sum(map(abs, step)) <= self.reach
            and number.get((node[0] + step[0], node[1] + step[1], node[2] + step[2]), -1) > n
        ]
        object.__setattr__(self, "rest_m", SPACING_M * np.array(index, dtype=np.float64))
        object.__setattr__(self, "pairs", np.array(pairs))

    @property
    def free(self) -> NDArray[np.bool_]:
        """(nodes,): not fixed."""
        return ~np.isin(np.arange(len(self.rest_m)), self.fixed)

    def acceleration(self, position_m: Array, velocity_m_s: Array) -> Array:
        """(nodes, 3): springs with dampers along them, and weight; zero where a node is fixed."""
        a, b = self.pairs.T
        across = position_m[b] - position_m[a]
        length_m = np.linalg.norm(across, axis=1)
        along = across / length_m[:, None]
        rest_length_m = np.linalg.norm(self.rest_m[b] - self.rest_m[a], axis=1)
        rate_m_s = np.einsum("ij,ij->i", velocity_m_s[b] - velocity_m_s[a], along)
        pull_N = (STIFFNESS_N_M * (length_m - rest_length_m) + self.damping_N_s_m * rate_m_s)[:, None] * along
        force_N = np.zeros_like(position_m)
        np.add.at(force_N, a, pull_N)
        np.add.at(force_N, b, -pull_N)
        return (force_N / MASS_KG + np.array(self.gravity_m_s2)) * self.free[:, None]

    def solve(self, start_m: Array, times_s: Array) -> tuple[Array, Array]:
        """Positions and velocities (times, nodes, 3), from rest at start_m."""

        def derivative(_: float, state: Array) -> Array:
            position_m, velocity_m_s = state.reshape(2, -1, 3)
            return np.stack([velocity_m_s, self.acceleration(position_m, velocity_m_s)]).ravel()

        solution = solve_ivp(
            derivative,
            (0.0, times_s[-1]),
            np.stack([start_m, np.zeros_like(start_m)]).ravel(),
            method="DOP853",
            t_eval=times_s,
            rtol=1e-10,
            atol=1e-13,
        )
        assert solution.success
        state = solution.y.T.reshape(len(times_s), 2, -1, 3)
        return state[:, 0], state[:, 1]

    def stiffness(self) -> sparse.csc_matrix:
        """K (3 nodes x 3 nodes, N/m) at rest."""
        a, b = self.pairs.T
        along = self.rest_m[b] - self.rest_m[a]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        block = STIFFNESS_N_M * along[:, :, None] * along[:, None, :]
        row, column = np.meshgrid(np.arange(3), np.arange(3), indexing="ij")
        size = 3 * len(self.rest_m)
        matrix = sparse.csc_matrix((size, size))
        for first, second, sign in ((a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)):
            rows, columns = 3 * first[:, None, None] + row, 3 * second[:, None, None] + column
            matrix += sparse.csc_matrix((sign * block.ravel(), (rows.ravel(), columns.ravel())), (size, size))
        return matrix


def body_text(lattice: Lattice, fixed_keys: str) -> str:
    """[body] of a scene; its damping in N s/m."""
    nx, ny, nz = lattice.counts
    planar = ny == 1
    neighbours = {1: "axis", 2: "edge", 3: "full"}[lattice.reach]
    return f"""
[body]
dimension = {2 if planar else 3}
nodes = {[nx, nz] if planar else [nx, ny, nz]}
spacing_m = {SPACING_M}
mass_kg = {MASS_KG}
stiffness_N_m = {STIFFNESS_N_M}
damping_N_s_m = {lattice.damping_N_s_m!r}
neighbours = "{neighbours}"
gravity_m_s2 = {list(lattice.gravity_m_s2)}
{fixed_keys}
"""


def simulate(folder: Path, text: str) -> dict[str, Any]:
    """Results of `palpate simulate` on a scene."""
    file = folder / "scene.toml"
    file.write_text(text)
    results: dict[str, Any] = _core.simulate(load_scene(file).to_dict(), lambda done, total: True)
    return results


@dataclass(frozen=True)
class Case:
    """A lattice that is let go from large displacements of all free nodes."""

    counts: tuple[int, int, int]
    reach: int
    damping_ratio: float
    gravity_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def lattice(self) -> Lattice:
        damping_N_s_m = self.damping_ratio * np.sqrt(2.0 * MASS_KG * STIFFNESS_N_M)
        return Lattice(self.counts, self.reach, float(damping_N_s_m), (0,), self.gravity_m_s2)

    def start_m(self) -> Array:
        """A fifth of the spacing in any direction: springs turn and stretch by a third."""
        lattice = self.lattice()
        moved_m = np.random.default_rng(7).uniform(-0.2, 0.2, lattice.rest_m.shape) * SPACING_M
        if self.counts[1] == 1:
            moved_m[:, 1] = 0.0
        return lattice.rest_m + moved_m * lattice.free[:, None]

    def scene(self, method: str, steps_per_tick: int) -> str:
        """The scene of it."""
        lattice, start_m = self.lattice(), self.start_m()
        nx, ny, _ = self.counts
        starts = []
        for n in np.flatnonzero(lattice.free):
            i, j, k = n % nx, n // nx % ny, n // (nx * ny)
            x, y, z = (start_m - lattice.rest_m)[n]
            node, moved = ([i, k], [x, z]) if ny == 1 else ([i, j, k], [x, y, z])
            moved_text = ", ".join(repr(float(u)) for u in moved)
            starts.append(f"  {{ node = {[int(u) for u in node]}, displacement_m = [{moved_text}] }},\n")
        fixed = "[0, 0]" if ny == 1 else "[0, 0, 0]"
        keys = f"fixed_nodes = [{fixed}]\ninitial_displacements = [\n{''.join(starts)}]"
        return (
            f"duration_s = {EXPORT_MS[-1] / 1000}\n{body_text(lattice, keys)}\n"
            f'[integrator]\nmethod = "{method}"\nstep_s = {1e-3 / steps_per_tick!r}\n'
            f"[outputs]\nnode_times_s = {[ms / 1000 for ms in EXPORT_MS]}\n"
        )


BLOCK_SHEET = [
    pytest.param(Case((4, 4, 4), 3, ratio), id=f"block-damping-{ratio:g}") for ratio in (0.0, 0.1, 1.0)
] + [pytest.param(Case((5, 1, 4), 2, ratio), id=f"sheet-damping-{ratio:g}") for ratio in (0.0, 0.1, 1.0)]
OTHERS = [
    pytest.param(Case((3, 4, 5), 2, 0.1, (1.0, -2.0, -9.81)), id="block-without-cell-diagonals-with-weight"),
    pytest.param(Case((4, 3, 3), 1, 0.1), id="block-along-axes"),
    pytest.param(Case((5, 1, 4), 1, 0.1, (0.0, 0.0, -9.81)), id="sheet-along-axes-with-weight"),
]


@pytest.fixture(scope="module")
def exact() -> Callable[[Case], tuple[Array, Array]]:
    """Solutions at EXPORT_MS, each computed once."""
    known: dict[Case, tuple[Array, Array]] = {}

    def solve(case: Case) -> tuple[Array, Array]:
        if case not in known:
            known[case] = case.lattice().solve(case.start_m(), np.array(EXPORT_MS) / 1000)
        return known[case]

    return solve


def exported(folder: Path, case: Case, method: str, steps_per_tick: int) -> tuple[Array, Array]:
    """Positions and velocities (times, nodes, 3) that `simulate` exports."""
    results = simulate(folder, case.scene(method, steps_per_tick))
    np.testing.assert_allclose(results["nodes/time_s"], np.array(EXPORT_MS) / 1000)
    return results["nodes/position_m"], results["nodes/velocity_m_s"]


@pytest.mark.parametrize("case", BLOCK_SHEET + OTHERS)
def test_motion_is_that_of_dop853(
    tmp_path: Path, exact: Callable[[Case], tuple[Array, Array]], case: Case
) -> None:
    coarse, fine = (exported(tmp_path, case, "semi_implicit", steps) for steps in (500, 1000))
    rest_m = case.lattice().rest_m
    for a, b, truth, offset in zip(coarse, fine, exact(case), (rest_m, 0.0), strict=True):
        extrapolated = 2.0 * b - a  # without the error of order h
        for i, ms in enumerate(EXPORT_MS):
            scale = np.abs(truth[i] - offset).max()
            error = np.abs(extrapolated[i] - truth[i]).max() / scale
            assert error < EXTRAPOLATED_ERROR, f"at {ms} ms"
    assert np.abs(fine[0] - rest_m).max() > 0.02 * SPACING_M  # it is far from rest at all times


@pytest.mark.parametrize("method", ["semi_implicit", "implicit"])
@pytest.mark.parametrize("case", BLOCK_SHEET)
def test_order_of_convergence(
    tmp_path: Path, exact: Callable[[Case], tuple[Array, Array]], case: Case, method: str
) -> None:
    errors = np.zeros((2, len(ORDER_STEPS)))
    for i, steps in enumerate(ORDER_STEPS):
        for j, (value, truth) in enumerate(
            zip(exported(tmp_path, case, method, steps), exact(case), strict=True)
        ):
            errors[j, i] = np.sqrt(np.mean((value - truth) ** 2))
    orders = np.log2(errors[:, :-1] / errors[:, 1:])
    # Without dampers semi-implicit Euler is leapfrog, its velocities half a step early. From rest, that start is one half
    # a step before: the motion runs half a step ahead, and the velocities are right to order 2, the positions to order 1.
    leapfrog = method == "semi_implicit" and case.damping_ratio == 0.0
    expected = [1.0, 2.0 if leapfrog else 1.0]
    assert np.all(np.diff(errors) < 0.0)
    np.testing.assert_allclose(orders[:, -1], expected, rtol=0.0, atol=ORDER_BAND)


@dataclass(frozen=True)
class Press:
    """A place on the top of the 12 x 12 x 12 body of the demo, in units of the spacing."""

    x: float
    y: float


def press(folder: Path, place: Press, friction: float) -> tuple[dict[str, Any], Lattice]:
    """Presses PRESS_DEPTH_M in along z and holds; the block stands as in the demo."""
    count = 12
    lattice = Lattice(
        (count, count, count),
        3,
        float(np.sqrt(2.0 * MASS_KG * STIFFNESS_N_M)),
        tuple(n for n in range(count**3) if n % count == 0 or n < count**2),
    )
    top_m = (count - 1) * SPACING_M
    x_m, y_m = place.x * SPACING_M, place.y * SPACING_M
    text = f"""
duration_s = 1.0
{body_text(lattice, 'fixed_faces = ["z-", "x-"]')}
[contact]
friction = {friction}
[path]
waypoints = [
  {{ time_s = 0.0, position_m = [{x_m}, {y_m}, {top_m + 2 * PRESS_DEPTH_M}] }},
  {{ time_s = 0.3, position_m = [{x_m}, {y_m}, {top_m - PRESS_DEPTH_M}] }},
]
[integrator]
step_s = 0.0002
"""
    return simulate(folder, text), lattice


def weights(place: Press, results: dict[str, Any]) -> dict[int, float]:
    """Barycentric coordinates by node of the place on the top, from the surface that the core reports."""
    rest_m, triangles = results["body/rest_m"], results["body/triangles"]
    point = np.array([place.x, place.y]) * SPACING_M
    for triangle in triangles:
        corners = rest_m[triangle]
        if np.ptp(corners[:, 2]) > 0.0 or corners[0, 2] < rest_m[:, 2].max() - 1e-9:
            continue
        edges = (corners[1:] - corners[0])[:, :2].T
        b, c = np.linalg.solve(edges, point - corners[0, :2])
        if min(b, c, 1.0 - b - c) > -1e-9:
            return {int(n): w for n, w in zip(triangle, (1.0 - b - c, b, c), strict=True)}
    raise AssertionError("the place is not on the top")


@pytest.mark.parametrize("place", [Press(5.0, 6.0), Press(4.3, 6.2), Press(9.5, 2.25)])
def test_static_press_is_that_of_the_stiffness_matrix(tmp_path: Path, place: Press) -> None:
    results, lattice = press(tmp_path, place, friction=10.0)
    free = np.repeat(lattice.free, 3)
    selection = np.zeros((len(free), 3))
    for node, weight in weights(place, results).items():
        selection[3 * node : 3 * node + 3] = weight * np.eye(3)
    inside = selection[free]
    compliance_m_N = inside.T @ splu(lattice.stiffness()[free][:, free]).solve(inside)
    expected_N = np.linalg.solve(compliance_m_N, [0.0, 0.0, -PRESS_DEPTH_M])
    force_N = results["tip/force_N"][-1]
    assert results["tip/contact_mode"][-1] == 1  # it sticks
    np.testing.assert_allclose(force_N, expected_N, atol=PRESS_ERROR * np.linalg.norm(expected_N))
    if place == Press(5.0, 6.0):
        assert -force_N[2] / PRESS_DEPTH_M == pytest.approx(QUOTED_N_M, rel=QUOTED_ERROR)
