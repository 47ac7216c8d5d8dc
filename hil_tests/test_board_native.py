"""What is particular to the firmware as a Linux process."""

import subprocess

import pytest
from board_peer import BURN_CYCLES, EXIT_NO_CHANNEL, EXIT_USAGE, NATIVE_IMAGE, lockstep


def run(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([str(NATIVE_IMAGE), *arguments], capture_output=True, text=True, timeout=20, check=False)


@pytest.mark.parametrize("arguments", [(), ("--lockstep",), ("--lockstep", "a"), ("--pty", "x"), ("--help",)])
def test_a_wrong_command_line_shows_the_usage(arguments):
    result = run(*arguments)
    assert result.returncode == EXIT_USAGE and result.stderr.startswith("usage: palpate_native")


def test_files_that_cannot_be_opened(tmp_path):
    assert run("--lockstep", str(tmp_path / "no" / "a"), str(tmp_path / "no" / "b")).returncode == EXIT_NO_CHANNEL


def test_has_no_clock_in_lockstep(tmp_path):
    with lockstep("native", tmp_path / "board") as board:
        board.run(5)
        frame = board.tick(flags=BURN_CYCLES)
        assert (frame["clock_Hz"], frame["tick_count"], frame["missed_deadlines"]) == (0, 0, 0)
        assert frame["next_tick"] == frame["tick"] + 1
