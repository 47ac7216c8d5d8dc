"""From a scene to the files, with a made-up core and board."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fake_core
import pytest

from palpate import experiment, hil, record, record_layout
from palpate.experiment import ProgressBar
from palpate.scene import Scene, SceneError, load_scene

SCENE = """
title = "Test"
duration_s = 0.4
[body]
nodes = [8, 8, 8]
fixed_faces = ["z-"]
[path]
waypoints = [{ time_s = 0.0, position_m = [0.0, 0.0, 0.0] }]
[outputs]
node_times_s = [0.1]
"""
SHEET = """
duration_s = 0.1
[body]
dimension = 2
nodes = [12, 12]
fixed_faces = ["z-"]
"""


@contextmanager
def silent(label: str, unit: str) -> Iterator[ProgressBar]:
    yield lambda done, total: True


@pytest.fixture(autouse=True)
def fake_board(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(hil.BOARDS, "mps2_an386", fake_core.board())


def scene_from(folder: Path, text: str) -> Scene:
    (folder / "scene.toml").write_text(text)
    return load_scene(folder / "scene.toml")


def test_run_writes_everything(tmp_path: Path) -> None:
    scene = scene_from(tmp_path, SCENE)
    outcome = experiment.run(fake_core, scene, "run", tmp_path / "out", silent)
    names = {"summary.json", "record.h5", "tip.csv", "forces.png", "body.png", "console.txt"}
    assert set(outcome.files) == names
    assert {file.name for file in (tmp_path / "out").iterdir()} == names
    assert json.loads((tmp_path / "out/summary.json").read_text()) == outcome.summary
    values, text, attributes = record.read_record(tmp_path / "out/record.h5", record_layout.RUN)
    assert text == SCENE
    assert attributes["record_hash"] == outcome.summary["record_hash"]
    assert attributes["record_hash"] == record.record_hash(record_layout.RUN, values)
    assert set(record_layout.RUN_COUNTERS) <= set(attributes)
    assert outcome.summary["rms_force_error_percent"] > 0


def test_run_without_reference_pictures_and_csv(tmp_path: Path) -> None:
    text = SCENE + "csv = false\npictures = false\n[reference]\nenabled = false\n"
    (tmp_path / "out").mkdir()
    for stale in ("forces.png", "tip.csv", "mine.txt"):
        (tmp_path / "out" / stale).write_text("old")
    outcome = experiment.run(fake_core, scene_from(tmp_path, text), "run", tmp_path / "out", silent)
    assert set(outcome.files) == {"summary.json", "record.h5", "console.txt"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == {*outcome.files, "mine.txt"}
    assert outcome.summary["rms_force_error_percent"] is None


def test_simulate_writes_everything(tmp_path: Path) -> None:
    outcome = experiment.simulate(fake_core, scene_from(tmp_path, SCENE), tmp_path / "out", silent)
    assert set(outcome.files) == {
        "summary.json",
        "record.h5",
        "tip.csv",
        "nodes.csv",
        "forces.png",
        "body.png",
    }
    assert all(file.stat().st_size > 0 for file in outcome.files.values())


def test_simulate_a_sheet(tmp_path: Path) -> None:
    outcome = experiment.simulate(fake_core, scene_from(tmp_path, SHEET), tmp_path / "out", silent)
    assert set(outcome.files) == {"summary.json", "record.h5", "body.png"}
    assert outcome.summary["nodes"] == 144


class Refusing:
    """A core that does not like the scene."""

    @staticmethod
    def simulate(scene: dict[str, Any], progress: object) -> dict[str, Any]:
        raise ValueError("step_s = 0.001: must be in\n(0, 0.00025] s")


def test_what_the_core_refuses_is_bad_input_of_the_scene(tmp_path: Path) -> None:
    scene = scene_from(tmp_path, SCENE)
    with pytest.raises(SceneError) as caught:
        experiment.simulate(Refusing, scene, tmp_path / "out", silent)
    assert str(caught.value) == f"{scene.file}: integrator.step_s = 0.001: must be in (0, 0.00025] s"
    assert not (tmp_path / "out").exists()
