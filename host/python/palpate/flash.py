"""`palpate flash`: puts a board's image into its part, by whichever program is there for that."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from palpate import hil
from palpate.machine.flash import BASE as FLASH_BASE
from palpate.machine.lockstep import identity
from palpate.machine.part import Image
from palpate.machine.peripheral import MachineError
from palpate.scene_checks import NUCLEO as BOARD  # the only one that is no emulator
from palpate.scene_schema import SceneError

_TIMEOUT_S = 120.0


def _openocd(elf: Path, binary: Path) -> list[str]:
    return ["openocd", "-f", "interface/stlink.cfg", "-f", "target/stm32g4x.cfg", "-c", f"program {{{elf}}} verify reset exit"]


def _st_flash(elf: Path, binary: Path) -> list[str]:
    return ["st-flash", "--reset", "write", str(binary), f"{FLASH_BASE:#010x}"]


def _dfu_util(elf: Path, binary: Path) -> list[str]:
    # The part's own boot loader: BOOT0 high while it is reset.
    return ["dfu-util", "--device", "0483:df11", "--alt", "0", "--dfuse-address", f"{FLASH_BASE:#010x}:leave", "--download", str(binary)]


# In the order in which they are tried. openocd is installed with everything else.
TOOLS: dict[str, Callable[[Path, Path], list[str]]] = {"openocd": _openocd, "st-flash": _st_flash, "dfu-util": _dfu_util}


@dataclass(frozen=True)
class Flashed:
    """What was done. image_bytes: from the beginning of the flash to the end of the image."""

    board: str
    image: Path
    identity: str
    image_bytes: int
    tool: str
    succeeded: bool
    said: str


def flash(link: str, tool: str | None) -> Flashed:
    """Raises SceneError where the image is not there or none for this board, or the program for it is missing."""
    elf = hil.BOARDS[BOARD].on(link).image
    if not elf.exists():
        raise SceneError(f"palpate flash: {elf} does not exist: ./run build --board {BOARD} builds it")
    try:
        image = Image.read(elf)
        name = identity(image)
    except MachineError as error:
        raise SceneError(f"palpate flash: {error}") from None
    if name.split()[1] != BOARD:
        raise SceneError(f"palpate flash: {elf}: is {name!r}: must be an image for {BOARD}")
    found = next((one for one in ((tool,) if tool else TOOLS) if shutil.which(one)), None)
    if found is None:
        raise SceneError(f"palpate flash: {tool or 'openocd'}: no such program: must be one of {', '.join(TOOLS)}, on the PATH")
    data = flat(image)
    with tempfile.NamedTemporaryFile(suffix=".bin") as binary:
        binary.write(data)
        binary.flush()
        try:
            done = subprocess.run(
                TOOLS[found](elf, Path(binary.name)),
                stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False, timeout=_TIMEOUT_S,
            )  # fmt: skip
            said, succeeded = done.stdout + done.stderr, done.returncode == 0
        except subprocess.TimeoutExpired:
            said, succeeded = f"no end within {_TIMEOUT_S:g} s", False
    return Flashed(BOARD, elf, name, len(data), found, succeeded, said)


def flat(image: Image) -> bytes:
    """The image from the beginning of the flash, with 0xFF between its segments."""
    data = bytearray(b"\xff" * (max(first + len(part) for first, part in image.segments) - FLASH_BASE))
    for first, part in image.segments:
        data[first - FLASH_BASE : first - FLASH_BASE + len(part)] = part
    return bytes(data)
