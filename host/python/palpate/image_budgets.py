"""What a board's images take of its part, as the build has measured it: the tables of boards/cmake/check_image.py and palpate.worst_tick, which
`./run build --board NAME` prints."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from palpate.hil import IMAGES
from palpate.paths import BUILD

# What palpate.worst_tick writes beside the tables of the images.
WORST_TICK_FILE = "worst_tick.txt"
_HEAD = re.compile(r"^(?P<name>\S.*?) +(?P<unit>bytes|cycles) +budget$")
_ROW = re.compile(r"^  (?P<what>\S.*?) +(?P<used>[\d,]+) +(?P<budget>[\d,]+) +\d+%(?: .*)?$")


@dataclass(frozen=True)
class Budget:
    """unit: bytes or cycles, of `used` and `budget`."""

    what: str
    used: int
    budget: int
    unit: str

    @property
    def share(self) -> float:
        return self.used / self.budget


@dataclass(frozen=True)
class Table:
    """Rows of one image, or of the longest tick of a run."""

    name: str
    rows: tuple[Budget, ...]


def parse(lines: Iterable[str]) -> Table:
    """Rows that have a budget; none where the lines have no such table."""
    name = unit = ""
    rows = []
    for line in lines:
        if head := _HEAD.match(line):
            name, unit = head["name"], head["unit"]
        elif name and (row := _ROW.match(line)):
            rows.append(Budget(row["what"], int(row["used"].replace(",", "")), int(row["budget"].replace(",", "")), unit))
    return Table(name, tuple(rows))


def folder(board: str) -> Path:
    return BUILD / board / "boards" / board


def tables(board: str, medium: str = "uart") -> list[Table]:
    """Of the image for this medium of a scene, and of its longest tick where one has been measured; none where the image is not built here."""
    image = folder(board) / f"palpate_{board}{IMAGES[medium]}.elf.budget.txt"
    read = [parse(file.read_text("utf-8").splitlines()) for file in (image, folder(board) / WORST_TICK_FILE) if file.exists()]
    return [table for table in read if table.rows]
