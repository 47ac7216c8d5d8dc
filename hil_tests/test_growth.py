"""A fault of the link does not raise the force, whoever builds the models (docs/safety.md, "Growth"): a pressing tip loses its cable.

The rule is that of the fault matrix, which holds `hybrid` to it on a longer path with all faults: no more than FORCE_SLACK_N above the
same tick without the fault, or above what the full body answers to a tip that has gone the same way, whichever is more.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from palpate import _core, experiment
from palpate.faults.rules import FORCE_SLACK_N
from palpate.scene import load_scene

PRESS = Path(__file__).parents[1] / "scenes/press.toml"
# In the air before it presses, at once after it has begun to touch, half way down, and so late that it comes back at the deepest place.
OUT_s = {"before": (0.25, 0.5), "touching": (0.42, 0.62), "pressing": (0.5, 0.7), "deep": (0.6, 0.8)}
FORCE_STEP_N = 0.5
# Of single precision, and of the trace's.
ROUNDING_N = 1e-4

Values = dict[str, NDArray[Any]]


def run(builder: str, out_s: tuple[float, float] | None = None, **keys: Any) -> Values:
    if out_s is not None:
        keys["link.faults.unplugged"] = [{"from_s": out_s[0], "to_s": out_s[1]}]
    scene = load_scene(PRESS, {"model.builder": builder, **keys}, "native")
    done = experiment.run_firmware(_core, scene, scene.to_dict(), scene.require_path().position_m[0], experiment.no_progress)
    return {**done.values, **experiment.follow(_core, scene.to_dict(), done.values, lambda done, total: True)}


def size_N(force_N: NDArray[Any]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(force_N.astype(np.float64), axis=1))


def above_N(faulty: Values, good: Values) -> float:
    """The most that the force is above what the rule has without its slack."""
    np.testing.assert_array_equal(faulty["ticks/tick"], good["ticks/tick"])
    allowed_N = np.maximum(size_N(good["ticks/force_N"]), size_N(faulty["reference/force_N"]))
    return float((size_N(faulty["ticks/force_N"]) - allowed_N).max())


@pytest.fixture(scope="module", params=["patch", "krylov", "hybrid"])
def builder(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def good(builder: str) -> Values:
    return run(builder)


@pytest.mark.parametrize("when", OUT_s)
def test_an_unplugged_cable_raises_no_force(builder: str, good: Values, when: str) -> None:
    faulty = run(builder, OUT_s[when])
    assert above_N(faulty, good) <= FORCE_SLACK_N
    change_N = np.linalg.norm(np.diff(faulty["ticks/force_N"].astype(np.float64), axis=0), axis=1)
    assert change_N.max() <= FORCE_STEP_N + ROUNDING_N
    # It is back: the last third of the path presses as without the fault.
    late = faulty["ticks/tick"] > 1000
    assert size_N(faulty["ticks/force_N"])[late].max() > 0.5 * size_N(good["ticks/force_N"])[late].max()


def test_without_the_rule_a_patch_raises_it(tmp_path: Path) -> None:
    """What the rule is there for; and a run without faults never comes near it."""
    free = {"model.growth_ticks": 65535}
    good = run("patch")
    assert above_N(run("patch", OUT_s["touching"], **free), run("patch", **free)) > FORCE_SLACK_N
    np.testing.assert_array_equal(run("patch", **free)["ticks/force_N"], good["ticks/force_N"])
