"""`palpate run` and `simulate` on odd scenes: they work, or end with exit code 2 and one line that says why."""

import json

import numpy as np
import pytest
from loop_scene import BODY, FREE, SLIP, command_line, run, scene

TINY = "[body]\nnodes = [2, 2, 2]\norigin_m = [-0.005, -0.005, -0.03]\nfixed_faces = [\"z-\"]\n"


def path(*points: tuple[float, float, float, float]) -> str:
    lines = (f"  {{ time_s = {t}, position_m = [{x}, {y}, {z}] }},\n" for t, x, y, z in points)
    return "[path]\nwaypoints = [\n" + "".join(lines) + "]\n"


PRESS = path((0.1, 0.001, 0.002, -0.0195), (0.3, 0.001, 0.002, -0.0225))
WORKING = {
    "tiny body, smaller than the patch": {"body": TINY},
    "sphere": {"extra": "[tool]\nradius_m = 0.004"},
    "no friction": {"friction": 0.0},
    "weight": {"body": BODY + "gravity_m_s2 = [0.0, 0.0, -9.81]\n"},
    "fixed nodes under the tip": {"body": BODY + "fixed_nodes = [[2, 2, 5], [3, 2, 5], [2, 3, 5], [3, 3, 5]]\n"},
    "all of the top fixed": {"body": BODY.replace('["z-"]', '["z-", "z+"]')},
    "one fixed node": {"body": BODY.replace('fixed_faces = ["z-"]', "fixed_nodes = [[0, 0, 0]]")},
    "one tick": {"duration_s": 0.001},
    "a path that never touches": {"path": path((0.0, 0.0, 0.0, 0.02), (0.3, 0.01, 0.0, 0.02))},
    "a path that starts inside": {"path": path((0.0, 0.0, 0.0, -0.03), (0.3, 0.0, 0.0, -0.01))},
    "a path of one point": {"path": path((0.2, 0.001, 0.002, -0.021))},
    "springs along the axes": {"body": BODY + 'neighbours = "edge"\n'},
    "no damping": {"body": BODY + "damping_ratio = 0.0\n"},
    "modes of the whole body": {"extra": '[model]\nbuilder = "krylov"'},
    "modes of the whole body, at an edge": {
        "extra": '[model]\nbuilder = "krylov"\ntangent = "rest"\nshifts_Hz = [0, 20]',
        "path": path((0.1, 0.0235, 0.002, -0.0195), (0.3, 0.0235, 0.002, -0.0225)),
    },
    "models as often as can be": {"extra": "[rates]\nmodel_update_Hz = 250\nhost_delay_ticks = 0"},
}


@pytest.mark.parametrize("name", WORKING)
def test_an_odd_scene_works(tmp_path, name):
    result = run(tmp_path, scene(**{"path": PRESS, "duration_s": 0.4, **WORKING[name]}, reference=True))
    assert result.summary["ticks"] == len(result["ticks/tick"]) > 0
    for dataset, values in result.record.items():
        if values.dtype.kind == "f" and dataset not in ("reference/normal",):
            assert np.all(np.isfinite(values)), dataset
    assert result.summary["faults"] == 0
    if name == "one tick":
        assert result.summary["ticks"] == 1
    if name == "a path that never touches":
        assert result.summary["peak_force_N"] == result.summary["contact_ticks"] == 0


BAD = {
    "out of reach": ({"path": path((0.0, 0.0, 0.0, 0.0), (0.3, 0.9, 0.0, 0.0))}, "path: point 1 (0.9, 0, 0) m", "outside the arm's workspace"),
    "too stiff for its step": ({"body": BODY + "stiffness_N_m = 1e5\n"}, "step_s = 0.0001", "must be in (0, "),
    "unknown builder": ({"extra": '[model]\nbuilder = "magic"'}, 'model.builder = "magic"', '"patch"'),
    "no fixed node": ({"body": BODY.replace('fixed_faces = ["z-"]', "")}, "body.fixed_faces", "at least one node is fixed"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_scene_is_refused_on_one_line(tmp_path, name):
    change, key, allowed = BAD[name]
    done = command_line(tmp_path, "run", scene(**{"path": PRESS, "duration_s": 0.4, **change}, reference=True))
    assert done.returncode == 2
    message = done.stderr.splitlines()[-1]
    assert message.startswith("scene.toml: ") and key in message and allowed in message
    assert "Traceback" not in done.stderr and not (tmp_path / "out").exists()
    assert json.loads(done.stdout) == {"error": message}


def test_a_tip_path_from_csv_can_be_run_and_simulated(tmp_path):
    time_s = np.arange(0.0, 0.4, 0.01)
    z_m = -0.019 - 0.003 * np.sin(np.pi * time_s / 0.4)
    rows = "".join(f"{t:.3f},0.001,0.002,{z:.6f}\n" for t, z in zip(time_s, z_m, strict=True))
    (tmp_path / "tip.csv").write_text("time_s,x_m,y_m,z_m\n" + rows)
    for command in ("run", "simulate"):
        done = command_line(tmp_path, command, scene(path='[path]\ncsv = "tip.csv"\n', duration_s=0.4))
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["contact_ticks"] > 20


def test_without_friction_the_force_is_along_the_normal(tmp_path):
    result = run(tmp_path, scene(path=PRESS, duration_s=0.7, friction=0.0, reference=True))
    rest = (result["ticks/tick"] > 450) & (result["ticks/contact_mode"] != FREE)
    rest &= result["reference/contact_mode"] != FREE
    assert np.count_nonzero(rest) > 100 and set(result["ticks/contact_mode"]) == {FREE, SLIP}
    force_N, normal = result["ticks/force_N"][rest], result["reference/normal"][rest]
    along_N = np.sum(force_N * -normal, axis=1)
    across_N = np.linalg.norm(force_N + along_N[:, None] * normal, axis=1)
    assert np.all(along_N > 0.0)
    assert np.median(across_N / along_N) < 0.05


def test_with_friction_a_drag_sticks_and_slips(tmp_path):
    drag = path((0.1, -0.008, 0.002, -0.0195), (0.3, -0.008, 0.002, -0.023), (0.8, 0.006, 0.002, -0.023))
    summary = run(tmp_path, scene(path=drag, duration_s=0.8, friction=1.0)).summary
    assert summary["stick_to_slip"] >= 1 and summary["peak_force_N"] > 1.0
