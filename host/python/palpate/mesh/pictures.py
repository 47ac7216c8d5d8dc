"""Pictures of a mesh: its surface, coloured by the quality of what is below, and the angles of all its tetrahedra."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from palpate.mesh.geometry import FACES

if TYPE_CHECKING:
    from palpate.mesh.command import Report

_MM = 1e3
_COLOURS = "RdYlGn"
_WORST_DEG, _GOOD_DEG = 0.0, 60.0
_MARK = "#b00020"


def draw(file: Path, report: "Report") -> None:
    """Writes a PNG."""
    filled = len(report.tetrahedra) > 0
    figure = Figure(figsize=(13.0, 6.0) if filled else (8.0, 6.0), dpi=120, layout="constrained")
    figure.suptitle(_title(report), fontsize=12)
    grid = figure.add_gridspec(1, 2 if filled else 1, width_ratios=(1.4, 1.0) if filled else (1.0,))
    norm = Normalize(_WORST_DEG, _GOOD_DEG)
    axes = figure.add_subplot(grid[0], projection="3d", computed_zorder=False)
    _draw_surface(axes, report, norm)
    if filled:
        figure.colorbar(ScalarMappable(norm=norm, cmap=_COLOURS), ax=axes, label="smallest angle of the tetrahedron below [°]", shrink=0.7)
        _draw_angles(figure.add_subplot(grid[1]), report)
    figure.savefig(file)


def _title(report: "Report") -> str:
    errors = sum(finding.error for finding in report.findings)
    state = "no problem found" if report.ok else f"{errors} problem{'s' if errors != 1 else ''}" if errors else "cannot be made a body"
    return f"{report.file.name}: {state}"


def _draw_surface(axes: Any, report: "Report", norm: Normalize) -> None:
    point_mm = _MM * report.point_m
    import matplotlib

    if len(report.tetrahedra):
        faces = np.sort(report.tetrahedra[:, FACES].reshape(-1, 3), axis=1)
        quality = np.repeat(np.nan_to_num(report.angles_deg[:, 0]), 4)
        below = dict(zip(map(tuple, faces.tolist()), quality.tolist(), strict=True))
        values = np.array([below[tuple(sorted(triangle))] for triangle in report.triangles.tolist()])
        colour: Any = matplotlib.colormaps[_COLOURS](norm(values))
    else:
        colour = "#cfd6dc"
    axes.add_collection3d(
        Poly3DCollection(point_mm[report.triangles], facecolors=colour, edgecolors="#00000050", linewidths=0.3, zorder=1)
    )
    if report.network is not None and report.network.fixed.any():
        held = report.network.fixed & np.isin(np.arange(len(report.network.fixed)), report.network.triangles)
        axes.scatter(*(_MM * report.network.rest_position_m[held]).T, s=7, color="black", depthshade=False, zorder=2, label="fixed nodes, also behind")
        axes.legend(loc="upper left", fontsize=8)
    low, high = point_mm.min(axis=0), point_mm.max(axis=0)
    axes.set(
        xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]"
    )
    axes.set_box_aspect(np.maximum(high - low, 1e-3 * (high - low).max()))
    axes.view_init(elev=28, azim=-58)


def _draw_angles(axes: Any, report: "Report") -> None:
    angle_deg = report.angles_deg[np.isfinite(report.angles_deg).all(axis=1)]
    bins = np.arange(0.0, 181.0, 5.0)
    axes.hist(angle_deg[:, 0], bins, color="#3f86bd", alpha=0.8, label="smallest of each tetrahedron")
    axes.hist(angle_deg[:, 1], bins, color="#d98200", alpha=0.7, label="largest")
    axes.axvline(70.53, color="black", linewidth=0.8, linestyle="--", label="regular tetrahedron")
    sliver = [finding for finding in report.findings if finding.kind == "sliver"]
    if sliver:
        axes.axvline(float(angle_deg.min()), color=_MARK, linewidth=1.2, label=sliver[0].element)
    axes.set(xlabel="angle between faces [°]", ylabel="tetrahedra", xlim=(0.0, 180.0))
    axes.legend(fontsize=8)
