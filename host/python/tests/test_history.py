"""The newest rows of a table."""

import numpy as np
import pytest

from palpate.history import History


@pytest.mark.parametrize("block", [1, 3, 10, 25])
def test_keeps_the_newest_rows_in_order(block: int) -> None:
    history = History(("t", "x"), capacity=10)
    for first in range(0, 60, block):
        t = np.arange(first, first + block)
        history.append({"t": t, "x": -t, "other": t})
        end = first + block
        np.testing.assert_array_equal(history["t"], np.arange(max(0, end - 10), end))
        np.testing.assert_array_equal(history["x"], -history["t"])
        assert len(history) == min(end, 10)


def test_refuses_rows_that_do_not_fit_and_keeps_what_it_has() -> None:
    history = History(("t", "x"), capacity=4)
    history.append({"t": [1.0], "x": [2.0]})
    with pytest.raises(ValueError, match="must be all of"):
        history.append({"t": [1.0]})
    with pytest.raises(ValueError, match="alike"):
        history.append({"t": [1.0, 2.0], "x": [2.0]})
    np.testing.assert_array_equal(history["t"], [1.0])
