"""What the builders of local models make of a body that gives way as a whole: on the native board, whose bits are the
emulated one's."""

import pathlib

import pytest
from loop_scene import no_progress

from palpate import _core, experiment
from palpate.scene import load_scene

STICK = pathlib.Path(__file__).resolve().parent.parent / "scenes/stick.toml"
# docs/decisions/whole_body.md: 0.9 % with krylov, 32 % with the patch. Stated before it was measured on this scene: the whole
# body's linear model at each frame's tangent misses what changes within a frame of 33 ms, some percent of the force.
KRYLOV_PERCENT = 3.0
PATCH_AT_LEAST_PERCENT = 10.0


def rms_error_percent(folder: pathlib.Path, builder: str) -> float:
    scene = load_scene(STICK, {"model.builder": builder, "outputs.pictures": False}).with_board("native")
    summary = experiment.run(_core, scene, "run", folder, no_progress).summary
    assert summary["faults"] == summary["models_refused"] == summary["background_overruns"] == 0
    return float(summary["rms_force_error_percent"])


@pytest.mark.slow
def test_the_whole_body_follows_where_the_patch_is_too_stiff(tmp_path: pathlib.Path) -> None:
    assert rms_error_percent(tmp_path / "krylov", "krylov") <= KRYLOV_PERCENT
    assert rms_error_percent(tmp_path / "patch", "patch") >= PATCH_AT_LEAST_PERCENT
