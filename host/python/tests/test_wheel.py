"""The wheel: built by pip, installed into a fresh environment, used from there without the source tree.

The packages that palpate depends on are those of the repository's environment: no test downloads anything.
"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
from command import ROOT

from palpate import __version__

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def environment() -> dict[str, str]:
    """Without the repository's package, with ccache where there is one."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if shutil.which("ccache"):
        kept |= {f"CMAKE_{language}_COMPILER_LAUNCHER": "ccache" for language in ("C", "CXX")}
        kept |= {"CCACHE_BASEDIR": "/", "CCACHE_NOHASHDIR": "1"}
    return kept


def run(command: list[str], cwd: Path) -> "subprocess.CompletedProcess[str]":
    """A command that must succeed."""
    done = subprocess.run(command, cwd=cwd, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built in build/wheel, which is kept: a second time only what has changed is compiled."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--no-deps", "--no-build-isolation"]
    run([*pip, f"--config-settings=build-dir={ROOT}/build/wheel", "--wheel-dir", str(folder), str(ROOT)], folder)
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the programs of an environment that has the wheel."""
    folder = tmp_path_factory.mktemp("environment")
    run([sys.executable, "-m", "venv", "--without-pip", str(folder)], folder)
    (site,) = (folder / "lib").glob("python3*/site-packages")
    (site / "dependencies.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", f"--python={folder}/bin/python"]
    run([*pip, "install", "--no-deps", "--no-index", str(wheel)], folder)
    return folder / "bin"


def test_what_is_inside(wheel: Path) -> None:
    assert wheel.name.startswith(f"palpate-{__version__}-")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    inside = {"palpate/bin/palpate_native", "palpate/scenes/demo.toml", "palpate/_core.pyi", "palpate/py.typed", "palpate/VERSION"}
    assert inside <= names
    assert len([name for name in names if re.fullmatch(r"palpate/_core\..*\.so", name)]) == 1
    assert {name.split("/")[0] for name in names} == {"palpate", f"palpate-{__version__}.dist-info"}


def test_the_command_works(installed: Path, tmp_path: Path) -> None:
    lines = run([str(installed / "palpate"), "--version"], tmp_path).stdout.splitlines()
    assert lines[0] == f"palpate {__version__}"
    assert re.fullmatch(rf"firmware native: {re.escape(__version__)}, schema [0-9a-f]{{16}}", lines[-1])
    doctor = run([str(installed / "palpate"), "doctor"], tmp_path).stdout
    assert "not the host's" not in doctor and "-> only in the source tree" in doctor


def test_a_body_is_touched(installed: Path, tmp_path: Path) -> None:
    shutil.copy(ROOT / "docs/examples/touch_a_body.py", tmp_path)
    assert "N up into the hand" in run([str(installed / "python"), "touch_a_body.py"], tmp_path).stdout
    where = run([str(installed / "python"), "-c", "import palpate; print(palpate.__file__)"], tmp_path).stdout
    assert not Path(where.strip()).is_relative_to(ROOT)


def test_a_scene_runs_on_the_board_that_is_inside(installed: Path, tmp_path: Path) -> None:
    scene = run([str(installed / "python"), "-c", "from palpate.paths import SCENES; print(SCENES)"], tmp_path).stdout.strip()
    short = ["--set=duration_s=0.3", "--set=outputs.node_times_s=[]", "--set=outputs.pictures=false"]
    run([str(installed / "palpate"), "run", f"{scene}/press.toml", "--board", "native", *short], tmp_path)
    assert (tmp_path / "out/press/summary.json").exists()
    refused = subprocess.run(
        [str(installed / "palpate"), "run", f"{scene}/press.toml", "--board", "mps2_an386", *short],
        cwd=tmp_path, env=environment(), capture_output=True, text=True,
    )
    assert refused.returncode == 1 and "it needs the source tree" in refused.stderr.splitlines()[-1]


def test_what_needs_the_source_tree_says_so(installed: Path, tmp_path: Path) -> None:
    refused = subprocess.run(
        [str(installed / "palpate"), "test"], cwd=tmp_path, env=environment(), capture_output=True, text=True
    )
    assert (refused.returncode, refused.stderr) == (2, "palpate test: only in the source tree: ./run test\n")


def test_a_board_process_is_reached(installed: Path, tmp_path: Path) -> None:
    shutil.copy(ROOT / "docs/examples/connect_to_a_board.py", tmp_path)
    assert "native, firmware" in run([str(installed / "python"), "connect_to_a_board.py"], tmp_path).stdout
