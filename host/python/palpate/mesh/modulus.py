"""Young's modulus of a block as its springs give it: pulled at two opposite faces, solved as a static problem."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from palpate.mesh.network import Network

Floats = NDArray[np.float64]

_STRAIN = 1e-3
_ON_FACE = 1e-6  # of the block's length


def stiffness_matrix(network: Network) -> sp.csc_matrix:
    """(3 n, 3 n), N/m: of all nodes at rest, fixed ones too; row 3 i + a is node i along axis a."""
    first, second = network.springs.T
    along = network.rest_position_m[second] - network.rest_position_m[first]
    along /= np.linalg.norm(along, axis=1)[:, None]
    block = network.stiffness_N_m[:, None, None] * np.einsum("si,sj->sij", along, along)
    a, b = (index.ravel() for index in np.meshgrid(range(3), range(3), indexing="ij"))
    rows, columns, values = [], [], []
    for i, j, sign in ((first, first, 1.0), (second, second, 1.0), (first, second, -1.0), (second, first, -1.0)):
        rows.append((3 * i[:, None] + a).ravel())
        columns.append((3 * j[:, None] + b).ravel())
        values.append(sign * block.reshape(-1, 9).ravel())
    size = 3 * len(network.mass_kg)
    return sp.csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))


def apparent_modulus_Pa(network: Network, axis: int, bonded: bool) -> float:
    """Stress over strain of a block between its two faces across `axis`, both plane. bonded: they do not slide, as between plates
    to which they are glued; otherwise they do, without friction."""
    place_m = network.rest_position_m[:, axis]
    low_m, high_m = place_m.min(), place_m.max()
    length_m = high_m - low_m
    bottom = np.flatnonzero(place_m < low_m + _ON_FACE * length_m)
    top = np.flatnonzero(place_m > high_m - _ON_FACE * length_m)
    across = [a for a in range(3) if a != axis]
    held = {3 * int(n) + axis: 0.0 for n in bottom} | {3 * int(n) + axis: _STRAIN * length_m for n in top}
    if bonded:
        held |= {3 * int(n) + a: 0.0 for n in np.concatenate([bottom, top]) for a in across}
    else:  # three that keep it from sliding and turning as a whole
        u, v = (network.rest_position_m[bottom, a] for a in across)
        corner, far = bottom[np.argmin(u + v)], bottom[np.argmax(u - v)]
        held |= {3 * int(corner) + across[0]: 0.0, 3 * int(corner) + across[1]: 0.0, 3 * int(far) + across[1]: 0.0}
    stiffness = stiffness_matrix(network)
    given = np.array(sorted(held))
    free = np.setdiff1d(np.arange(stiffness.shape[0]), given)
    moved_m = np.zeros(stiffness.shape[0])
    moved_m[given] = [held[int(d)] for d in given]
    moved_m[free] = spsolve(stiffness[free][:, free], -stiffness[free][:, given] @ moved_m[given])
    force_N = float((stiffness @ moved_m)[3 * top + axis].sum())
    section_m2 = float(network.volume_m3.sum()) / length_m
    return float(force_N / section_m2 / _STRAIN)
