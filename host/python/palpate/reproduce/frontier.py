"""The speed study: certified error against order and time against states, to meshes beyond the paper's (section 2.2)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.reduce.study import Reduction
from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Study, Table
from palpate.reproduce.reductions import states_check
from palpate.reproduce.table1 import PAPER_2D, PAPER_3D

Array = NDArray[np.float64]

ORDER = 20
ORDERS = (2, 4, 6, 8, 10, 14, 20, 28, 40, 56)
# (dimension, nodes a side)
MESHES = ((2, 12), (2, 25), (3, 12), (3, 20))
PAPER_STATES = {"12 x 12": 524, "25 x 25": 2396}
LARGEST_ERROR = 0.01
# Up to this many times the projection's error, order has little to do with what is left.
_OF_PROJECTION = 2.0


def mesh_name(dimension: int, n: int) -> str:
    """As in 12 x 12."""
    return " x ".join([str(n)] * dimension)


def collect(reduction: Reduction) -> Record:
    """order (k,): of ORDERS, those the projection has; certified, a_priori (k,): relative bounds at each; projected: states
    that were balanced."""
    orders = [order for order in ORDERS if order <= reduction.balanced.largest_order]
    at_orders = [reduction.at_order(order) for order in orders]
    return {
        "states": np.array(reduction.system.states),
        "projected": np.array(2 * reduction.projected.size),
        "projection_error": np.array(reduction.projection_error),
        "order": np.array(orders),
        "certified": np.array([other.certified_error for other in at_orders]),
        "a_priori": np.array([other.a_priori_bound for other in at_orders]),
    }


def steps(record: Record) -> Array:
    """Certified error at each order over that at the order before, down to where the projection's error takes over."""
    certified = np.asarray(record["certified"], dtype=np.float64)
    above = certified[1:] > _OF_PROJECTION * float(record["projection_error"])
    return np.asarray((certified[1:] / certified[:-1])[above])


def certified_at(record: Record, order: int) -> float:
    """The certified error at one of ORDERS."""
    return float(record["certified"][np.flatnonzero(record["order"] == order)[0]])


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    paper = records["25 x 25"]
    largest = records[mesh_name(*MESHES[-1])]
    return [
        states_check(records, PAPER_STATES),
        Check(
            "processor time for 25 x 25, 2,396 states",
            "1,172.1 s, on another machine",
            float(paper["processor_s"]),
            "s",
            "reported only: it depends on the machine. The aim is 2 s",
        ),
        Check(
            f"certified error of 25 x 25 at order {ORDER}",
            "0.307 %, undefined; less than 1 % for the 12 x 12 mesh",
            100.0 * certified_at(paper, ORDER),
            "%",
            "1 %, the paper’s word for a good reduction, here for all frequencies",
            at_most=100.0 * LARGEST_ERROR,
        ),
        Check(
            "largest certified error over that at the next lower order, all meshes",
            NO_NUMBER,
            max(float(steps(record).max()) for record in records.values()),
            "",
            f"at most 1: more states must not be worse. Errors within {_OF_PROJECTION:g} times the projection’s are left out: "
            "order has little to do with them",
            at_most=1.0,
        ),
        Check(
            "largest certified error over the bound known before truncation, at equal order, all meshes",
            NO_NUMBER,
            max(float((record["certified"] / record["a_priori"]).max()) for record in records.values()),
            "",
            "at most 1: no error of a balanced truncation exceeds twice the sum of the singular values left out",
            at_most=1.0,
        ),
        Check(
            f"processor time for {mesh_name(*MESHES[-1])}, {int(largest['states']):,} states",
            "no mesh above 2,396 states",
            float(largest["processor_s"]),
            "s",
            "reported only: it depends on the machine",
        ),
        Check(
            f"its certified error at order {ORDER}",
            "no mesh above 2,396 states",
            100.0 * certified_at(largest, ORDER),
            "%",
            "reported only: the paper has nothing to compare it with",
        ),
    ]


def tables(records: Records) -> list[Table]:
    """Meshes, and the errors at each order."""
    meshes = [(dimension, n, records[mesh_name(dimension, n)]) for dimension, n in MESHES]
    return [
        Table(
            f"Meshes; certified error at order {ORDER}",
            ("dimension", "nodes a side", "states", "order", "projected states", "processor time [s]", "certified [%]"),
            tuple(
                (dimension, n, int(record["states"]), ORDER, int(record["projected"]), float(record["processor_s"]))
                + (100.0 * certified_at(record, ORDER),)
                for dimension, n, record in meshes
            ),
            main=True,
        ),
        *(
            Table(
                f"{mesh_name(dimension, n)}: {int(record['states']):,} states",
                ("order", "certified [%]", "known before truncation [%]", "of it the projection’s [%]"),
                tuple(
                    (int(order), 100.0 * float(certified), 100.0 * float(a_priori))
                    + (100.0 * float(record["projection_error"]),)
                    for order, certified, a_priori in zip(
                        record["order"], record["certified"], record["a_priori"], strict=True
                    )
                ),
            )
            for dimension, n, record in meshes
        ),
    ]


def draw(records: Records, file: Path) -> None:
    """Above certified errors against order, below time against states."""
    figure, (above, below) = plot.panels((1.5, 1.2), share_x=False)
    look = zip(MESHES, ((plot.LIGHT_BLUE, "o"), (plot.BLUE, "o"), (plot.GREEN, "s"), (plot.VIOLET, "s")), strict=True)
    for (dimension, n), (colour, marker) in look:
        record = records[mesh_name(dimension, n)]
        name = f"{mesh_name(dimension, n)}: {int(record['states']):,} states"
        above.loglog(record["order"], record["certified"], f"{marker}-", color=colour, markersize=4, label=name)
        above.loglog(record["order"], record["a_priori"], ":", color=colour, linewidth=1)
        below.loglog(record["states"], record["processor_s"], marker, color=colour, markersize=7, label=mesh_name(dimension, n))
    above.plot([], [], ":", color=plot.GREY, linewidth=1, label="dotted: known before truncation")
    above.axhline(LARGEST_ERROR, color=plot.GREY, linestyle="--", linewidth=1)
    above.set(xlabel="order (states kept)", ylabel="certified error, relative")
    above.set_xticks(ORDERS, [str(order) for order in ORDERS])
    above.minorticks_off()
    plot.legend(above, place="lower left")
    for rows, marker, words in ((PAPER_2D, "o", "2D"), (PAPER_3D, "s", "3D")):
        states, seconds = [row[0] for row in rows.values()], [row[1] for row in rows.values()]
        label = f"paper, its machine, {words}"
        below.loglog(states, seconds, f"{marker}-", color=plot.RED, markersize=4, linewidth=1, label=label)
    below.set(xlabel="states of the full model", ylabel="processor time [s]")
    plot.legend(below, place="upper right")
    below.set_ylim(top=1e4)
    plot.save(figure, file)


FIGURE = PaperFigure(
    name="frontier",
    title="Error of the reduction against order, and its time up to meshes beyond the paper’s",
    claims=(
        (
            "Balanced model reduction also requires costly calculations. Balanced optimal Hankel model reduction (sysbal.m in "
            "Matlab) was used and has a complexity of O(N³), where N is the order of the full-order model. [Table 1: 1,172.1 s "
            "for 2,396 states.]",
            "2.2",
        ),
    ),
    setting=(
        "Sheets and blocks as in Table 1. Each is projected once, with a certified error of 1e-6, and the projection balanced "
        "once; it is then truncated to each order. The certified error bounds that of the strictly proper part at all "
        "frequencies, over its largest response, the projection’s part included.",
        "Times are processor times of one core of this machine, from the body to the reduction to 20 states, errors’ norms "
        "included; the paper’s are of another machine. Memory is not measured here, because it takes a process for each mesh: "
        "host/bench/reduction.py does that, and docs/benchmarks.md has it.",
    ),
    caption="Above: certified error against order; dashed: 1 %. Below: time against the states of the full model.",
    studies=tuple(
        Study(
            mesh_name(dimension, n),
            "square" if dimension == 2 else "cube",
            {"body.nodes": [n] * dimension},
            order=ORDER,
            collect=collect,
        )
        for dimension, n in MESHES
    ),
    checks=checks,
    draw=draw,
    tables=tables,
)
