"""Writes and reads the record of an experiment (HDF5, CSV) and computes its hash. Layout: docs/records.md."""

import csv
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from palpate.record_layout import BODY, CONTACT_MODES, RUN, SIMULATE, Dataset

Values = Mapping[str, Any]
_HASH_HEADER = b"palpate record 1\n"


class RecordError(ValueError):
    """The values do not fit the layout, or a file is not a record."""


class BadRecord(RecordError):
    """A file that cannot be read as a record; the message names the file and what is wrong with it."""


@dataclass(frozen=True)
class Record:
    """What a file holds, of a whole or of an interrupted recording.

    values: by path, those datasets of the layout that the file has; all columns of a table have the same rows. closed:
    False where the recording was interrupted. dropped_rows: by table, where the disk did not keep up.
    """

    file: Path
    kind: Literal["run", "simulate"]
    values: dict[str, NDArray[Any]]
    scene_text: str
    attributes: dict[str, Any]
    closed: bool
    dropped_rows: dict[str, int]


def conform(layout: Sequence[Dataset], values: Values) -> dict[str, NDArray[Any]]:
    """The values as arrays of the layout's types. Raises RecordError for a missing or unknown dataset, a wrong shape,
    or a number that its type cannot hold."""
    unknown = sorted(set(values) - {dataset.path for dataset in layout})
    if unknown:
        raise RecordError(f"{unknown[0]}: not in the record's layout")
    lengths: dict[str, tuple[int, str]] = {}
    arrays: dict[str, NDArray[Any]] = {}
    for dataset in layout:
        if dataset.path not in values:
            if dataset.optional:
                continue
            raise RecordError(f"{dataset.path}: missing")
        given = np.asarray(values[dataset.path])
        if given.dtype.kind not in "fiub":
            raise RecordError(f"{dataset.path}: has {given.dtype} in place of numbers")
        array = np.ascontiguousarray(given, dtype=np.dtype(dataset.dtype).newbyteorder("<")).reshape(
            given.shape
        )
        if array.dtype.kind != "f" and not np.array_equal(array, given):
            raise RecordError(f"{dataset.path}: has numbers that do not fit {dataset.dtype}")
        _check_shape(dataset, array, lengths)
        arrays[dataset.path] = array
    return arrays


def _check_shape(dataset: Dataset, array: NDArray[Any], lengths: dict[str, tuple[int, str]]) -> None:
    fits = array.ndim == len(dataset.shape)
    for name, length in zip(dataset.shape, array.shape, strict=False):
        if isinstance(name, int):
            fits = fits and length == name
        else:
            expected, first = lengths.setdefault(name, (length, dataset.path))
            if length != expected:
                raise RecordError(f"{dataset.path}: has {length} {name}, but {first} has {expected}")
    if not fits:
        raise RecordError(f"{dataset.path}: has shape {array.shape}, must be {dataset.shape_text()}")


def record_hash(layout: Sequence[Dataset], values: Values) -> str:
    """SHA-256 (hexadecimal) over the hashed datasets, in the layout's order; absent optional ones are skipped.

    Of each: its path, type and shape as text, then its numbers, little-endian in C order. Equal hashes mean equal bits.
    """
    digest = hashlib.sha256(_HASH_HEADER)
    arrays = conform(layout, values)
    for dataset in layout:
        if dataset.hashed and dataset.path in arrays:
            array = arrays[dataset.path]
            shape = "x".join(map(str, array.shape))
            digest.update(f"{dataset.path} {dataset.dtype} {shape}\n".encode())
            digest.update(array.tobytes())
    return digest.hexdigest()


def write_record(
    file: Path,
    layout: Sequence[Dataset],
    values: Values,
    scene_text: str,
    attributes: Mapping[str, str | int | float],
) -> None:
    """Writes an HDF5 record: the datasets with units and descriptions as attributes, the scene's text as /scene."""
    arrays = conform(layout, values)
    with h5py.File(file, "w") as h5:
        for name, value in attributes.items():
            h5.attrs[name] = value
        h5.create_dataset("scene", data=scene_text, dtype=h5py.string_dtype("utf-8"))
        for dataset in layout:
            if dataset.path not in arrays:
                continue
            array = arrays[dataset.path]
            options = (
                {"compression": "gzip", "compression_opts": 1, "shuffle": True} if array.size > 64 else {}
            )
            stored = h5.create_dataset(dataset.path, data=array, **options)
            stored.attrs["unit"] = dataset.unit
            stored.attrs["description"] = dataset.description


def read_record(file: Path, layout: Sequence[Dataset]) -> tuple[dict[str, NDArray[Any]], str, dict[str, Any]]:
    """Datasets by path, the scene's text, and the attributes of a record that `write_record` wrote.

    Raises RecordError where the file does not fit the layout, OSError where it is not HDF5.
    """
    with h5py.File(file, "r") as h5:
        if "scene" not in h5:
            raise RecordError(f"{file}: has no /scene")
        values = {dataset.path: h5[dataset.path][()] for dataset in layout if dataset.path in h5}
        scene_text = h5["scene"].asstr()[()]
        attributes = dict(h5.attrs.items())
    return conform(layout, values), scene_text, attributes


def load(file: Path) -> Record:
    """Reads a record of any origin: `run`, `simulate`, a Recorder's; the body may be missing from the latter.

    Raises BadRecord: one line that names the file and what is missing.
    """
    try:
        with _open(file) as h5:
            return _load(file, h5)
    except RecordError as error:
        raise BadRecord(f"{file}: {error}") from None
    except (OSError, RuntimeError, KeyError) as error:  # what h5py makes of a damaged structure
        raise BadRecord(f"{file}: cannot be read: {' '.join(str(error).split())}: the file is damaged") from None


def _open(file: Path) -> h5py.File:
    if file.exists() and not file.is_file():
        raise RecordError("no regular file: must be a record (docs/records.md)")
    if not file.is_file():
        raise RecordError("no such file: must be a record (docs/records.md)")
    if not os.access(file, os.R_OK):
        raise RecordError("may not be read")
    if not h5py.is_hdf5(file):
        raise RecordError("not HDF5: must be a record (docs/records.md)")
    try:
        return h5py.File(file, "r")
    except OSError as error:
        problem = " ".join(str(error).split())
    try:  # being written, or its writer was killed or met the end of the disk
        return h5py.File(file, "r", swmr=True)
    except OSError:
        raise RecordError(f"HDF5 that cannot be opened: {problem}") from None


def _load(file: Path, h5: h5py.File) -> Record:
    if "scene" not in h5:
        raise RecordError("has no /scene: not a record of palpate")
    if "ticks/tick" in h5:
        kind: Literal["run", "simulate"] = "run"
    elif "nodes/time_s" in h5:
        kind = "simulate"
    else:
        raise RecordError("has neither /ticks/tick nor /nodes/time_s: not a record of palpate")
    layout = RUN if kind == "run" else SIMULATE
    attributes = dict(h5.attrs.items())
    counts = {
        name: _count(attributes, name)
        for name in attributes
        if name == "closed" or name.startswith("dropped_") or name in {str(dataset.shape[0]) for dataset in layout if dataset.shape}
    }
    values = {}
    for dataset in layout:
        if dataset.path in h5:
            # A recorder's columns may be longer by a block that was being written: so many rows are whole.
            rows = counts.get(str(dataset.shape[0])) if dataset.shape and "closed" in attributes else None
            values[dataset.path] = _read(h5, dataset.path, rows)
    dropped = {name.removeprefix("dropped_"): count for name, count in counts.items() if name.startswith("dropped_")}
    return Record(
        file,
        kind,
        conform([replace(dataset, optional=dataset.optional or dataset in BODY) for dataset in layout], values),
        _text(_read(h5, "scene", None)),
        attributes,
        bool(counts.get("closed", 1)),
        dropped,
    )


def _count(attributes: Mapping[str, Any], name: str) -> int:
    value = attributes[name]
    if isinstance(value, bool | np.bool_ | int | np.integer) and value >= 0:
        return int(value)
    raise RecordError(f"attribute {name} is {value!r}: must be a whole number, at least 0")


def _text(value: Any) -> str:
    try:
        return str(value.decode("utf-8"))
    except (AttributeError, UnicodeDecodeError):
        raise RecordError("/scene is no text: damaged") from None


def _read(h5: h5py.File, path: str, rows: int | None) -> Any:
    try:
        return h5[path][()] if rows is None else h5[path][:rows]
    except (OSError, KeyError, AttributeError, TypeError, ValueError):  # the chunk is beyond the end of the file, or it is no dataset
        raise RecordError(f"/{path} cannot be read: the file is cut short or damaged") from None


def write_tip_csv(
    file: Path, time_s: NDArray[Any], tip_m: NDArray[Any], force_N: NDArray[Any], contact_mode: NDArray[Any]
) -> None:
    """Tip position, force on the body and contact mode of every tick; a scene's path.csv may name such a file.

    time_s: (n,); tip_m, force_N: (n, 3), device frame; contact_mode: (n,) of 0, 1, 2.
    """
    with file.open("w", newline="", encoding="utf-8") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(
            ["time_s", "x_m", "y_m", "z_m", "force_x_N", "force_y_N", "force_z_N", "contact_mode"]
        )
        for t, tip, force, mode in zip(
            time_s.tolist(), tip_m.tolist(), force_N.tolist(), contact_mode.tolist(), strict=True
        ):
            writer.writerow([_seconds(t), *tip, *force, CONTACT_MODES[mode]])


def write_nodes_csv(
    file: Path, time_s: NDArray[Any], position_m: NDArray[Any], velocity_m_s: NDArray[Any]
) -> None:
    """Positions and velocities (times, nodes, 3) of all nodes, one line per time and node."""
    with file.open("w", newline="", encoding="utf-8") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["time_s", "node", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"])
        for t, positions, velocities in zip(time_s.tolist(), position_m, velocity_m_s, strict=True):
            for node, (x, v) in enumerate(zip(positions.tolist(), velocities.tolist(), strict=True)):
                writer.writerow([_seconds(t), node, *x, *v])


def _seconds(time_s: float) -> str:
    """Ticks are whole milliseconds: written without the digits of their binary rounding."""
    return f"{time_s:.9g}"
