"""The Python interface: bodies, models, sessions, the device and experiments do what the command line and physics say."""

import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import ROOT, palpate as palpate_command

import palpate
from palpate import _core
from palpate.body import State

SCENE = ROOT / "scenes/press.toml"
SHORT: dict[str, Any] = {
    "duration_s": 0.6,
    "outputs.pictures": False,
    "outputs.csv": False,
    "outputs.node_times_s": [],
    "reference.enabled": False,
}
# A settled body: its slowest motion has died out to 1e-9 of what it was.
SETTLED_S = 3.0


def cube(**more: Any) -> palpate.Body:
    """4 x 4 x 4 nodes on a fixed bottom."""
    return palpate.Body(nodes=(4, 4, 4), fixed_faces=["z-"], **more)


def test_every_public_name_is_there_and_documented() -> None:
    for name in palpate.__all__:
        value = getattr(palpate, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(value), name
        if inspect.isclass(value) and value.__module__ in ("palpate.body", "palpate.plant", "palpate.session"):
            for member, item in vars(value).items():
                if not member.startswith("_") and (callable(item) or isinstance(item, property)):
                    assert inspect.getdoc(item), f"{name}.{member}"
    with pytest.raises(AttributeError, match="no attribute 'Bodie'"):
        getattr(palpate, "Bodie")


def test_shapes() -> None:
    body = cube()
    assert body.node_count == 64
    assert body.rest_m.shape == body.state.position_m.shape == body.state.velocity_m_s.shape == (64, 3)
    assert body.mass_kg.shape == (64,)
    np.testing.assert_array_equal(body.fixed_nodes, np.arange(16))
    assert body.springs.shape == (len(body.spring_stiffness_N_m), 2) == (len(body.spring_damping_N_s_m), 2)
    assert body.triangles.shape == (6 * 9 * 2, 3)
    np.testing.assert_allclose(body.rest_m[body.node(1, 2, 3)], [0.01, 0.02, 0.03])


def test_forces_are_none_at_rest_and_add_up_to_none() -> None:
    body = cube()
    np.testing.assert_allclose(body.forces_N(), 0.0, atol=1e-14)
    body.step(0.01, {body.node(1, 1, 3): (0.1, 0.2, -0.3)})
    forces_N = body.forces_N()
    assert np.abs(forces_N).max() > 0.01
    np.testing.assert_allclose(forces_N.sum(axis=0), 0.0, atol=1e-12)  # every spring pulls at both its ends


def test_a_node_gives_way_as_the_linear_body_says() -> None:
    body = cube()
    node = body.node(1, 1, 3)
    model = palpate.build_model(body, at=body.rest_m[node])
    force_N = np.array([1e-4, 0.0, -2e-4])  # so small that the body is linear to 1e-3
    body.step(SETTLED_S, {node: force_N})
    moved_m = body.state.position_m[node] - body.rest_m[node]
    expected_m = model.body_compliance_m_N(0.0)[0].real @ force_N
    np.testing.assert_allclose(moved_m, expected_m, atol=1e-3 * np.linalg.norm(expected_m))


def test_touch_is_what_simulate_does() -> None:
    result = palpate.simulate(SCENE, SHORT)
    body = palpate.Body.from_scene(SCENE)
    path = result.scene.require_path()
    tips_m = result["tip/position_m"]
    body.touch(path.position_m[0])  # where the path begins, in the air
    touches = [body.touch(tip_m) for tip_m in tips_m]
    np.testing.assert_allclose([t.force_N for t in touches], result["tip/force_N"], atol=1e-9)
    assert [t.mode for t in touches] == [("free", "stick", "slip")[mode] for mode in result["tip/contact_mode"]]
    assert np.abs(result["tip/force_N"]).max() > 0.1


def test_states_are_copies_that_can_be_set() -> None:
    body = cube()
    start = body.state
    body.step(0.01, {63: (0.1, 0.0, 0.0)})
    assert not np.array_equal(body.state.position_m, start.position_m)
    middle = body.state
    first = body.step(0.01)
    body.state = middle
    np.testing.assert_array_equal(body.step(0.01).position_m, first.position_m)
    assert body.time_s == pytest.approx(0.03)


def test_a_driven_node_goes_where_it_is_sent() -> None:
    body = cube()
    body.set_drives([palpate.Drive(63, (0.002, 0.0, 0.001), start_s=0.0, reach_s=0.05, release_s=1.0)])
    moved_m = body.step(0.1).position_m[63] - body.rest_m[63]
    np.testing.assert_allclose(moved_m, [0.002, 0.0, 0.001], atol=1e-12)
    with pytest.raises(ValueError, match="not while nodes are driven"):
        body.step(forces_N={5: (0, 0, 1)})
    body.set_drives([])
    assert np.linalg.norm(body.step(1.0).position_m[63] - body.rest_m[63]) < 1e-4


@pytest.mark.parametrize("builder", ["patch", "condensed", "krylov"])
def test_a_models_error_is_that_of_the_comparison(builder: Any) -> None:
    body = palpate.Body(nodes=(6, 6, 6), fixed_faces=["z-"])
    node = body.node(2, 2, 5)
    model = palpate.build_model(body, at=body.rest_m[node], builder=builder)
    scene = body.scene.with_model(builder=builder).to_dict()
    compared = _core.compliance_errors(scene, node, [scene["model"]], 0.0, lambda done, total: True)
    chosen = [0, 40, 80, 120]
    frequency_Hz = compared["frequency_Hz"][chosen]
    np.testing.assert_allclose(model.compliance_error(frequency_Hz), compared["models"][0]["at_node"][chosen], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(model.damping_bound(frequency_Hz), compared["models"][0]["damping_bound"][chosen])
    assert model.modes == compared["models"][0]["modes"]


def test_packed_models_are_as_the_protocol_says() -> None:
    body = palpate.Body(nodes=(6, 6, 6), fixed_faces=["z-"])
    model = palpate.build_model(body, at=(0.025, 0.025, 0.05), builder="hybrid")
    basis = model.packed_basis
    assert int.from_bytes(basis[0:8], "little") == _core.SCHEMA_HASH
    assert int.from_bytes(basis[8:12], "little") == len(basis)
    assert int.from_bytes(basis[12:14], "little") == model.modes
    assert basis[14] == len(model.nodes) and basis[15] == model.surface_nodes and basis[18] == model.springs > 0
    assert 0 < len(model.packed_state) < 1500
    assert (np.diff(model.frequencies_Hz) >= 0.0).all() and len(model.lambda_rad2_s2) == len(model.damping_rad_s) == model.modes
    assert repr(model).startswith(f"LocalModel({model.modes} modes, ")


def test_a_model_keeps_what_it_was_made_of() -> None:
    body = cube()
    model = palpate.build_model(body, at=(0.015, 0.015, 0.03))
    before = model.compliance_error([1.0])
    body.step(0.05, {60: (0.5, 0.5, -1.0)})
    pressed = palpate.build_model(body, at=(0.015, 0.015, 0.03))
    del body
    np.testing.assert_array_equal(model.compliance_error([1.0]), before)
    assert not np.array_equal(pressed.lambda_rad2_s2, model.lambda_rad2_s2)


def test_a_session_follows_the_tip() -> None:
    simulated = palpate.simulate(SCENE, SHORT)
    session = palpate.Session.from_scene(SCENE)
    tips_m = simulated["tip/position_m"]
    updates = []
    for begin in range(0, 600, 4):
        session.take(begin, tips_m[begin : begin + 4])
        if session.due(begin + 3) and (update := session.update()) is not None:
            updates.append(update)
    assert len(updates) > 5
    assert [update.sequence for update in updates] == list(range(1, len(updates) + 1))
    assert all(update.modes > 0 and update.basis_bytes > 0 and update.interpolated_ticks == 0 for update in updates)
    assert session.contact_mode in ("stick", "slip")
    # The session has the tip in single precision, 1e-9 m, and begins a tick later; the body is 1e3 N/m stiff at most.
    last_N = simulated["tip/force_N"][session.tick]
    np.testing.assert_allclose(np.linalg.norm(session.force_N), np.linalg.norm(last_N), rtol=0.05)


def test_the_device_follows_its_hand() -> None:
    start_m, end_m = (0.0, 0.0, 0.02), (0.01, 0.0, 0.0)
    path = [(0.0, start_m), (0.2, end_m)]
    plant = palpate.Plant(path)
    np.testing.assert_allclose(plant.tip_m, start_m, atol=1e-9)
    before = plant.encoder_counts
    for _ in range(500):
        plant.advance([0.0, 0.0, 0.0])
    assert plant.time_s == pytest.approx(0.5)
    np.testing.assert_allclose(plant.intended_m, end_m, atol=1e-12)
    np.testing.assert_allclose(plant.tip_m, end_m, atol=2e-3)  # the hand gives way under the arm's weight
    assert np.abs(plant.encoder_counts - before).max() > 10
    scripted = palpate.Plant(path, hand={"kind": "scripted"})
    scripted.advance([0.0, 0.0, 0.0], duration_s=0.5)
    np.testing.assert_allclose(scripted.tip_m, end_m, atol=1e-9)


def test_a_line_takes_its_time() -> None:
    line = palpate.Uart(1_000_000)
    assert line.bytes_per_tick == 100.0
    assert line.submit(bytes(range(250)), 0)
    arrived = [line.deliver(tick) for tick in range(4)]
    assert [len(piece) for piece in arrived] == [0, 100, 100, 50]
    assert b"".join(arrived) == bytes(range(250))
    assert line.backlog_bytes(4) == 0 and line.counters["bytes_delivered"] == 250
    small = palpate.Uart(9600, queue_bytes=10)
    assert not small.submit(bytes(11), 0) and small.counters["submissions_dropped"] == 1


def test_an_experiment_is_that_of_the_command_line(tmp_path: Path) -> None:
    result = palpate.run(SCENE, SHORT, board="native")
    options = [f"--set={key}={str(value).lower()}" for key, value in SHORT.items()]
    done = palpate_command("run", str(SCENE), "--board", "native", "--out", str(tmp_path), *options)
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "record.h5") as record:
        assert record.attrs["record_hash"] == result.summary["record_hash"]
        np.testing.assert_array_equal(record["ticks/force_N"][:], result["ticks/force_N"])
    assert result.files == {} and result.summary["ticks"] == 600
    with pytest.raises(KeyError, match="ticks/forces: must be one of ticks/tick, "):
        result["ticks/forces"]
    kept = palpate.simulate(SCENE, SHORT, out=tmp_path / "kept")
    assert set(kept.files) == {"record.h5", "summary.json"}


def test_a_sweep_runs_all_and_checks_first() -> None:
    results = palpate.sweep(SCENE, "contact.friction", [0.0, 1.0], SHORT, experiment=palpate.simulate)
    assert [result.scene.sections.contact.friction for result in results] == [0.0, 1.0]
    ran: list[Any] = []

    def counted(scene: palpate.Scene) -> palpate.Result:
        ran.append(scene)
        return results[0]

    with pytest.raises(palpate.SceneError, match="contact.friction = -1"):
        palpate.sweep(SCENE, "contact.friction", [0.0, -1.0], SHORT, experiment=counted)
    assert ran == []


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda body: palpate.Body(nodes=(8, 8, 1)), r"^Body: body\.nodes = \[8, 8, 1\]: must be .* in \[2, 64\]"),
        (lambda body: palpate.Body(nodes=(8, 8, 8), stiff=1), r"body\.stiff = 1: unknown key"),
        (lambda body: palpate.Body(palpate.load_scene(SCENE), mass_kg=1), "not together with a scene"),
        (lambda body: palpate.Body.from_scene("nowhere.toml"), r"^nowhere\.toml: no such file"),
        (lambda body: body.step(-1.0), r"duration_s = -1: must be in \[0, "),
        (lambda body: body.step(forces_N={64: (0, 0, 1)}), r"node = 64: must be in \[0, 63\]"),
        (lambda body: body.step(forces_N={3: (0, 1)}), r"forces_N\[3\] = \(0, 1\): must be three finite numbers"),
        (lambda body: body.node(4, 0, 0), r"i = 4: must be in \[0, 3\]"),
        (lambda body: body.touch((0, 0, float("nan"))), "tip_m = .*: must be three finite numbers"),
        (lambda body: palpate.Body(nodes=(4, 4), dimension=2, fixed_faces=["z-"]).touch((0, 0, 0)), "dimension = 2: must be 3"),
        (lambda body: setattr(body, "state", State(np.zeros((3, 3)), np.zeros((3, 3)))), "must have 64 rows"),
        (lambda body: setattr(body, "state", State(np.zeros((64, 2)), np.zeros((64, 3)))), r"position_m: has the shape \(64, 2\)"),
        (lambda body: body.set_drives([palpate.Drive(0, (0, 0, 0), 0.0, 1.0, 2.0)]), "fixed"),
        (lambda body: palpate.build_model(body, at=(0, 0, 0), near_nodes=99), r"model\.near_nodes = 99: must be"),
        (lambda body: palpate.build_model(body, at=(0, 0, 0), builder="best"), r"model\.builder = .best.: must be"),
        (lambda body: palpate.build_model(body, at=(0, 0, 0.03)).compliance_m_N(-1.0), r"frequency_Hz: must be numbers in \[0, inf\)"),
        (lambda body: palpate.Plant([(0.0, (0.9, 0.0, 0.0))]), "outside the arm's workspace"),
        (lambda body: palpate.Plant([(0.0, (0, 0, 0))], hand={"mass_kg": -1.0}), r"hand\.mass_kg = -1"),
        (lambda body: palpate.Uart(5), r"baud = 5: must be in \[1200, 20000000\]"),
        (lambda body: palpate.Uart(9600, 0), "queue_bytes = 0: must be at least 1"),
        (lambda body: palpate.run(palpate.load_scene(SCENE), SHORT), "only with a scene's file"),
    ],
)
def test_errors_name_thing_place_and_range(wrong: Callable[[palpate.Body], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        wrong(cube())


def test_stubs_and_interface_hold_under_mypy() -> None:
    modules = ["__init__", "body", "local_model", "link", "plant", "session", "experiments", "board_link", "live", "history", "stress"]
    files = [str(ROOT / f"host/python/palpate/{module}.py") for module in modules]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "--cache-dir=/dev/null", *files],
        cwd=ROOT / "host/python", capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout


def test_the_stub_names_what_the_core_has() -> None:
    stub = (ROOT / "host/python/palpate/_core.pyi").read_text("utf-8")
    named = set(re.findall(r"^(?:def |class )(\w+)", stub, re.MULTILINE)) | set(re.findall(r"^([A-Z_]+): ", stub, re.MULTILINE))
    assert named == {name for name in dir(_core) if not name.startswith("__")}
    for name in ("Body", "LocalModel", "Session", "Plant", "Uart", "HostEndpoint"):
        of_class = re.search(rf"^class {name}:\n(.*?)(?=^\w|\Z)", stub, re.MULTILINE | re.DOTALL)
        assert of_class is not None
        members = set(re.findall(r"def (\w+)", of_class[1])) - {"__init__"}
        assert members == {member for member in vars(getattr(_core, name)) if not member.startswith("__")}
