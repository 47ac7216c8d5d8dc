"""Pictures of the fault matrix: for each case how long the force lasts, how far it changes in a tick and what is left of the
bound on it; and the forces themselves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from palpate.faults.rules import FORCE_STEP_N, Result
from palpate.reproduce import plot

_ROW_IN = 0.2
# Beyond the bound of a panel by so much of it.
_ROOM = 1.15
# Height of a bar for how long a fault lasts, in the forces' axes.
_BAR_N = 0.3
_GOOD: dict[str, Any] = {"color": "#444444", "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 3}


def draw(results: Sequence[Result], file: Path) -> None:
    """A row a case. results: not empty."""
    plot.save(cases_figure(results), file)


def cases_figure(results: Sequence[Result]) -> Figure:
    """What `draw` saves."""
    figure = Figure(figsize=(10.0, 1.3 + _ROW_IN * len(results)), layout="constrained")
    times, steps, bounds = figure.subplots(1, 3, sharey=True)
    rows = np.arange(len(results))
    colours = [plot.RED if result.broken else plot.BLUE for result in results]

    def bars(axes: Any, name: str, height: float, shift: float, **style: Any) -> None:
        values = [result.numbers[name] for result in results]
        known = [i for i, value in enumerate(values) if value is not None]
        axes.barh([rows[i] + shift for i in known], [values[i] for i in known], height, **style)

    bars(times, "force_gone_ticks", 0.38, -0.2, color=plot.BLUE, label="force of the model gone")
    bars(times, "outputs_off_ticks", 0.38, 0.2, color="#b8b8b8", label="outputs off")
    times.set_xlabel("after the fault begins [ms]")
    times.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0))

    # Each row has its own: a case with another body is held against a run of that one.
    limits_N = np.array([result.numbers["step_limit_N"] for result in results])
    bars(steps, "step_N", 0.7, 0.0, color=colours)
    steps.vlines(limits_N - FORCE_STEP_N, rows - 0.5, rows + 0.5, color=plot.GREEN, linewidth=1.0)
    steps.vlines(limits_N, rows - 0.5, rows + 0.5, color=plot.RED, linewidth=1.0)
    steps.set_xlim(0.0, _ROOM * limits_N.max())
    steps.set_xlabel("largest change in a tick [N]\ngreen: without faults, red: limit")

    bars(bounds, "rise_N", 0.38, -0.2, color="#b8b8b8", label="above the same tick without the fault")
    bars(bounds, "excess_N", 0.38, 0.2, color=colours, label="above what rule 3 allows (negative: left)")
    bounds.axvline(0.0, color=plot.RED, linewidth=1.0)
    bounds.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    bounds.set_xlabel("largest of the run [N]\nred: limit of rule 3")

    times.set_yticks(rows, [result.case.name for result in results], fontsize=7)
    times.set_ylim(len(results) - 0.4, -0.6)
    for axes in (times, steps, bounds):
        axes.grid(axis="x", linewidth=0.4)
        axes.set_axisbelow(True)
    return figure


def draw_forces(results: Sequence[Result], file: Path) -> None:
    """Force over time: axes for each group, with a curve for each of its cases, and that of the run without faults."""
    plot.save(forces_figure(results), file)


def forces_figure(results: Sequence[Result]) -> Figure:
    """What `draw_forces` saves. Below the curves a bar for each case says how long its fault lasts, in its curve's colour."""
    groups = list(dict.fromkeys(result.case.group for result in results))
    columns = min(2, len(groups))
    rows = -(-len(groups) // columns)
    figure = Figure(figsize=(12.0, 0.8 + 2.3 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)).ravel()
    most = max(sum(result.case.group == group for result in results) for group in groups)
    for one, group in zip(axes, groups, strict=False):
        of_group = [result for result in results if result.case.group == group]
        _draw_group(one, of_group)
        one.set_title(group, fontsize=9)
    for i, one in enumerate(axes):
        one.set_visible(i < len(groups))
        # The lowest of its column that is there has the labels.
        one.tick_params(labelbottom=i + columns >= len(groups))
    ticks_N = np.array([tick for tick in axes[0].get_yticks() if tick >= 0.0])
    axes[0].set_ylim(-_BAR_N * (most + 1), None)
    axes[0].set_yticks(ticks_N[:-1])  # the last is above the curves
    figure.legend(handles=[Line2D([], [], label="without faults", **_GOOD), Line2D([], [], color="#444444", linewidth=2.5, label="the fault lasts")],
                  loc="outside upper center", ncols=2, fontsize=8)  # fmt: skip
    figure.supxlabel("time [s]")
    figure.supylabel("force [N]")
    return figure


def _draw_group(axes: Axes, results: Sequence[Result]) -> None:
    good = results[0].good
    good_s = good.values["ticks/tick"] * 1e-3
    axes.plot(good_s, good.force_N, **_GOOD)
    for i, result in enumerate(results):
        case, colour = result.case, colormaps["tab20"](i % 20)
        time_s = result.run.values["ticks/tick"] * 1e-3
        shown = time_s <= good_s[-1]
        # Of a group all cases begin with its name.
        name = case.name.removeprefix(case.group).lstrip(" ,") or case.name
        ends = "" if time_s[-1] >= good_s[-1] else f" (the run ends at {time_s[-1]:.0f} s)"
        failed = " FAILED" if result.broken else ""
        axes.plot(time_s[shown], result.run.force_N[shown], color=colour, linewidth=1.0, label=f"{name}{ends}{failed}")
        end_s = max(min(case.end_s, good_s[-1]), case.first_s + 0.02)
        axes.plot([case.first_s, end_s], [-_BAR_N * (i + 1)] * 2, color=colour, linewidth=2.5, solid_capstyle="butt")
    axes.grid(linewidth=0.4)
    axes.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.05), frameon=False, handlelength=1.2)
