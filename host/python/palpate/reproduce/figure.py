"""What a figure of the paper needs to be reproduced: runs, checks, a plot and words."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from palpate.paths import SCENES
from palpate.reproduce.checks import Check

# Datasets of one run by path, as in its record.h5 (docs/records.md).
Record = Mapping[str, NDArray[Any]]
# Records of all runs of a figure, by the runs' names.
Records = Mapping[str, Record]

SCENE_FOLDER = SCENES / "reproduce"


@dataclass(frozen=True)
class Run:
    """One run of a scene in scenes/reproduce. overrides: keys of the scene that it sets otherwise. may_fault: the board
    may cut the motors, which then is a result."""

    name: str
    scene: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    may_fault: bool = False

    @property
    def file(self) -> Path:
        """The scene's file."""
        return SCENE_FOLDER / f"{self.scene}.toml"


@dataclass(frozen=True)
class Table:
    """Numbers that come one by one. columns: headings with units."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]

    def to_dict(self) -> dict[str, Any]:
        """The entry of results.json."""
        return {"title": self.title, "columns": list(self.columns), "rows": [list(row) for row in self.rows]}


@dataclass(frozen=True)
class PaperFigure:
    """One figure of the paper.

    claims: quotations in short, each with its section. setting: what was done here, and how that differs. caption: what
    our plot shows. checks: from the records. draw: the plot, into a PNG file. tables: lists of events, if any. more: runs
    that follow from the records so far; it is asked again with theirs, until there are none.
    """

    name: str
    title: str
    claims: tuple[tuple[str, str], ...]
    setting: tuple[str, ...]
    caption: str
    runs: tuple[Run, ...]
    checks: Callable[[Records], list[Check]]
    draw: Callable[[Records, Path], None]
    tables: Callable[[Records], list[Table]] = lambda records: []
    more: Callable[[Records], tuple[Run, ...]] = lambda records: ()
