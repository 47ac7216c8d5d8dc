"""`palpate mesh`: checks a mesh, or that of a scene, and says and draws what body it makes."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.body import Body
from palpate.mesh.checks import Finding, volume_findings
from palpate.mesh.fill import fill
from palpate.mesh.geometry import boundary, dihedral_angles_deg, enclosed_volume, volumes
from palpate.mesh.load import examine, mesh_file
from palpate.mesh.network import Network, modulus_bounds
from palpate.mesh.read import Mesh, MeshError, read_mesh
from palpate.scene import Scene, SceneError, load_scene, make_scene
from palpate.scene_mesh import BodyMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Of a file that is no scene, nodes up to this part of its height are fixed for the longest step.
_FIXED_PART = 0.1


@dataclass(frozen=True)
class Report:
    """What there is to say of a mesh. point_m, tetrahedra: as built, of a surface those of its fill; without any where it cannot be
    filled, and then triangles are those of the file. network: None where the mesh is no body; problem: why, where that is not a finding."""

    file: Path
    mesh: Mesh
    findings: tuple[Finding, ...]
    point_m: Floats
    tetrahedra: Ints
    triangles: Ints
    network: Network | None
    step_s: float | None
    problem: str

    @property
    def ok(self) -> bool:
        """A scene takes it."""
        return not self.problem and not any(finding.error for finding in self.findings)

    @property
    def angles_deg(self) -> Floats:
        """(t, 2): smallest angle between two faces of each tetrahedron, and the largest."""
        angle_deg = dihedral_angles_deg(self.point_m, self.tetrahedra)
        return np.column_stack([angle_deg.min(axis=1), angle_deg.max(axis=1)])


def examine_file(file: Path, keys: Mapping[str, Any]) -> Report:
    """A mesh file; keys: of [body.mesh] (docs/scenes.md) and damping_ratio, checked. Raises SceneError where it cannot be read."""
    table = {"file": str(file.absolute()), **keys}
    body = {"damping_ratio": table.pop("damping_ratio")} if "damping_ratio" in table else {}
    mesh = BodyMesh(**table)

    def scene_of(point_m: Floats) -> Scene:
        low_m, high_m = point_m[:, 2].min(), point_m[:, 2].max()
        plane = {"point_m": [0.0, 0.0, float(low_m + _FIXED_PART * (high_m - low_m))], "normal": [0.0, 0.0, 1.0]}
        return make_scene({"body": {**body, "mesh": {**table, "fixed_planes": [plane]}}}, name=str(file))

    try:
        return _examined(file, read_mesh(file), mesh, (0.0, 0.0, 0.0), scene_of)
    except MeshError as error:
        raise SceneError(str(error)) from None


def examine_scene(file: Path, overrides: dict[str, Any]) -> Report:
    """The mesh of a scene. Raises SceneError as load_scene does, which names what is wrong with the mesh, and where there is none."""
    scene = load_scene(file, overrides)
    body = scene.sections.body
    mesh = body.mesh
    if mesh is None:
        raise SceneError(f"{file}: body.mesh: missing; must be a table [body.mesh] with at least file")
    return _examined(file, read_mesh(mesh_file(file.parent, mesh)), mesh, body.origin_m, lambda point_m: scene)


def _examined(
    file: Path, mesh: Mesh, given: BodyMesh, origin_m: tuple[float, ...], scene_of: Callable[[Floats], Scene]
) -> Report:
    point_m, nodes, findings = examine(mesh, given.scale_m, origin_m, given.min_angle_deg)
    bad = any(finding.error for finding in findings)
    none: Ints = np.zeros((0, 4), dtype=np.int64)
    if mesh.is_volume:
        tetrahedra, triangles = nodes, boundary(nodes)
    else:
        tetrahedra, triangles = none, nodes
        if not bad:
            try:
                point_m, tetrahedra = fill(point_m, nodes, given.cell_m)
            except MeshError as error:
                return Report(file, mesh, tuple(findings), point_m, none, triangles, None, None, str(error))
            triangles = boundary(tetrahedra)
            findings += volume_findings(point_m, tetrahedra, given.min_angle_deg)
            bad = any(finding.error for finding in findings)
    if bad:
        return Report(file, mesh, tuple(findings), point_m, tetrahedra, triangles, None, None, "")
    try:
        scene = scene_of(point_m)
        step_s = Body(scene).stable_step_s()
    except SceneError as error:
        return Report(file, mesh, tuple(findings), point_m, tetrahedra, triangles, None, None, str(error))
    return Report(file, mesh, tuple(findings), point_m, tetrahedra, triangles, scene.network, step_s, "")


def to_dict(report: Report) -> dict[str, Any]:
    """For --json and mesh.json; lengths in m, angles in degrees."""
    mesh = report.mesh
    values: dict[str, Any] = {
        "command": "mesh",
        "file": str(report.file),
        "ok": report.ok,
        "kind": "volume" if mesh.is_volume else "surface",
        "file_nodes": len(mesh.point),
        "file_tetrahedra": len(mesh.tetrahedra.nodes),
        "file_triangles": len(mesh.triangles.nodes),
        "regions": {
            name: int(np.count_nonzero(mesh.tetrahedra.region == i) + np.count_nonzero(mesh.triangles.region == i))
            for i, name in enumerate(mesh.regions)
        },
        "low_m": report.point_m.min(axis=0).tolist(),
        "high_m": report.point_m.max(axis=0).tolist(),
        "findings": [asdict(finding) for finding in report.findings],
        "problem": report.problem,
        "tetrahedra": len(report.tetrahedra),
        "triangles": len(report.triangles),
    }
    if len(report.tetrahedra):
        angle_deg = report.angles_deg
        values |= {
            "volume_m3": float(volumes(report.point_m, report.tetrahedra).sum()),
            "smallest_angle_deg": _number(np.nanmin(angle_deg[:, 0])),
            "median_smallest_angle_deg": _number(np.nanmedian(angle_deg[:, 0])),
            "largest_angle_deg": _number(np.nanmax(angle_deg[:, 1])),
        }
    elif not mesh.is_volume:
        values["volume_m3"] = abs(enclosed_volume(report.point_m, report.triangles))
    network = report.network
    if network is not None:
        low, high = modulus_bounds(report.point_m, report.tetrahedra, np.ones(len(report.tetrahedra)))
        values |= {
            "nodes": len(network.mass_kg),
            "fixed_nodes": int(np.count_nonzero(network.fixed)),
            "springs": len(network.springs),
            "mass_kg": float(network.mass_kg.sum()),
            "node_mass_kg": _range(network.mass_kg),
            "stiffness_N_m": _range(network.stiffness_N_m),
            "damping_N_s_m": _range(network.damping_N_s_m),
            "length_m": _range(network.rest_length_m),
            "longest_stable_step_s": report.step_s,
            "modulus_from": low.tolist(),
            "modulus_to": high.tolist(),
        }
    return values


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def _range(values: Floats) -> list[float]:
    """Smallest, median, largest."""
    return [float(values.min()), float(np.median(values)), float(values.max())]


def lines(values: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Names and values of a table, of `to_dict`, without findings."""
    size_mm = [1e3 * (high - low) for low, high in zip(values["low_m"], values["high_m"], strict=True)]
    yield "file", f"{values['file_nodes']:,} nodes, {values['file_tetrahedra']:,} tetrahedra, {values['file_triangles']:,} triangles"
    if values["regions"]:
        yield "regions", ", ".join(f"{name} ({count:,})" for name, count in values["regions"].items())
    yield "size", " x ".join(f"{side:.4g}" for side in size_mm) + " mm"
    if "volume_m3" in values:
        yield "volume", f"{1e6 * values['volume_m3']:.4g} cm³"
    if values["kind"] == "surface" and values["tetrahedra"]:
        yield "filled", f"{values['tetrahedra']:,} tetrahedra, {values['triangles']:,} triangles on the surface"
    if "smallest_angle_deg" in values and values["smallest_angle_deg"] is not None:
        yield "angles between faces", (
            f"{values['smallest_angle_deg']:.1f} to {values['largest_angle_deg']:.1f} degrees, median of the smallest "
            f"{values['median_smallest_angle_deg']:.1f}"
        )
    if "springs" not in values:
        return
    yield "body", f"{values['nodes']:,} nodes, {values['fixed_nodes']:,} of them fixed, {values['springs']:,} springs"
    yield "mass", f"{1e3 * values['mass_kg']:.4g} g"
    for name, key, unit, factor in (
        ("mass of a node", "node_mass_kg", "g", 1e3),
        ("stiffness of a spring", "stiffness_N_m", "N/m", 1.0),
        ("damping of a spring", "damping_N_s_m", "N s/m", 1.0),
        ("length of a spring", "length_m", "mm", 1e3),
    ):
        low, middle, high = (factor * value for value in values[key])
        yield name, f"{low:.3g} to {high:.3g}, median {middle:.3g} {unit}"
    yield "longest stable step", f"{1e6 * values['longest_stable_step_s']:.0f} µs"
    ranges = [f"{low:.2f} to {high:.2f}" for low, high in zip(values["modulus_from"], values["modulus_to"], strict=True)]
    yield "modulus, of that asked for", f"x {ranges[0]}, y {ranges[1]}, z {ranges[2]} (bounds)"


def write(report: Report, values: dict[str, Any], folder: Path) -> list[Path]:
    """mesh.json and mesh.png."""
    from palpate.mesh.pictures import draw

    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / "mesh.json", folder / "mesh.png"]
    files[0].write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    draw(files[1], report)
    return files
