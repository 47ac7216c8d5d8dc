"""Modes of patches that are kept between runs: the results are the same bits whatever is there."""

import pytest
from loop_scene import command_line, no_progress, run, scene

from palpate import _core, experiment
from palpate.scene import load_scene

KRYLOV = '[model]\nbuilder = "krylov"\ntangent = "rest"\n'


def text(extra: str = "") -> str:
    return scene(KRYLOV + extra, board="native")


@pytest.fixture
def bases(tmp_path, monkeypatch):
    monkeypatch.setenv("PALPATE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache/bases"


def test_results_do_not_depend_on_what_is_kept(tmp_path, bases):
    without = run(tmp_path / "without", text("basis_cache_MB = 0\n"))
    assert not bases.exists()
    # The drag goes from patch to patch.
    empty = run(tmp_path / "empty", text())
    kept = sorted(bases.iterdir())
    assert len(kept) > 1 and {file.suffix for file in kept} == {".basis"}
    full = run(tmp_path / "full", text())
    assert sorted(bases.iterdir()) == kept
    assert without.summary["model_updates"] > 10
    hashes = {r.summary["record_hash"] for r in (without, empty, full)}
    assert len(hashes) == 1


def test_damaged_files_are_named_and_not_used(tmp_path, bases):
    good = run(tmp_path / "good", text())
    intact = {file: file.read_bytes() for file in bases.iterdir()}
    damaged = {}
    for file, content in intact.items():
        data = bytearray(content)
        data[len(data) // 2] ^= 1
        damaged[file] = bytes(data)
        file.write_bytes(data)
    (tmp_path / "scene.toml").write_text(text())
    outcome = experiment.run(_core, load_scene(tmp_path / "scene.toml"), "run", tmp_path / "out", no_progress)
    assert outcome.summary["record_hash"] == good.summary["record_hash"]
    (warning,) = outcome.warnings
    assert str(bases) in warning and "is damaged: its CRC does not match" in warning
    # What has been named has been put in order. Others, that are prepared for when there is time, the run may not have read.
    (named,) = (file for file in intact if str(file) in warning)
    assert named.read_bytes() == intact[named]
    for file in intact:
        assert file.read_bytes() in (intact[file], damaged[file]), file
    # With all of them in order there is nothing to name.
    for file, content in intact.items():
        file.write_bytes(content)
    done = command_line(tmp_path, "run", text())
    assert done.returncode == 0 and "damaged" not in done.stderr


def test_a_place_that_cannot_be_used_is_a_warning(tmp_path, monkeypatch):
    in_the_way = tmp_path / "file"
    in_the_way.write_text("")
    monkeypatch.setenv("PALPATE_CACHE", str(in_the_way))
    done = command_line(tmp_path, "run", text())
    assert done.returncode == 0
    assert f"palpate run: warning: {in_the_way}/bases cannot be made: Not a directory" in done.stderr


def test_a_basis_comes_a_latency_after_it_is_wanted(tmp_path, bases):
    # The hand is over the body from the first tick on.
    early, late = (run(tmp_path / str(ticks), text(f"basis_latency_ticks = {ticks}\n")) for ticks in (0, 250))
    assert early["updates/tick"][0] < 50
    assert 250 <= late["updates/tick"][0] < 350
    assert early.summary["basis_waits"] == 0
    assert late.summary["basis_waits"] >= 7
