"""Stress at the nodes of a body, for pictures."""

import numpy as np
from numpy.typing import NDArray

from palpate.body import Body

Floats = NDArray[np.float64]


class NodalStress:
    """Von Mises stress of each node's virial stress: what a node's springs carry, without their dampers.

    sigma = 1 / (2 V) sum over the node's springs of d f^T, with d (m) from the node to the spring's other end, f (N) the
    spring's pull on the node, and V the volume that is the node's (Admal and Tadmor, Journal of Elasticity 100, 2010,
    equation 5.20, static part). volume_m3: of a mesh (n,); of a lattice that of a cell, also for nodes at the border, which
    have less: there the stress is an underestimate.
    """

    def __init__(self, body: Body, volume_m3: float | Floats) -> None:
        self._first, self._second = body.springs.T.astype(np.intp)
        self._stiffness_N_m = body.spring_stiffness_N_m
        self._length_m = np.linalg.norm(body.rest_m[self._second] - body.rest_m[self._first], axis=1)
        self._nodes = body.node_count
        self._volume_m3 = volume_m3

    def von_mises_Pa(self, position_m: Floats) -> Floats:
        """(n,) of positions (n, 3)."""
        d = position_m[self._second] - position_m[self._first]
        length_m = np.linalg.norm(d, axis=1)
        # Of the pull along d, per metre of d; a spring of no length has no direction.
        pull_N_m = self._stiffness_N_m * (1.0 - self._length_m / np.maximum(length_m, 1e-12))
        sigma = np.empty((6, self._nodes))
        for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))):
            virial = pull_N_m * d[:, i] * d[:, j]  # the same for both ends
            sigma[row] = np.bincount(self._first, virial, self._nodes) + np.bincount(
                self._second, virial, self._nodes
            )
        sigma /= 2.0 * self._volume_m3
        xx, yy, zz, xy, yz, zx = sigma
        deviatoric = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
        shear = xy**2 + yz**2 + zx**2
        return np.sqrt(0.5 * deviatoric + 3.0 * shear)
