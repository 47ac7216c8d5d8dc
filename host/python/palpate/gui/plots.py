"""Live plots beside the body: the last seconds of forces, path, load and time, and histograms."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import polyscope.imgui as psim
import polyscope.implot as implot
from numpy.typing import NDArray

from palpate.history import History
from palpate.live import TICK_S

Floats = NDArray[np.float64]

_MOST_POINTS = 600  # of a line: wider than the plot is in pixels
_BLUE, _ORANGE, _GREEN, _GREY, _RED = (
    (0.12, 0.40, 0.80, 1.0), (0.90, 0.45, 0.05, 1.0), (0.10, 0.58, 0.30, 1.0), (0.45, 0.45, 0.45, 1.0),
    (0.80, 0.15, 0.15, 1.0),
)  # fmt: skip
_COUNT_us = 0.04  # the emulated boards' clocks have 25 MHz
_X, _Y = 0, 3  # implot's first axes
_ALWAYS = 1


@dataclass(frozen=True)
class Plot:
    """One plot: its name in the list, and what draws it in so many pixels."""

    name: str
    draw: Callable[[History, float, tuple[float, float]], None]


def _thin(values: Floats) -> Floats:
    """Largest and smallest of each group, in turn: what a dense line looks like, and no peak is lost."""
    if len(values) <= _MOST_POINTS:
        return np.ascontiguousarray(values)
    group = -(-len(values) // (_MOST_POINTS // 2))
    whole = values[len(values) % group :].reshape(-1, group)
    return np.column_stack([whole.min(axis=1), whole.max(axis=1)]).ravel()


def _thin_time(time_s: Floats) -> Floats:
    """Times for `_thin`."""
    if len(time_s) <= _MOST_POINTS:
        return np.ascontiguousarray(time_s)
    group = -(-len(time_s) // (_MOST_POINTS // 2))
    first = time_s[len(time_s) % group :: group]
    return np.repeat(first, 2)


def _lines(
    title: str,
    unit: str,
    history: History,
    window_s: float,
    size: tuple[float, float],
    lines: list[tuple[str, Floats, tuple[float, float, float, float]]],
    smallest: float,
) -> None:
    """Lines over the last seconds; the axis of values is at least `smallest` high and begins at 0 or below."""
    rows = round(window_s / TICK_S)
    time_s = history["time_s"][-rows:]
    now_s = float(time_s[-1]) if len(time_s) else 0.0
    top, bottom = smallest, 0.0
    drawn = []
    for label, values, colour in lines:
        shown = _thin(values[-rows:])
        if len(shown):
            top, bottom = max(top, float(np.nanmax(shown))), min(bottom, float(np.nanmin(shown)))
        drawn.append((label, shown, colour))
    if not implot.BeginPlot(f"##{title}", size):
        return
    implot.SetupAxes("s", f"{title} ({unit})", 0, 0)
    implot.SetupAxisLimits(_X, now_s - window_s, now_s, _ALWAYS)
    margin = 0.06 * (top - bottom)
    implot.SetupAxisLimits(_Y, bottom - margin, top + margin, _ALWAYS)
    implot.SetupLegend(implot.ImPlotLocation_NorthWest, implot.ImPlotLegendFlags_Horizontal)
    thin_s = _thin_time(time_s)
    for label, shown, colour in drawn:
        implot.SetNextLineStyle(colour, 1.5)
        implot.PlotLine(label, thin_s, shown)
    implot.EndPlot()


def _forces(history: History, window_s: float, size: tuple[float, float]) -> None:
    cone_N = history["cone_N"]
    _lines("force", "N", history, window_s, size, [
        ("normal", history["force_normal_N"], _BLUE),
        ("cone", cone_N, _GREY),
        ("tangential", history["force_tangential_N"], _ORANGE),
    ], 0.5)  # fmt: skip


def _modes(history: History, window_s: float, size: tuple[float, float]) -> None:
    _lines("mode", "1 stick, 2 slip", history, window_s, size,
           [("contact", history["contact_mode"], _GREEN)], 2.0)  # fmt: skip


def _path(history: History, window_s: float, size: tuple[float, float]) -> None:
    rows = round(window_s / TICK_S)
    x_mm, z_mm = (1e3 * np.ascontiguousarray(history[name][-rows:][::4]) for name in ("tip_x_m", "tip_z_m"))
    if not implot.BeginPlot("##path", size, implot.ImPlotFlags_Equal):
        return
    implot.SetupAxes("tip x (mm)", "tip z (mm)", implot.ImPlotAxisFlags_AutoFit, implot.ImPlotAxisFlags_AutoFit)
    implot.SetupLegend(implot.ImPlotLocation_NorthWest)
    implot.SetNextLineStyle(_BLUE, 1.5)
    implot.PlotLine("path", x_mm, z_mm)
    implot.PlotScatter("now", x_mm[-1:], z_mm[-1:])
    implot.EndPlot()


def _ticks(history: History, window_s: float, size: tuple[float, float]) -> None:
    if len(history) and history["tick_count"].max() > 0:
        _lines("tick", "us", history, window_s, size, [
            ("with background", _COUNT_us * history["busy_count"], _GREY),
            ("tick", _COUNT_us * history["tick_count"], _BLUE),
        ], 100.0)  # fmt: skip
    else:
        _lines("tick", "ms", history, window_s, size, [
            ("took", 1e3 * history["took_s"], _BLUE)
        ], 1.0)  # fmt: skip


def _link(history: History, window_s: float, size: tuple[float, float]) -> None:
    def kB_s(name: str) -> Floats:
        """Over 100 ms."""
        bytes_per_tick = history[name]
        if len(bytes_per_tick) < 100:
            return np.zeros(len(bytes_per_tick))
        total = np.concatenate([[0.0], np.cumsum(bytes_per_tick)])
        mean = (total[100:] - total[:-100]) / 100.0
        return np.asarray(np.concatenate([np.full(99, mean[0]), mean]))

    _lines("link", "kB/s", history, window_s, size, [
        ("to board", kB_s("link_down_bytes"), _BLUE), ("to host", kB_s("link_up_bytes"), _ORANGE),
    ], 10.0)  # fmt: skip


def _losses(history: History, window_s: float, size: tuple[float, float]) -> None:
    _lines("lost so far", "frames", history, window_s, size, [("both directions", history["frames_lost"], _RED)], 5.0)


def _age(history: History, window_s: float, size: tuple[float, float]) -> None:
    _lines("model age", "ms", history, window_s, size, [("age", 1e3 * history["model_age_s"], _BLUE)], 50.0)


def _energy(history: History, window_s: float, size: tuple[float, float]) -> None:
    _lines("energy", "mJ", history, window_s, size, [("into the body", 1e3 * history["absorbed_J"], _GREEN)], 1.0)


def _late(history: History, window_s: float, size: tuple[float, float]) -> None:
    rows = round(window_s / TICK_S)
    late_ms = 1e3 * np.minimum(np.ascontiguousarray(history["late_s"][-rows:]), 0.02)
    if not implot.BeginPlot("##late", size):
        return
    implot.SetupAxes("a tick begins late by (ms, 20 and more as 20)", "ticks", 0, implot.ImPlotAxisFlags_AutoFit)
    implot.SetupAxisLimits(_X, 0.0, 20.0, _ALWAYS)
    if len(late_ms):
        implot.PlotHistogram("##wall clock", late_ms, 40, 1.0, (0.0, 20.0))
    implot.EndPlot()


PLOTS = (
    Plot("forces and cone", _forces),
    Plot("contact mode", _modes),
    Plot("tip path", _path),
    Plot("tick time", _ticks),
    Plot("link", _link),
    Plot("losses", _losses),
    Plot("model age", _age),
    Plot("energy", _energy),
    Plot("jitter", _late),
)
DEFAULT = ("forces and cone", "tip path", "model age", "link", "jitter")


class PlotPanel:
    """Which plots are shown, and how far back."""

    def __init__(self) -> None:
        self.shown = list(DEFAULT)
        self.window_s = 5.0

    def draw(self, history: History) -> None:
        """In the present window, in all of its height."""
        if psim.Button("plots..."):
            psim.OpenPopup("plots")
        psim.SameLine()
        psim.SetNextItemWidth(150)
        _, self.window_s = psim.SliderFloat("back", self.window_s, 1.0, 10.0, "%.0f s", psim.ImGuiSliderFlags_AlwaysClamp)
        if psim.BeginPopup("plots"):
            for plot in PLOTS:
                changed, wanted = psim.Checkbox(plot.name, plot.name in self.shown)
                if changed and wanted:
                    self.shown.append(plot.name)
                elif changed:
                    self.shown.remove(plot.name)
            psim.EndPopup()
        shown = [plot for plot in PLOTS if plot.name in self.shown]
        if not shown:
            return
        width, height = psim.GetContentRegionAvail()
        each = max(110.0, height / len(shown) - 4.0)
        for plot in shown:
            plot.draw(history, self.window_s, (width, each))
