"""Figure 17: oscillation when the operator loosens the grip, without and with the local model (section 6.1)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.reproduce import plot
from palpate.reproduce.checks import NO_NUMBER, Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Run
from palpate.reproduce.forces import TICK_S, time_s

LOOSEN_S = 1.5
# Grips after loosening; 1 keeps the grip, 0 lets go.
GRIPS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.0)
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


def oscillation(record: Record) -> tuple[float, float]:
    """Peak-to-peak amplitude in m and frequency in Hz of the tip's motion after settling, along the axis on which it is
    largest; drift over more than 0.5 s is taken out by a moving mean. The frequency is that of the largest line of the
    spectrum; NaN without motion."""
    tip_m = record["ticks/true_tip_m"][time_s(record) >= LOOSEN_S + _SETTLE_S]
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


def _largest_unstable_grip(amplitudes_m: NDArray[Any]) -> float:
    """NaN where every grip is calm."""
    return max(
        (grip for grip, span_m in zip(GRIPS, amplitudes_m, strict=True) if not span_m <= LARGEST_CALM_M),
        default=float("nan"),
    )


def checks(records: Records) -> list[Check]:
    """Rows of results.json."""
    without_m, with_m = _amplitudes_m(records, _WITHOUT), _amplitudes_m(records, _WITH)
    loosened = [grip < 1.0 for grip in GRIPS]
    held = [0.0 < grip < 1.0 for grip in GRIPS]
    worst = GRIPS[int(np.argmax(np.where(held, without_m, -1.0)))]
    without = "when the local linear approximation was not used, the haptic interface tended to have oscillatory behavior"
    with_it = "not present with the local linear approximation even when the operator completely released the instrument"
    return [
        Check(
            "without the local model (30 Hz, held), grip loosened: largest oscillation, peak to peak",
            without,
            1e3 * float(np.max(without_m[held])),
            "mm",
            f"{NO_NUMBER}: ten times what counts as none",
            at_least=1e3 * SMALLEST_OSCILLATION_M,
        ),
        Check(
            f"its frequency, at a grip of {worst:g}",
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
            "without: largest grip that oscillates",
            NO_NUMBER,
            _largest_unstable_grip(without_m),
            "",
            "reported only, out of those tried; 1 is a firm grip of 5,000 N/m",
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
            "with: largest grip that oscillates",
            with_it,
            _largest_unstable_grip(with_m),
            "",
            "reported only, out of those tried",
        ),
    ]


def draw(records: Records, file: Path) -> None:
    """The tip's height at one loose grip, and the amplitude over all grips."""
    figure, (above, below) = plot.panels((1.2, 1.2), share_x=False)
    held = [grip for grip in GRIPS if 0.0 < grip < 1.0]
    grip = max(held, key=lambda each: oscillation(records[_name(_WITHOUT, each)])[0])
    for kind, colour, label in (
        (_WITHOUT, plot.RED, "without the local model: 30 Hz, held"),
        (_WITH, plot.BLUE, "with the local model"),
    ):
        record = records[_name(kind, grip)]
        above.plot(time_s(record), 1e3 * record["ticks/true_tip_m"][:, 2], color=colour, linewidth=0.8, label=label)
        amplitudes_mm = 1e3 * _amplitudes_m(records, kind)
        # A logarithmic axis has no place for 0: released stands one step to the left, stillness at the foot.
        places = [each if each > 0.0 else 0.3 * min(held) for each in GRIPS]
        below.plot(places, np.maximum(amplitudes_mm, 1e-4), "o-", color=colour, linewidth=1.0, markersize=4, label=label)
    above.axvline(LOOSEN_S, color="black", linewidth=0.6)
    above.annotate(f"grip 1 → {grip:g}", (LOOSEN_S, 1.0), xycoords=("data", "axes fraction"), xytext=(3, -10),
                   textcoords="offset points", fontsize=8)
    above.set(xlabel="time [s]", ylabel="height of the\ntip [mm]")
    plot.legend(above, place="lower right")
    below.axhline(1e3 * LARGEST_CALM_M, color=plot.GREY, linewidth=0.8, linestyle="--")
    below.set(xscale="log", yscale="log", xlabel="grip after loosening", ylabel="oscillation, peak\nto peak [mm]")
    places = [each if each > 0.0 else 0.3 * min(held) for each in GRIPS]
    below.set_xticks(places, [f"{each:g}" if each > 0.0 else "released" for each in GRIPS])
    below.minorticks_off()
    plot.legend(below)
    plot.save(figure, file)


def _run(kind: str, grip: float) -> Run:
    overrides: dict[str, object] = {"hand.grip_changes": [{"time_s": LOOSEN_S, "grip": grip}]}
    if kind == _WITHOUT:
        overrides["model.feedback"] = "hold"
    return Run(_name(kind, grip), "fig17", overrides)


FIGURE = PaperFigure(
    name="fig17",
    title="Oscillation when the operator loosens the grip",
    claims=(
        (
            "When the local linear approximation was not used, the haptic interface tended to have oscillatory behavior "
            "when the operator loosens his/her grip (Figure 17). This oscillatory behavior was not present with the "
            "local linear approximation even when the operator completely released the instrument.",
            "6.1",
        ),
    ),
    setting=(
        "The simulated hand presses 5 mm in with a firm grip, and at 1.5 s loosens it; without the local model the force "
        "is that of the global model at 30 Hz, held between updates. Oscillation is the tip’s motion in the plant from "
        "2.5 s on, without drift slower than 0.5 s, peak to peak along the axis on which it is largest.",
        "A loosened hand still rests on the tool: its grip is a softer spring. Completely released, the arm is pushed "
        "out by the body and floats away: it has no weight to fall back with, since the board compensates it. Then "
        "“no oscillation” means that it comes to rest without touching the body again and again.",
    ),
    caption="Above: the tip’s height at the grip with the largest oscillation. Below: oscillation over the grip; "
    "dashed: what counts as none.",
    runs=tuple(_run(kind, grip) for kind in (_WITHOUT, _WITH) for grip in GRIPS),
    checks=checks,
    draw=draw,
)
