"""Records open in other programs: the examples of docs/records.md, and HDF5's own tools, another version of the library."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command import ROOT
from synthetic import run_values

from palpate import record, record_layout
from palpate.recorder import Recorder

TICKS = 700


@pytest.fixture(params=["run", "recording"])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A record.h5 as `run` writes it, and one as a session does."""
    values = record.conform(record_layout.RUN, run_values(ticks=TICKS)[0])
    path = tmp_path / "record.h5"
    if request.param == "run":
        record.write_record(path, record_layout.RUN, values, "title = 'x'\n", {"board": "native"})
        return path
    with Recorder(path, record_layout.RUN, {"board": "native"}, scene_text="title = 'x'\n", commit_s=0.0) as recorder:
        recorder.append({p: a for p, a in values.items() if p.startswith(("ticks/", "updates/"))})
    return path


def examples() -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / "docs/records.md").read_text("utf-8"), re.DOTALL)


def test_the_examples_of_the_documentation_run(file: Path) -> None:
    assert len(examples()) == 2
    # The second one prints a table of the forces in contact; here it is also compared.
    check = """
import numpy as np
with h5py.File("record.h5") as file:
    assert len(ticks) == 700 and len(table("updates")) == len(file["updates/tick"])
    for i in range(3):
        np.testing.assert_array_equal(ticks[f"force_N_{i}"], file["ticks/force_N"][:, i])
    np.testing.assert_array_equal(ticks.index, file["ticks/tick"])
    np.testing.assert_array_equal(ticks["model_age_ticks"], file["ticks/model_age_ticks"])
"""
    for text, expected in zip((examples()[0], examples()[1] + check), ("(700, 3) N native", "force_N_2"), strict=True):
        done = subprocess.run(
            [sys.executable, "-c", text], cwd=file.parent, capture_output=True, text=True, env={**os.environ}, timeout=120
        )
        assert done.returncode == 0, done.stderr
        assert expected in done.stdout


def test_h5ls_lists_what_the_documentation_says(file: Path) -> None:
    done = subprocess.run(["h5ls", "-r", str(file)], capture_output=True, text=True, check=True)
    listed = {line.split()[0]: line for line in done.stdout.splitlines()}
    loaded = record.load(file).values
    assert {f"/{path}" for path in loaded} <= set(listed)
    for path, array in loaded.items():
        sizes = [int(size) for size in re.findall(r"(\d+)(?:/Inf|/\d+)?(?=[,}])", listed[f"/{path}"].split("Dataset")[1])]
        assert sizes == list(array.shape), path


def test_h5dump_gives_the_same_bytes(file: Path, tmp_path: Path) -> None:
    for path, array in record.load(file).values.items():
        raw = tmp_path / "raw.bin"
        subprocess.run(
            ["h5dump", "-d", f"/{path}", "-b", "LE", "-o", str(raw), str(file)], capture_output=True, check=True
        )
        assert raw.read_bytes() == array.tobytes(), path


def test_h5dump_reads_text_and_units(file: Path) -> None:
    def dumped(*options: str) -> str:
        return subprocess.run(["h5dump", *options, str(file)], capture_output=True, text=True, check=True).stdout

    assert "title = 'x'" in dumped("-d", "/scene")
    assert '"N"' in dumped("-a", "/ticks/force_N/unit")
    assert '"native"' in dumped("-a", "/board")
    # By rows, as in docs/records.md: MATLAB, by columns, has it the other way round.
    force_N = record.load(file).values["ticks/force_N"]
    text = dumped("-d", "/ticks/force_N", "-s", "300,0", "-c", "1,3", "-m", "%.9g").split("DATA {")[1]
    numbers = re.findall(r"[-\d.e]+", re.sub(r"\(\d+,\d+\):", " ", text.split("}")[0]))
    np.testing.assert_allclose([float(number) for number in numbers], force_N[300], rtol=1e-6)
