"""The operator at a terminal: told what to do, and waited for until the Enter key."""

import os
import select
import sys
import termios
from typing import TextIO

from palpate.calibration.session import Drive
from palpate.scene_schema import SceneError


class Terminal:
    """table: where the operator is told; is_asked False: told, and not waited for (--yes)."""

    def __init__(self, table: TextIO, is_asked: bool) -> None:
        self._table, self._is_asked = table, is_asked
        self._typed = b""

    def ask(self, _: str, text: str, drive: Drive | None) -> None:
        """Raises SceneError where the standard input is none or has ended, and what `drive` raises."""
        print(text, file=self._table, flush=True)
        if not self._is_asked:
            return
        try:
            descriptor = sys.stdin.fileno()
        except (AttributeError, OSError, ValueError):
            raise SceneError("the standard input is none: must be a terminal with the operator") from None
        if os.isatty(descriptor):
            # What was typed before the question is no answer to it.
            termios.tcflush(descriptor, termios.TCIFLUSH)
            self._typed = b""
        print("Enter, when it is so: ", end="", file=sys.stderr, flush=True)
        while b"\n" not in self._typed:
            if drive is not None:
                drive()
            # A drive takes the time of the board's answer; it is not kept from its next one.
            if select.select([descriptor], [], [], None if drive is None else 0.0)[0]:
                part = os.read(descriptor, 1024)
                if not part:
                    raise SceneError("the standard input has ended: must be a terminal with the operator")
                self._typed += part
        self._typed = self._typed.partition(b"\n")[2]
