"""What is installed: versions of host and firmware, and the hash of the message definitions that each was built with.

The images are asked themselves: both say it in the first line that they print.
"""

import os
import re
import select
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from palpate import __version__
from palpate.hil import BOARDS, BoardType

# An emulator starts within a tenth of a second; this is for a machine that is busy otherwise.
_PATIENCE_S = 20.0
_BANNER = re.compile(r"^palpate (\S+) (\S+) schema ([0-9a-f]{16})\b")


@dataclass(frozen=True)
class Firmware:
    """A board's image by its own words; version and schema None: why not stands in `problem`."""

    board: str
    version: str | None
    schema: int | None
    problem: str = ""


def host_schema() -> int | None:
    """Hash of the message definitions that the host was built with; None where the extension is not built."""
    try:
        from palpate import _core
    except ImportError:
        return None
    return int(_core.SCHEMA_HASH)


def schema_text(schema: int | None) -> str:
    """As the firmware prints it: 16 hexadecimal digits; "unknown" for None."""
    return "unknown" if schema is None else f"{schema:016x}"


def identify(board: BoardType) -> Firmware:
    """Starts the image, reads the line that says what it is, and ends it."""
    if not board.image.exists():
        return Firmware(board.name, None, None, f"{board.image.name} is not built")
    try:
        line = _first_line(board.identify(board.image))
    except OSError as error:
        return Firmware(board.name, None, None, f"cannot start {error.filename}: {error.strerror}")
    match = _BANNER.match(line)
    if match is None:
        return Firmware(board.name, None, None, f"{board.image.name} does not say what it is")
    if match[1] != board.name:
        return Firmware(board.name, None, None, f"{board.image.name} calls itself {match[1]}")
    return Firmware(board.name, match[2], int(match[3], 16))


def _first_line(command: list[str]) -> str:
    deadline_s = time.monotonic() + _PATIENCE_S
    text = b""
    with (
        tempfile.TemporaryDirectory(prefix="palpate-") as folder,
        subprocess.Popen(
            command, cwd=Path(folder), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as process,
    ):
        assert process.stdout is not None
        while b"\n" not in text and (left_s := deadline_s - time.monotonic()) > 0:
            if select.select([process.stdout], [], [], left_s)[0]:
                piece = os.read(process.stdout.fileno(), 4096)
                if not piece:
                    break
                text += piece
        process.kill()
    return text.decode(errors="replace").partition("\n")[0]


def all_firmware() -> list[Firmware]:
    """Of every board, built or not."""
    return [identify(board) for board in BOARDS.values()]


def text() -> str:
    """For `palpate --version`: the host's version on the first line, then the schema, then each board's firmware."""
    lines = [f"palpate {__version__}", f"message schema {schema_text(host_schema())}"]
    for one in all_firmware():
        said = one.problem if one.version is None else f"{one.version}, schema {schema_text(one.schema)}"
        lines.append(f"firmware {one.board}: {said}")
    return "\n".join(lines)
