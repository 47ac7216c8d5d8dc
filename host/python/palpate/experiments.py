"""Experiments in Python: a scene goes in, arrays and numbers come out. The command line runs the same functions."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from palpate import _core, experiment
from palpate.experiment import Outcome, ProgressBar
from palpate.scene import Scene, load_scene


@dataclass(frozen=True)
class Result:
    """What became of a scene.

    scene: as it was run. summary: the numbers of summary.json (docs/records.md). arrays: every dataset of the record by its
    path, "ticks/force_N" say; docs/records.md has shape, unit and meaning of each. files: that were written, by name.
    """

    scene: Scene
    summary: dict[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    files: dict[str, Path]

    def __getitem__(self, path: str) -> NDArray[Any]:
        """The array of this path. KeyError names those that there are."""
        if path not in self.arrays:
            raise KeyError(f"{path}: must be one of {', '.join(self.arrays)}")
        return self.arrays[path]


@contextmanager
def _quiet(label: str, unit: str) -> Iterator[ProgressBar]:
    yield lambda done, total: True


def _scene(scene: Scene | str | Path, overrides: Mapping[str, Any] | None) -> Scene:
    if not isinstance(scene, Scene):
        return load_scene(Path(scene), overrides)
    if overrides:
        raise ValueError("overrides: only with a scene's file; a Scene has its keys already")
    return scene


def _result(scene: Scene, outcome: Outcome) -> Result:
    return Result(scene, outcome.summary, outcome.arrays, outcome.files)


def run(
    scene: Scene | str | Path,
    overrides: Mapping[str, Any] | None = None,
    *,
    board: str | None = None,
    out: str | Path | None = None,
    progress: experiment.Progress = _quiet,
) -> Result:
    """Runs a scene with the firmware in the loop, as `palpate run`. board: "native" needs nothing but this package,
    "mps2_an386" and "mps2_an500" want QEMU and the source tree. out: a folder for the files of `palpate run`. Raises
    SceneError, hil.BoardError, or RuntimeError."""
    given = _scene(scene, overrides)
    if board is not None:
        given = given.with_board(board)
    return _result(given, experiment.run(_core, given, "run", None if out is None else Path(out), progress))


def simulate(
    scene: Scene | str | Path,
    overrides: Mapping[str, Any] | None = None,
    *,
    out: str | Path | None = None,
    progress: experiment.Progress = _quiet,
) -> Result:
    """Steps the full body alone, as `palpate simulate`, with the tip on the scene's path if it has one."""
    given = _scene(scene, overrides)
    return _result(given, experiment.simulate(_core, given, None if out is None else Path(out), progress))


def sweep(
    scene: str | Path,
    key: str,
    values: Sequence[Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    experiment: Callable[..., Result] = run,
    **options: Any,
) -> list[Result]:
    """Runs a scene's file once for each value of a key, as in sweep("scenes/press.toml", "contact.friction", [0.1, 0.5]).
    experiment: run or simulate; options are handed to it. All scenes are checked before the first one is run."""
    scenes = [load_scene(Path(scene), {**(overrides or {}), key: value}) for value in values]
    return [experiment(one, **options) for one in scenes]
