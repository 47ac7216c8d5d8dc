"""The linear system between the displacement of one node and the force on it (section 2.2 of the paper).

The body at rest, without load, the contact node driven and all others free or fixed. With x the displacements of the
free nodes, u that of the contact node and f the force that moves it so, against its springs and dampers (theirs on it is
-f; the contact node's own inertia is left out: it has no states):

    M x'' + B x' + K x = -(K_c u + B_c u')
    f = K_c^T x + B_c^T x' + K_cc u + B_cc u'

The input enters with its derivative too, for dampers end at the driven node. It is taken away by the state
w = x' + M^-1 B_c u in the place of x', exactly:

    x' = w - M^-1 B_c u
    w' = -M^-1 (K x + B w + (K_c - B M^-1 B_c) u)
    f  = K_c^T x + B_c^T w + (K_cc - B_c^T M^-1 B_c) u + B_cc u'

The first two terms of f are the strictly proper part, the only one that has states; the others are kept as they are.
Everything here is mass-normalized: x stands for M^(1/2) x, K for M^(-1/2) K M^(-1/2), and so on.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from palpate.reduce.cholesky import NotPositiveDefiniteError, ShiftedCholesky

Array = NDArray[np.float64]

# Relative room between an eigenvalue that iteration found and the bound below it that a factorization confirms.
_EIGENVALUE_MARGIN = 1e-6
# An eigenvalue below this part of the largest is zero but for rounding.
_ROUNDING = 1e-12


class BodyError(ValueError):
    """The body has no such system; the message says which node or motion is at fault."""


@dataclass(frozen=True)
class LinearBody:
    """A body at rest. d degrees of freedom of free nodes, n nodes; device frame.

    mass_kg (d,); node, axis (d,): of each degree of freedom; stiffness_N_m, damping_N_s_m (d, d): -df/dX and -df/dV;
    rest_position_m (n, 3); fixed (n,); triangles (t, 3): nodes of the outer surface; shape (3,): nodes of the lattice along
    x, y, z.
    """

    mass_kg: Array
    node: NDArray[np.int64]
    axis: NDArray[np.int64]
    stiffness_N_m: sp.csc_matrix
    damping_N_s_m: sp.csc_matrix
    rest_position_m: Array
    fixed: NDArray[np.bool_]
    triangles: NDArray[np.int64]
    shape: tuple[int, int, int]

    def coordinates(self, node: int) -> tuple[int, int, int]:
        """Where a node is in the lattice: i, j, k."""
        nx, ny, _ = self.shape
        return node % nx, node // nx % ny, node // (nx * ny)


def linear_body(core: Any, scene: dict[str, Any]) -> LinearBody:
    """The linear body of a scene (`Scene.to_dict`). ValueError: from the core. BodyError: for a mesh."""
    raw = core.linear_body(scene)
    if not len(raw["nodes"]):
        raise BodyError("body.mesh: given; must be left out, with body.nodes in its place: reductions are of lattices only")
    size = (len(raw["mass_kg"]),) * 2

    def matrix(name: str) -> sp.csc_matrix:
        parts = raw[name]
        return sp.csc_matrix((parts["data"], parts["indices"], parts["indptr"]), shape=size)

    shape = raw["nodes"]
    return LinearBody(
        mass_kg=raw["mass_kg"],
        node=np.asarray(raw["node"], dtype=np.int64),
        axis=np.asarray(raw["axis"], dtype=np.int64),
        stiffness_N_m=matrix("stiffness"),
        damping_N_s_m=matrix("damping"),
        rest_position_m=raw["rest_position_m"],
        fixed=np.asarray(raw["fixed"], dtype=bool),
        triangles=np.asarray(raw["triangles"], dtype=np.int64),
        shape=(int(shape[0]), int(shape[1]), int(shape[2])),
    )


@dataclass(frozen=True)
class SecondOrder:
    """x'' + damping x' + stiffness x = -(input_stiffness u + input_damping u'), f = input_stiffness^T x +
    input_damping^T x': the strictly proper part is what a state space of it gives.

    d degrees of freedom, m inputs; mass-normalized. stiffness_1_s2, damping_1_s (d, d), sparse or dense; input_stiffness,
    input_damping (d, m), in N/m and N s/m times kg^(-1/2).
    """

    stiffness_1_s2: Any
    damping_1_s: Any
    input_stiffness: Array
    input_damping: Array

    @property
    def size(self) -> int:
        """Degrees of freedom; half the states."""
        return int(self.input_stiffness.shape[0])

    def forcing(self, s: complex) -> NDArray[Any]:
        """(d, m): what drives x, up to its sign, at the complex frequency s in rad/s."""
        return np.asarray(self.input_stiffness + s * self.input_damping)


@dataclass(frozen=True)
class ContactSystem(SecondOrder):
    """The body as its contact node sees it. node, axis (d,): of each degree of freedom; contact_node; contact_axes: of
    inputs and outputs; direct_stiffness_N_m, direct_damping_N_s_m (m, m): of the terms without states, K_cc and B_cc;
    mass_kg (d,).

    slowest_1_s2: no eigenvalue of the stiffness is smaller; fastest_1_s2: the largest, to 0.1 %; damped_1_s: no
    eigenvalue of the damping is smaller. time_s: wall clock that all this took, from the body's matrices on.
    """

    body: LinearBody
    contact_node: int
    contact_axes: tuple[int, ...]
    node: NDArray[np.int64]
    axis: NDArray[np.int64]
    mass_kg: Array
    direct_stiffness_N_m: Array
    direct_damping_N_s_m: Array
    slowest_1_s2: float
    fastest_1_s2: float
    damped_1_s: float
    time_s: float

    @property
    def states(self) -> int:
        """States of the full model: displacements and velocities of all free nodes but the contact's."""
        return 2 * self.size

    def direct(self, s: complex) -> NDArray[np.complex128]:
        """(m, m), N/m: what the force has beside the strictly proper part, at s in rad/s."""
        proper = self.direct_stiffness_N_m - self.input_damping.T @ self.input_damping
        return np.asarray(proper + s * self.direct_damping_N_s_m, dtype=np.complex128)


def contact_system(body: LinearBody, contact_node: int) -> ContactSystem:
    """The system of one node of the body. Raises BodyError for a node that is fixed or does not exist, a body that
    something unsupported belongs to, and one whose motions are not all damped."""
    start_s = time.perf_counter()
    count = len(body.fixed)
    if not 0 <= contact_node < count:
        raise BodyError(f"node {contact_node}: must be in [0, {count - 1}]")
    name = f"node {body.coordinates(contact_node)}"
    if body.fixed[contact_node]:
        raise BodyError(f"{name}: is fixed; the contact node must be a free one")
    driven = body.node == contact_node
    inner = np.flatnonzero(~driven)
    outer = np.flatnonzero(driven)
    if len(inner) == 0:
        raise BodyError(f"{name}: no other node is free, so nothing has states")
    scale = sp.diags_array(1.0 / np.sqrt(body.mass_kg[inner]))

    def parts(matrix: sp.csc_matrix) -> tuple[sp.csc_matrix, Array, Array]:
        columns = matrix[:, outer]
        free = sp.csc_matrix(scale @ matrix[inner][:, inner] @ scale)
        return free, scale @ columns[inner].toarray(), columns[outer].toarray()

    stiffness, input_stiffness, direct_stiffness = parts(body.stiffness_N_m)
    damping, input_damping, direct_damping = parts(body.damping_N_s_m)
    _require_connected(body, name, contact_node)
    factor = ShiftedCholesky(stiffness, damping)
    slowest_1_s2 = _least_stiffness(body, inner, factor)
    fastest_1_s2 = _largest_eigenvalue(stiffness)
    damped_1_s = _least_damping(body, inner, factor)
    return ContactSystem(
        stiffness_1_s2=stiffness,
        damping_1_s=damping,
        input_stiffness=input_stiffness,
        input_damping=input_damping,
        body=body,
        contact_node=contact_node,
        contact_axes=tuple(int(axis) for axis in body.axis[outer]),
        node=body.node[inner],
        axis=body.axis[inner],
        mass_kg=body.mass_kg[inner],
        direct_stiffness_N_m=direct_stiffness,
        direct_damping_N_s_m=direct_damping,
        slowest_1_s2=slowest_1_s2,
        fastest_1_s2=fastest_1_s2,
        damped_1_s=damped_1_s,
        time_s=time.perf_counter() - start_s,
    )


def middle_of_top(body: LinearBody) -> int:
    """The free node on the top face of the lattice that is nearest to its middle; of several, the first. The paper's
    contact node (section 2.2). Raises BodyError where none is free."""
    nx, ny, nz = body.shape
    middle = np.array([(nx - 1) / 2, (ny - 1) / 2])
    top = [node for node in range(nx * ny * (nz - 1), nx * ny * nz) if not body.fixed[node]]
    if not top:
        raise BodyError("no node of the top face is free; name the contact node")
    return min(top, key=lambda node: float(np.sum((np.array(body.coordinates(node)[:2]) - middle) ** 2)))


def _require_connected(body: LinearBody, name: str, contact_node: int) -> None:
    """Every free node must be joined with the contact node by springs."""
    entries = body.stiffness_N_m.tocoo()
    count = len(body.fixed)
    graph = sp.coo_array((np.ones(entries.nnz), (body.node[entries.row], body.node[entries.col])), shape=(count, count))
    _, part = connected_components(graph, directed=False)
    apart = np.flatnonzero((part != part[contact_node]) & ~body.fixed)
    if len(apart):
        raise BodyError(
            f"node {body.coordinates(int(apart[0]))}: is one of {len(apart)} free nodes that no springs connect with the "
            f"contact, {name}; the free part of the body must be in one piece"
        )


def _least_stiffness(body: LinearBody, inner: NDArray[np.int64], factor: ShiftedCholesky) -> float:
    try:
        return _least_eigenvalue(factor, 1.0, 0.0)
    except NotPositiveDefiniteError:
        pass
    hint = "" if body.fixed.any() else "; the body has no fixed node"
    motion = _softest_node(factor.stiffness, body.node[inner])
    raise BodyError(
        f"the body has a motion that no spring resists, largest at node {body.coordinates(motion)}{hint}: unstable or "
        "unconstrained bodies have no balanced reduction"
    )


def _least_damping(body: LinearBody, inner: NDArray[np.int64], factor: ShiftedCholesky) -> float:
    try:
        return _least_eigenvalue(factor, 0.0, 1.0)
    except NotPositiveDefiniteError:
        pass
    motion = _softest_node(factor.damping, body.node[inner])
    raise BodyError(
        f"the body has a motion that no damper resists, largest at node {body.coordinates(motion)}: its vibration never "
        "ends, and balanced reduction needs one that does; give every spring some damping (body.damping_ratio above 0)"
    )


def _softest_node(matrix: sp.csc_matrix, node: NDArray[np.int64]) -> int:
    """The node that moves most where the stiffness (or damping) resists least."""
    # Inverse iteration on a slightly stiffer body: the free motion grows by far the most.
    scale = float(abs(matrix).sum(axis=0).max()) or 1.0
    shifted = ShiftedCholesky(sp.csc_matrix(matrix + 1e-6 * scale * sp.eye_array(matrix.shape[0])), None)
    try:
        solve = shifted.factor(1.0, 0.0)
    except NotPositiveDefiniteError:  # a spring that pushes: name the node that it pushes most
        return int(node[int(np.argmin(matrix.diagonal()))])
    motion = np.random.default_rng(1).standard_normal((matrix.shape[0], 1))
    for _ in range(5):
        motion = solve(motion / np.linalg.norm(motion))
    return int(node[int(np.argmax(np.abs(motion[:, 0])))])


def _largest_eigenvalue(matrix: sp.csc_matrix) -> float:
    if matrix.shape[0] < 20:
        return float(np.linalg.eigvalsh(matrix.toarray())[-1])
    start = np.random.default_rng(1).standard_normal(matrix.shape[0])
    return float(sp.linalg.eigsh(matrix, k=1, tol=1e-3, v0=start, return_eigenvectors=False)[0])


def _least_eigenvalue(factor: ShiftedCholesky, stiffness: float, damping: float) -> float:
    """A bound below the eigenvalues of stiffness K + damping B, confirmed by a Cholesky factorization of the matrix less
    the bound; at most one part in a million too low. Raises NotPositiveDefiniteError."""
    size = factor.stiffness.shape[0]
    matrix = stiffness * factor.stiffness + damping * factor.damping
    rounding = _ROUNDING * float(abs(matrix).sum(axis=0).max())
    solve = factor.factor(stiffness, damping)
    if size < 20:
        least = float(np.linalg.eigvalsh(matrix.toarray())[0])
    else:
        inverse = sp.linalg.LinearOperator((size, size), matvec=lambda x: solve(x.reshape(-1, 1))[:, 0], dtype=float)
        start = np.random.default_rng(1).standard_normal(size)
        least = 1.0 / float(sp.linalg.eigsh(inverse, k=1, tol=1e-8, v0=start, return_eigenvectors=False)[0])
    if least <= rounding:
        raise NotPositiveDefiniteError
    bound = least * (1.0 - _EIGENVALUE_MARGIN)
    factor.factor(stiffness, damping, -bound)
    return bound
