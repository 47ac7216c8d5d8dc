"""The look of the plots: one size and one palette, legible on a phone and in grey."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

BLUE, RED, GREEN, GREY, VIOLET = "#17508f", "#a3201a", "#2d7a3a", "#6b6b6b", "#7a1fa2"
LIGHT_BLUE, LIGHT_RED = "#9cc3ea", "#f0aaa5"
_WIDTH_IN, _PANEL_IN, _DPI = 7.2, 2.6, 140


def panels(heights: tuple[float, ...] = (1.4,), share_x: bool = True) -> tuple[Figure, list[Axes]]:
    """An empty plot with panels one above the other, of these relative heights."""
    figure = Figure(figsize=(_WIDTH_IN, 0.4 + _PANEL_IN * sum(heights)), dpi=_DPI, layout="constrained")
    axes = list(figure.subplots(len(heights), 1, sharex=share_x, height_ratios=heights, squeeze=False)[:, 0])
    for panel in axes:
        panel.grid(alpha=0.25)
    return figure, axes


def grid(rows: int, columns: int, heights: tuple[float, ...], share_y: bool = False) -> tuple[Figure, NDArray[Any]]:
    """An empty plot with panels (rows, columns), each row of its relative height."""
    figure = Figure(figsize=(_WIDTH_IN, 0.4 + _PANEL_IN * sum(heights)), dpi=_DPI, layout="constrained")
    axes = figure.subplots(rows, columns, height_ratios=heights, sharey="row" if share_y else False, squeeze=False)
    for panel in axes.flat:
        panel.grid(alpha=0.25)
    return figure, axes


def legend(axes: Axes, columns: int = 1, place: str = "best") -> None:
    """The legend of a panel."""
    axes.legend(fontsize=8, framealpha=0.9, ncols=columns, loc=place)


def save(figure: Figure, file: Path) -> None:
    """Writes the PNG file."""
    figure.savefig(file)
