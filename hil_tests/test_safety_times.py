"""Times of the supervisor that a scene asks for: when a force is gone, when outputs go off, how long a host may be away."""

import subprocess

import numpy as np
import pytest
from board_peer import EXIT_USAGE, NATIVE_IMAGE, qemu_command
from loop_scene import FREE, MODE_FAULT, MODE_RENDER, Run, run, scene

from palpate import Live
from palpate.scene import SceneError, load_scene

MODE_SUSPENDED = 6
LINK_LOST = 1 << 9
# Pressed 3 mm from 0.3 s on, and from 0.5 s to the end the cable is out, or the host is heard and none of its models counts.
PRESS = """
[path]
waypoints = [
  { time_s = 0.1, position_m = [-0.004, 0.002, -0.0195] },
  { time_s = 0.3, position_m = [-0.004, 0.002, -0.023] },
]
"""
UNPLUGGED_TICK = 500
CUT = f"[link.faults]\nunplugged = [{{ from_s = {1e-3 * UNPLUGGED_TICK} }}]\n"
NO_MODELS = f"[link.faults]\nother_schema = [{{ from_s = {1e-3 * UNPLUGGED_TICK} }}]\n"
# Ticks; those of a scene (a new model comes every 33 ticks and catches up: none gets so old), and what firmware/core/supervisor.hpp has without one (a model is valid for 200).
HORIZON, FADE, DAMP, RESUME = 80, 40, 100, 1000
USUAL_HORIZON, USUAL_FADE = 200, 200
DAMPING_N_s_m = 2.0
SAFETY = (
    f"[safety]\nhorizon_s = {1e-3 * HORIZON}\nfade_s = {1e-3 * FADE}\ndamp_s = {1e-3 * DAMP}\n"
    f"resume_within_s = {1e-3 * RESUME}\n"
)
SILENT = 300
# What had passed the cable arrives, a few ticks behind it; and the last frame before may be 100 ticks old (docs/safety.md).
SLACK = 10
EARLY = 100
# Of the emulated board: so long that outputs are off.
SHORT_s = 0.95


def text(safety: str, duration_s: float, board: str = "native", fault: str = CUT) -> str:
    return scene(fault + safety, path=PRESS, duration_s=duration_s, board=board)


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("usual"), text("", 1.6))


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("changed"), text(SAFETY, 1.6))


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("heard"), text(SAFETY, 1.9, fault=NO_MODELS))


def assert_fades(done: Run, horizon: int, fade: int) -> None:
    """By the model's age alone; then there is the damper, of a tip that moves no faster than before."""
    rows = (done["ticks/tick"] > UNPLUGGED_TICK) & (done["ticks/tick"] < UNPLUGGED_TICK + SILENT - EARLY)
    rows &= (done["ticks/contact_mode"] != FREE) & (done["ticks/mode"] == MODE_RENDER)
    age, force_N = done["ticks/model_age_ticks"], done.force_N
    fresh, fading = rows & (age <= horizon), rows & (age > horizon) & (age < horizon + fade)
    assert np.any(fresh) and np.all(force_N[fresh] > 0.3)
    if np.any(fading):
        assert np.all(force_N[fading] > 0.0) and force_N[fading][-1] < force_N[fresh].min()
    faded = rows & (age >= horizon + fade)
    assert np.any(faded) == (done["ticks/tick"][rows][-1] > UNPLUGGED_TICK + horizon + fade)
    if np.any(faded):
        assert force_N[faded].max() <= DAMPING_N_s_m * speed_m_s(done)[rows].max()


def speed_m_s(done: Run) -> np.ndarray:
    way_m = np.diff(done["ticks/true_tip_m"], axis=0, prepend=done["ticks/true_tip_m"][:1])
    return np.linalg.norm(way_m, axis=1) * 1e3


def test_the_force_is_gone_by_the_scenes_times(usual, changed):
    assert_fades(usual, USUAL_HORIZON, USUAL_FADE)
    assert_fades(changed, HORIZON, FADE)
    # At one tick the one has none any more but the damper's, of the same model that the other renders in full.
    row = changed.row_of(UNPLUGGED_TICK + HORIZON + FADE)
    assert changed["ticks/model_sequence"][row] == usual["ticks/model_sequence"][row]
    assert changed.force_N[row] < 0.1 and usual.force_N[row] > 0.3
    before = usual.row_of(UNPLUGGED_TICK - SLACK)
    assert np.array_equal(changed["ticks/force_N"][:before], usual["ticks/force_N"][:before])


def off_and_latched(done: Run) -> tuple[int, int]:
    """The first ticks of both; outputs go off when the newest model is as old as the scene says."""
    suspended = np.flatnonzero(done["ticks/mode"] == MODE_SUSPENDED)
    assert done["ticks/model_age_ticks"][suspended[0]] == HORIZON + FADE + DAMP
    assert not np.any(done["ticks/enabled"][suspended[0]:])
    assert done["ticks/faults"][-1] == LINK_LOST
    (latched, *_) = done["ticks/tick"][done["ticks/mode"] == MODE_FAULT].astype(int)
    return int(done["ticks/tick"][suspended[0]]), latched


def test_outputs_go_off_and_stay_so_by_the_scenes_times(usual, changed):
    _, latched = off_and_latched(changed)
    # When the host was heard for the last time.
    assert -EARLY <= latched - (UNPLUGGED_TICK + RESUME) <= SLACK
    assert usual["ticks/mode"][-1] == MODE_RENDER and not usual["ticks/faults"][-1]


def test_a_host_whose_models_do_not_count_keeps_outputs_on_no_longer(changed, heard):
    off, latched = off_and_latched(heard)
    assert off == off_and_latched(changed)[0]
    assert_fades(heard, HORIZON, FADE)
    # Suspended for so long without a model, though the host is heard.
    assert latched == off + RESUME + 1
    assert heard.summary["frames_lost"] == 0


def test_the_emulated_board_takes_the_same_times(changed, tmp_path):
    emulated = run(tmp_path, text(SAFETY, SHORT_s, "mps2_an386"))
    assert emulated["ticks/mode"][-1] == MODE_SUSPENDED
    rows = len(emulated["ticks/tick"]) - 1  # the last tick is told to end
    for name in ("ticks/mode", "ticks/force_N"):
        assert np.array_equal(emulated[name][:rows], changed[name][:rows]), name


def test_an_empty_time_is_the_boards_own(usual, tmp_path):
    gone_s = 1e-3 * (UNPLUGGED_TICK + USUAL_HORIZON + USUAL_FADE + DAMP + SLACK)
    partly = run(tmp_path, text(f"[safety]\ndamp_s = {1e-3 * DAMP}", gone_s))
    assert partly["ticks/mode"][-1] == MODE_SUSPENDED
    assert_fades(partly, USUAL_HORIZON, USUAL_FADE)


@pytest.mark.parametrize("command", [
    [NATIVE_IMAGE, "--lockstep", "act.fifo", "sen.fifo", "times=50:1:100:1000"],
    qemu_command("-serial", "stdio", program_arguments=",arg=times=50:1:100:1000"),
], ids=["native", "mps2"])
def test_a_board_refuses_times_out_of_range(command, tmp_path):
    done = subprocess.run(
        command, cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)
    assert done.returncode == EXIT_USAGE and 'times of the supervisor out of range: ' in done.stdout
    assert "times=50:1:100:1000" in done.stdout


def test_a_board_that_runs_by_itself_has_its_own(tmp_path):
    (tmp_path / "scene.toml").write_text(text(SAFETY, 1.0))
    with pytest.raises(SceneError, match="safety: given, but the board at serial:/nowhere has times of its own"):
        Live(load_scene(tmp_path / "scene.toml"), "serial:/nowhere")
