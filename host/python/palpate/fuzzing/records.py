"""Records with changed datasets, attributes and bytes: each can be read for a replay, or is refused with a BadRecord or a
SceneError."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from palpate.fuzzing.draw import Draw
from palpate.fuzzing.values import odd_value
from palpate.paths import SCENES
from palpate.record import BadRecord, load, write_record
from palpate.record_layout import RUN, Dataset
from palpate.replay import load_source, motion_of
from palpate.scene import SceneError

_TICKS = 6
_OTHER_ROWS = 3


class RecordFuzz:
    """One execution after another; `folder` is for the files."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "record.h5"
        whole = folder / "whole.h5"
        values = {dataset.path: _values(dataset) for dataset in RUN if not dataset.optional}
        scene = (SCENES / "press.toml").read_text(encoding="utf-8")
        write_record(whole, RUN, values, scene, {"board": "native", "closed": 1, "ticks": _TICKS})
        load_source(whole, {}, None)  # nothing is wrong with it yet
        self._whole = whole.read_bytes()

    def execute(self, data: bytes) -> None:
        """Whatever is not one of the two refusals is a finding."""
        self._write(Draw(data))
        try:
            load(self.file)
            motion_of(load_source(self.file, {}, None).record.values)
        except (BadRecord, SceneError) as error:
            assert str(error) and "\n" not in str(error), "a refusal is one line"

    def _write(self, draw: Draw) -> None:
        if draw.chance(0.4):
            self.file.write_bytes(self._changed_bytes(draw))
            return
        self.file.write_bytes(self._whole)
        with h5py.File(self.file, "r+") as h5:
            for _ in range(draw.randint(1, 3)):
                _change(h5, draw)

    def _changed_bytes(self, draw: Draw) -> bytes:
        data = bytearray(self._whole)
        for _ in range(draw.randint(1, 8)):
            data[draw.randrange(len(data))] = draw.choice((0, 1, 0x7F, 0xFF, draw.randrange(256)))
        if draw.chance(0.2):
            del data[draw.randrange(len(data)) :]
        return bytes(data)


def _change(h5: h5py.File, draw: Draw) -> None:
    paths = [dataset.path for dataset in RUN if dataset.path in h5] + ["scene", "ticks", "updates"]
    path = "ticks/tick" if draw.chance(0.1) else draw.choice(paths)
    match draw.randrange(6):
        case 0:
            h5.attrs[draw.choice(("board", "closed", "ticks", "updates", "dropped_ticks"))] = _storable(odd_value(draw))
        case 1 if path in h5:
            del h5[path]
        case 2 if path in h5:
            del h5[path]
            h5[path] = _storable(odd_value(draw))
        case 3 if path in h5 and draw.choice(paths) in h5:
            other = draw.choice([name for name in paths if name in h5])
            if not other.startswith(path):
                del h5[path]
                h5[path] = h5[other]  # another one by this name, too
        case 4 if path in h5 and isinstance(h5[path], h5py.Dataset) and h5[path].dtype.kind in "fiu" and h5[path].size:
            array = np.asarray(h5[path][()])
            place = tuple(draw.randrange(length) for length in array.shape)
            limits = (0, -1, 2**31 - 1, 2**32 - 1) if array.dtype.kind in "iu" else (np.nan, np.inf, -np.inf, 1e300)
            with np.errstate(over="ignore"):
                array[place] = np.array(draw.choice(limits)).astype(array.dtype)
            h5[path][...] = array
        case _ if path in h5 and isinstance(h5[path], h5py.Dataset) and h5[path].ndim:
            array = h5[path][: draw.randint(0, 3)]
            del h5[path]
            h5[path] = array.astype(draw.choice(("f8", "i8", "u1"))) if array.dtype.kind in "fiu" else array


def _values(dataset: Dataset) -> Any:
    shape = [length if isinstance(length, int) else _TICKS if length == "ticks" else _OTHER_ROWS for length in dataset.shape]
    if dataset.path == "ticks/tick":
        return np.arange(_TICKS)
    return np.zeros(shape, dtype=dataset.dtype)


def _storable(value: Any) -> Any:
    """As HDF5 can hold it."""
    if isinstance(value, str):
        return value.replace("\x00", "")
    if isinstance(value, int) and not isinstance(value, bool) and not -(2**63) <= value < 2**64:
        return float("inf")
    if isinstance(value, list) and value in ([1, 2], [0]):
        return value
    return value if isinstance(value, int | float) else str(value)
