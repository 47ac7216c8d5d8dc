"""Frequency responses from the contact node's displacement to the force on it, with all terms, in N/m."""

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from palpate.reduce.state_space import StateSpace
from palpate.reduce.system import ContactSystem

Array = NDArray[np.float64]
Response = NDArray[np.complex128]


def direct_response(system: ContactSystem, frequency_rad_s: Array) -> Response:
    """(w, m, m): the part without states."""
    return np.stack([system.direct(1j * float(w)) for w in frequency_rad_s])


def reduced_response(system: ContactSystem, strictly_proper: StateSpace, frequency_rad_s: Array) -> Response:
    """(w, m, m): of a reduced system, the terms without states added."""
    return strictly_proper.response(frequency_rad_s) + direct_response(system, frequency_rad_s)


def full_response(system: ContactSystem, frequency_rad_s: Array, nodes: NDArray[np.bool_] | None = None) -> Response:
    """(w, m, m): of the full model, by a sparse factorization for each frequency. nodes (n,): only these move, all others
    are held: the paper's local model (section 2.3)."""
    free = np.ones(system.size, dtype=bool) if nodes is None else nodes[system.node]
    index = np.flatnonzero(free)
    stiffness, damping = (
        scipy.sparse.csc_array(matrix)[:, index][index] for matrix in (system.stiffness_1_s2, system.damping_1_s)
    )
    identity = scipy.sparse.eye_array(len(index), format="csc")
    out = []
    for w in frequency_rad_s:
        s = 1j * float(w)
        forcing = system.forcing(s)[index].astype(np.complex128)
        indirect = np.zeros((forcing.shape[1],) * 2, dtype=np.complex128)
        if len(index):
            matrix = scipy.sparse.csc_matrix(stiffness + s * damping + s * s * identity)
            factor = scipy.sparse.linalg.splu(
                matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
            indirect = forcing.T @ factor.solve(forcing)
        # `direct` holds the strictly proper part's value at infinite frequency; here that is in `indirect`.
        out.append(system.direct(s) + system.input_damping.T @ system.input_damping - indirect)
    return np.stack(out)


def local_states(system: ContactSystem, nodes: NDArray[np.bool_]) -> int:
    """States of the local model of these nodes (n,)."""
    return 2 * int(np.count_nonzero(nodes[system.node]))


def box(system: ContactSystem, along: int, depth: int) -> NDArray[np.bool_]:
    """(n,): the box of lattice nodes, `along` wide on each axis of the top face and `depth` deep, that has the contact node
    in the middle of its top (of an even number, the higher of the two middle ones), moved as little as needed to lie within
    the lattice: the paper's 4 x 2 and 4 x 4 x 2 neighbourhoods (Figure 7)."""
    body = system.body
    nx, ny, nz = body.shape
    contact = body.coordinates(system.contact_node)
    i, j, k = np.meshgrid(np.arange(nx), np.arange(ny), np.arange(nz), indexing="ij")
    inside = k > contact[2] - depth
    for place, at, count in ((i, contact[0], nx), (j, contact[1], ny)):
        width = min(along, count)
        first = min(max(at - width // 2, 0), count - width)
        inside &= (place >= first) & (place < first + width)
    chosen = np.zeros(nx * ny * nz, dtype=bool)
    chosen[(i + nx * (j + ny * k))[inside]] = True
    return chosen
