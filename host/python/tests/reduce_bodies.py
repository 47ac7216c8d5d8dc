"""Bodies for the tests of palpate.reduce: lattices of scenes, random ones made here, and their exact responses."""

from itertools import product
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import slycot
from numpy.typing import NDArray

from palpate import _core
from palpate.reduce.state_space import StateSpace
from palpate.reduce.system import BodyError, ContactSystem, LinearBody, contact_system, linear_body
from palpate.scene import load_scene

Array = NDArray[np.float64]
Response = NDArray[np.complex128]


def scene_body(folder: Path, lines: str) -> LinearBody:
    """The linear body of a scene with these lines of [body]."""
    file = folder / "scene.toml"
    file.write_text(f"duration_s = 1.0\n[body]\n{lines}\n")
    return linear_body(_core, load_scene(file).to_dict())


def sheet(n: int, ratio: float = 1.0) -> str:
    """Lines of [body]: the paper's 2D mesh, one edge fixed."""
    return f'dimension = 2\nnodes = [{n}, {n}]\nfixed_faces = ["z-"]\ndamping_ratio = {ratio}'


def block(n: int, ratio: float = 1.0) -> str:
    """Lines of [body]: the paper's 3D mesh, two adjacent faces fixed."""
    return f'nodes = [{n}, {n}, {n}]\nfixed_faces = ["z-", "x-"]\ndamping_ratio = {ratio}'


def lattice_springs(shape: tuple[int, int, int]) -> NDArray[np.int64]:
    """(s, 2): a spring between each two nodes of a lattice that share a cell."""
    places = list(product(*(range(count) for count in reversed(shape))))  # k, j, i: x runs fastest
    index = {place: node for node, place in enumerate(places)}
    steps = [step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)]
    ends = [
        (node, index[neighbour])
        for place, node in index.items()
        for step in steps
        if (neighbour := (place[0] + step[0], place[1] + step[1], place[2] + step[2])) in index
    ]
    return np.array(ends)


def made_body(
    shape: tuple[int, int, int],
    springs: NDArray[np.int64],
    stiffness_N_m: Array,
    damping_N_s_m: Array,
    fixed: NDArray[np.int64],
    mass_kg: float | Array = 0.001,
) -> LinearBody:
    """A lattice of 1 cm with these springs, whatever their sign; a sheet in x and z where it is one node thick along y.
    springs (s, 2), stiffness_N_m, damping_N_s_m (s,); fixed: nodes; mass_kg: of each node."""
    count = int(np.prod(shape))
    nodes = np.arange(count)
    place = np.stack([nodes % shape[0], nodes // shape[0] % shape[1], nodes // (shape[0] * shape[1])], axis=1)
    axes = np.array([0, 2] if shape[1] == 1 else [0, 1, 2])
    is_fixed = np.isin(nodes, fixed)
    free = np.flatnonzero(~is_fixed)
    node, axis = np.repeat(free, len(axes)), np.tile(axes, len(free))
    along = (place[springs[:, 1]] - place[springs[:, 0]]).astype(float)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    stretch = np.zeros((len(springs), count, 3))
    row = np.arange(len(springs))
    stretch[row, springs[:, 0]], stretch[row, springs[:, 1]] = -along, along
    stretch = stretch[:, node, axis]

    def assembled(constant: Array) -> sp.csc_matrix:
        return sp.csc_matrix(stretch.T @ (constant[:, None] * stretch))

    return LinearBody(
        mass_kg=np.broadcast_to(mass_kg, count)[node].copy(),
        node=node,
        axis=axis,
        stiffness_N_m=assembled(stiffness_N_m),
        damping_N_s_m=assembled(damping_N_s_m),
        rest_position_m=0.01 * place,
        fixed=is_fixed,
        triangles=np.zeros((0, 3), dtype=np.int64),
        shape=shape,
    )


def random_system(rng: np.random.Generator, longest: int) -> ContactSystem:
    """A random lattice with at most `longest` nodes along an axis: stiffness and damping of each spring over two decades,
    each without regard to the other, mass of each node over one; random fixed nodes, at a random node."""
    while True:
        flat = rng.random() < 0.5
        width, depth, height = (int(n) for n in rng.integers(2, longest + 1, 3))
        shape = (width, 1 if flat else min(depth, 3), height)
        count = int(np.prod(shape))
        springs = lattice_springs(shape)
        held = rng.permutation(count)[: int(rng.integers(2, max(count // 3, 2) + 1))]
        body = made_body(
            shape,
            springs,
            10.0 ** rng.uniform(1, 3, len(springs)),
            10.0 ** rng.uniform(-1.5, 0.5, len(springs)),
            held,
            10.0 ** rng.uniform(-3.5, -2.5, count),
        )
        free = np.flatnonzero(~body.fixed)
        if len(free) < 6:
            continue
        try:
            return contact_system(body, int(rng.choice(free)))
        except BodyError:  # the fixed nodes cut off a corner, or leave a rotation
            continue


def frequencies_rad_s(system: ContactSystem, count: int) -> Array:
    """From 0 to a decade above the body's own, with the undamped resonances among them."""
    resonances = np.sqrt(np.linalg.eigvalsh(system.stiffness_1_s2.toarray()))
    some = resonances[np.unique(np.linspace(0, len(resonances) - 1, count // 3).astype(int))]
    spread = np.geomspace(0.03 * resonances[0], 10.0 * resonances[-1], count - 1 - len(some))
    return np.unique(np.concatenate([[0.0], spread, some]))


def exact_response(body: LinearBody, contact_node: int, frequency_rad_s: Array) -> Response:
    """(w, m, m): force over displacement of the contact node in N/m, from M, B, K as they are: the free nodes' equations
    with the driven node's displacement and velocity as forces on them, solved for each frequency."""
    driven = body.node == contact_node
    stiffness, damping = body.stiffness_N_m.toarray(), body.damping_N_s_m.toarray()
    out = []
    for w in frequency_rad_s:
        dynamic = stiffness + 1j * w * damping
        free = dynamic[~driven][:, ~driven] - w**2 * np.diag(body.mass_kg[~driven])
        moved = np.linalg.solve(free, -dynamic[~driven][:, driven])
        out.append(dynamic[driven][:, ~driven] @ moved + dynamic[driven][:, driven])
    return np.stack(out)


def exact_strictly_proper(system: ContactSystem, frequency_rad_s: Array) -> Response:
    """(w, m, m): `exact_response` less the terms without states."""
    exact = exact_response(system.body, system.contact_node, frequency_rad_s)
    return np.asarray(exact - np.stack([system.direct(1j * w) for w in frequency_rad_s]))


def largest(response: Response) -> float:
    """The largest 2-norm at any frequency."""
    return float(np.linalg.norm(response, 2, axis=(1, 2)).max())


def h_infinity_N_m(system: StateSpace) -> float:
    """At most 1e-6 of it below the norm, as SLICOT's AB13DD computes it."""
    outputs, inputs = system.d.shape
    peak, _ = slycot.ab13dd(
        "C", "I", "S", "D", system.order, inputs, outputs, system.a, np.eye(system.order), system.b, system.c, system.d,
        1e-6,
    )  # fmt: skip
    return float(peak)
