"""The path of the tip or of the hand over time: from waypoints, or from a CSV file."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from palpate.scene_schema import SceneError

Interpolation = Literal["linear", "minimum_jerk"]

CSV_COLUMNS = ("time_s", "x_m", "y_m", "z_m")
MAX_TIME_S = 600.0
MAX_POSITION_M = 1.0
MAX_ROWS = 2_000_000


@dataclass(frozen=True)
class TipPath:
    """Points in time and space with what lies between them; before the first and after the last the path rests.

    time_s: (n,), increasing. position_m: (n, 3), device frame. "linear" moves at constant speed from point to point,
    "minimum_jerk" rests at each (host/plant/tip_path.hpp has the formulas).
    """

    time_s: NDArray[np.float64]
    position_m: NDArray[np.float64]
    interpolation: Interpolation


def read_csv(file: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (n,) in s and positions (n, 3) in m from a CSV file with a header line.

    The columns time_s, x_m, y_m and z_m may stand in any order and among others. Raises SceneError with the line's
    number, the column, the value and its range.
    """
    try:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            return _read_rows(file, csv.reader(lines, skipinitialspace=True))
    except UnicodeDecodeError:
        raise SceneError(
            f"{file}: is not UTF-8 text: must be CSV with the columns {', '.join(CSV_COLUMNS)}"
        ) from None
    except csv.Error as error:
        raise SceneError(f"{file}: {error}: must be CSV with the columns {', '.join(CSV_COLUMNS)}") from None


def _read_rows(file: Path, rows: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    header = [name.strip() for name in next(rows, [])]
    for name in CSV_COLUMNS:
        if header.count(name) != 1:
            problem = "missing" if name not in header else "given twice"
            raise SceneError(
                f"{file}:1: column {name}: {problem}; must have the columns {', '.join(CSV_COLUMNS)}"
            )
    columns = [header.index(name) for name in CSV_COLUMNS]
    values: list[list[float]] = []
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise SceneError(
                f"{file}:{rows.line_num}: {len(row)} values: must be {len(header)}, as in the header"
            )
        point = [_read_cell(file, rows.line_num, header[column], row[column]) for column in columns]
        if values and point[0] <= values[-1][0]:
            raise SceneError(
                f"{file}:{rows.line_num}: time_s = {point[0]:.12g}: must be greater than the previous time "
                f"{values[-1][0]:.12g}"
            )
        if len(values) == MAX_ROWS:
            raise SceneError(f"{file}:{rows.line_num}: too many rows: must be at most {MAX_ROWS:,}")
        values.append(point)
    if not values:
        raise SceneError(f"{file}: no rows: must have at least one row below the header")
    table = np.array(values, dtype=np.float64)
    return table[:, 0].copy(), table[:, 1:].copy()


def _read_cell(file: Path, line: int, name: str, text: str) -> float:
    low, high = (0.0, MAX_TIME_S) if name == "time_s" else (-MAX_POSITION_M, MAX_POSITION_M)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        unit = "s" if name == "time_s" else "m"
        raise SceneError(
            f"{file}:{line}: {name} = {text.strip()[:40]}: must be a number in [{low:g}, {high:g}] {unit}"
        )
    return value
