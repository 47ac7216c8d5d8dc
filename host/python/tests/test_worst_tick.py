"""What `./run build` says of the longest tick: the table and the verdict. The run itself: hil_tests/test_nucleo_images.py."""

import pytest

from palpate import worst_tick
from palpate.versions import Firmware
from palpate.worst_tick import CYCLES_PER_INSTRUCTION, GOAL_CYCLES, PARTS, NotMeasured, Worst, is_over, report


@pytest.mark.parametrize("board", PARTS)
def test_the_budget_leaves_time_for_the_background(board: str) -> None:
    most = PARTS[board].servo_cycles / CYCLES_PER_INSTRUCTION
    assert 0.5 * PARTS[board].tick_cycles < PARTS[board].servo_cycles < 0.8 * PARTS[board].tick_cycles
    assert not is_over(board, Worst(most, 10 * most))
    assert is_over(board, Worst(most + 1, most + 1))


def test_a_tick_over_its_budget_fails_and_is_named() -> None:
    code, lines = report("nucleo_g474re", lambda: Worst(80_000, 90_000))
    assert code == 1
    assert lines[-1] == "nucleo_g474re: worst servo tick: 144,000 cycles, the budget is 119,000"
    assert "144,000   119,000    121%" in lines[1]


def test_a_tick_that_keeps_all_is_plain() -> None:
    instructions = GOAL_CYCLES / CYCLES_PER_INSTRUCTION - 1
    code, lines = report("mps2_an386", lambda: Worst(instructions, instructions))
    assert code == 0 and len(lines) == 4
    assert not any("missed" in line or "late" in line for line in lines)


def test_the_goal_of_the_design_and_a_late_background_are_told_and_fail_nothing() -> None:
    code, lines = report("mps2_an386", lambda: Worst(40_000, 100_000))
    assert code == 0
    assert lines[2].endswith("60,000    120%  missed, no failure") and lines[3].endswith("late, which costs no force")


@pytest.mark.parametrize(("schema", "message"), [(None, "the host is not built"), (1, "the host has other message definitions")])
def test_a_host_that_does_not_fit_measures_nothing(
    monkeypatch: pytest.MonkeyPatch, schema: int | None, message: str
) -> None:
    monkeypatch.setattr(worst_tick.versions, "host_schema", lambda: schema)
    monkeypatch.setattr(worst_tick.versions, "identify", lambda board: Firmware(board.name, "0", 2))
    with pytest.raises(NotMeasured, match=message):
        worst_tick.measure("mps2_an386")


def test_a_board_that_nothing_runs_says_why() -> None:
    with pytest.raises(NotMeasured, match="no emulation here runs this board's image"):
        worst_tick.measure("native")
    code, lines = report("other", lambda: worst_tick.measure("other"))
    assert code == 0 and lines == ["worst tick: not measured: no emulation here runs this board's image with a host"]
