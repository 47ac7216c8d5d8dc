"""Memory of the board."""

import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from palpate.hil import BOARDS, BoardError

# As boards/cmake/check_image.py counts them.
_RAM_SECTIONS = (".stack", ".data", ".bss", ".noinit")


@dataclass(frozen=True)
class Ram:
    """Bytes. renderer: local models in their slots and tip history; image: all of the firmware's, its stack included."""

    renderer: int
    image: int


def read_sections(listing: str) -> int:
    """Bytes of RAM in what `size -A` prints."""
    rows = [line.split() for line in listing.splitlines()]
    return sum(int(row[1]) for row in rows if len(row) >= 2 and row[0] in _RAM_SECTIONS)


def ram_of(core: Any, board: str) -> Ram | None:
    """None for a board that is no firmware image. Raises BoardError where the image can't be read."""
    if BOARDS[board].instructions_per_count is None:
        return None
    image: Path = BOARDS[board].image
    try:
        listing = subprocess.run(
            ["arm-none-eabi-size", "-A", str(image)], capture_output=True, text=True, check=True
        ).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise BoardError(f"board {board}: cannot read {image}: {error}") from None
    return Ram(renderer=core.RENDERER_BYTES, image=read_sections(listing))
