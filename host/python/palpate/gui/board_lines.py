"""What the window says of a board: the last reset, what its image takes of its part, the longest tick. Each line with how it is meant."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from palpate.hil import BOARDS
from palpate.image_budgets import Table
from palpate.reset_record import ResetRecord
from palpate.worst_tick import SERVO_SHARE

Line = tuple[str, Literal["plain", "dull", "warning"]]
_TICKS_PER_S = 1000
# Rows of the tables, as the panel is wide enough for.
_SHORT = {"RAM, stack included": "RAM with stack", "the same, by the design's goal": "servo, by the goal", "servo and background": "with background"}
# Over these nothing fails: a goal, and work that is late (palpate.worst_tick).
_SOFT = {"the same, by the design's goal", "servo and background"}


def reset_lines(record: ResetRecord | None) -> list[Line]:
    """None: the board keeps none."""
    if record is None:
        return [("why it started last, this board does not know", "dull")]
    lines: list[Line] = [(f"last reset: {record.cause}", "plain")]
    if record.fault:
        lines.append((record.fault, "warning"))
    lines.append((record.before, "warning" if record.faults else "dull"))
    return lines


def budget_lines(board: str, tables: Sequence[Table]) -> list[Line]:
    """Of the image that the build has made here, which an attached board need not have."""
    if board == "native":
        return [("a Linux process: no budgets", "dull")]
    if not tables:
        return [(f"budgets of {board}: not built here", "dull")]
    lines: list[Line] = []
    for table in tables:
        lines.append((f"{table.name.removesuffix('.elf')}, {table.rows[0].unit}", "dull"))
        for row in table.rows:
            text = f"{_SHORT.get(row.what, row.what)}: {row.used:,} of {row.budget:,}, {100.0 * row.share:.0f} %"
            lines.append((text, "warning" if row.share > 1.0 and row.what not in _SOFT else "plain"))
    return lines


def medium_of(address: str) -> str:
    """Of scenes, the one whose image is behind this address of an attached board."""
    kind, _, rest = address.partition(":")
    if kind == "can":
        return "canfd" if rest.endswith(",fd") else "can"
    return kind if kind in ("canfd", "usb") else "uart"


def tick_lines(board: str, status: Mapping[str, Any]) -> list[Line]:
    """The longest servo tick so far, as the board says it; in instructions where it is an emulated one that counts them."""
    if not status["board_heard"]:
        return []
    if not status["board_clock_Hz"]:
        return [("longest tick: the board has no clock", "dull")]
    counts, tick_counts = status["board_worst_tick_count"], status["board_clock_Hz"] / _TICKS_PER_S
    share = counts / tick_counts
    per_count = BOARDS[board].instructions_per_count if board in BOARDS else None
    if per_count is None:
        text = f"{1e3 * counts / status['board_clock_Hz']:.3f} ms of 1"
    else:
        text = f"{counts * per_count:,.0f} of {tick_counts * per_count:,.0f} instructions"
    return [(f"longest tick: {text}, {100.0 * share:.0f} %", "warning" if share > SERVO_SHARE else "plain")]
