"""Histograms of the latencies, a row for each medium."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.link_bench.runs import LinkRun
from palpate.reproduce import plot

_BINS = 40


def draw_latencies(done: Sequence[LinkRun], file: Path) -> None:
    """Of the runs: tip to host, and host to model in use, on a logarithmic axis of ms."""
    figure, axes = plot.grid(len(done), 2, (0.42,) * len(done))
    everything = np.concatenate([np.concatenate([one.tip_ticks, one.model_ticks]) for one in done] or [np.ones(1)])
    edges = np.geomspace(0.9, max(2.0, 1.1 * float(everything.max(initial=1))), _BINS)
    for row, one in enumerate(done):
        for panel, ticks, colour in zip(axes[row], (one.tip_ticks, one.model_ticks), (plot.BLUE, plot.RED), strict=True):
            _histogram(panel, ticks, edges, colour)
        axes[row, 0].set_ylabel(f"{one.medium}\n{one.rate_Hz} Hz\nshare [%]", fontsize=7)
    for column, label in enumerate(("tip's sample to host [ms]", "host to model in use [ms]")):
        for row in range(len(done) - 1):
            axes[row, column].tick_params(labelbottom=False)
        axes[-1, column].set_xlabel(label, fontsize=8)
    figure.suptitle("Latency by medium, virtual time", fontsize=9)
    plot.save(figure, file)


def _histogram(panel: plot.Axes, ticks: NDArray[np.int64], edges: NDArray[np.float64], colour: str) -> None:
    if len(ticks):
        panel.hist(ticks, bins=edges, weights=np.full(len(ticks), 100.0 / len(ticks)), color=colour)
    panel.set_xscale("log")
    panel.set_xlim(edges[0], edges[-1])
    panel.set_xticks([x for x in (1, 2, 5, 10, 20, 50, 100, 200) if x <= edges[-1]])
    panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    panel.minorticks_off()
    panel.tick_params(labelsize=7)
