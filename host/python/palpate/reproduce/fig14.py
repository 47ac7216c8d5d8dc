"""Figure 14: dragging without friction (section 5.2)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Run
from palpate.reproduce.forces import contact_forces, dragging, largest_ratio

# Zero in the paper. The force is a number times the normal in single precision: each component and the normal's own
# length are rounded at 6e-8, a few of which add up.
LARGEST_TANGENTIAL_RATIO = 1e-6
# 1 would be a body that is equally stiff everywhere and answers at once.
SMALLEST_CORRELATION = 0.9


def depth_m(record: Record) -> NDArray[Any]:
    """How far the tip is below the top of the body at rest, per tick; 0 above it."""
    top_m = float(record["body/rest_m"][:, 2].max())
    return np.clip(top_m - record["ticks/tip_m"][:, 2].astype(np.float64), 0.0, None)


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    record = records["drag"]
    forces = contact_forces(record)
    touching = forces.touching
    lost = int(np.count_nonzero(dragging(record) & ~touching))
    correlation = 0.0
    if np.ptp(forces.normal_N) > 0.0:
        correlation = float(np.corrcoef(depth_m(record), forces.normal_N)[0, 1])
    return [
        Check(
            "largest tangential force relative to the normal force",
            "the tangential force was zero throughout the experiment",
            largest_ratio(forces.tangential_N[touching], forces.normal_N[touching]),
            "",
            "zero up to the rounding of single precision: the force is a number times the contact normal",
            at_most=LARGEST_TANGENTIAL_RATIO,
        ),
        Check(
            "correlation of the normal force with the depth of the tip",
            "when the instrument is pushed into the surface, forces are generated in the normal direction",
            correlation,
            "",
            f"{NO_NUMBER}; below 1, since the body is stiffer under a node than between nodes, and softer at its edges",
            at_least=SMALLEST_CORRELATION,
        ),
        Check(
            "ticks without contact while the hand drags",
            "loss of contact as the instrument rolls over triangle boundaries is named as a weak point (section 6.2)",
            lost,
            "ticks",
            "the hand presses throughout the drag, so contact must hold, over triangle edges too",
            at_most=0,
        ),
        Check(
            "largest normal force",
            NO_NUMBER,
            float(forces.normal_N.max(initial=0.0)),
            "N",
            "reported only",
        ),
    ]


def draw(records: Records, file: Path) -> None:
    """Normal and tangential force, and the depth, over time."""
    record = records["drag"]
    forces = contact_forces(record)
    figure, (above, below) = plot.panels((1.3, 0.7))
    above.plot(forces.time_s, forces.normal_N, color=plot.BLUE, linewidth=0.8, label="normal force")
    above.plot(
        forces.time_s, forces.tangential_N, color=plot.RED, linewidth=1.0, linestyle=":", label="tangential force"
    )
    above.set_ylabel("force [N]")
    plot.legend(above)
    below.plot(forces.time_s, 1e3 * depth_m(record), color=plot.GREY, linewidth=1.0)
    below.set(xlabel="time [s]", ylabel="depth of\nthe tip [mm]")
    plot.save(figure, file)


FIGURE = PaperFigure(
    name="fig14",
    title="Pure slipping: dragging without friction",
    claims=(
        (
            "The magnitude of the tangential force response was zero throughout the experiment. When the instrument is "
            "pushed into the surface, contact forces are generated in the normal direction but not in the tangential "
            "direction, consistent with a zero-friction model.",
            "5.2",
        ),
    ),
    setting=(
        "The paper moved the instrument by hand to one edge of the mesh and dragged it over the surface. Here the "
        "simulated hand presses 3 mm in, drags 3.5 cm, presses 3 mm more and drags another 3 cm, with a coefficient of "
        "friction of 0, through encoders, motors and the kinematic coupling of tip and contact point that the paper has.",
        "Normal and tangential are meant in the contact normal with which the board computed the force in that tick. "
        "The force rises and falls with the nodes that the tip passes, 1 cm apart.",
    ),
    caption="Normal and tangential force, and the tip's depth below the surface at rest.",
    runs=(Run("drag", "fig14"),),
    checks=checks,
    draw=draw,
)
