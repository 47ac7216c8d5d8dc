"""Pictures: error against each cost, with dominated points greyed and the default marked; error over each sweep."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from palpate.frontier.bench import Measured
from palpate.frontier.points import BUILDERS, DEFAULT, EXPERIMENTS, SWEEPS
from palpate.frontier.results import COSTS, LINK, Cost, is_choice, on_frontier
from palpate.reproduce import plot

_COLOURS = (plot.BLUE, plot.RED, plot.GREEN, plot.VIOLET, "#b06a00", "#00798c", "#444444")
_PALE = "#b8b8b8"
# Points whose errors are nearer than this, as a logarithm, share the line of their numbers.
_NEAR = 0.07
_SWEEP_LABELS = {
    "delay_frames": "delay [frames]",
    "shifts_Hz": "shifts [Hz]",
    "near_nodes": "nodes below the surface in the modes",
    "patch_nodes": "nodes of the patch",
    "update_Hz": "updates [Hz]",
    "body_step_s": "step of the body [s]",
}


def _colour(family: str) -> str:
    families = list(dict.fromkeys(builder.family for builder in BUILDERS.values()))
    return _COLOURS[families.index(family) % len(_COLOURS)]


def draw_costs(points: Sequence[Measured], experiment: str, file: Path) -> None:
    """Error against each cost, for the points of one experiment."""
    own = [point for point in points if point.point.experiment.name == experiment]
    costs = [cost for cost in COSTS if any(cost.of(point) is not None for point in own)]
    title = f"{EXPERIMENTS[experiment].title}; grey: another point is better in all"
    _draw_panels([(own, cost, cost.label) for cost in costs], costs, title, file)


def draw_link(points: Sequence[Measured], file: Path) -> None:
    """Error against what the link carries, a panel for each experiment."""
    panels = [
        ([point for point in points if point.point.experiment.name == name], LINK, f"{EXPERIMENTS[name].title}\n{LINK.label}")
        for name in dict.fromkeys(point.point.experiment.name for point in points)
    ]
    _draw_panels(panels, (LINK,), "grey: another builder has a smaller error and needs less", file)


def _draw_panels(
    panels: Sequence[tuple[Sequence[Measured], Cost, str]], costs: Sequence[Cost], title: str, file: Path
) -> None:
    """panels: points of one experiment, what is drawn along x, and the label there. costs: what makes a point dominated."""
    figure, axes = plot.grid(1, len(panels), (1.5,), share_y=True)
    names = dict.fromkeys(point.point.builder.name for points, _, _ in panels for point in points)
    numbers = {name: i + 1 for i, name in enumerate(names)}
    for (points, cost, label), panel in zip(panels, axes[0], strict=True):
        best = on_frontier(points, costs)
        shown = [place for point in points if is_choice(point) and (place := _place(point, cost)) is not None]
        for place in shown:
            _draw_point(panel, place, best[place.point.point.name])
        plain = [place for place in shown if place.point.point.sweep is None]
        _draw_numbers(panel, plain, [numbers[place.point.point.builder.name] for place in plain])
        _percent_axis(panel)
        panel.margins(x=0.2, y=0.08)
        panel.set_xlim(left=0.0)
        panel.set_xlabel(label, fontsize=8)
    axes[0, 0].set_ylabel("force error [%]")
    handles, labels = [], []
    for name, number in numbers.items():
        mark = axes[0, 0].plot([], [], _marker(name), color=_colour(BUILDERS[name].family), linestyle="none")[0]
        handles.append(mark)
        labels.append(f"{number} {BUILDERS[name].title}{' (default)' if name == DEFAULT else ''}")
    figure.legend(handles, labels, fontsize=7, ncols=2, loc="outside lower center")
    figure.suptitle(title, fontsize=9)
    plot.save(figure, file)


def _percent_axis(panel: Axes) -> None:
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.yaxis.set_minor_formatter(NullFormatter())
    panel.tick_params(labelsize=8)


def _marker(builder: str) -> str:
    return "*" if builder == DEFAULT else "o"


@dataclass(frozen=True)
class _Place:
    """Where a point is drawn."""

    point: Measured
    x: float
    y: float


def _place(point: Measured, cost: Cost) -> _Place | None:
    """None where there is a number missing, or none that the axis has."""
    error, value = point.metrics["error_percent"], cost.of(point)
    if value is None or error is None or not math.isfinite(error) or error <= 0.0:
        return None
    return _Place(point, value * cost.drawn_scale, error)


def _draw_point(panel: Axes, place: _Place, is_best: bool) -> None:
    builder, swept = place.point.point.builder, place.point.point.sweep is not None
    is_default = builder.name == DEFAULT and not swept
    panel.plot(
        place.x,
        place.y,
        "." if swept else _marker(builder.name),
        color=_colour(builder.family) if is_best else _PALE,
        markersize=13 if is_default else 5,
        markeredgecolor="black" if is_default else "none",
        zorder=3 if is_best else 2,
        clip_on=False,
    )


def _draw_numbers(panel: Axes, places: Sequence[_Place], numbers: Sequence[int]) -> None:
    """Beside each point its number; those of points that lie on each other in one line."""
    width = max((place.x for place in places), default=0.0)
    groups: list[tuple[_Place, list[int]]] = []
    for place, number in sorted(zip(places, numbers, strict=True), key=lambda pair: -pair[0].y):
        for first, together in groups:
            if abs(first.x - place.x) < 0.03 * width and abs(math.log(first.y / place.y)) < _NEAR:
                together.append(number)
                break
        else:
            groups.append((place, [number]))
    for first, together in groups:
        text = ", ".join(map(str, sorted(together)))
        panel.annotate(text, (first.x, first.y), xytext=(5, 3), textcoords="offset points", fontsize=8)


def draw_sweeps(points: Sequence[Measured], file: Path) -> None:
    """Error over each sweep that was run: a line for each builder (colour) and experiment (style)."""
    names = [name for name in SWEEPS if any(point.point.sweep == name for point in points)]
    figure, panels = plot.panels(tuple(0.9 for _ in names), share_x=False)
    for name, panel in zip(names, panels, strict=True):
        own = [point for point in points if point.point.sweep == name]
        places = {value: i for i, value in enumerate(SWEEPS[name])}
        pairs = dict.fromkeys((point.point.builder.name, point.point.experiment.name) for point in own)
        styles = dict(zip(dict.fromkeys(e for _, e in pairs), ("-", "--", ":"), strict=False))
        for builder, experiment in pairs:
            line = [p for p in own if (p.point.builder.name, p.point.experiment.name) == (builder, experiment)]
            errors = [math.nan if p.metrics["error_percent"] is None else p.metrics["error_percent"] for p in line]
            panel.plot(
                [places[p.point.value] for p in line],
                errors,
                f"o{styles[experiment]}",
                color=_colour(BUILDERS[builder].family),
                markersize=4,
                label=f"{builder}: {EXPERIMENTS[experiment].title}",
            )
        panel.set_xticks(list(places.values()), list(places))
        _percent_axis(panel)
        panel.set_xlabel(_SWEEP_LABELS[name], fontsize=8)
        panel.set_ylabel("force error [%]", fontsize=8)
        # Above the panel: lines go everywhere.
        panel.legend(fontsize=6, ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    plot.save(figure, file)
