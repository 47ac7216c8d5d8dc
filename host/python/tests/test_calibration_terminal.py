"""The operator at a terminal: what feeds the motors goes on until the Enter key, and only that key, after the question, is an answer."""

import io
import os
from collections.abc import Iterator

import pytest

from palpate.calibration.terminal import Terminal
from palpate.scene_schema import SceneError


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A pseudo-terminal as standard input; the descriptor that types."""
    far, near = os.openpty()
    with os.fdopen(near, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield far
    os.close(far)


class Motors:
    """Fed by calls, of which the last types. Fails where it is fed for ever."""

    def __init__(self, keyboard: int, calls: int, typed: bytes = b"\n") -> None:
        self.fed, self._keyboard, self._calls, self._typed = 0, keyboard, calls, typed

    def drive(self) -> None:
        self.fed += 1
        if self.fed == self._calls:
            os.write(self._keyboard, self._typed)
        # A terminal hands its line over a little later than it is typed.
        assert self.fed < 1_000_000


def test_motors_are_fed_until_the_key(keyboard: int) -> None:
    table = io.StringIO()
    motors = Motors(keyboard, 20)
    Terminal(table, True).ask("release", "Let go of the tool.", motors.drive)
    assert motors.fed >= 20
    assert table.getvalue() == "Let go of the tool.\n"


def test_what_was_typed_before_the_question_is_no_answer(keyboard: int) -> None:
    os.write(keyboard, b"\n\n")
    motors = Motors(keyboard, 20)
    Terminal(io.StringIO(), True).ask("release", "Let go of the tool.", motors.drive)
    assert motors.fed >= 20


def test_each_line_of_a_pipe_answers_once_and_its_end_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    near, far = os.pipe()
    os.write(far, b"\nyes\n")
    os.close(far)
    with os.fdopen(near, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        terminal = Terminal(io.StringIO(), True)
        terminal.ask("base", "Base", None)
        terminal.ask("zero", "Zero", None)
        with pytest.raises(SceneError, match="standard input has ended"):
            terminal.ask("hold", "Hold", None)


def test_a_failing_drive_ends_the_wait(keyboard: int) -> None:
    def drive() -> None:
        raise RuntimeError("the arm does not follow")

    with pytest.raises(RuntimeError, match="does not follow"):
        Terminal(io.StringIO(), True).ask("take", "Take it.", drive)


def test_who_is_not_asked_is_told() -> None:
    table = io.StringIO()
    Terminal(table, False).ask("base", "Swing the tip.", None)
    assert table.getvalue() == "Swing the tip.\n"
