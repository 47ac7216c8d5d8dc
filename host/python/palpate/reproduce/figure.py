"""What a figure or table of the paper needs to be reproduced: runs or studies, checks, a plot and words."""

import string
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from palpate.paths import SCENES
from palpate.reduce.study import DEFAULT_TOLERANCE, Reduction
from palpate.reproduce.checks import Check, number_or_none

# Of a run: its datasets by path, as in its record.h5 (docs/records.md); of a study: what it collected, by name.
Record = Mapping[str, NDArray[Any]]
# Records of all runs and studies of a figure, by their names.
Records = Mapping[str, Record]

@dataclass(frozen=True)
class Case:
    """Something done with a scene. overrides: keys of the scene that it sets otherwise; folder: the scene's, in scenes."""

    name: str
    scene: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    folder: str = field(default="reproduce", kw_only=True)

    @property
    def file(self) -> Path:
        """The scene's file."""
        return SCENES / self.folder / f"{self.scene}.toml"

    @property
    def shown_file(self) -> str:
        """The scene's file as in a command."""
        return f"scenes/{self.folder}/{self.scene}.toml"


@dataclass(frozen=True)
class Run(Case):
    """One run of the firmware. may_fault: the board may cut the motors, which then is a result."""

    may_fault: bool = False


@dataclass(frozen=True)
class Study(Case):
    """One reduction of the scene's body at the middle of its top, without device and firmware. order: states asked for,
    or None for a check of locality, which takes as many as 1 % needs; dense, tolerance: as in
    palpate.reduce.study.reduce_system; collect: the study's record, from the reduction."""

    order: int | None = field(kw_only=True)
    collect: Callable[[Reduction], Record] = field(kw_only=True)
    dense: bool = False
    tolerance: float = DEFAULT_TOLERANCE


@dataclass(frozen=True)
class Table:
    """Numbers that come one by one. columns: headings with units. main: the report shows it at once. names: of the rows, in
    front of their numbers and without a heading, if they have any."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    main: bool = False
    names: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The entry of results.json; a number that is not finite becomes null."""
        rows = [[number_or_none(value) for value in row] for row in self.rows]
        names = {"names": list(self.names)} if self.names else {}
        return {"title": self.title, "columns": list(self.columns), **names, "rows": rows}


@dataclass(frozen=True)
class PaperFigure:
    """One figure or table of the paper, or a study beyond them.

    claims: quotations in short, each with its section. setting: what was done here, and how that differs. caption: what
    our plot shows. checks: from the records. draw: the plot, into a PNG file. runs, studies: what it rests on. tables:
    lists of numbers, if any. more: runs that follow from the records so far; it is asked again with theirs, until there
    are none.
    """

    name: str
    title: str
    claims: tuple[tuple[str, str], ...]
    setting: tuple[str, ...]
    caption: str
    checks: Callable[[Records], list[Check]]
    draw: Callable[[Records, Path], None]
    runs: tuple[Run, ...] = ()
    studies: tuple[Study, ...] = ()
    tables: Callable[[Records], list[Table]] = lambda records: []
    more: Callable[[Records], tuple[Run, ...]] = lambda records: ()

    @property
    def cases(self) -> tuple[Case, ...]:
        """Runs and studies."""
        return (*self.runs, *self.studies)

    @property
    def label(self) -> str:
        """As the paper calls it: Figure 12, Table 1; what it does not have goes by its name."""
        number = self.name.lstrip(string.ascii_lowercase)
        kind = "Table" if self.name.startswith("table") else "Figure"
        return f"{kind} {number}" if number else self.name.capitalize()
