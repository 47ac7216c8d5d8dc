"""Records a loop while it goes on: rows are handed over in blocks, a process of its own writes them (HDF5).

The loop never waits for the disk. `append` copies a block into a queue of bounded length; a thread sends it on through a
pipe; the process at its other end (`recorder_process`) writes. When the program that records dies, by SIGKILL even, that
process finishes what it was sent and closes the file. docs/records.md says what a reader finds.
"""

import contextlib
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from palpate import __version__
from palpate.record import RecordError, conform
from palpate.record_layout import Dataset
from palpate.recorder_process import Begin, Block, End, frame, tables_of

Attribute = str | int | float

# Half a minute of a loop of 1 kHz, 6 MB: far longer than a disk stalls, small beside the rest of the program.
CAPACITY_ROWS = 30_000
COMMIT_S = 1.0
# Several times what a full queue takes.
RESERVE_BYTES = 50_000_000
# After close() the rest of a full queue takes a second or two to write.
_CLOSE_TIMEOUT_S = 60.0


class Recorder:
    """Writes blocks of rows to a new HDF5 file that has the layout's names, types, units and descriptions.

    A dataset whose shape begins with a name in `recorder_process.CHUNK_ROWS` ("ticks", "updates") is a column of that
    table and grows; optional columns are not recorded. All other datasets are written once, from `fixed`.
    Any thread may call; the calls wait for one another, never for the disk, but for close().
    """

    def __init__(
        self,
        path: Path,
        layout: Sequence[Dataset],
        attributes: Mapping[str, Attribute],
        *,
        scene_text: str = "",
        fixed: Mapping[str, Any] | None = None,
        capacity_rows: int = CAPACITY_ROWS,
        commit_s: float = COMMIT_S,
        reserve_bytes: int = RESERVE_BYTES,
    ) -> None:
        """An existing file is replaced. attributes: of `/`. scene_text: the scene in TOML, for /scene. fixed: datasets
        outside of the tables, as known now. capacity_rows: that wait for the disk at most. commit_s: until rows are on
        disk for good, and at most a chunk more (`recorder_process.CHUNK_ROWS`). reserve_bytes: where less of the disk is free, the
        recording ends.

        Raises OSError where the file cannot be made, RecordError for fixed datasets that do not fit the layout.
        """
        self._path = path
        self._tables = tables_of(layout)
        self._fixed_layout = {d.path: d for d in layout if d.shape == () or d.shape[0] not in self._tables}
        self._capacity_rows = capacity_rows
        self._condition = threading.Condition()
        self._queue: deque[Block] = deque()
        self._rows_waiting = 0
        self._dropped = dict.fromkeys(self._tables, 0)
        self._closing: End | None = None
        self._problem: str | None = None
        begin = Begin(
            path.absolute(),
            self._tables,
            {"palpate_version": __version__, **attributes},
            scene_text,
            self._conform_fixed(fixed or {}),
            self._fixed_layout,
            commit_s,
            reserve_bytes,
        )
        path.open("wb").close()  # a file that cannot be made is told here, not by the process
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROCESS, str(Path(__file__).parents[1])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for this program
        )
        self._sender = threading.Thread(target=self._send, args=(begin,), name="recorder", daemon=True)
        self._sender.start()

    def append(self, values: Mapping[str, Any]) -> bool:
        """Takes the next rows of one or more tables: every column of each (rows, ...), rows >= 0 the same in a table.

        The arrays are copied. Rows stay as they are: hand over an update when the board has answered it. False: the
        queue is full, or the writer has failed, and the whole block is dropped and its rows are counted.
        Raises RecordError for columns that are missing, unknown, or do not fit.
        """
        columns, rows = self._conform_rows(values)
        total = sum(rows.values())
        with self._condition:
            if self._closing is not None:
                raise RecordError(f"{self._path}: the recording is closed")
            if self._problem is not None or self._rows_waiting + total > self._capacity_rows:
                for table, count in rows.items():
                    self._dropped[table] += count
                return False
            self._queue.append(Block(columns, rows, dict(self._dropped)))
            self._rows_waiting += total
            self._condition.notify()
        return True

    def close(
        self, attributes: Mapping[str, Attribute] | None = None, fixed: Mapping[str, Any] | None = None
    ) -> None:
        """Writes what is waiting and closes the file; waits for that. attributes, fixed: added, or in place of earlier
        ones. A second call does nothing. Raises RecordError where the file could not be written."""
        with self._condition:
            if self._closing is not None:
                return
            self._closing = End(dict(attributes or {}), self._conform_fixed(fixed or {}), dict(self._dropped))
            self._condition.notify()
        self._sender.join(_CLOSE_TIMEOUT_S)
        try:
            self._process.wait(_CLOSE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            self._problem = self._problem or f"took more than {_CLOSE_TIMEOUT_S:g} s to write the rest"
        if self._problem is None and self._process.returncode != 0:
            self._problem = self._last_words()
        if self._process.stdout is not None:
            self._process.stdout.close()
        if self._problem is not None:
            raise RecordError(f"{self._path}: {self._problem}")

    @property
    def dropped_rows(self) -> dict[str, int]:
        """Rows of each table that were dropped so far: the queue was full, or the writer had failed."""
        with self._condition:
            return dict(self._dropped)

    @property
    def problem(self) -> str | None:
        """Why nothing is written any more; None while all is well."""
        return self._problem

    @property
    def process_id(self) -> int:
        """Of the process that writes."""
        return self._process.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _conform_fixed(self, fixed: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        for path in fixed:
            if path not in self._fixed_layout:
                raise RecordError(f"{path}: not a dataset that is written once")
        return conform([self._fixed_layout[path] for path in fixed], fixed)

    def _conform_rows(self, values: Mapping[str, Any]) -> tuple[dict[str, NDArray[Any]], dict[str, int]]:
        columns: dict[str, NDArray[Any]] = {}
        rows: dict[str, int] = {}
        for table, layout in self._tables.items():
            given = {dataset.path: values[dataset.path] for dataset in layout if dataset.path in values}
            if given:
                arrays = conform(layout, given)
                rows[table] = len(arrays[layout[0].path])
                columns.update((path, np.array(array)) for path, array in arrays.items())
        if unknown := sorted(set(values) - set(columns)):
            raise RecordError(f"{unknown[0]}: not in the recording's tables")
        return columns, rows

    def _send(self, begin: Begin) -> None:
        """The thread: from the queue to the pipe, where it waits when the process does not keep up."""
        pipe = self._process.stdin
        assert pipe is not None
        try:
            pipe.write(frame(begin))
            pipe.flush()
            while True:
                with self._condition:
                    while not self._queue and self._closing is None:
                        self._condition.wait()
                    block = self._queue.popleft() if self._queue else None
                if block is None:
                    pipe.write(frame(self._closing))
                    pipe.close()
                    return
                pipe.write(frame(block))
                pipe.flush()
                with self._condition:
                    self._rows_waiting -= sum(block.rows.values())
        except OSError:  # the process is gone
            with contextlib.suppress(OSError):
                pipe.close()
            problem = self._last_words()
            with self._condition:
                self._problem = problem
                self._queue.clear()

    def _last_words(self) -> str:
        """What the process said at its end."""
        assert self._process.stdout is not None
        said = self._process.stdout.read().decode(errors="replace").strip()
        return said or f"the process that writes it ended with code {self._process.wait()}"


# It must find this package, which need not be installed.
_PROCESS = "import sys; sys.path.insert(0, sys.argv[1]); from palpate.recorder_process import main; sys.exit(main())"
