"""BoardLink's commands, against a board that is made up: order, tokens, refusals, disarming."""

import os
import termios
from collections.abc import Iterator
from typing import Any

import pytest

from palpate import BoardLink, BoardLinkError, _core, board_link

ARM_REQUEST, ARM_CONFIRM, DISARM = 1, 2, 3
TOKEN = 0x1234


class MadeUpBoard:
    """Stands for the endpoint: answers every command with the next of `answers` (status), and says its status after."""

    name, schema_hash = "native", _core.SCHEMA_HASH

    def __init__(self, answers: list[int], mode: int = 1) -> None:
        self.answers, self.mode, self.asked = answers, mode, list[tuple[int, int]]()
        self._said: list[dict[str, Any]] = []

    def command(self, action: int, token: int) -> tuple[bytes, int]:
        self.asked.append((action, token))
        status = self.answers.pop(0) if self.answers else 0
        told = TOKEN if action == ARM_REQUEST else 0
        self._said = [self.status(), {"message": "Command", "transfer_id": 999, "status": 0, "mode": 1, "token": 7},
                      {"message": "Command", "transfer_id": len(self.asked), "status": status, "mode": self.mode, "token": told}]
        return b"frame", len(self.asked)

    def get_info(self) -> tuple[bytes, int]:
        numbers = dict.fromkeys(("max_modes", "max_nodes", "basis_slots", "tick_rate_Hz", "tip_history_ticks"), 0)
        self._said = [{"message": "GetInfo", "transfer_id": 0, "board": self.name, "firmware": "0.1.0",
                       "schema_hash": self.schema_hash, **numbers}]  # fmt: skip
        return b"frame", 0

    def status(self) -> dict[str, Any]:
        numbers = dict.fromkeys(("faults", "models_taken", "frames_refused", "missed_deadlines"), 0)
        return {"message": "BoardStatus", "tick": 1000 * len(self.asked), "mode": self.mode, **numbers}

    def receive(self, data: bytes, tick: int) -> list[dict[str, Any]]:
        said, self._said = self._said, []
        return said or [self.status()]


class MadeUpLink:
    """Stands for the transport."""

    is_open = True

    def __init__(self, address: str) -> None:
        assert address == "serial:made up"

    def write(self, frame: bytes) -> bool:
        return frame == b"frame"

    def read(self, longest_s: float) -> bytes:
        return b""


@pytest.fixture
def pseudo_terminal() -> Iterator[tuple[int, str]]:
    """A line with nobody at its other end: descriptor and path."""
    far, near = os.openpty()
    yield near, os.ttyname(near)
    os.close(near)
    os.close(far)


def connected(monkeypatch: pytest.MonkeyPatch, board: MadeUpBoard) -> BoardLink:
    """A link to a made-up board."""
    monkeypatch.setattr(board_link._core, "Transport", MadeUpLink)
    monkeypatch.setattr(board_link._core, "HostEndpoint", lambda link: board)
    return BoardLink("made up", timeout_s=1.0)


def test_a_line_has_the_rate_of_the_boards_unless_told(pseudo_terminal: tuple[int, str]) -> None:
    """921,600: that of boards/stm32g4/lpuart_link.hpp and boards/stm32f4/usart_link.hpp."""
    descriptor, path = pseudo_terminal
    with BoardLink(path):
        assert termios.tcgetattr(descriptor)[4:6] == [termios.B921600, termios.B921600]
    with BoardLink(path, 115_200):
        assert termios.tcgetattr(descriptor)[4:6] == [termios.B115200, termios.B115200]


def test_arming_takes_two_steps_and_ends_with_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    board = MadeUpBoard([])
    with connected(monkeypatch, board) as link:
        link.arm()
        assert board.asked == [(ARM_REQUEST, 0), (ARM_CONFIRM, TOKEN)]
    assert board.asked[-1] == (DISARM, 0)
    assert not hasattr(link, "_link")  # closed


def test_a_refusal_is_told_and_the_board_left_disarmed(monkeypatch: pytest.MonkeyPatch) -> None:
    board = MadeUpBoard([0, 49])
    with pytest.raises(BoardLinkError, match="made up: confirming: refused in mode idle with status 49"):
        with connected(monkeypatch, board) as link:
            link.arm()
    assert [action for action, _ in board.asked] == [ARM_REQUEST, ARM_CONFIRM, DISARM]


def test_patience_asks_again_while_idle_only(monkeypatch: pytest.MonkeyPatch) -> None:
    board = MadeUpBoard([48, 48])
    link = connected(monkeypatch, board)
    link.arm(patience_s=1000.0)
    assert [action for action, _ in board.asked] == [ARM_REQUEST] * 3 + [ARM_CONFIRM]
    faulty = MadeUpBoard([48, 48], mode=4)
    with pytest.raises(BoardLinkError, match="refused in mode fault"):
        connected(monkeypatch, faulty).arm(patience_s=1000.0)
    assert len(faulty.asked) == 1


def test_a_block_without_arming_sends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    board = MadeUpBoard([])
    with connected(monkeypatch, board) as link:
        assert (link.state().mode, link.state().tip_m) == ("idle", None)
    assert board.asked == []


def test_an_unknown_board_is_not_armed(monkeypatch: pytest.MonkeyPatch) -> None:
    board = MadeUpBoard([])
    board.name = "strangers_board"
    with connected(monkeypatch, board) as link:
        with pytest.raises(BoardLinkError, match="board 'strangers_board' is not armed: must be one of .*native"):
            link.arm()
    assert not board.asked


def test_a_board_of_other_messages_is_not_armed(monkeypatch: pytest.MonkeyPatch) -> None:
    board = MadeUpBoard([])
    board.schema_hash = _core.SCHEMA_HASH ^ 1
    with connected(monkeypatch, board) as link:
        with pytest.raises(BoardLinkError, match="message schema .* must be the host's"):
            link.arm()
    assert not board.asked
