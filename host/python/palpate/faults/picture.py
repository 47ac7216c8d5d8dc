"""Pictures of the fault matrix: for each case how long the force lasts, how far it changes in a tick and what is left of the
bound on it; and the forces themselves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from palpate.faults.rules import FORCE_STEP_N, Result
from palpate.reproduce import plot

_ROW_IN = 0.2
# Beyond the bound of a panel by so much of it.
_ROOM = 1.15


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
    bounds.set_xlabel("force at most [N]")

    times.set_yticks(rows, [result.case.name for result in results], fontsize=7)
    times.set_ylim(len(results) - 0.4, -0.6)
    for axes in (times, steps, bounds):
        axes.grid(axis="x", linewidth=0.4)
        axes.set_axisbelow(True)
    return figure


def draw_forces(results: Sequence[Result], file: Path) -> None:
    """Force over time: axes for each group, with a curve for each of its cases, and that of the run without faults."""
    groups = list(dict.fromkeys(result.case.group for result in results))
    columns = min(3, len(groups))
    rows = -(-len(groups) // columns)
    figure = Figure(figsize=(10.0, 0.6 + 1.9 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)).ravel()
    for one, group in zip(axes, groups, strict=False):
        of_group = [result for result in results if result.case.group == group]
        good = of_group[0].good
        good_s = good.values["ticks/tick"] * 1e-3
        for result in of_group:
            time_s = result.run.values["ticks/tick"] * 1e-3
            shown = time_s <= good_s[-1]
            one.plot(time_s[shown], result.run.force_N[shown], color=plot.RED if result.broken else plot.BLUE, linewidth=0.6, alpha=0.7)
        one.plot(good_s, good.force_N, color="#444444", linewidth=0.9, linestyle=(0, (4, 2)))
        one.set_title(group, fontsize=9)
        one.grid(linewidth=0.4)
    for one in axes[len(groups):]:
        one.set_visible(False)
    figure.supxlabel("time [s]")
    figure.supylabel("force [N]")
    plot.save(figure, file)
