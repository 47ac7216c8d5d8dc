"""Pictures of a record beside the forces: the tip's path, the link and the models that crossed it, ages and tick lengths."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from palpate.figures import with_breaks
from palpate.record_layout import CONTACT_MODES

Array = NDArray[Any]

# Dark enough for lines on white; the fills of figures.py are too light.
_MODE_LINES = ("#8a8a8a", "#2e8b3a", "#d9820f")  # free, stick, slip
_UP, _DOWN, _BASIS, _BAD, _AGE, _BUSY = "#17508f", "#a3201a", "#e3a6a1", "#000000", "#3a3a3a", "#b9b9b9"
_MM, _UJ = 1e3, 1e6
_STATUS_OK, _STATUS_UNKNOWN = 0, 255
_BYTES_PER_KB = 1000.0
_SHORTEST_BIN_S = 0.1  # three models: shorter ones show now a model, now none


@dataclass(frozen=True)
class PathTrace:
    """The tip's way. time_s: (n,); tip_m: (n, 3), device frame; contact_mode: (n,); hand_target_m: (n, 3), where it is known;
    body_m: (nodes, 3) at rest, where it is known."""

    time_s: Array
    tip_m: Array
    contact_mode: Array
    hand_target_m: Array | None
    body_m: Array | None


@dataclass(frozen=True)
class LinkTrace:
    """Bytes that crossed the link in each tick (n,), and the models: (u,) time of sending, status, bytes of the state and of
    the basis before it, ticks that the host interpolated, energy of its correction. losses: a line of text."""

    time_s: Array
    up_bytes: Array
    down_bytes: Array
    sent_s: Array
    status: Array
    state_bytes: Array
    basis_bytes: Array
    interpolated_ticks: Array
    correction_energy_J: Array
    losses: str


@dataclass(frozen=True)
class TimingTrace:
    """model_age_ms: (n,), NaN without a model. tick_length, busy_length: (n,) of each servo tick, and of that with the
    background work that ended in it, in `unit`; None where the board has no clock. budget: what a tick may take."""

    time_s: Array
    model_age_ms: Array
    tick_length: Array | None
    busy_length: Array | None
    unit: str
    budget: float | None
    overruns: str


def save_path(file: Path, *, title: str, trace: PathTrace) -> None:
    """Draws the tip's path from four sides, coloured by contact mode, over the outline of the body at rest."""
    figure = Figure(figsize=(11.0, 9.6), dpi=130, layout="constrained")
    figure.suptitle(title, fontsize=12)
    names = "xyz"
    middle_mm, half_mm = _window(_MM * trace.tip_m)
    for place, (across, up) in ((1, (0, 1)), (3, (0, 2)), (4, (1, 2))):
        axes = figure.add_subplot(2, 2, place)
        _draw_projection(axes, trace, across, up, middle_mm, half_mm)
        axes.set(xlabel=f"{names[across]} [mm]", ylabel=f"{names[up]} [mm]", aspect="equal")
        axes.set_title(f"seen along {names[3 - across - up]}", fontsize=10)
    axes = figure.add_subplot(2, 2, 2, projection="3d")
    for mode, part_m in _by_mode(trace):
        axes.plot(*(_MM * part_m.T), color=_MODE_LINES[mode], linewidth=1.4 if mode else 0.9)
    for row, marker in ((0, "o"), (-1, "s")):
        axes.plot(*(_MM * trace.tip_m[[row]].T), marker, color="black", markersize=4)
    limits = [(middle - half_mm, middle + half_mm) for middle in middle_mm]
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", xlim=limits[0], ylim=limits[1], zlim=limits[2])
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=0.88)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.view_init(elev=24, azim=-58)
    figure.legend(handles=_path_legend(trace), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    figure.savefig(file)


def _by_mode(trace: PathTrace) -> list[tuple[int, Array]]:
    """The path in each mode, NaN in the others; with the tick before, so that nothing is missing in between."""
    parts = []
    for mode in range(len(CONTACT_MODES)):
        here = trace.contact_mode == mode
        here[:-1] |= here[1:]
        if here.any():
            parts.append((mode, with_breaks(trace.time_s, np.where(here[:, None], trace.tip_m, np.nan))[1]))
    return parts


def _draw_projection(axes: Axes, trace: PathTrace, across: int, up: int, middle_mm: Array, half_mm: float) -> None:
    tip_mm = _MM * trace.tip_m[:, [across, up]]
    if trace.body_m is not None:
        corner_mm, far_mm = _MM * trace.body_m[:, [across, up]].min(axis=0), _MM * trace.body_m[:, [across, up]].max(axis=0)
        axes.add_patch(Rectangle((corner_mm[0], corner_mm[1]), *(far_mm - corner_mm), facecolor="#e9edf2", edgecolor="#9aa7b5", zorder=0))
    if trace.hand_target_m is not None:
        target_m = with_breaks(trace.time_s, trace.hand_target_m)[1]
        axes.plot(*(_MM * target_m[:, [across, up]].T), color="#b08fd0", linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
    for mode, part_m in _by_mode(trace):
        axes.plot(*(_MM * part_m[:, [across, up]].T), color=_MODE_LINES[mode], linewidth=1.4 if mode else 0.9, zorder=2 + mode)
    axes.plot(*tip_mm[0], "o", color="black", markersize=5, zorder=6)
    axes.plot(*tip_mm[-1], "s", color="black", markersize=5, zorder=6)
    # The path fills the picture; of the body as much is seen as there is.
    axes.set_xlim(middle_mm[across] - half_mm, middle_mm[across] + half_mm)
    axes.set_ylim(middle_mm[up] - half_mm, middle_mm[up] + half_mm)
    axes.grid(alpha=0.25)


def _window(points: Array) -> tuple[Array, float]:
    """Middle (3,) and half the side of a cube that holds points (n, 3) with room around them."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    return 0.5 * (low + high), max(0.6 * float((high - low).max()), 0.5)


def _path_legend(trace: PathTrace) -> list[Any]:
    handles: list[Any] = [
        Line2D([], [], color=colour, linewidth=1.8, label=f"tip, {mode}")
        for mode, colour in zip(CONTACT_MODES, _MODE_LINES, strict=True)
    ]
    if trace.hand_target_m is not None:
        handles.append(Line2D([], [], color="#b08fd0", linewidth=0.8, linestyle=(0, (4, 2)), label="hand's intention"))
    handles.append(Line2D([], [], color="black", marker="o", linestyle="", markersize=5, label="begin"))
    handles.append(Line2D([], [], color="black", marker="s", linestyle="", markersize=5, label="end"))
    if trace.body_m is not None:
        handles.append(Rectangle((0, 0), 1, 1, facecolor="#e9edf2", edgecolor="#9aa7b5", label="body at rest (outline)"))
    return handles


def save_link(file: Path, *, title: str, trace: LinkTrace) -> None:
    """Draws the link's rate in both directions, the length of each model and what became of it, the energy of corrections."""
    figure = Figure(figsize=(11.0, 9.2), dpi=130, layout="constrained")
    figure.suptitle(f"{title}\n{trace.losses}", fontsize=12)
    rate, models, gaps, energy = figure.subplots(4, 1, sharex=True, height_ratios=(3, 2.4, 1.3, 1.6))
    bin_s, edges_s, (down_kB_s, up_kB_s) = _rates(trace)
    rate.stairs(down_kB_s, edges_s, color=_DOWN, linewidth=1.0, label="to the board")
    rate.stairs(up_kB_s, edges_s, color=_UP, linewidth=1.0, label="to the host")
    rate.set_ylabel(f"link, mean of\n{1e3 * bin_s:.3g} ms [kB/s]")
    rate.set_ylim(bottom=0.0)

    basis_kB, state_kB = trace.basis_bytes / _BYTES_PER_KB, trace.state_bytes / _BYTES_PER_KB
    models.vlines(trace.sent_s, 0.0, basis_kB, color=_BASIS, linewidth=2.0, label="basis before it")
    models.vlines(trace.sent_s, basis_kB, basis_kB + state_kB, color=_DOWN, linewidth=2.0, label="state")
    top_kB = basis_kB + state_kB
    for name, marker, chosen in (
        ("refused or dropped", "x", (trace.status != _STATUS_OK) & (trace.status != _STATUS_UNKNOWN)),
        ("never answered", "v", trace.status == _STATUS_UNKNOWN),
    ):
        label = f"{name}: {np.count_nonzero(chosen)}"
        models.plot(trace.sent_s[chosen], top_kB[chosen], marker, color=_BAD, markersize=6, label=label)
    models.set_ylabel("models sent [kB]")
    models.set_ylim(bottom=0.0)
    models.margins(y=0.15)

    if not trace.interpolated_ticks.any():
        gaps.text(0.5, 0.5, "none", transform=gaps.transAxes, ha="center", va="center", color="#808080")
    gaps.vlines(trace.sent_s, 0.0, trace.interpolated_ticks, color=_UP, linewidth=2.0)
    gaps.set_ylabel("ticks\ninterpolated")
    gaps.set_ylim(0.0, max(1.0, 1.15 * float(np.max(trace.interpolated_ticks, initial=0))))
    gaps.yaxis.set_major_locator(MaxNLocator(4, integer=True))

    energy_uJ = _UJ * trace.correction_energy_J
    for name, colour, chosen in (("given to the hand", _DOWN, energy_uJ > 0.0), ("taken from it", _UP, energy_uJ < 0.0)):
        energy.vlines(trace.sent_s[chosen], 0.0, energy_uJ[chosen], color=colour, linewidth=2.0, label=name)
    energy.axhline(0.0, color="#808080", linewidth=0.6)
    energy.set_ylabel("correction\nenergy [µJ]")
    energy.set_xlabel("virtual time [s]")
    energy.set_xlim(float(trace.time_s[0]), float(trace.time_s[-1]))
    for axes in (rate, models, energy):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    for axes in (rate, models, gaps, energy):
        axes.grid(alpha=0.25)
    figure.savefig(file)


def _rates(trace: LinkTrace) -> tuple[float, Array, tuple[Array, Array]]:
    """Length of the bins, their edges (b + 1,) in s, and kB/s in them, to the board and to the host; NaN where no tick is."""
    duration_s = float(trace.time_s[-1] - trace.time_s[0]) + 1e-3
    bin_s = max(_SHORTEST_BIN_S, 1e-3 * round(duration_s / 400 / 1e-3))
    bins = max(1, int(np.ceil(duration_s / bin_s - 1e-9)))
    edges_s = trace.time_s[0] + bin_s * np.arange(bins + 1)
    at = np.minimum(((trace.time_s - trace.time_s[0]) / bin_s + 1e-9).astype(int), bins - 1)
    lengths_s = 1e-3 * np.bincount(at, minlength=bins)

    def rate(values: Array) -> Array:
        kB = np.bincount(at, values, minlength=bins) / _BYTES_PER_KB
        kB_s: Array = np.divide(kB, lengths_s, out=np.full(bins, np.nan), where=lengths_s > 0.0)
        return kB_s

    return bin_s, edges_s, (rate(trace.down_bytes), rate(trace.up_bytes))


def save_timing(file: Path, *, title: str, trace: TimingTrace) -> None:
    """Draws the age of the model and the length of the servo ticks, over time and as histograms."""
    rows = 1 if trace.tick_length is None else 2
    figure = Figure(figsize=(11.0, 1.2 + 3.4 * rows), dpi=130, layout="constrained")
    figure.suptitle(f"{title}\n{trace.overruns}", fontsize=12)
    panels = figure.subplots(rows, 2, width_ratios=(2.2, 1.0), squeeze=False)
    line, bars = panels[0]
    line.plot(*with_breaks(trace.time_s, trace.model_age_ms), color=_AGE, linewidth=0.8)
    line.set_ylabel("age of the model [ms]")
    known_ms = trace.model_age_ms[np.isfinite(trace.model_age_ms)]
    if len(known_ms):
        bars.hist(known_ms, bins=np.arange(known_ms.min(), known_ms.max() + 2) - 0.5, color=_AGE)
        bars.set_title(_median_and_worst(known_ms), fontsize=9)
    bars.set(xlabel="age of the model [ms]", ylabel="ticks", yscale="log", ylim=(0.5, None))
    if trace.tick_length is not None and trace.busy_length is not None:
        line, bars = panels[1]
        line.plot(*with_breaks(trace.time_s, trace.busy_length), color=_BUSY, linewidth=0.6, label="with background work")
        line.plot(*with_breaks(trace.time_s, trace.tick_length), color=_UP, linewidth=0.7, label="servo tick")
        bins = np.linspace(0.0, max(float(trace.busy_length.max()), 1e-9), 80).tolist()
        bars.hist(trace.busy_length, bins=bins, color=_BUSY, label="with background work")
        bars.hist(trace.tick_length, bins=bins, color=_UP, alpha=0.8, label="servo tick")
        if trace.budget is not None:
            line.axhline(trace.budget, color=_DOWN, linewidth=1.0, linestyle=(0, (4, 2)), label="a whole tick")
        line.set_ylabel(f"length of a tick [{trace.unit}]")
        line.set_ylim(0.0, 1.25 * max(float(trace.busy_length.max()), trace.budget or 0.0, 1e-9))
        line.legend(loc="upper right", fontsize=8, ncols=3, framealpha=0.9)
        bars.set(xlabel=f"length of a tick [{trace.unit}]", ylabel="ticks", yscale="log", ylim=(0.5, None))
        bars.set_title(f"servo tick: {_median_and_worst(trace.tick_length)}", fontsize=9)
    for line, bars in panels:
        line.set_xlabel("virtual time [s]")
        line.set_xlim(float(trace.time_s[0]), float(trace.time_s[-1]))
        line.set_ylim(bottom=0.0)
        line.grid(alpha=0.25)
        bars.grid(alpha=0.25)
    figure.savefig(file)


def _median_and_worst(values: Array) -> str:
    return f"median {np.median(values):.4g}, worst {values.max():.4g}"
