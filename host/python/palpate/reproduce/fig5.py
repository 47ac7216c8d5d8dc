"""Figure 5: where on the mesh the states of the reduced model lie (section 2.2)."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from palpate.reduce.study import Reduction
from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Study, Table
from palpate.reproduce.reductions import CLOSED_2D, ORDER_2D, TOLERANCE

Array = NDArray[np.float64]

ONE_EDGE, THREE_EDGES = "one edge", "three edges"
DISTANCES = (2.0, 3.0, 4.0)
# A quarter of the mesh's width: a state spread evenly has 10 % of itself within it.
NEAR, LEAST_NEAR = 3.0, 0.5
# From half the mesh's depth on.
FAR = 6.0


def collect(reduction: Reduction) -> Record:
    """distance (n,): of the free nodes from the contact node, in cells; place (n, 2): i, k; size (2,): of the mesh in
    nodes; contact (2,): the contact node's place; share, left_share (n, order): of
    the squared components of each reduced state on each node, sum 1 over the nodes; weight (order,): Hankel singular values
    relative to their sum. share: of displacements that a state stands for (columns of the balancing transformation),
    left_share: of displacements that it is read from (rows of its inverse)."""
    system, body = reduction.system, reduction.system.body
    nodes = np.unique(system.node)
    place = np.array([body.coordinates(int(node)) for node in nodes])[:, [0, 2]]
    contact = np.array(body.coordinates(system.contact_node))[[0, 2]]

    def share(shapes: Array) -> Array:
        squared = np.zeros((len(nodes), shapes.shape[1]))
        np.add.at(squared, np.searchsorted(nodes, system.node), shapes**2)
        return np.asarray(squared / squared.sum(axis=0))

    left = reduction.balanced.left[: reduction.projected.size, : reduction.order]
    weight = reduction.hankel_N_m[: reduction.order]
    return {
        "place": place,
        "size": np.array([body.shape[0], body.shape[2]]),
        "contact": contact,
        "distance": np.linalg.norm(place - contact, axis=1),
        "share": share(reduction.shapes()),
        "left_share": share(left if reduction.basis is None else reduction.basis @ left),
        "weight": weight / weight.sum(),
    }


def within(record: Record, distance: float, name: str = "share") -> float:
    """Share of the states, weighted, within this distance of the contact node."""
    return float((record[name] @ record["weight"])[record["distance"] <= distance].sum())


def rings(record: Record) -> tuple[Array, Array]:
    """Distances of rings one cell wide, and the root mean square of a node's weighted component there."""
    weighted = record["share"] @ record["weight"]
    ring = np.rint(record["distance"]).astype(int)
    numbers = np.unique(ring)
    mean = np.array([np.sqrt(weighted[ring == number].mean()) for number in numbers])
    distance = np.array([record["distance"][ring == number].mean() for number in numbers])
    return distance, mean


def exponent(record: Record) -> float:
    """Of the distance, in the power law that fits the rings best."""
    distance, mean = rings(record)
    return float(np.polyfit(np.log(distance), np.log(mean), 1)[0])


def far_share(record: Record) -> float:
    """A node's mean share beyond FAR, over that of a node next to the contact."""
    weighted = record["share"] @ record["weight"]
    return float(weighted[record["distance"] > FAR].mean() / weighted[record["distance"] < 1.5].mean())


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    local = "the states of the new low-order model show that it is a local approximation"
    decay = "stress decays inversely proportional to the square of the distance from the load"
    three = records[THREE_EDGES]
    even = float((three["distance"] <= NEAR).mean())
    rows = [
        Check(
            f"least share of one of the {three['share'].shape[1]} states within {NEAR:g} cells: {THREE_EDGES} held",
            local,
            float(three["share"][three["distance"] <= NEAR].sum(axis=0).min()),
            "",
            "reported only: the later states, of little weight, reach further",
        )
    ]
    for name, record in records.items():
        judged = name == THREE_EDGES
        unjudged = "reported only: where the sides are free, the sheet swings as a whole, and its largest states with it"
        rows += [
            Check(
                f"share of the states within {NEAR:g} cells of the contact node: {name} held",
                local,
                within(record, NEAR),
                "",
                f"{NO_NUMBER}; most of each state, weighted by its Hankel singular value, in a quarter of the mesh’s width, "
                f"where an evenly spread state would have {100 * even:.0f} %"
                if judged
                else unjudged,
                at_least=LEAST_NEAR if judged else None,
            ),
            Check(
                f"a node’s mean share more than {FAR:g} cells away, over that of a node next to the contact: {name} held",
                decay,
                far_share(record),
                "",
                f"{NO_NUMBER}; an inverse square of the share, 1/{FAR:g}², is slower than what the paper says of the stress"
                if judged
                else unjudged,
                at_most=1.0 / FAR**2 if judged else None,
            ),
            Check(
                f"exponent of the distance in the decay of a node’s component: {name} held",
                f"{decay}, exponent -2, in a semi-infinite body in 3D under a point load",
                exponent(record),
                "",
                "reported only: this is a sheet, 12 cells deep, and components are displacements, not stresses; on a "
                "half-plane under a load stress goes with 1/r, displacement with its logarithm",
            ),
            Check(
                f"share within {NEAR:g} cells of the weights with which the states are read from the mesh: {name} held",
                local,
                within(record, NEAR, "left_share"),
                "",
                "reported only: the paper does not say which of the two transformations its figure shows",
            ),
        ]
    return rows


def tables(records: Records) -> list[Table]:
    """Each state's share near the contact."""
    found = []
    for name, record in records.items():
        near = [record["share"][record["distance"] <= distance].sum(axis=0) for distance in DISTANCES]
        rows = [(i + 1, float(weight), *(float(share[i]) for share in near)) for i, weight in enumerate(record["weight"])]
        found.append(
            Table(
                f"Share of each state near the contact, {name} held; weighted by Hankel singular values: "
                + ", ".join(f"{within(record, distance):.2f} within {distance:g} cells" for distance in DISTANCES),
                ("state", "relative weight", *(f"within {distance:g} cells" for distance in DISTANCES)),
                tuple(rows),
            )
        )
    return found


def _map(panel: Axes, record: Record, magnitude: Array) -> Any:
    shown = np.full(record["size"][::-1], np.nan)
    shown[record["place"][:, 1], record["place"][:, 0]] = magnitude / magnitude.max()
    image = panel.imshow(shown, origin="lower", cmap=colormaps["Blues"].with_extremes(bad="0.8"), vmin=0.0, vmax=1.0)
    panel.plot(*record["contact"], "v", color=plot.RED, markersize=5)
    panel.set(xticks=[], yticks=[])
    panel.grid(False)
    return image


def draw(records: Records, file: Path) -> None:
    """Maps of the first states' magnitudes and of all states together, and the decay with distance."""
    figure = Figure(figsize=(7.2, 7.4), dpi=140, layout="constrained")
    axes = figure.subplots(3, 3, height_ratios=(1.0, 1.0, 1.1))
    record = records[THREE_EDGES]
    for state, panel in enumerate(axes[:2].flat):
        magnitude = np.sqrt(record["share"][:, state])
        image = _map(panel, record, magnitude)
        panel.set_title(f"state {state + 1}, weight {record['weight'][state]:.2g}", fontsize=9)
    figure.colorbar(image, ax=list(axes[:2].flat), shrink=0.6, label="magnitude")
    for panel, name in zip(axes[2, :2], (THREE_EDGES, ONE_EDGE), strict=True):
        weighted = np.sqrt(records[name]["share"] @ records[name]["weight"])
        _map(panel, records[name], weighted)
        panel.set_title(f"all states, {name} held", fontsize=9)
    panel = axes[2, 2]
    for name, colour in ((THREE_EDGES, plot.BLUE), (ONE_EDGE, plot.LIGHT_BLUE)):
        distance, mean = rings(records[name])
        panel.loglog(distance, mean / mean[0], "o-", color=colour, markersize=3, linewidth=1.2, label=f"{name} held")
    law = (distance / distance[0]) ** -2.0
    panel.loglog(distance, law, "--", color=plot.GREY, linewidth=1.2, label="1/r²")
    panel.grid(alpha=0.25)
    panel.set(xlabel="distance from the contact [cells]", title="mean magnitude of a node")
    panel.title.set_fontsize(9)
    panel.set_xticks([1, 2, 5, 10], ["1", "2", "5", "10"])
    panel.set_xticks([], minor=True)
    panel.legend(fontsize=7, loc="lower left")
    plot.save(figure, file)


FIGURE = PaperFigure(
    name="fig5",
    title="Spatial dependence of the states of the reduced model",
    claims=(
        (
            "The figure shows the magnitude of the components of the reduced-order model states with respect to the location "
            "on the mesh. The states of the new low-order model show that it is a local approximation.",
            "2.2",
        ),
        (
            "This result is actually expected, because stress decays inversely proportional to the square of the distance "
            "from the load in a semi-infinite linear elastic body under a point load.",
            "2.2",
        ),
    ),
    setting=(
        "The 20 states of the sheet at a damping ratio of 1, spread over the mesh: for each one the displacements of "
        "the nodes that it stands for. A node’s share is its part of their squares. Where states are put together, each counts by "
        "its Hankel singular value. The triangle is the contact node; nodes that are held are grey.",
        "Two meshes have the paper’s 524 states (see Table 2). The one with three edges held, as in the paper’s "
        "text, is judged. With one edge held the states are not local by the same measure: the sheet’s free sides swing. Its "
        "tolerances were set for both before measuring; this one fails them and is only reported.",
        "That states are near the contact does not say that a local model will do: see docs/reduction.md, and Figure 8.",
    ),
    caption="Magnitude of the first six states (three edges held) and of all states on the mesh, and its decay with distance.",
    studies=(
        Study(
            THREE_EDGES,
            "square",
            {"body.nodes": [13, 13], **CLOSED_2D},
            order=ORDER_2D,
            tolerance=TOLERANCE,
            collect=collect,
        ),
        Study(ONE_EDGE, "square", order=ORDER_2D, tolerance=TOLERANCE, collect=collect),
    ),
    checks=checks,
    draw=draw,
    tables=tables,
)
