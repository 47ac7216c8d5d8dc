"""host/session/kernel_session_test.cpp in a guest (linux_guest.py): its command, and what its board feels."""

from board_peer import BUILD_HOST

import palpate

# An emulated processor is some twenty times slower than its host, and models are too old after 256 ticks: the board's ticks come no
# faster than this beside a session in a guest.
TICK_s = 16e-3


def at_the_same_interface(framing: str, address: str) -> str:
    """The firmware is in the program, at the same CAN interface."""
    return _program(framing, "PALPATE_TEST_CAN", address, "SameInterface")


def with_a_board(framing: str, address: str) -> str:
    return _program(framing, "PALPATE_TEST_BOARD", address, "BoardElsewhere")


def _program(framing: str, variable: str, address: str, test: str) -> str:
    return f"{variable}={address} {BUILD_HOST}/host/session/kernel_session_{framing}_test --gtest_filter=*{test}"


def pressing_plant() -> palpate.Plant:
    """A tip that is pressed 3 mm into the program's body, whatever it meets."""
    return palpate.Plant(
        [(0.1, (0.001, 0.002, -0.0195)), (0.35, (0.001, 0.002, -0.023))], hand={"kind": "scripted"}
    )
