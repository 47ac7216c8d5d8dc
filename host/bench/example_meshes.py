"""Writes the meshes of the example scenes into scenes/meshes, or the folder that is given: `python host/bench/example_meshes.py [FOLDER]`.

Shapes and regions: palpate.mesh.shapes. A surface, and tetrahedra in two formats, so that the examples cover what is read.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "host/python"))

import meshio  # noqa: E402
import numpy as np  # noqa: E402

from palpate.mesh.shapes import Regions, Surface, liver, skin, sphere  # noqa: E402

_RADIUS_M = 0.04
_MM = 1e3


def write_surface(file: Path, surface: Surface) -> None:
    """In millimetres; not by meshio, which writes the date."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in (_MM * surface.point_m).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (surface.triangles + 1).tolist()]
    file.write_text("\n".join(lines) + "\n", encoding="ascii")


def _as_meshio(body: Regions, name: str, point: np.ndarray) -> meshio.Mesh:
    cells = [("tetra", body.tetrahedra), ("triangle", body.triangles)]
    data = [body.region.astype(np.int32), body.triangle_region.astype(np.int32)]
    used = 2 if len(body.triangles) else 1
    return meshio.Mesh(point, cells[:used], cell_data={name: data[:used]})


def write_gmsh(file: Path, body: Regions) -> None:
    """In metres, with physical groups by name."""
    mesh = _as_meshio(body, "gmsh:physical", np.round(body.point_m, 9))
    mesh.cell_data["gmsh:geometrical"] = mesh.cell_data["gmsh:physical"]
    mesh.field_data = {name: np.array([number, 3]) for number, name in body.names.items()}
    mesh.field_data |= {name: np.array([number, 2]) for number, name in body.triangle_names.items()}
    mesh.write(file, file_format="gmsh22", binary=False, float_fmt=".9g")


def write_vtu(file: Path, body: Regions) -> None:
    """In metres, its regions numbers."""
    _as_meshio(body, "region", np.round(body.point_m, 9)).write(file)


def write_all(folder: Path) -> None:
    """The three of them."""
    folder.mkdir(parents=True, exist_ok=True)
    write_surface(folder / "sphere.obj", sphere(_RADIUS_M))
    write_gmsh(folder / "liver.msh", liver())
    write_vtu(folder / "skin.vtu", skin())


if __name__ == "__main__":
    write_all(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "scenes/meshes")
