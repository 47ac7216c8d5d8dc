"""Records: what is written is read back, and the hash changes with every bit that counts."""

import csv
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from synthetic import run_values, simulate_values

from palpate import record, record_layout
from palpate.record import RecordError
from palpate.tip_path import read_csv

# Computed once from integer_values(): it must not depend on machine, NumPy version or dictionary order.
FIXED_VALUES_HASH = "7e2c610640af7f6ccfa910ec70892631a8a3f85bf418d17bb6f22cd7d93c685e"


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    return run_values(ticks=200)[0]


def integer_values() -> dict[str, Any]:
    """Values without any arithmetic in floating point, so that they are the same everywhere."""
    shapes = {"ticks": 7, "updates": 2, "nodes": 8, "triangles": 12, "patch nodes": 4}
    made: dict[str, Any] = {}
    for i, dataset in enumerate(record_layout.RUN):
        shape = tuple(n if isinstance(n, int) else shapes[n] for n in dataset.shape)
        made[dataset.path] = (np.arange(np.prod(shape, dtype=int)) % 100 + i).reshape(shape)
    return made


def test_round_trip(tmp_path: Path, values: dict[str, Any]) -> None:
    file = tmp_path / "record.h5"
    record.write_record(file, record_layout.RUN, values, "title = 'é'\n", {"board": "native", "clock_Hz": 25})
    read, scene_text, attributes = record.read_record(file, record_layout.RUN)
    assert scene_text == "title = 'é'\n"
    assert attributes == {"board": "native", "clock_Hz": 25}
    expected = record.conform(record_layout.RUN, values)
    assert read.keys() == expected.keys()
    for path, array in expected.items():
        np.testing.assert_array_equal(read[path], array)
        assert read[path].dtype == array.dtype
    assert record.record_hash(record_layout.RUN, read) == record.record_hash(record_layout.RUN, values)


def test_every_dataset_states_its_unit(tmp_path: Path, values: dict[str, Any]) -> None:
    record.write_record(tmp_path / "record.h5", record_layout.RUN, values, "", {})
    with h5py.File(tmp_path / "record.h5") as file:
        for dataset in record_layout.RUN:
            if dataset.optional and dataset.path not in values:
                continue
            assert file[dataset.path].attrs["unit"] == dataset.unit
            assert file[dataset.path].attrs["description"] == dataset.description


def test_hash_is_fixed() -> None:
    values = integer_values()
    assert record.record_hash(record_layout.RUN, values) == FIXED_VALUES_HASH
    assert record.record_hash(record_layout.RUN, dict(reversed(values.items()))) == FIXED_VALUES_HASH
    big_endian = {path: np.asarray(array).astype(">i8") for path, array in values.items()}
    assert record.record_hash(record_layout.RUN, big_endian) == FIXED_VALUES_HASH


@pytest.mark.parametrize("dataset", record_layout.RUN, ids=lambda dataset: dataset.path)
def test_hash_sees_the_last_bit_of_what_counts(dataset: record_layout.Dataset) -> None:
    values = record.conform(record_layout.RUN, integer_values())
    array = values[dataset.path].copy()
    last = array.reshape(-1)[-1:]
    last[:] = np.nextafter(last, np.inf) if array.dtype.kind == "f" else last + 1
    changed = record.record_hash(record_layout.RUN, {**values, dataset.path: array}) != FIXED_VALUES_HASH
    assert changed == dataset.hashed


def test_hash_does_not_need_the_reference() -> None:
    values = {path: array for path, array in integer_values().items() if not path.startswith("reference/")}
    assert record.record_hash(record_layout.RUN, values) == FIXED_VALUES_HASH


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ticks/tip_m": None}, r"ticks/tip_m: missing"),
        ({"ticks/unheard_of": np.zeros(3)}, r"ticks/unheard_of: not in the record's layout"),
        ({"ticks/enabled": np.zeros(3)}, r"ticks/enabled: has 3 ticks, but ticks/tick has 200"),
        ({"ticks/tip_m": np.zeros((200, 2))}, r"ticks/tip_m: has shape \(200, 2\), must be ticks × 3"),
        ({"ticks/tip_m": np.zeros(200)}, r"ticks/tip_m: has shape \(200,\), must be ticks × 3"),
        ({"ticks/enabled": np.full(200, 0.5)}, r"ticks/enabled: has numbers that do not fit u1"),
        ({"ticks/enabled": np.full(200, 256)}, r"ticks/enabled: has numbers that do not fit u1"),
        ({"ticks/faults": np.full(200, -1)}, r"ticks/faults: has numbers that do not fit u4"),
    ],
)
def test_values_that_do_not_fit_are_refused(
    values: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    changed = {path: array for path, array in {**values, **change}.items() if array is not None}
    with pytest.raises(RecordError, match=message):
        record.conform(record_layout.RUN, changed)


def test_a_file_without_a_scene_is_not_a_record(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w"):
        pass
    with pytest.raises(RecordError, match="has no /scene"):
        record.read_record(tmp_path / "other.h5", record_layout.RUN)


def test_tip_csv_can_be_replayed(tmp_path: Path) -> None:
    values = record.conform(record_layout.SIMULATE, simulate_values())
    file = tmp_path / "tip.csv"
    record.write_tip_csv(
        file,
        values["tip/time_s"],
        values["tip/position_m"],
        values["tip/force_N"],
        values["tip/contact_mode"],
    )
    time_s, position_m = read_csv(file)
    np.testing.assert_allclose(time_s, values["tip/time_s"], rtol=1e-12)
    np.testing.assert_array_equal(position_m, values["tip/position_m"])
    with file.open() as text:
        rows = list(csv.DictReader(text))
    np.testing.assert_array_equal([float(row["force_z_N"]) for row in rows], values["tip/force_N"][:, 2])
    assert {row["contact_mode"] for row in rows} == {"free", "stick"}


def test_nodes_csv_has_a_line_per_time_and_node(tmp_path: Path) -> None:
    values = record.conform(record_layout.SIMULATE, simulate_values(times=2))
    position_m = values["nodes/position_m"]
    record.write_nodes_csv(
        tmp_path / "nodes.csv", values["nodes/time_s"], position_m, values["nodes/velocity_m_s"]
    )
    table = np.loadtxt(tmp_path / "nodes.csv", delimiter=",", skiprows=1)
    assert table.shape == (position_m.shape[0] * position_m.shape[1], 8)
    np.testing.assert_array_equal(table[:, 2:5], position_m.reshape(-1, 3))
