"""palpate.gui.board_lines: what the window says of a board, without a window."""

import pytest

from palpate.gui.board_lines import budget_lines, medium_of, reset_lines, tick_lines
from palpate.image_budgets import Budget, Table
from palpate.reset_record import ResetRecord


def status(count: int, clock_Hz: int, heard: bool = True) -> dict[str, int | bool]:
    return {"board_heard": heard, "board_worst_tick_count": count, "board_clock_Hz": clock_Hz}


def test_a_budget_that_is_exceeded_is_a_warning_and_a_missed_goal_is_not() -> None:
    image = Table("palpate_x.elf", (Budget("RAM, stack included", 90, 100, "bytes"), Budget("deepest stack", 101, 100, "bytes")))
    tick = Table("worst tick", (Budget("servo", 130_000, 119_000, "cycles"), Budget("the same, by the design's goal", 130_000, 60_000, "cycles")))
    assert budget_lines("x", [image, tick]) == [
        ("palpate_x, bytes", "dull"), ("RAM with stack: 90 of 100, 90 %", "plain"), ("deepest stack: 101 of 100, 101 %", "warning"),
        ("worst tick, cycles", "dull"), ("servo: 130,000 of 119,000, 109 %", "warning"), ("servo, by the goal: 130,000 of 60,000, 217 %", "plain"),
    ]  # fmt: skip
    assert budget_lines("native", [])[0][0].startswith("a Linux process")
    assert budget_lines("x", []) == [("budgets of x: not built here", "dull")]


def test_a_tick_is_in_instructions_where_the_board_counts_them() -> None:
    assert tick_lines("mps2_an386", status(10_000, 25_000_000)) == [("longest tick: 50,000 of 125,000 instructions, 40 %", "plain")]
    assert tick_lines("serial:/dev/ttyACM0", status(130_000, 170_000_000)) == [("longest tick: 0.765 ms of 1, 76 %", "warning")]
    assert tick_lines("native", status(0, 0)) == [("longest tick: the board has no clock", "dull")]
    assert tick_lines("mps2_an386", status(0, 0, heard=False)) == []


def test_a_fault_before_the_reset_is_a_warning() -> None:
    assert reset_lines(None)[0][1] == "dull"
    quiet = ResetRecord.of("nucleo_g474re", [1 << 27, *[0] * 9])
    assert [meant for _, meant in reset_lines(quiet)] == ["plain", "dull"]
    faulty = ResetRecord.of("nucleo_g474re", [1 << 29, 5, 700, 0, 0, 0, 0, 0, 700, 1])
    assert reset_lines(faulty) == [("last reset: watchdog", "plain"), ("background stuck, at tick 700", "warning"), ("last tick 700, latched: emergency stop", "warning")]


@pytest.mark.parametrize(("address", "medium"), [
    ("serial:/dev/ttyACM0,921600", "uart"), ("udp:192.168.1.7:5760", "uart"), ("usb:1209:0001", "usb"),
    ("can:can0", "can"), ("can:can0,fd", "canfd"), ("canfd:can0", "canfd"),
])  # fmt: skip
def test_the_image_behind_an_address(address: str, medium: str) -> None:
    assert medium_of(address) == medium
