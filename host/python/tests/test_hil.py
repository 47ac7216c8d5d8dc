"""Boards that work, die, hang or cannot be started."""

import os
from pathlib import Path

import fake_core
import pytest
from fake_core import TICKS, board

from palpate import hil
from palpate.hil import BoardError


def going_on(done: int, total: int) -> bool:
    return True


def open_descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_a_run_returns_results_and_console_and_leaves_nothing_behind() -> None:
    before = open_descriptors()
    ticks: list[int] = []

    def note(done: int, total: int) -> bool:
        ticks.append(done)
        return True

    results, console = hil.run_closed_loop(fake_core, {}, board(), note)
    assert ticks == list(range(1, TICKS + 1))
    assert len(results["ticks/tick"]) == TICKS
    assert console == "hello from the board\n"
    assert open_descriptors() == before


@pytest.mark.parametrize(
    ("behaviour", "reason"),
    [
        ("if tick == 7: sys.exit(5)", "ended with code 5 (processor fault); last sign of life at tick 7"),
        ("if tick == 7: sys.exit(99)", "ended with code 99 (unknown); last sign of life at tick 7"),
        (
            "if tick == 7: os.kill(os.getpid(), signal.SIGSEGV)",
            "was ended by signal 11; last sign of life at tick 7",
        ),
    ],
)
def test_a_board_that_dies_is_reported(behaviour: str, reason: str) -> None:
    before = open_descriptors()
    with pytest.raises(BoardError) as caught:
        hil.run_closed_loop(fake_core, {}, board(behaviour), going_on)
    assert str(caught.value) == f"board fake {reason}; it said: hello from the board"
    assert open_descriptors() == before


def test_a_board_that_hangs_is_ended() -> None:
    with pytest.raises(
        BoardError, match=r"gave no tick for 0\.5 s and was ended; last sign of life at tick 3"
    ):
        hil.run_closed_loop(fake_core, {}, board("if tick == 3: time.sleep(600)"), going_on, watchdog_s=0.5)


def test_a_board_that_never_opens_its_streams_is_ended() -> None:
    silent = hil.BoardType("fake", Path("/bin/sleep"), lambda image: [str(image), "600"], None, lambda image: [])
    with pytest.raises(
        BoardError, match=r"gave no tick for 0\.5 s and was ended; last sign of life at tick 0"
    ):
        hil.run_closed_loop(fake_core, {}, silent, going_on, watchdog_s=0.5)


def test_a_board_that_cannot_be_started_is_reported(tmp_path: Path) -> None:
    before = open_descriptors()
    with pytest.raises(BoardError, match=r"none\.elf does not exist: \./run builds it"):
        hil.run_closed_loop(fake_core, {}, board(image=tmp_path / "none.elf"), going_on)
    missing = hil.BoardType("fake", Path("/bin/sh"), lambda image: ["/nowhere/qemu-system-none"], None, lambda image: [])
    with pytest.raises(
        BoardError, match=r"cannot start /nowhere/qemu-system-none: No such file or directory"
    ):
        hil.run_closed_loop(fake_core, {}, missing, going_on)
    assert open_descriptors() == before


def test_an_interruption_ends_the_board() -> None:
    def interrupt(done: int, total: int) -> bool:
        raise KeyboardInterrupt

    before = open_descriptors()
    with pytest.raises(KeyboardInterrupt):
        hil.run_closed_loop(fake_core, {}, board(), interrupt)
    assert open_descriptors() == before


def test_an_error_of_the_core_is_not_blamed_on_the_board() -> None:
    with pytest.raises(RuntimeError, match="^stopped$"):
        hil.run_closed_loop(fake_core, {}, board(), lambda done, total: done < 5)


def test_boards_of_scenes_can_be_started() -> None:
    from palpate.scene_schema import Choice, key_specs
    from palpate.scene_sections import Board

    kind = dict(key_specs(Board))["name"].kind
    assert isinstance(kind, Choice)
    assert set(kind.choices) == set(hil.BOARDS)
