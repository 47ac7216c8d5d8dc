"""The newest rows of a table of numbers, for plots of what goes on."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


class History:
    """Columns of float64 of which the newest `capacity` rows are kept, each contiguous in memory."""

    def __init__(self, columns: Sequence[str], capacity: int) -> None:
        self._capacity = capacity
        # Twice as long as needed: rows move to the front only once in `capacity` rows.
        self._columns = {name: np.empty(2 * capacity) for name in columns}
        self._end = 0

    def __len__(self) -> int:
        return min(self._end, self._capacity)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Oldest first; a view that holds until the next append."""
        return self._columns[name][self._end - len(self) : self._end]

    def append(self, rows: Mapping[str, ArrayLike]) -> None:
        """Every column, (rows,) each. Raises ValueError where columns are missing or of other lengths."""
        arrays = {name: np.asarray(rows[name], dtype=np.float64) for name in self._columns if name in rows}
        lengths = {array.shape for array in arrays.values()}
        if len(arrays) != len(self._columns) or len(lengths) != 1:
            raise ValueError(
                f"history: got {sorted(arrays)} of shapes {sorted(lengths)}: must be all of {sorted(self._columns)}, alike"
            )
        count = min(next(iter(lengths))[0], self._capacity)
        if self._end + count > 2 * self._capacity:
            keep = len(self)
            for column in self._columns.values():
                column[:keep] = column[self._end - keep : self._end]
            self._end = keep
        for name, array in arrays.items():
            self._columns[name][self._end : self._end + count] = array[len(array) - count :]
        self._end += count
