"""Recordings: written while a loop goes on, whole after close(), readable after a SIGKILL at any moment."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import ROOT
from synthetic import run_values

from palpate import record, record_layout
from palpate.record import BadRecord, RecordError
from palpate.record_layout import RUN, TICKS, UPDATES
from palpate.recorder import Recorder
from palpate.recorder_process import CHUNK_ROWS

TICK_COUNT = 1000
# Gives up on what should have come long ago.
DEADLINE_S = 60.0


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    return run_values(ticks=TICK_COUNT)[0]


def part(values: dict[str, Any], table: str, rows: slice) -> dict[str, Any]:
    """Some rows of all columns of a table."""
    return {path: array[rows] for path, array in values.items() if path.startswith(f"{table}/")}


def body(values: dict[str, Any]) -> dict[str, Any]:
    return {path: array for path, array in values.items() if path.startswith("body/")}


def blocks(values: dict[str, Any], size: int) -> Iterator[dict[str, Any]]:
    """All ticks in blocks; one of the updates with each as long as there are any."""
    for i, start in enumerate(range(0, TICK_COUNT, size)):
        yield {**part(values, "ticks", slice(start, start + size)), **part(values, "updates", slice(i, i + 1))}


def assert_same(file: Path, values: dict[str, Any], layout: tuple[record_layout.Dataset, ...]) -> None:
    read = record.load(file).values
    for path, array in record.conform(layout, {d.path: values[d.path] for d in layout}).items():
        assert read[path].dtype == array.dtype
        np.testing.assert_array_equal(read[path], array, err_msg=path)


@pytest.mark.parametrize("size", [1, 7, 256, 1000])
def test_what_is_appended_is_read(tmp_path: Path, values: dict[str, Any], size: int) -> None:
    file = tmp_path / "record.h5"
    recorder = Recorder(file, RUN, {"board": "native"}, scene_text="title = 'é'\n", commit_s=0.0)
    for block in blocks(values, size):
        assert recorder.append(block)
    recorder.append(part(values, "updates", slice(-(-TICK_COUNT // size), None)))
    recorder.close({"models_sent": 3}, body(values))
    assert_same(file, values, (*TICKS, *UPDATES, *record_layout.BODY))
    loaded = record.load(file)
    assert (loaded.kind, loaded.closed, loaded.scene_text) == ("run", True, "title = 'é'\n")
    assert loaded.dropped_rows == {"ticks": 0, "updates": 0}
    assert (loaded.attributes["board"], loaded.attributes["models_sent"]) == ("native", 3)
    # The reader of a run's record reads it too.
    without = {path: array for path, array in values.items() if not path.startswith("reference/")}
    read, _, _ = record.read_record(file, RUN)
    assert record.record_hash(RUN, read) == record.record_hash(RUN, without)


def test_every_dataset_states_its_unit(tmp_path: Path, values: dict[str, Any]) -> None:
    with Recorder(tmp_path / "record.h5", RUN, {}, fixed=body(values)):
        pass
    with h5py.File(tmp_path / "record.h5") as file:
        for dataset in (*TICKS, *UPDATES, *record_layout.BODY):
            assert file[dataset.path].attrs["unit"] == dataset.unit
            assert file[dataset.path].attrs["description"] == dataset.description


def test_the_newest_body_counts(tmp_path: Path, values: dict[str, Any]) -> None:
    file = tmp_path / "record.h5"
    recorder = Recorder(file, RUN, {}, fixed={"body/time_s": 1.0, "body/patch_nodes": np.arange(3)})
    recorder.close(fixed={"body/time_s": 2.0, "body/patch_nodes": np.arange(5)})
    read = record.load(file).values
    assert read["body/time_s"] == 2.0
    assert len(read["body/patch_nodes"]) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ticks/tip_m": None}, r"ticks/tip_m: missing"),
        ({"ticks/unheard_of": np.zeros(10)}, r"ticks/unheard_of: not in the recording's tables"),
        ({"reference/force_N": np.zeros((10, 3))}, r"reference/force_N: not in the recording's tables"),
        ({"ticks/enabled": np.zeros(3)}, r"ticks/enabled: has 3 ticks, but ticks/tick has 10"),
        ({"ticks/faults": np.full(10, -1)}, r"ticks/faults: has numbers that do not fit u4"),
    ],
)
def test_blocks_that_do_not_fit_are_refused(
    tmp_path: Path, values: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    block = {**part(values, "ticks", slice(0, 10)), **change}
    with Recorder(tmp_path / "record.h5", RUN, {}) as recorder:
        with pytest.raises(RecordError, match=message):
            recorder.append({path: array for path, array in block.items() if array is not None})
        assert recorder.append(part(values, "ticks", slice(0, 10)))
    assert len(record.load(tmp_path / "record.h5").values["ticks/tick"]) == 10


def test_the_caller_may_use_its_arrays_again(tmp_path: Path, values: dict[str, Any]) -> None:
    block = record.conform(TICKS, part(values, "ticks", slice(0, 10)))
    with Recorder(tmp_path / "record.h5", TICKS, {}) as recorder:
        recorder.append(block)
        block["ticks/force_N"][:] = -1.0
    with h5py.File(tmp_path / "record.h5") as file:
        np.testing.assert_array_equal(file["ticks/force_N"], values["ticks/force_N"][:10].astype("f4"))


def test_what_the_disk_is_too_slow_for_is_dropped_and_counted(tmp_path: Path, values: dict[str, Any]) -> None:
    file = tmp_path / "record.h5"
    recorder = Recorder(file, RUN, {}, capacity_rows=500)
    os.kill(recorder.process_id, signal.SIGSTOP)  # a disk that stands still: append() must come back all the same
    taken: list[int] = []
    for round_number in range(5):
        for block in blocks(values, 10):
            block["ticks/tick"] = block["ticks/tick"] + TICK_COUNT * round_number
            if recorder.append(block):
                taken.extend(block["ticks/tick"].tolist())
    dropped = recorder.dropped_rows
    os.kill(recorder.process_id, signal.SIGCONT)
    recorder.close()
    loaded = record.load(file)
    assert 500 < len(taken) < 5 * TICK_COUNT
    assert loaded.values["ticks/tick"].tolist() == taken
    assert loaded.dropped_rows == dropped
    assert dropped["ticks"] == 5 * TICK_COUNT - len(taken)
    assert dropped["updates"] == 5 * len(values["updates/tick"]) - len(loaded.values["updates/tick"])


def test_a_file_that_cannot_be_made(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Recorder(tmp_path / "nowhere/record.h5", RUN, {})


def test_a_disk_that_is_full_is_told(tmp_path: Path, values: dict[str, Any]) -> None:
    (tmp_path / "record.h5").symlink_to("/dev/full")
    recorder = Recorder(tmp_path / "record.h5", RUN, {})
    recorder.append(part(values, "ticks", slice(0, 10)))
    with pytest.raises(RecordError, match=r"record.h5: .*(No space left|unable to)"):
        recorder.close()
    recorder.close()


def await_problem(recorder: Recorder, block: dict[str, Any]) -> None:
    end_s = time.monotonic() + DEADLINE_S
    while recorder.append(block):
        assert time.monotonic() < end_s
        time.sleep(0.01)


def test_a_recording_ends_before_the_disk_is_full(tmp_path: Path, values: dict[str, Any]) -> None:
    file, block = tmp_path / "record.h5", part(values, "ticks", slice(0, 10))
    recorder = Recorder(file, TICKS, {}, commit_s=0.0, reserve_bytes=2**62)
    await_problem(recorder, block)
    with pytest.raises(RecordError, match=r"the disk is full: [\d,]+ MB are free, .* the recording has ended"):
        recorder.close()
    with h5py.File(file) as h5:  # closed as it should be, with the rows that came first
        assert h5.attrs["closed"] == 0
        assert h5.attrs["ticks"] == len(h5["ticks/tick"]) >= 10


# A limit on the length of files, as a quota has it, is not seen in the free room: there a write fails.
FULL = """
import resource, sys
sys.path[:0] = {folders!r}
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
import numpy as np
from pathlib import Path
from palpate.record_layout import TICKS, UPDATES
from palpate.recorder import Recorder
noise, tick = np.random.default_rng(1), 0
recorder = Recorder(Path({file!r}), (*TICKS, *UPDATES), {{}}, scene_text="x = 1", commit_s=0.0)
while True:
    block = {{d.path: np.zeros((50, *d.shape[1:])) for d in TICKS}}
    block["ticks/tick"] = np.arange(tick, tick + 50)
    block["ticks/true_tip_m"] = noise.normal(size=(50, 3))
    if not recorder.append(block) and recorder.problem:
        sys.exit(recorder.problem)
    tick += 50
"""


def test_a_write_that_fails_leaves_what_was_committed(tmp_path: Path) -> None:
    file = tmp_path / "record.h5"
    text = FULL.format(folders=[str(ROOT / "host/python")], file=str(file))
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=DEADLINE_S)
    assert "File too large" in done.stderr and done.stderr.count("\n") == 1
    loaded = record.load(file)
    assert not loaded.closed
    ticks = loaded.values["ticks/tick"]
    assert len(ticks) > 0
    np.testing.assert_array_equal(ticks, np.arange(len(ticks)))
    assert np.all(np.linalg.norm(loaded.values["ticks/true_tip_m"], axis=1) > 0.0)
    make_open_everywhere(file)
    np.testing.assert_array_equal(record.load(file).values["ticks/tick"], ticks)


def test_without_its_process_all_is_dropped(tmp_path: Path, values: dict[str, Any]) -> None:
    recorder = Recorder(tmp_path / "record.h5", RUN, {})
    os.kill(recorder.process_id, signal.SIGKILL)
    await_problem(recorder, part(values, "ticks", slice(0, 10)))
    assert recorder.problem == "the process that writes it ended with code -9"
    assert recorder.dropped_rows == {"ticks": 10, "updates": 0}
    with pytest.raises(RecordError, match="ended with code -9"):
        recorder.close()


def test_a_closed_recording_takes_nothing(tmp_path: Path, values: dict[str, Any]) -> None:
    recorder = Recorder(tmp_path / "record.h5", RUN, {})
    recorder.close()
    recorder.close()
    with pytest.raises(RecordError, match="the recording is closed"):
        recorder.append(part(values, "ticks", slice(0, 10)))


# A loop of 1 kHz, every number of a row made from the number of its tick, and an update every 33 ticks. It says first
# which process writes.
LOOP = """
import sys, time
sys.path[:0] = {folders!r}
import numpy as np
from pathlib import Path
from palpate.record_layout import TICKS, UPDATES
from palpate.recorder import Recorder
recorder = Recorder(Path({file!r}), (*TICKS, *UPDATES), {{}}, scene_text="title = 'loop'", commit_s={commit_s})
print(recorder.process_id, flush=True)
def rows(layout, numbers):
    return {{d.path: np.multiply.outer(numbers % 251, np.ones(d.shape[1:], int)) if d.path[-5:] != "/tick" else numbers
            for d in layout}}
tick = update = 0
while True:
    count = 20
    block = rows(TICKS, np.arange(tick, tick + count))
    tick += count
    updates = tick // 33
    if updates > update:
        block.update(rows(UPDATES, np.arange(update, updates)))
    update = updates
    recorder.append(block)
    time.sleep({pause_s})
"""


@contextlib.contextmanager
def loop(file: Path, commit_s: float, pause_s: float) -> "Iterator[tuple[subprocess.Popen[str], int]]":
    """The loop in a process of its own, and the number of the process that writes."""
    folders = [str(ROOT / "host/python")]
    text = LOOP.format(folders=folders, file=str(file), commit_s=commit_s, pause_s=pause_s)
    with subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, int(process.stdout.readline())
        finally:
            process.kill()


def committed_rows(file: Path) -> int:
    """As a reader sees it while the loop goes on."""
    try:
        return len(record.load(file).values["ticks/tick"])
    except BadRecord:  # its writer is just beginning
        return 0


def await_rows(file: Path, count: int) -> int:
    end_s = time.monotonic() + DEADLINE_S
    while (rows := committed_rows(file)) < count:
        assert time.monotonic() < end_s
        time.sleep(0.02)
    return rows


def assert_whole(loaded: record.Record) -> None:
    """Rows without a gap from the first tick on, each number as the loop made it, all columns as long."""
    assert loaded.scene_text == "title = 'loop'"
    for table, layout in (("ticks", TICKS), ("updates", UPDATES)):
        numbers = np.arange(len(loaded.values[f"{table}/tick"]))
        for dataset in layout:
            read = loaded.values[dataset.path]
            expected = numbers if dataset.path.endswith("/tick") else numbers % 251
            expected = np.broadcast_to(expected.reshape(-1, *[1] * (read.ndim - 1)), read.shape)
            np.testing.assert_array_equal(read, expected, err_msg=dataset.path)


def opens(file: Path) -> bool:
    try:
        h5py.File(file).close()
    except OSError:
        return False
    return True


def make_open_everywhere(file: Path) -> None:
    """What docs/records.md says to do for other programs."""
    assert not opens(file)
    subprocess.run(["h5clear", "--status", "--increment=0", str(file)], check=True)
    assert opens(file)


@pytest.mark.parametrize("seed", range(4))
def test_a_killed_program_leaves_a_file_that_any_reader_opens(tmp_path: Path, seed: int) -> None:
    file, choice = tmp_path / "record.h5", random.Random(seed)
    with loop(file, commit_s=0.1, pause_s=0.02) as (process, _):
        seen = await_rows(file, choice.randrange(1, 4) * CHUNK_ROWS["ticks"])
        time.sleep(choice.uniform(0.0, 0.3))
        process.kill()
        end_s = time.monotonic() + DEADLINE_S
        while not opens(file):  # as any reader does, without SWMR; the other process is still finishing
            assert time.monotonic() < end_s
            time.sleep(0.02)
    loaded = record.load(file)
    assert not loaded.closed
    assert len(loaded.values["ticks/tick"]) >= seen
    assert_whole(loaded)


# Without a pause between the commits nearly every SIGKILL meets one: with 0 s, as fast as the loop gives rows.
@pytest.mark.parametrize("seed", range(12))
def test_a_killed_writer_leaves_the_rows_that_it_had_committed(tmp_path: Path, seed: int) -> None:
    file, choice = tmp_path / "record.h5", random.Random(seed)
    with loop(file, commit_s=0.0, pause_s=0.001) as (process, writer):
        seen = await_rows(file, choice.randrange(1, 20) * CHUNK_ROWS["ticks"])
        time.sleep(choice.uniform(0.0, 0.3))
        os.kill(writer, signal.SIGKILL)
        process.kill()
        process.wait()
    loaded = record.load(file)
    assert not loaded.closed
    assert len(loaded.values["ticks/tick"]) >= seen
    assert len(loaded.values["ticks/tick"]) % CHUNK_ROWS["ticks"] == 0
    assert_whole(loaded)
    make_open_everywhere(file)
    assert_whole(record.load(file))


def test_files_that_are_no_records_are_refused_on_one_line(tmp_path: Path, values: dict[str, Any]) -> None:
    with pytest.raises(BadRecord, match=r"none.h5: no such file"):
        record.load(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("title = 'not a record'\n")
    with pytest.raises(BadRecord, match=r"text.h5: not HDF5"):
        record.load(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = np.zeros(3)
    with pytest.raises(BadRecord, match=r"other.h5: has no /scene: not a record of palpate"):
        record.load(tmp_path / "other.h5")
    record.write_record(tmp_path / "record.h5", RUN, values, "", {})
    with h5py.File(tmp_path / "record.h5", "r+") as mine:
        del mine["ticks/force_N"]
    with pytest.raises(BadRecord, match=r"record.h5: ticks/force_N: missing"):
        record.load(tmp_path / "record.h5")


def test_a_record_that_is_cut_short_is_refused_on_one_line(tmp_path: Path, values: dict[str, Any]) -> None:
    whole = tmp_path / "whole.h5"
    record.write_record(whole, RUN, values, "", {})
    data = whole.read_bytes()
    for length in (0, 100, len(data) // 2, len(data) - 1):
        (tmp_path / "cut.h5").write_bytes(data[:length])
        with pytest.raises(BadRecord, match=r"cut.h5: \S") as caught:
            record.load(tmp_path / "cut.h5")
        assert "\n" not in str(caught.value)
