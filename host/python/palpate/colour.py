"""Colours for people: only on a terminal that takes them, and not where NO_COLOR is set (no-color.org)."""

import os
from typing import Literal, TextIO

Colour = Literal["red", "yellow", "green"]
_CODES = {"red": 31, "yellow": 33, "green": 32}


def wanted(stream: TextIO) -> bool:
    """May this stream get colours?"""
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def paint(text: str, colour: Colour, stream: TextIO) -> str:
    """The text as it is to be written to the stream."""
    return f"\033[{_CODES[colour]}m{text}\033[0m" if wanted(stream) else text
