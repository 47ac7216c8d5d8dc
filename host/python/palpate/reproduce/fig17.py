"""Figure 17: oscillation when the operator loosens the grip, without and with the local model (section 6.1)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Run
from palpate.reproduce.forces import time_s
from palpate.scene_sections import TICK_S

LOOSEN_S = 1.5
# Grips after loosening; 1 keeps the grip, 0 lets go.
GRIPS = (1.0, 0.3, 0.2, 0.1, 0.03, 0.01, 0.0)
# How often the largest unstable grip without the local model is bisected, between it and the calm one above it.
BISECTIONS = 4
# What counts as none: below twice the encoders' resolution of 0.03 mm, which the arm may rattle about in.
LARGEST_CALM_M = 5e-5
# What counts as oscillation: ten times that.
SMALLEST_OSCILLATION_M = 5e-4
# Settling after the grip has changed; then the tip's motion is judged.
_SETTLE_S = 1.0
# The tip's motion slower than this is drift.
_HIGH_PASS_S = 0.5
_WITH, _WITHOUT = "with", "without"


def _name(kind: str, grip: float) -> str:
    return f"{kind}_{grip:g}"


def was_cut(record: Record) -> bool:
    """The board's supervisor has switched the motors off."""
    return bool(np.any(record["ticks/faults"]))


def oscillation(record: Record) -> tuple[float, float]:
    """Peak-to-peak amplitude in m and frequency in Hz of the tip's motion after settling, along the axis on which it is
    largest; drift over more than 0.5 s is taken out by a moving mean. The frequency is that of the largest line of the
    spectrum; NaN without motion. Up to where the board has cut the motors, for what moves then is the arm alone; both NaN
    where that was too soon to tell."""
    driven = np.cumsum(record["ticks/faults"] != 0) == 0
    tip_m = record["ticks/true_tip_m"][driven & (time_s(record) >= LOOSEN_S + _SETTLE_S)]
    half = round(0.5 * _HIGH_PASS_S / TICK_S)
    if len(tip_m) <= 2 * half:
        return float("nan"), float("nan")
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), tip_m]), axis=0)
    mean_m = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    moving_m = tip_m[half:-half] - mean_m
    spans_m = np.ptp(moving_m, axis=0)
    axis = int(np.argmax(spans_m))
    if spans_m[axis] == 0.0:
        return 0.0, float("nan")
    spectrum = np.abs(np.fft.rfft((moving_m[:, axis] - moving_m[:, axis].mean()) * np.hanning(len(moving_m))))
    line = int(np.argmax(spectrum[1:])) + 1
    return float(spans_m[axis]), line / (len(moving_m) * TICK_S)


def _amplitudes_m(records: Records, kind: str) -> NDArray[Any]:
    return np.array([oscillation(records[_name(kind, grip)])[0] for grip in GRIPS])


def limit(records: Records, kind: str) -> tuple[float, float]:
    """The largest grip of all runs that is unstable, and the smallest calm one above it; NaN for none. A grip whose
    motors were cut is unstable."""
    spans_m = {
        float(name.removeprefix(f"{kind}_")): float("nan") if was_cut(record) else oscillation(record)[0]
        for name, record in records.items()
        if name.startswith(f"{kind}_")
    }
    unstable = max((grip for grip, span_m in spans_m.items() if not span_m <= LARGEST_CALM_M), default=float("nan"))
    return unstable, min((grip for grip in spans_m if grip > unstable), default=float("nan"))


def more(records: Records) -> tuple[Run, ...]:
    """The next grip of the bisection without the local model."""
    tried = sum(name.startswith(f"{_WITHOUT}_") for name in records) - len(GRIPS)
    middle = 0.5 * sum(limit(records, _WITHOUT))
    return (_run(_WITHOUT, middle),) if tried < BISECTIONS and np.isfinite(middle) else ()


def _worst_grip(amplitudes_m: NDArray[Any]) -> float:
    """The loosened grip with the largest oscillation that could be measured."""
    spans_m = np.where(np.isfinite(amplitudes_m), amplitudes_m, -1.0)
    return max((grip for grip in GRIPS if grip < 1.0), key=lambda grip: float(spans_m[GRIPS.index(grip)]))


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    without_m = _amplitudes_m(records, _WITHOUT)
    # Here a cut is a failure, however calm it was before.
    with_m = np.array([np.nan if was_cut(records[_name(_WITH, g)]) else oscillation(records[_name(_WITH, g)])[0] for g in GRIPS])
    loosened = [grip < 1.0 for grip in GRIPS]
    worst = _worst_grip(without_m)
    cut = sum(was_cut(records[_name(_WITHOUT, grip)]) for grip in GRIPS)
    without = "when the local linear approximation was not used, the haptic interface tended to have oscillatory behavior"
    with_it = "not present with the local linear approximation even when the operator completely released the instrument"
    return [
        Check(
            f"without the local model (30 Hz, held), grip loosened to {worst:g}: oscillation, peak to peak",
            without,
            1e3 * float(without_m[GRIPS.index(worst)]),
            "mm",
            f"{NO_NUMBER}: ten times what counts as none",
            at_least=1e3 * SMALLEST_OSCILLATION_M,
        ),
        Check(
            "its frequency",
            NO_NUMBER,
            oscillation(records[_name(_WITHOUT, worst)])[1],
            "Hz",
            "reported only",
        ),
        Check(
            "without, tight grip: oscillation, peak to peak",
            "oscillatory behavior when the operator loosens his/her grip",
            1e3 * float(without_m[0]),
            "mm",
            "reported only: the paper says nothing of a tight grip",
        ),
        Check(
            "without: grips at which the board cut the motors (too fast, out of the workspace, or energy created)",
            without,
            cut,
            "",
            "reported only: the safety supervisor ended the swing; one that was over within a second has no amplitude",
        ),
        Check(
            "without: largest grip that oscillates or is cut",
            NO_NUMBER,
            limit(records, _WITHOUT)[0],
            "",
            "reported only, bisected; 1 is a firm grip of 5,000 N/m",
        ),
        Check(
            "without: smallest calm grip above it",
            NO_NUMBER,
            limit(records, _WITHOUT)[1],
            "",
            "reported only: the limit of stability lies between the two",
        ),
        Check(
            "with the local model, tight grip: oscillation, peak to peak",
            with_it,
            1e3 * float(with_m[0]),
            "mm",
            "none: below twice the encoders’ resolution of 0.03 mm",
            at_most=1e3 * LARGEST_CALM_M,
        ),
        Check(
            "with the local model, loosened or released: largest oscillation, peak to peak",
            with_it,
            1e3 * float(np.max(with_m[loosened])),
            "mm",
            "none: below twice the encoders’ resolution of 0.03 mm",
            at_most=1e3 * LARGEST_CALM_M,
        ),
        Check(
            "with: largest grip that oscillates or is cut",
            with_it,
            limit(records, _WITH)[0],
            "",
            "reported only, out of those tried",
        ),
    ]


def draw(records: Records, file: Path) -> None:
    """The tip's height at the loose grip that oscillates most, and the amplitude over all grips."""
    figure, (above, below) = plot.panels((1.2, 1.2), share_x=False)
    grip = _worst_grip(_amplitudes_m(records, _WITHOUT))
    # A logarithmic axis has no place for 0: released stands one step to the left, stillness at the foot.
    places = np.array([each if each > 0.0 else 0.3 * min(filter(None, GRIPS)) for each in GRIPS])
    for kind, colour, marker, label in (
        (_WITHOUT, plot.RED, "s", "without the local model: 30 Hz, held"),
        (_WITH, plot.BLUE, "o", "with the local model"),
    ):
        record = records[_name(kind, grip)]
        above.plot(time_s(record), 1e3 * record["ticks/true_tip_m"][:, 2], color=colour, linewidth=0.8, label=label)
        spans_mm = 1e3 * _amplitudes_m(records, kind)
        below.plot(places, np.maximum(spans_mm, 1e-4), marker, color=colour, markersize=5, label=label)
        cut = np.isnan(spans_mm)
        if np.any(cut):
            high = np.full(int(np.count_nonzero(cut)), 100.0)
            below.plot(places[cut], high, "x", color=colour, markersize=8, label="motors cut by the board")
    above.axvline(LOOSEN_S, color="black", linewidth=0.6)
    above.annotate(
        f"grip 1 → {grip:g}",
        (LOOSEN_S, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(3, -10),
        textcoords="offset points",
        fontsize=8,
    )
    above.set(xlabel="time [s]", ylabel="height of the\ntip [mm]")
    plot.legend(above, place="lower left")
    below.axhline(1e3 * LARGEST_CALM_M, color=plot.GREY, linewidth=0.8, linestyle="--")
    below.set(xscale="log", yscale="log", xlabel="grip after loosening", ylabel="oscillation, peak\nto peak [mm]")
    below.set_xticks(places, [f"{each:g}" if each > 0.0 else "released" for each in GRIPS])
    below.minorticks_off()
    plot.legend(below, place="center right")
    plot.save(figure, file)


def _run(kind: str, grip: float) -> Run:
    overrides: dict[str, object] = {"hand.grip_changes": [{"time_s": LOOSEN_S, "grip": grip}]}
    if kind == _WITHOUT:
        overrides["model.feedback"] = "hold"
    return Run(_name(kind, grip), "fig17", overrides, may_fault=kind == _WITHOUT)


FIGURE = PaperFigure(
    name="fig17",
    title="Oscillation when the operator loosens the grip",
    claims=(
        (
            "[…] when the local linear approximation was not used, the haptic interface tended to have oscillatory behavior "
            "when the operator loosens his/her grip (Figure 17). This oscillatory behavior was not present with the "
            "local linear approximation even when the operator completely released the instrument.",
            "6.1",
        ),
    ),
    setting=(
        "The simulated hand presses 5 mm in with a firm grip, and at 1.5 s loosens it; without the local model the force "
        "is that of the global model at 30 Hz, held between updates. Oscillation is the tip’s motion in the plant from "
        "2.5 s on, without drift slower than 0.5 s, peak to peak along the axis on which it is largest. Where the "
        "board’s safety supervisor cut the motors before, there is no amplitude: the swing had grown too fast for it. Seven "
        "grips are tried; between the largest that swings without the local model and the calm one above it, four more.",
        "A loosened hand still rests on the tool: its grip is a softer spring. Completely released, the arm is pushed "
        "out by the body and floats away: it has no weight to fall back with, since the board compensates it. Then "
        "“no oscillation” means that it comes to rest without touching the body again and again.",
    ),
    caption="Above: the tip’s height at the grip with the largest oscillation. Below: oscillation over the grip; "
    "dashed: what counts as none.",
    runs=tuple(_run(kind, grip) for kind in (_WITHOUT, _WITH) for grip in GRIPS),
    checks=checks,
    draw=draw,
    more=more,
)
