"""The tests of the safety supervisor reach every line and every branch of it (host/bench/supervisor_coverage.py)."""

import sys

import pytest

from palpate.paths import ROOT

sys.path.insert(0, str(ROOT / "host/bench"))
import supervisor_coverage
from supervisor_coverage import File

from palpate.mutants.firmware_build import NoBuild


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, File]:
    try:
        return supervisor_coverage.measure(tmp_path_factory.mktemp("coverage"))
    except NoBuild as error:
        pytest.skip(f"{error} (./run does it)")


def test_every_line_and_branch_is_reached(files: dict[str, File]) -> None:
    for name, file in files.items():
        assert file.line and file.branch, f"{name}: nothing was counted"
        assert not file.missing_lines(), name
        assert not file.missing_branches(), name


def test_all_of_the_supervisor_is_counted(files: dict[str, File]) -> None:
    source = (ROOT / "firmware/core/supervisor.cpp").read_text().splitlines()
    deciding = {number for number, line in enumerate(source, 1) if line.lstrip().startswith("if (")}
    assert len(deciding) > 40
    assert deciding <= set(files["supervisor.cpp"].line)
    assert deciding <= {number for number, _ in files["supervisor.cpp"].branch}


def test_what_no_test_reaches_is_named() -> None:
    file = File()
    file.line.update({3: 1, 4: 0, 9: 0})
    file.branch.update({(3, 0): 5, (3, 1): 0})
    assert (file.missing_lines(), file.missing_branches()) == ([4, 9], [3])
