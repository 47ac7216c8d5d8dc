"""Pictures: error against each cost, with dominated points greyed and the default marked; error over each sweep."""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from palpate.frontier.bench import Measured
from palpate.frontier.points import BUILDERS, DEFAULT, EXPERIMENTS, SWEEPS
from palpate.frontier.results import COSTS, is_choice, on_frontier
from palpate.reproduce import plot

_COLOURS = (plot.BLUE, plot.RED, plot.GREEN, plot.VIOLET, "#b06a00", "#00798c", "#444444")
_PALE = "#b8b8b8"
_SWEEP_LABELS = {
    "delay_frames": "delay [frames]",
    "shifts_Hz": "shifts [Hz]",
    "patch_nodes": "nodes of the patch",
    "update_Hz": "updates [Hz]",
    "body_step_s": "step of the body [s]",
}


def _colour(family: str) -> str:
    families = list(dict.fromkeys(builder.family for builder in BUILDERS.values()))
    return _COLOURS[families.index(family) % len(_COLOURS)]


def draw_costs(points: Sequence[Measured], experiment: str, file: Path) -> None:
    """Error against each cost, for the points of one experiment."""
    own = [point for point in points if point.point.experiment.name == experiment and is_choice(point)]
    best = on_frontier(own)
    numbers = {name: i + 1 for i, name in enumerate(dict.fromkeys(point.point.builder.name for point in own))}
    costs = [cost for cost in COSTS if any(cost.of(point) is not None for point in own)]
    figure, axes = plot.grid(1, len(costs), (1.5,), share_y=True)
    for cost, panel in zip(costs, axes[0], strict=True):
        for point in own:
            number = numbers[point.point.builder.name]
            _draw_point(panel, point, cost.of(point), cost.drawn_scale, best[point.point.name], number)
        _percent_axis(panel)
        panel.margins(x=0.12, y=0.08)
        panel.set_xlim(left=0.0)
        panel.set_xlabel(cost.label, fontsize=8)
    axes[0, 0].set_ylabel("force error [%]")
    handles, labels = [], []
    for name, number in numbers.items():
        mark = axes[0, 0].plot([], [], _marker(name), color=_colour(BUILDERS[name].family))[0]
        handles.append(mark)
        labels.append(f"{number} {BUILDERS[name].title}{' (default)' if name == DEFAULT else ''}")
    figure.legend(handles, labels, fontsize=7, ncols=2, loc="outside lower center")
    figure.suptitle(f"{EXPERIMENTS[experiment].title}; grey: another point is better in all", fontsize=9)
    plot.save(figure, file)


def _percent_axis(panel: Axes) -> None:
    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.yaxis.set_minor_formatter(NullFormatter())
    panel.tick_params(labelsize=8)


def _marker(builder: str) -> str:
    return "*" if builder == DEFAULT else "o"


def _draw_point(panel: Axes, point: Measured, cost: float | None, scale: float, is_best: bool, number: int) -> None:
    error = point.metrics["error_percent"]
    if cost is None or error is None or not math.isfinite(error) or error <= 0.0:
        return
    builder, swept = point.point.builder, point.point.sweep is not None
    is_default = builder.name == DEFAULT and not swept
    panel.plot(
        cost * scale,
        error,
        _marker(builder.name) if not swept else ".",
        color=_colour(builder.family) if is_best else _PALE,
        markersize=13 if is_default else 5,
        markeredgecolor="black" if is_default else "none",
        zorder=3 if is_best else 2,
        clip_on=False,
    )
    if not swept:
        panel.annotate(str(number), (cost * scale, error), xytext=(4, 3), textcoords="offset points", fontsize=8)


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
                label=f"{BUILDERS[builder].title}: {EXPERIMENTS[experiment].title}",
            )
        panel.set_xticks(list(places.values()), list(places))
        _percent_axis(panel)
        panel.set_xlabel(_SWEEP_LABELS[name], fontsize=8)
        panel.set_ylabel("force error [%]", fontsize=8)
        panel.legend(fontsize=6, framealpha=0.9)
    plot.save(figure, file)
