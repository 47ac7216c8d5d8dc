"""Prints the table of docs/bodies.md: Young's modulus of a cube of 10 cm as the springs of its mesh give it, of that asked for.

`python host/bench/mesh_modulus.py` (half a minute).
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host/python"))

import numpy as np  # noqa: E402

from palpate.mesh.fill import fill_layers  # noqa: E402
from palpate.mesh.modulus import apparent_modulus_Pa  # noqa: E402
from palpate.mesh.network import Material, make_network, modulus_bounds  # noqa: E402

_SIDE_M = 0.1
_CELLS_M = (0.02, 0.012, 0.008)


def measure(cell_m: float) -> str:
    """A row."""
    point_m, tetrahedra, _ = fill_layers(_SIDE_M, [_SIDE_M], cell_m)
    one = np.ones(len(tetrahedra))
    network = make_network(point_m, tetrahedra, Material(one, one, one), np.zeros(len(point_m), dtype=bool))
    pulled = [apparent_modulus_Pa(network, axis, bonded=False) for axis in range(3)]
    bonded = [apparent_modulus_Pa(network, axis, bonded=True) for axis in range(3)]
    low, high = modulus_bounds(point_m, tetrahedra, one)
    cells = [f"{1e3 * cell_m:g} mm", f"{len(point_m):,}", *(", ".join(f"{x:.3f}" for x in row) for row in (pulled, bonded))]
    return f"| {' | '.join(cells)} | {low.mean():.2f} to {high.mean():.2f} |"


if __name__ == "__main__":
    for each_m in _CELLS_M:
        print(measure(each_m), flush=True)
