"""Pictures of an experiment, from plain arrays: forces over time, and the deformed body."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

matplotlib.use("Agg")

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from palpate.record_layout import CONTACT_MODES

Array = NDArray[Any]

_MODE_COLOURS = ("#f2f2f2", "#a8d5a2", "#f6c177")  # free, stick, slip
_NORMAL, _TANGENTIAL, _NORMAL_LIGHT, _TANGENTIAL_LIGHT = "#17508f", "#a3201a", "#9cc3ea", "#f0aaa5"
_CONE, _ERROR, _AGE = "#6b6b6b", "#7a1fa2", "#3a3a3a"
# Light where nothing moves, so that the mesh stays visible; lightness falls steadily, so that it also prints in grey.
_DEFORMATION = LinearSegmentedColormap.from_list(
    "deformation", ["#cfd6dc", "#8fbcdc", "#3f86bd", "#28529c", "#4b1566", "#2a0632"]
)
_MARK = "#d98200"
_MOST_SHADES = 500
_MM = 1e3
_TICK_S = 1e-3
# Shorter ones are overlong ticks of the board: a line may go straight over them.
_LONG_GAP_S = 4.5e-3


@dataclass(frozen=True)
class ForceTrace:
    """Tip force on the body and contact mode over time. force_N: (n, 3), device frame; contact_mode: (n,) 0, 1, 2.
    normal: (n, 3), outward surface normal at the contact (NaN or zero: none), for splitting the force."""

    force_N: Array
    contact_mode: Array
    normal: Array


@dataclass(frozen=True)
class Marks:
    """Spans of time to mark, by what they are: (from_s, to_s) each. causes: those of which the forces are shaded."""

    rows: Mapping[str, Sequence[tuple[float, float]]]
    causes: tuple[str, ...]


@dataclass(frozen=True)
class BodyShape:
    """A body in two states. rest_m, position_m: (nodes, 3); triangles: (t, 3) node indices; lattice: its nodes along
    x, y, z (numbered with x fastest), of which y has one in two dimensions, None of a mesh; patch_nodes: (p,) node indices."""

    rest_m: Array
    position_m: Array
    triangles: Array
    lattice: tuple[int, int, int] | None
    patch_nodes: Array


def with_breaks(time_s: Array, *columns: Array) -> list[Array]:
    """The times (n,) and columns (n, ...), with a row of NaN in each long gap of the times, so that no line crosses it."""
    gaps = np.flatnonzero(np.diff(time_s) > _LONG_GAP_S) + 1
    if not len(gaps):
        return [time_s, *columns]
    return [
        np.insert(time_s, gaps, time_s[gaps]),
        *(np.insert(column.astype(np.float64), gaps, np.nan, axis=0) for column in columns),
    ]


def split_force(force_N: Array, normal: Array) -> tuple[Array, Array]:
    """Pressing part along the inward normal and magnitude of the rest, in N. force_N, normal: (n, 3); normals point
    out of the body and are of unit length; where one is NaN or zero the whole force counts as pressing."""
    known: Array = np.all(np.isfinite(normal), axis=1) & np.any(normal != 0.0, axis=1)
    pressing_N = np.where(known, -np.einsum("ij,ij->i", force_N, normal), np.linalg.norm(force_N, axis=1))
    tangential_N = np.where(known[:, None], force_N + pressing_N[:, None] * normal, 0.0)
    return pressing_N, np.linalg.norm(tangential_N, axis=1)


def save_forces(
    file: Path,
    *,
    title: str,
    time_s: Array,
    rendered: ForceTrace,
    friction: Array,
    reference: ForceTrace | None = None,
    model_age_ticks: Array | None = None,
    rendered_name: str = "firmware",
    reference_name: str = "full body",
    error_name: str = "error",
    marks: Marks | None = None,
) -> None:
    """Draws normal and tangential force with the friction cone, contact modes, error and model age over time.

    time_s: (n,). friction: (n, 2), static and kinetic coefficient of the triangle that is touched (0 when free).
    model_age_ticks: (n,), NaN where no model was rendered.
    marks: a strip of its own, a row for each of its spans, and a shade behind the forces.
    """
    marked = marks is not None and len(marks.rows) > 0
    heights = [4.0, 0.5] + ([0.12 + 0.16 * len(marks.rows)] if marks is not None and marked else []) + ([1.6] if reference else []) + ([1.3] if model_age_ticks is not None else [])
    figure = Figure(figsize=(11.0, 1.1 + 1.05 * sum(heights)), dpi=130, layout="constrained")
    panels = list(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0])
    figure.suptitle(title, fontsize=12)
    _draw_forces(panels[0], time_s, rendered, friction, reference, (rendered_name, reference_name))
    _draw_modes(panels[1], time_s, rendered, reference, (rendered_name, reference_name))
    rest = panels[2:]
    if marks is not None and marked:
        _draw_marks(rest.pop(0), panels[0], marks)
    if reference is not None:
        _draw_error(rest.pop(0), time_s, rendered, reference, error_name)
    if model_age_ticks is not None:
        _draw_age(rest.pop(0), time_s, model_age_ticks)
    panels[-1].set_xlabel("virtual time [s]")
    panels[-1].set_xlim(min(0.0, float(time_s[0])), float(time_s[-1]))
    figure.savefig(file)


def _draw_forces(
    axes: Axes,
    time_s: Array,
    rendered: ForceTrace,
    friction: Array,
    reference: ForceTrace | None,
    names: tuple[str, str],
) -> None:
    line_s, pressing_N, tangential_N = with_breaks(time_s, *split_force(rendered.force_N, rendered.normal))
    if friction.any():
        _draw_cone(axes, line_s, pressing_N, *with_breaks(time_s, friction)[1:])
    lengths_N = [np.linalg.norm(rendered.force_N, axis=1)]
    if reference is not None:  # broad and light, below the rendered forces: where they agree both are seen
        _, normal_N, tangent_N = with_breaks(time_s, *split_force(reference.force_N, reference.normal))
        axes.plot(line_s, normal_N, color=_NORMAL_LIGHT, linewidth=2.6, label=rf"$f_n$, {names[1]}")
        axes.plot(line_s, tangent_N, color=_TANGENTIAL_LIGHT, linewidth=2.6, label=rf"$|f_t|$, {names[1]}")
        lengths_N.append(np.linalg.norm(reference.force_N, axis=1))
    axes.plot(line_s, pressing_N, color=_NORMAL, linewidth=0.8, label=rf"normal $f_n$, {names[0]}")
    label = rf"tangential $|f_t|$, {names[0]}"
    axes.plot(line_s, tangential_N, color=_TANGENTIAL, linewidth=0.8, label=label)
    # A wide friction cone may leave the picture: the forces must not shrink for it.
    largest_N = max(1e-3, *(float(length_N.max()) for length_N in lengths_N))
    axes.set_ylim(-0.03 * largest_N, 1.1 * largest_N)
    axes.set_ylabel("force of the tip [N]")
    axes.grid(alpha=0.25)
    axes.legend(loc="upper right", fontsize=8, framealpha=0.9)


def _draw_cone(axes: Axes, time_s: Array, pressing_N: Array, friction: Array) -> None:
    static, kinetic = friction.T
    touching = np.nan_to_num(static) > 0.0
    different = np.unique(friction[touching], axis=0)
    label = rf"friction cone: {different[0, 0]:g} $f_n$"
    if len(different) > 1:
        label = r"friction cone $\mu f_n$ of the triangle touched"
    elif different[0, 0] != different[0, 1]:
        label = rf"friction cones: {different[0, 0]:g} $f_n$ (static), {different[0, 1]:g} $f_n$ (kinetic)"
    if not np.array_equal(static[touching], kinetic[touching]):
        axes.plot(time_s, kinetic * pressing_N, color=_CONE, linewidth=0.9, linestyle=(0, (1, 1.5)))
    axes.fill_between(time_s, 0.0, static * pressing_N, color=_CONE, alpha=0.10, linewidth=0)
    axes.plot(time_s, static * pressing_N, color=_CONE, linewidth=0.9, linestyle=(0, (4, 2)), label=label)


def _draw_modes(
    axes: Axes, time_s: Array, rendered: ForceTrace, reference: ForceTrace | None, names: tuple[str, str]
) -> None:
    rows = [(names[0], rendered.contact_mode)] + ([(names[1], reference.contact_mode)] if reference else [])
    tick = np.rint(time_s / _TICK_S).astype(np.int64)
    strip = np.full((len(rows), int(tick[-1] - tick[0]) + 1), np.nan)  # white where a record has no tick
    for i, (_, mode) in enumerate(rows):
        strip[i, tick - tick[0]] = mode
    axes.imshow(
        strip,
        aspect="auto",
        interpolation="nearest",
        cmap=ListedColormap(_MODE_COLOURS),
        vmin=0,
        vmax=2,
        extent=(_TICK_S * (tick[0] - 0.5), _TICK_S * (tick[-1] + 0.5), len(rows) - 0.5, -0.5),
    )
    axes.hlines(np.arange(1, len(rows)) - 0.5, *axes.get_xlim(), color="white", linewidth=2.0)
    axes.set_yticks(range(len(rows)), [row for row, _ in rows], fontsize=8)
    axes.set_ylabel("contact", rotation=0, ha="right", va="center", labelpad=4)
    handles = [
        Patch(facecolor=colour, edgecolor="#999999", linewidth=0.5, label=mode)
        for mode, colour in zip(CONTACT_MODES, _MODE_COLOURS, strict=True)
    ]
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)


def _draw_marks(axes: Axes, forces: Axes, marks: Marks) -> None:
    for i, (what, spans) in enumerate(marks.rows.items()):
        colour = _MARK if what in marks.causes else _CONE
        # A tick is narrower than a pixel of a long run: the edge stays.
        axes.broken_barh([(a, b - a) for a, b in spans], (i - 0.35, 0.7), facecolor=colour, edgecolor=colour, linewidth=0.6)
        if what in marks.causes:
            for begin_s, end_s in spans[:_MOST_SHADES]:
                forces.axvspan(begin_s, end_s, color=_MARK, alpha=0.10, linewidth=0.3, zorder=0)
    axes.set_yticks(range(len(marks.rows)), list(marks.rows), fontsize=8)
    axes.set_ylim(len(marks.rows) - 0.5, -0.5)
    axes.set_ylabel("faults", rotation=0, ha="right", va="center", labelpad=4)


def _draw_error(axes: Axes, time_s: Array, rendered: ForceTrace, reference: ForceTrace, name: str) -> None:
    error_mN = _MM * np.linalg.norm(rendered.force_N - reference.force_N, axis=1)
    axes.plot(*with_breaks(time_s, error_mN), color=_ERROR, linewidth=0.9)
    axes.set_ylabel(f"{name} [mN]")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.25)


def _draw_age(axes: Axes, time_s: Array, model_age_ticks: Array) -> None:
    axes.plot(*with_breaks(time_s, model_age_ticks), color=_AGE, linewidth=0.8)
    axes.set_ylabel("age of the\nmodel [ms]")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.25)


def save_body(
    file: Path,
    *,
    title: str,
    body: BodyShape,
    tip_m: Array | None = None,
    tip_radius_m: float = 0.0,
    path_m: Array | None = None,
) -> None:
    """Draws the deformed body, coloured by displacement, with the patch, the tool and its path.

    tip_m: (3,); path_m: (n, 3), the tip's path. A body in three dimensions is drawn as a whole and as the section
    through the layer of nodes nearest to the tip, of a mesh the outline of its section through the tip; a sheet only as the
    latter.
    """
    displacement_mm = _MM * np.linalg.norm(body.position_m - body.rest_m, axis=1)
    norm = Normalize(0.0, max(float(displacement_mm.max()), 1e-6))
    whole = body.lattice is None or body.lattice[1] > 1
    figure = Figure(figsize=(14.0, 6.6) if whole else (8.6, 7.0), dpi=120, layout="constrained")
    figure.suptitle(title, fontsize=12)
    if whole:
        grid = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
        _draw_surface(
            figure.add_subplot(grid[0], projection="3d", computed_zorder=False),
            body,
            displacement_mm,
            norm,
            tip_m,
            tip_radius_m,
            path_m,
        )
        section = figure.add_subplot(grid[1])
    else:
        section = figure.add_subplot()
    _draw_section(section, body, displacement_mm, norm, tip_m, tip_radius_m, path_m)
    colours = matplotlib.cm.ScalarMappable(norm=norm, cmap=_DEFORMATION)
    figure.colorbar(colours, ax=section, label="displacement of the nodes [mm]", shrink=0.8)
    figure.savefig(file, bbox_inches="tight", pad_inches=0.15)


def _draw_surface(
    axes: Any,
    body: BodyShape,
    displacement_mm: Array,
    norm: Normalize,
    tip_m: Array | None,
    tip_radius_m: float,
    path_m: Array | None,
) -> None:
    points_mm = _MM * body.position_m
    colour = _DEFORMATION(norm(displacement_mm[body.triangles].mean(axis=1)))
    surface = Poly3DCollection(
        points_mm[body.triangles], facecolors=colour, edgecolors="#00000040", linewidths=0.3, zorder=1
    )
    axes.add_collection3d(surface)
    top = (
        body.patch_nodes[np.isin(body.patch_nodes, body.triangles)]
        if len(body.patch_nodes)
        else body.patch_nodes
    )
    if len(top):
        axes.scatter(
            *points_mm[top].T,
            s=16,
            color="white",
            edgecolors=_TANGENTIAL,
            linewidths=1.1,
            depthshade=False,
            zorder=3,
            label="patch (surface nodes)",
        )
    extent = [points_mm]
    if path_m is not None:
        axes.plot(*(_MM * path_m.T), color="black", linewidth=1.2, zorder=4, label="path of the tip")
        extent.append(_MM * path_m)
    if tip_m is not None:
        axes.scatter(
            *(_MM * tip_m),
            s=60,
            color=_TANGENTIAL,
            edgecolors="black",
            depthshade=False,
            zorder=5,
            label="tip",
        )
        if tip_radius_m > 0.0:
            axes.add_collection3d(_sphere_mm(tip_m, tip_radius_m))
    corners = np.concatenate(extent)
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.set(
        xlim=(low[0], high[0]),
        ylim=(low[1], high[1]),
        zlim=(low[2], high[2]),
        xlabel="x [mm]",
        ylabel="y [mm]",
        zlabel="z [mm]",
    )
    axes.set_box_aspect(np.maximum(high - low, 1e-6))
    axes.view_init(elev=32, azim=-58)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", fontsize=8)


def _sphere_mm(centre_m: Array, radius_m: float) -> Poly3DCollection:
    polar, around = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 25), indexing="ij")
    unit = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    grid = _MM * (centre_m + radius_m * unit)
    faces = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    return Poly3DCollection(faces, facecolors=_TANGENTIAL, edgecolors="none", alpha=0.45, zorder=4)


def _draw_section(
    axes: Axes,
    body: BodyShape,
    displacement_mm: Array,
    norm: Normalize,
    tip_m: Array | None,
    tip_radius_m: float,
    path_m: Array | None,
) -> None:
    if body.lattice is None:
        title = _draw_outline(axes, body, norm, tip_m)
    else:
        title = _draw_layer(axes, body, body.lattice, displacement_mm, norm, tip_m)
    if path_m is not None:
        axes.plot(
            *(_MM * path_m[:, [0, 2]].T), color="black", linewidth=1.0, zorder=5, label="path of the tip"
        )
    if tip_m is not None:
        centre = (float(_MM * tip_m[0]), float(_MM * tip_m[2]))
        if tip_radius_m > 0.0:
            axes.add_patch(Circle(centre, _MM * tip_radius_m, facecolor=_TANGENTIAL, alpha=0.35, zorder=5))
        axes.plot(
            *centre, "o", markersize=7, color=_TANGENTIAL, markeredgecolor="black", zorder=6, label="tip"
        )
    axes.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal")
    axes.set_title(title, fontsize=10)
    axes.autoscale_view()
    axes.margins(0.05)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=3, fontsize=8, frameon=False)


def _draw_outline(axes: Axes, body: BodyShape, norm: Normalize, tip_m: Array | None) -> str:
    """Where the surface at rest crosses the plane of constant y of the tip, at rest and now."""
    y_m = float(np.median(body.rest_m[:, 1])) if tip_m is None else float(tip_m[1])
    y_m = float(np.clip(y_m, *np.quantile(body.rest_m[:, 1], [0.02, 0.98])))
    rest_m, now_m = _crossings(body, y_m)
    moved_mm = _MM * np.linalg.norm(now_m - rest_m, axis=2).mean(axis=1)
    axes.add_collection(
        LineCollection(list(_MM * rest_m[:, :, [0, 2]]), colors="#b8b8b8", linewidths=1.0, zorder=1)
    )
    axes.add_collection(
        LineCollection(list(_MM * now_m[:, :, [0, 2]]), array=moved_mm, norm=norm, cmap=_DEFORMATION, linewidths=2.2, zorder=2)
    )
    return f"outline at y = {_MM * y_m:.1f} mm (grey: at rest)"


def _crossings(body: BodyShape, y_m: float) -> tuple[Array, Array]:
    """(s, 2, 3) twice: ends of the lines in which a plane cuts triangles at rest, there and where the same points are now."""
    side = body.rest_m[body.triangles][:, :, 1] - y_m
    rest, now = [], []
    for triangle, height in zip(body.triangles, side, strict=True):
        above = height > 0.0
        if above.all() or not above.any():
            continue
        ends_rest: list[Array] = []
        ends_now: list[Array] = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            if above[a] != above[b]:
                way = height[a] / (height[a] - height[b])
                for points, ends in ((body.rest_m, ends_rest), (body.position_m, ends_now)):
                    ends.append((1.0 - way) * points[triangle[a]] + way * points[triangle[b]])
        rest.append(ends_rest)
        now.append(ends_now)
    return np.array(rest).reshape(-1, 2, 3), np.array(now).reshape(-1, 2, 3)


def _draw_layer(
    axes: Axes,
    body: BodyShape,
    lattice: tuple[int, int, int],
    displacement_mm: Array,
    norm: Normalize,
    tip_m: Array | None,
) -> str:
    """The layer of a lattice's nodes that is nearest to the tip."""
    nx, ny, nz = lattice
    layers = body.rest_m.reshape(nz, ny, nx, 3)[0, :, 0, 1]
    layer = 0 if tip_m is None else int(np.argmin(np.abs(layers - tip_m[1])))
    nodes = np.arange(nx * ny * nz).reshape(nz, ny, nx)[:, layer, :]
    pairs = np.array([*_pairs(nodes), *_pairs(nodes.T)])
    flat_mm = _MM * body.position_m[:, [0, 2]]
    rest_mm = _MM * body.rest_m[:, [0, 2]]
    axes.add_collection(LineCollection(list(rest_mm[pairs]), colors="#d8d8d8", linewidths=0.6, zorder=1))
    axes.add_collection(
        LineCollection(
            list(flat_mm[pairs]),
            array=displacement_mm[pairs].mean(axis=1),
            norm=norm,
            cmap=_DEFORMATION,
            linewidths=1.1,
            zorder=2,
        )
    )
    x_mm, z_mm = flat_mm[nodes.ravel()].T
    axes.scatter(
        x_mm,
        z_mm,
        c=displacement_mm[nodes.ravel()],
        norm=norm,
        cmap=_DEFORMATION,
        s=max(3.0, 260.0 / max(nx, nz)),
        zorder=3,
    )
    patch = body.patch_nodes[np.isin(body.patch_nodes, nodes)]
    if len(patch):
        x_mm, z_mm = flat_mm[patch].T
        axes.scatter(
            x_mm,
            z_mm,
            s=52,
            facecolors="none",
            edgecolors=_TANGENTIAL,
            linewidths=1.2,
            zorder=4,
            label="patch",
        )
    return f"section at y = {_MM * layers[layer]:.1f} mm (grey: at rest)" if ny > 1 else "grey: at rest"


def _pairs(grid: Array) -> Sequence[tuple[int, int]]:
    """Neighbouring nodes along the second axis of a grid of node indices."""
    return list(zip(grid[:, :-1].ravel().tolist(), grid[:, 1:].ravel().tolist(), strict=True))
