"""Makes room for new results, and deletes nothing but results of an earlier run."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from palpate.experiment import OUTPUTS
from palpate.reproduce.figure import PaperFigure
from palpate.reproduce.report import TITLE
from palpate.reproduce.results import PLOT, RESULTS
from palpate.scene import SceneError

REPORT = "index.html"


def clear(out: Path, figures: Sequence[PaperFigure]) -> None:
    """Deletes the report in `out` and the folders of these figures. Raises SceneError, before anything is deleted, where
    one of them holds what palpate does not write."""
    report = out / REPORT
    folders = [out / figure.name for figure in figures]
    for path in (report, *folders):
        strange = _strange(path)
        if strange is not None:
            raise SceneError(
                f"palpate reproduce: {strange}: not a result of palpate reproduce, and in the place of one; "
                "move it, or choose another --out"
            )
    report.unlink(missing_ok=True)
    for folder in folders:
        if folder.exists():
            shutil.rmtree(folder)


def _strange(path: Path) -> Path | None:
    """The first thing there that palpate does not write."""
    if path.is_symlink():
        return path
    if not path.exists():
        return None
    if path.name == REPORT:
        return None if path.is_file() and TITLE in path.read_text(encoding="utf-8", errors="replace") else path
    return _strange_in(path, (PLOT, RESULTS), runs=True)


def _strange_in(folder: Path, names: Sequence[str], runs: bool) -> Path | None:
    """names: files that may be there. runs: so may folders of runs."""
    if folder.is_symlink() or not folder.is_dir():
        return folder
    for entry in sorted(folder.iterdir()):
        if entry.name in names and entry.is_file() and not entry.is_symlink():
            continue
        strange = _strange_in(entry, OUTPUTS, runs=False) if runs else entry
        if strange is not None:
            return strange
    return None
