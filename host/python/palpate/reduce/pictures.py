"""Pictures of `palpate reduce`: singular values and responses; where the states lie, and what patches miss."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from palpate.reduce.compliance import Comparison
from palpate.reduce.locality import GOOD_ERROR, Locality
from palpate.reduce.response import reduced_response
from palpate.reduce.state_space import state_space
from palpate.reduce.study import Reduction
from palpate.reproduce import plot

_FREQUENCIES = 300
# Singular values below this part of the largest are not shown.
_SMALLEST_SHOWN = 1e-16


def draw_reduction(reduction: Reduction, file: Path) -> None:
    """Hankel singular values with the order, and the frequency response of full and reduced model with their difference."""
    figure, (above, below) = plot.panels((1.2, 1.6), share_x=False)
    hankel = reduction.hankel_N_m / reduction.hankel_N_m[0]
    shown = hankel[hankel > _SMALLEST_SHOWN]
    kept = np.arange(1, len(shown) + 1) <= reduction.order
    number = np.arange(1, len(shown) + 1)
    above.semilogy(number[kept], shown[kept], "o", markersize=3, color=plot.BLUE, label=f"kept: {reduction.order}")
    above.semilogy(number[~kept], shown[~kept], "o", markersize=3, color=plot.LIGHT_BLUE, label="left out")
    above.set(xlabel="number of the state", ylabel="Hankel singular value\nrelative to the largest")
    plot.legend(above)

    system = reduction.system
    lowest, fastest = 0.03 * np.sqrt(system.slowest_1_s2), 10.0 * np.sqrt(system.fastest_1_s2)
    frequency_rad_s = np.geomspace(lowest, fastest, _FREQUENCIES)
    full = reduced_response(system, state_space(reduction.projected), frequency_rad_s)
    reduced = reduced_response(system, reduction.reduced, frequency_rad_s)

    def size(response: np.ndarray) -> np.ndarray:
        return np.linalg.norm(response, 2, axis=(1, 2))

    frequency_Hz = frequency_rad_s / (2.0 * np.pi)
    below.loglog(frequency_Hz, size(full), color=plot.LIGHT_RED, linewidth=4, label=f"full: {system.states:,} states")
    below.loglog(frequency_Hz, size(reduced), color=plot.BLUE, linewidth=1.2, label=f"reduced: {reduction.order}")
    below.loglog(frequency_Hz, size(full - reduced), color=plot.GREY, linewidth=1, label="difference")
    below.axhline(
        reduction.certified_error * reduction.norm_N_m,
        color=plot.GREY,
        linestyle="--",
        linewidth=1,
        label="its certified bound",
    )
    below.set(xlabel="frequency [Hz]", ylabel="force by displacement\n(2-norm) [N/m]")
    plot.legend(below, columns=2)
    plot.save(figure, file)


def draw_locality(locality: Locality, file: Path) -> None:
    """Left: the share of the states on the nodes of the section through the contact; right: the patches' errors."""
    figure = Figure(figsize=(9.6, 4.6), dpi=140, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    draw_section_bar(draw_section(*section(locality), left), figure, [left])
    name = locality.patches[0].name(locality.planar)
    left.set_title(f"Where the states lie ({100 * locality.state_share:.0f} % in {name})")
    right.axvspan(locality.update_rate_Hz, locality.frequency_Hz[-1], color="#eef3f8", zorder=0)
    right.axhline(GOOD_ERROR, color=plot.GREY, linestyle="--", linewidth=1, label=f"good: {GOOD_ERROR:g}")
    colours = np.linspace(0.0, 0.75, len(locality.patches))
    for patch, colour in zip(locality.patches, colours, strict=True):
        fits = "" if patch.fits else ": too many"
        right.loglog(
            locality.frequency_Hz,
            patch.error,
            color=(0.05 + 0.9 * colour, 0.2 + 0.5 * colour, 0.55 + 0.3 * colour),
            linestyle="-" if patch.fits else ":",
            label=f"{patch.name(locality.planar)} patch ({patch.modes} modes{fits})",
        )
    right.loglog(
        locality.frequency_Hz,
        locality.reduced_error,
        color=plot.GREEN,
        label=f"whole body reduced to {locality.reduction.order} states",
    )
    right.grid(alpha=0.25)
    right.set(xlabel="frequency [Hz]", ylabel="relative error of the force", title="What each model misses")
    right.annotate(
        "the local model alone",
        (np.sqrt(locality.update_rate_Hz * locality.frequency_Hz[-1]), 0.985),
        xycoords=("data", "axes fraction"),
        ha="center",
        va="top",
        fontsize=8,
        color=plot.GREY,
    )
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    plot.save(figure, file)


def draw_compliance(comparison: Comparison, file: Path) -> None:
    """Relative error of each builder's compliance by frequency: at the node, and in the middle of a triangle."""
    figure, (above, below) = plot.panels((1.5, 1.5))
    colours = np.linspace(0.0, 1.0, len(comparison.models))
    rising = comparison.frequency_Hz[1:]
    # Neighbours have much the same colour.
    styles = itertools.cycle(("-", "--", "-.", ":"))
    for one, shade, style in zip(comparison.models, colours, styles, strict=False):
        colour = (0.05 + 0.85 * shade, 0.25 + 0.3 * shade * (1 - shade), 0.6 - 0.5 * shade)
        label = f"{one.name()}: {one.modes} modes"
        for panel, error in ((above, one.at_node), (below, one.between_nodes)):
            panel.loglog(rising, error[1:], style, color=colour, linewidth=1.2, label=label)
    for panel, place in ((above, "at the node"), (below, "between nodes")):
        panel.axhline(0.01, color=plot.GREY, linestyle="--", linewidth=1)
        panel.set_ylim(1e-5, 2.0)
        panel.set_ylabel(f"relative error\n{place}")
    below.set_xlabel("frequency [Hz]")
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    plot.save(figure, file)


def section(locality: Locality) -> tuple[np.ndarray, np.ndarray]:
    """(nz, nx): the share on the nodes of the section through the contact, over the largest; (5,): lower left node of the
    first patch, its width and depth in nodes, and the contact's place along x."""
    system = locality.reduction.system
    nx, ny, nz = system.body.shape
    i, j, _ = system.body.coordinates(system.contact_node)
    share = locality.node_share.reshape(nz, ny, nx)[:, j, :]
    first = locality.patches[0]
    low = min(max(i - first.along // 2, 0), nx - first.along)
    return share / share.max(), np.array([low, nz - first.depth, first.along, first.depth, i])


def draw_section(share: np.ndarray, patch: np.ndarray, axes: Axes) -> AxesImage:
    """What `section` returns, as a picture without a colour bar, for which the image is returned."""
    nz, nx = share.shape
    low, bottom, along, depth, contact = patch
    shown = np.log10(np.maximum(share, 1e-4))
    image = axes.imshow(shown, origin="lower", cmap="Blues", vmin=-4, vmax=0, extent=(-0.5, nx - 0.5, -0.5, nz - 0.5))
    axes.add_patch(Rectangle((low - 0.5, bottom - 0.5), along, depth, fill=False, edgecolor=plot.RED, linewidth=1.5))
    axes.plot([contact], [nz - 1], "v", color=plot.RED, markersize=6)
    axes.set(xlabel="node along x", ylabel="node along z")
    return image


def draw_section_bar(image: AxesImage, figure: Figure, axes: Sequence[Axes]) -> None:
    """The colour bar of `draw_section`."""
    bar = figure.colorbar(image, ax=axes, shrink=0.75, ticks=[-4, -3, -2, -1, 0])
    bar.ax.set_yticklabels(["1e-4", "1e-3", "0.01", "0.1", "1"])
    bar.set_label("share, relative to the largest")
