"""Figure 16: dragging with sticking and frictional sliding (section 5.4)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Records, Run, Table
from palpate.reproduce.forces import SLIP, STICK, ContactForces, contact_forces, largest_ratio

KINETIC, STATIC = 1.0, 1.3
# |f_t| <= mu f_n holds up to the rounding of single precision (6e-8 in each component), a few of which add up.
_ROUNDING = 1e-6
# A drop is looked for as long as the slip lasts, at most this long: later changes of the force have other causes.
_DROP_TICKS = 20


def slip_events(forces: ContactForces) -> NDArray[Any]:
    """Last sticking tick before each slip. (events,) indices of ticks."""
    return np.flatnonzero((forces.mode[:-1] == STICK) & (forces.mode[1:] == SLIP))


def drops_N(forces: ContactForces) -> NDArray[Any]:
    """At each slip event, by how much the tangential force falls from the last sticking tick to its least value in the
    slip that follows, over 20 ms at most. (events,); negative where it only rises."""
    drops = []
    for event in slip_events(forces):
        after = forces.mode[event + 1 : event + 1 + _DROP_TICKS]
        ends = np.flatnonzero(after != SLIP)
        length = int(ends[0]) if len(ends) else len(after)
        least_N = forces.tangential_N[event + 1 : event + 1 + length].min()
        drops.append(forces.tangential_N[event] - least_N)
    return np.array(drops, dtype=np.float64)


def relative_drops(forces: ContactForces) -> NDArray[Any]:
    """The same, relative to the tangential force before. (events,)"""
    before_N = forces.tangential_N[slip_events(forces)]
    drops = drops_N(forces)
    return np.divide(drops, before_N, out=np.zeros_like(drops), where=before_N > 0.0)


def _median(values: NDArray[Any]) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _ratio(forces: ContactForces, ticks: NDArray[Any]) -> float:
    return largest_ratio(forces.tangential_N[ticks], forces.normal_N[ticks])


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    equal, above = contact_forces(records["equal"]), contact_forces(records["static"])
    events_equal, events_above = slip_events(equal), slip_events(above)
    bound = "the tangential force is bounded by the normal force, f_t ≤ µ f_n"
    rounding = "the bound itself, up to the rounding of single precision"
    decrease = "the algorithm switches from sticking to sliding, leading to a decrease in force (t = 61.8)"
    return [
        Check(
            "largest |f_t| / f_n, µ = 1",
            bound,
            _ratio(equal, equal.touching),
            "",
            rounding,
            at_most=KINETIC * (1.0 + _ROUNDING),
        ),
        Check(
            f"largest |f_t| / f_n in slip, static µ {STATIC:g}, kinetic {KINETIC:g}",
            bound,
            _ratio(above, (above.mode == SLIP) & ~above.ramped),
            "",
            rounding + "; without the ticks in which the board holds a drop of the force back, to 0.5 N a tick",
            at_most=KINETIC * (1.0 + _ROUNDING),
        ),
        Check(
            f"largest |f_t| / f_n in stick, static µ {STATIC:g}",
            bound,
            _ratio(above, above.mode == STICK),
            "",
            rounding + ", of static friction",
            at_most=STATIC * (1.0 + _ROUNDING),
        ),
        Check(
            "changes from stick to slip, µ = 1",
            "the algorithm switches from pure sticking to frictional sliding",
            len(events_equal),
            "",
            f"{NO_NUMBER}: at least one, or nothing is tested",
            at_least=1,
        ),
        Check(
            "median drop of the tangential force at these, µ = 1",
            decrease,
            _median(drops_N(equal)),
            "N",
            "reported only: with equal coefficients the force at the change is continuous; it stops growing, and falls "
            "only as the normal force does",
        ),
        Check(
            "largest drop, µ = 1", decrease, float(drops_N(equal).max(initial=0.0)), "N", "reported only, as above"
        ),
        Check(
            f"changes from stick to slip, static µ {STATIC:g}",
            "the algorithm switches from pure sticking to frictional sliding",
            len(events_above),
            "",
            f"{NO_NUMBER}: at least one, or nothing is tested",
            at_least=1,
        ),
        Check(
            f"median drop relative to the force before, static µ {STATIC:g}",
            decrease,
            _median(relative_drops(above)),
            "",
            f"{NO_NUMBER}; from {STATIC:g} f_n to {KINETIC:g} f_n it is {1 - KINETIC / STATIC:.2f}, less where sticking "
            "ends below that or the normal force rises: at least half of it",
            at_least=0.5 * (1.0 - KINETIC / STATIC),
        ),
        Check(
            f"largest drop, static µ {STATIC:g}",
            decrease,
            float(drops_N(above).max(initial=0.0)),
            "N",
            "reported only",
        ),
    ]


def tables(records: Records) -> list[Table]:
    """Every slip event of both runs."""
    found = []
    for name, title in (("equal", "µ = 1"), ("static", f"static µ {STATIC:g}")):
        forces = contact_forces(records[name])
        events = slip_events(forces)
        found.append(
            Table(
                f"Each change from stick to slip, {title}",
                ("time [s]", "normal force before [N]", "tangential force before [N]", "drop of the tangential force [N]"),
                tuple(
                    (float(forces.time_s[event]), float(forces.normal_N[event]), float(forces.tangential_N[event]), float(drop))
                    for event, drop in zip(events, drops_N(forces), strict=True)
                ),
            )
        )
    return found


def draw(records: Records, file: Path) -> None:
    """Normal and tangential force over time, with equal coefficients and with static above kinetic friction."""
    figure, axes = plot.panels((1.2, 1.2))
    for panel, name, title in (
        (axes[0], "equal", "µ = 1"),
        (axes[1], "static", f"static µ = {STATIC:g}, kinetic µ = {KINETIC:g}"),
    ):
        forces = contact_forces(records[name])
        panel.plot(forces.time_s, forces.normal_N, color=plot.BLUE, linewidth=0.9, label="normal force")
        panel.plot(
            forces.time_s,
            forces.tangential_N,
            color=plot.RED,
            linewidth=1.1,
            linestyle=":",
            label="tangential force",
        )
        events = slip_events(forces)
        panel.plot(
            forces.time_s[events],
            np.full(len(events), -0.12),
            "|",
            color=plot.GREY,
            markersize=5,
            label="stick to slip",
        )
        panel.set_ylabel("force [N]")
        panel.set_title(title, fontsize=10)
        plot.legend(panel)
    axes[-1].set_xlabel("time [s]")
    plot.save(figure, file)


FIGURE = PaperFigure(
    name="fig16",
    title="Stick-slip hybrid: friction that breaks loose",
    claims=(
        (
            "The tangential force is bounded by the normal force, since f_t ≤ µ f_n. Therefore, when the force generated "
            "by the sticking constraint rises above the normal force, the algorithm switches from pure sticking to "
            "frictional sliding, leading to a decrease in force. A typical transition event can be seen at t = 61.8.",
            "5.4",
        ),
    ),
    setting=(
        "The simulated hand presses 4 mm in and drags 6.6 cm across the body at a coefficient of friction of 1, the "
        "paper's; a second run raises static friction to 1.3.",
        "The hand drags in three strokes with a halt after each: contact sticks until it breaks loose, slides, and sticks "
        "again where the stroke ends.",
    ),
    caption="Solid: normal force; dotted: tangential force, as in the paper's figure. Ticks at the foot: changes from "
    "stick to slip.",
    runs=(
        Run("equal", "fig16"),
        Run("static", "fig16", {"contact.static_friction": STATIC}),
    ),
    checks=checks,
    draw=draw,
    tables=tables,
)
