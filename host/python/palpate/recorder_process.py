"""The process that writes a recording: reads blocks of rows from its standard input until that ends.

The file is written in HDF5's SWMR mode (single writer, multiple readers), whose order of writing keeps it readable at
every moment, after a SIGKILL of this process too. Whole chunks alone are written while it goes on, each once, and every
commit ends with the number of rows that are complete; the rest follows at the end.
"""

import os
import pickle
import select
import shutil
import signal
import struct
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from palpate.record_layout import Dataset

# Tables and how many of their rows stand in a chunk: a quarter of a second of ticks, about a second of updates.
CHUNK_ROWS = {"ticks": 256, "updates": 32}
# Of HDF5 1.10, which MATLAB and Debian's tools read, and the oldest with SWMR.
_FORMAT = ("v110", "v110")
_LENGTH = struct.Struct("<Q")

Tables = dict[str, tuple[Dataset, ...]]


@dataclass(frozen=True)
class Begin:
    """The first message. tables: columns by the name of the table; fixed: datasets that are known now, by path;
    fixed_layout: all that may come; commit_s: from one commit to the next; reserve_bytes: of the disk that are left free."""

    path: Path
    tables: Tables
    attributes: Mapping[str, Any]
    scene_text: str
    fixed: Mapping[str, NDArray[Any]]
    fixed_layout: Mapping[str, Dataset]
    commit_s: float
    reserve_bytes: int


@dataclass(frozen=True)
class Block:
    """Rows of some tables. columns: by path; rows: by table; dropped: rows of each table that are lost so far."""

    columns: Mapping[str, NDArray[Any]]
    rows: Mapping[str, int]
    dropped: Mapping[str, int]


@dataclass(frozen=True)
class End:
    """The last message of a recording that is closed; without it the program that recorded has died."""

    attributes: Mapping[str, Any]
    fixed: Mapping[str, NDArray[Any]]
    dropped: Mapping[str, int]


Message = Begin | Block | End


def tables_of(layout: Sequence[Dataset]) -> Tables:
    """The columns of each table of a layout, without the optional ones."""
    tables: dict[str, list[Dataset]] = {}
    for dataset in layout:
        if dataset.shape and dataset.shape[0] in CHUNK_ROWS and not dataset.optional:
            tables.setdefault(str(dataset.shape[0]), []).append(dataset)
    return {name: tuple(columns) for name, columns in tables.items()}


def frame(message: object) -> bytes:
    """A message as bytes for the pipe: its length, then itself. Both ends are this version of this program."""
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(data)) + data


def _read(fd: int, length: int) -> bytes:
    """So many bytes; fewer where the pipe ends."""
    parts: list[bytes] = []
    while length > 0 and (part := os.read(fd, min(length, 1 << 20))):
        parts.append(part)
        length -= len(part)
    return b"".join(parts)


def _receive(fd: int) -> Message | None:
    """The next message; None where the pipe ends, in the middle of one too."""
    head = _read(fd, _LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    data = _read(fd, length)
    message: Message | None = pickle.loads(data) if len(data) == length else None
    return message


class _DiskFull(Exception):
    """Too little room for another commit."""


class _File:
    """The recording on disk."""

    def __init__(self, begin: Begin) -> None:
        self._begin = begin
        self._written = dict.fromkeys(begin.tables, 0)
        self._waiting: dict[str, list[NDArray[Any]]] = {
            column.path: [] for columns in begin.tables.values() for column in columns
        }
        self._dropped: Mapping[str, int] = dict.fromkeys(begin.tables, 0)
        self._h5 = h5py.File(begin.path, "w", libver=_FORMAT)
        for name, value in begin.attributes.items():
            self._h5.attrs[name] = value
        self._h5.attrs["closed"] = np.uint8(0)
        self._write_counts()
        self._h5.create_dataset("scene", data=begin.scene_text, dtype=h5py.string_dtype("utf-8"))
        # Kept open: h5py says nothing of a write that fails while a dataset is being closed.
        self._stored = {
            column.path: self._create_column(column, CHUNK_ROWS[table])
            for table, columns in begin.tables.items()
            for column in columns
        }
        self._write_fixed(begin.fixed)
        self._h5.swmr_mode = True

    def _create_column(self, column: Dataset, chunk_rows: int) -> h5py.Dataset:
        width = column.shape[1:]
        stored = self._h5.create_dataset(
            column.path,
            (0, *width),
            np.dtype(column.dtype).newbyteorder("<"),
            maxshape=(None, *width),
            chunks=(chunk_rows, *width),
            compression="gzip",
            compression_opts=1,
            shuffle=True,
        )
        _describe(stored, column)
        return stored

    def _write_fixed(self, fixed: Mapping[str, NDArray[Any]]) -> None:
        for path, array in fixed.items():
            if path in self._h5:
                del self._h5[path]
            _describe(self._h5.create_dataset(path, data=array), self._begin.fixed_layout[path])

    def _write_counts(self) -> None:
        for table, rows in self._written.items():
            self._h5.attrs[table] = np.uint64(rows)
            self._h5.attrs[f"dropped_{table}"] = np.uint64(self._dropped[table])

    def take(self, block: Block) -> None:
        """Keeps the rows until the next commit."""
        for path, rows in block.columns.items():
            self._waiting[path].append(rows)
        self._dropped = block.dropped

    def commit(self, *, everything: bool = False) -> None:
        """Writes the rows that fill whole chunks, or all, then how many there are."""
        for table, columns in self._begin.tables.items():
            waiting = sum(map(len, self._waiting[columns[0].path]))
            rows = waiting if everything else waiting // CHUNK_ROWS[table] * CHUNK_ROWS[table]
            if rows == 0:
                continue
            for column in columns:
                values = np.concatenate(self._waiting[column.path])
                self._waiting[column.path] = [values[rows:]]
                stored = self._stored[column.path]
                stored.resize(self._written[table] + rows, axis=0)
                stored[self._written[table] :] = values[:rows]
            self._written[table] += rows
        self._h5.flush()
        self._write_counts()
        self._h5.flush()

    def close(self, end: End | None) -> None:
        """Writes the rest. end: None where nobody closed the recording."""
        if end is not None:
            self._dropped = end.dropped
        self.commit(everything=True)
        self._h5.close()
        if end is None:
            return
        # New attributes and datasets: not in SWMR mode.
        self._h5 = h5py.File(self._begin.path, "r+", libver=_FORMAT)
        self._write_fixed(end.fixed)
        for name, value in end.attributes.items():
            self._h5.attrs[name] = value
        self._h5.attrs["closed"] = np.uint8(1)
        self._h5.close()


def _require_room(begin: Begin) -> None:
    """Raises _DiskFull while there is room to close the file: a write that fails leaves it in the middle of a commit."""
    free_bytes = shutil.disk_usage(begin.path.parent).free
    if free_bytes < begin.reserve_bytes:
        raise _DiskFull(f"the disk is full: {free_bytes / 1e6:,.0f} MB are free, {begin.reserve_bytes / 1e6:,.0f} MB stay so; the recording has ended")


def _describe(stored: h5py.Dataset, dataset: Dataset) -> None:
    stored.attrs["unit"] = dataset.unit
    stored.attrs["description"] = dataset.description


def _record(fd: int, file: _File, begin: Begin) -> None:
    due_s = time.monotonic() + begin.commit_s
    while True:
        if select.select([fd], [], [], max(0.0, due_s - time.monotonic()))[0]:
            message = _receive(fd)
            if not isinstance(message, Block):
                assert not isinstance(message, Begin)
                file.close(message)
                return
            file.take(message)
        if time.monotonic() >= due_s:
            _require_room(begin)
            file.commit()
            due_s = time.monotonic() + begin.commit_s


def main() -> int:
    """Records from standard input; what goes wrong is said on one line of standard output. Returns the exit code."""
    # It ends with its input, not before: the last rows are worth having when all else is being ended.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    begin = _receive(0)
    if not isinstance(begin, Begin):
        return 0
    try:
        file = _File(begin)
        try:
            _record(0, file, begin)
        except _DiskFull as problem:
            file.close(None)
            print(problem, flush=True)
            return 1
    except (OSError, RuntimeError, ValueError) as error:  # h5py has each of them for a write that fails
        print(" ".join(str(error).split()), flush=True)
        os._exit(1)  # as if killed: HDF5 would try to close the file and spoil what stands in it
    return 0
