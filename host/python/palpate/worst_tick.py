"""The longest servo tick of a board's firmware against its budget, in a run that is known to take long ones: a slide at 10 cm/s on the model
with the most work in a tick (docs/decisions/cycles.md).

    python -m palpate.worst_tick BOARD

`./run build` calls it. The table is left beside those of the board's images, too (palpate.image_budgets). Exit code 1 where the tick is over its budget, or the run fails.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from palpate import hil, versions
from palpate.experiment import Progress, no_progress
from palpate.image_budgets import WORST_TICK_FILE, folder
from palpate.paths import SCENES

SCENE = SCENES / "frontier/reference.toml"
SLIDE: dict[str, Any] = {
    "model.builder": "hybrid",
    "path.csv": "drag_10cm_s.csv",
    "contact.friction": 0.3,
    "duration_s": 1.65,
}
# Of an instruction, at most (docs/decisions/cycles.md).
CYCLES_PER_INSTRUCTION = 1.8
# The goal of the design for the servo tick, which no builder with the near field keeps.
GOAL_CYCLES = 60_000


# Of the cycles between two ticks, that the servo's may take, so that the background always goes on.
SERVO_SHARE = 0.7


@dataclass(frozen=True)
class Part:
    """Cycles between two ticks, and what the scene must have otherwise for this board's link."""

    tick_cycles: int
    overrides: Mapping[str, Any] = field(default_factory=dict)

    @property
    def servo_cycles(self) -> int:
        """The budget of the servo's tick."""
        return round(SERVO_SHARE * self.tick_cycles)


# mps2_an386 stands for an STM32G474, mps2_an500 for an i.MX RT1062 (docs/decisions/larger_part.md).
PARTS = {
    "mps2_an386": Part(170_000),
    "mps2_an500": Part(600_000),
    "nucleo_g474re": Part(170_000, {"link.medium": "canfd"}),
}


@dataclass(frozen=True)
class Worst:
    """Instructions of the longest servo tick, and of the longest time without idling: a servo tick and the background before it."""

    servo: float
    busy: float


class NotMeasured(RuntimeError):
    """Why not."""


def measure(board: str, progress: Progress = no_progress) -> Worst:
    """Runs the slide. Raises NotMeasured where nothing runs the board's image here, hil.BoardError or SceneError where it fails."""
    if board not in PARTS:
        raise NotMeasured("no emulation here runs this board's image with a host")
    schema = versions.host_schema()
    if schema is None:
        raise NotMeasured("the host is not built: any other command of ./run builds it")
    firmware = versions.identify(hil.BOARDS[board])
    if firmware.schema is not None and firmware.schema != schema:
        raise NotMeasured("the host has other message definitions: any other command of ./run builds it")
    from palpate import experiments

    quiet: dict[str, Any] = {"outputs.pictures": False, "outputs.csv": False}
    summary = experiments.run(SCENE, {**SLIDE, **PARTS[board].overrides, **quiet}, board=board, progress=progress).summary
    if summary["contact_ticks"] == 0 or summary["faults"]:
        raise hil.BoardError(f"board {board}: the slide was not rendered: faults {summary['faults']}")
    return Worst(summary["worst_tick_instructions"], summary["worst_busy_instructions"])


def table(board: str, worst: Worst) -> list[str]:
    """Lines as those of boards/cmake/check_image.py, in cycles by the bound."""
    part = PARTS[board]

    def row(name: str, instructions: float, budget: int, remark: str = "") -> str:
        cycles = instructions * CYCLES_PER_INSTRUCTION
        return f"  {name:<36}{cycles:>10,.0f}{budget:>10,}{cycles / budget:>8.0%}{remark}"

    busy_is_late = worst.busy * CYCLES_PER_INSTRUCTION > part.tick_cycles
    goal_is_missed = worst.servo * CYCLES_PER_INSTRUCTION > GOAL_CYCLES
    return [
        f"{'worst tick, slide at 10 cm/s':<38}{'cycles':>10}{'budget':>10}",
        row("servo", worst.servo, part.servo_cycles),
        row("the same, by the design's goal", worst.servo, GOAL_CYCLES, "  missed, no failure" if goal_is_missed else ""),
        row("servo and background", worst.busy, part.tick_cycles, "  late, which costs no force" if busy_is_late else ""),
    ]


def is_over(board: str, worst: Worst) -> bool:
    return worst.servo * CYCLES_PER_INSTRUCTION > PARTS[board].servo_cycles


def report(board: str, measured: Callable[[], Worst]) -> tuple[int, list[str]]:
    """Exit code, and what to print."""
    try:
        worst = measured()
    except NotMeasured as reason:
        return 0, [f"worst tick: not measured: {reason}"]
    lines = table(board, worst)
    if is_over(board, worst):
        most = PARTS[board].servo_cycles
        lines.append(f"{board}: worst servo tick: {worst.servo * CYCLES_PER_INSTRUCTION:,.0f} cycles, the budget is {most:,}")
        return 1, lines
    return 0, lines


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m palpate.worst_tick", description=__doc__.splitlines()[0])
    parser.add_argument("board")
    board = parser.parse_args().board
    from palpate.cli import _progress
    from palpate.scene import SceneError

    try:
        code, lines = report(board, lambda: measure(board, _progress))
    except (hil.BoardError, SceneError, RuntimeError) as error:
        print(f"worst tick: the run failed: {error}", file=sys.stderr)
        return 1
    print("\n".join(lines))
    file = folder(board) / WORST_TICK_FILE
    if file.parent.is_dir():
        # What is not measured now is not that of another image.
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return code


if __name__ == "__main__":
    sys.exit(main())
