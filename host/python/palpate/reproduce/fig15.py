"""Figure 15: dragging with pure sticking (section 5.3)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Records, Run
from palpate.reproduce.forces import STICK, contact_forces, dragging, largest_ratio

SMALLEST_STICKING_SHARE = 0.99
# "Often": more often than not.
SMALLEST_SHARE_ABOVE_NORMAL = 0.5


def _share(of: NDArray[Any], among: NDArray[Any]) -> float:
    return float(np.mean(of[among])) if np.any(among) else float("nan")


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    record = records["drag"]
    forces = contact_forces(record)
    touching = forces.touching
    above = forces.tangential_N > forces.normal_N
    return [
        Check(
            "share of the contact that sticks",
            "pure sticking contact, to simulate a surface with a high coefficient of friction",
            _share(forces.mode == STICK, touching),
            "",
            "all of it, but for a few ticks where the tip lifts off and the normal force vanishes: the paper forbids slip "
            "there, here the coefficient of friction is 10",
            at_least=SMALLEST_STICKING_SHARE,
        ),
        Check(
            "share of the drag in contact in which the tangential force is above the normal force",
            "a tangential force often larger than the normal, as the motion is mostly in the tangential direction",
            _share(above, touching & dragging(record)),
            "",
            f"{NO_NUMBER}: “often” is taken as more often than not",
            at_least=SMALLEST_SHARE_ABOVE_NORMAL,
        ),
        Check(
            "the same share of all ticks in contact", NO_NUMBER, _share(above, touching), "", "reported only"
        ),
        Check(
            "largest tangential force relative to the normal force",
            NO_NUMBER,
            largest_ratio(forces.tangential_N[touching], forces.normal_N[touching]),
            "",
            "reported only",
        ),
    ]


def draw(records: Records, file: Path) -> None:
    """Normal and tangential force over time."""
    forces = contact_forces(records["drag"])
    figure, (axes,) = plot.panels((1.4,))
    axes.plot(forces.time_s, forces.normal_N, color=plot.BLUE, linewidth=0.9, label="normal force")
    axes.plot(
        forces.time_s, forces.tangential_N, color=plot.RED, linewidth=1.1, linestyle=":", label="tangential force"
    )
    axes.set(xlabel="time [s]", ylabel="force [N]")
    plot.legend(axes)
    plot.save(figure, file)


FIGURE = PaperFigure(
    name="fig15",
    title="Pure sticking: the tip takes the surface along",
    claims=(
        (
            "A tangential as well as a normal force was observed, with a tangential force often larger than the normal, "
            "as the motion of the instrument is mostly in the tangential direction.",
            "5.3",
        ),
    ),
    setting=(
        "The simulated hand presses 4 mm in, drags the surface 9 mm sideways and back, and lifts. The drag is shorter than "
        "in Figures 14 and 16: the surface goes along, and the tangential force grows with the way.",
        "The paper switches slip off; here the coefficient of friction is 10, the largest that a scene may have.",
    ),
    caption="Solid: normal force; dotted: tangential force, as in the paper's figure.",
    runs=(Run("drag", "fig15"),),
    checks=checks,
    draw=draw,
)
