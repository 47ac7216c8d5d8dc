"""Maps of stiffness over damping, a panel for what is varied."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from palpate.reproduce import plot
from palpate.stability.zwidth import Servo, of

_TITLES = {"rate_Hz": "servo rate", "delay_ticks": "delay", "count_m": "encoder count"}
_COLOURS = (plot.GREY, plot.GREEN, plot.BLUE, plot.VIOLET, plot.RED)
# Stands for a wall that is not even 10 N/m stiff.
_FLOOR_N_m = 5.0


def label(key: str, servo: Servo) -> str:
    """What is varied of a servo, with its unit."""
    if key == "rate_Hz":
        return f"{servo.rate_Hz / 1000.0:g} kHz"
    if key == "delay_ticks":
        return f"{servo.delay_ticks} ticks"
    return f"{1e6 * servo.count_m:g} um" if servo.count_m else "no counts"


def draw(rows: Sequence[dict[str, Any]], sweeps: Mapping[str, Sequence[Servo]], file: Path) -> None:
    """Below a line a wall creates less than 1 mJ. Dashed: without the controller."""
    figure, axes = plot.grid(len(sweeps), 1, (1.0,) * len(sweeps))
    for panel, (key, servos) in zip(axes[:, 0], sweeps.items(), strict=True):
        for servo, colour in zip(servos, _COLOURS, strict=False):
            for is_controlled, style in ((False, "--"), (True, "-")):
                line = of(rows, servo, is_controlled)
                panel.plot(
                    [row["damping_N_s_m"] for row in line],
                    [row["stiffest_N_m"] or _FLOOR_N_m for row in line],
                    style,
                    color=colour,
                    marker="o",
                    markersize=3,
                    label=f"{label(key, servo)}, controlled" if is_controlled else None,
                )
            if key == "count_m" and line and line[0]["quantization_N_m"]:
                panel.axhline(line[0]["quantization_N_m"], color=colour, linewidth=0.8, linestyle=":")
            if key == "rate_Hz" and line:
                panel.plot([0.0], [line[0]["colgate_N_m"]], "x", color=colour, clip_on=False)
        panel.set_yscale("log")
        panel.set_xscale("symlog", linthresh=0.5)
        panel.set_xlim(0.0, None)
        panel.set_ylabel("stiffest wall [N/m]", fontsize=8)
        panel.set_title(_TITLES[key], fontsize=9)
        panel.set_xticks([row["damping_N_s_m"] for row in of(rows, servos[0], False)])
        panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
        panel.minorticks_off()
        panel.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[-1, 0].set_xlabel("damping of the wall [N s/m]; dashed: without the controller; x: Colgate's bound; dotted: the count's bound", fontsize=8)
    plot.save(figure, file)
