"""What goes wrong in the closed loop is counted and told, and the loop goes on."""

import json

import matplotlib.image
import numpy as np
import pytest
from loop_scene import FREE, MODE_FAULT, STATUS_UNKNOWN, Run, command_line, run, scene

# In scene(): two commands of arming go down first, then the models, from 1 on: of each its basis in 12 pieces, and its
# state.
PIECES = 12


def frame_of_state(model: int) -> int:
    return 1 + model * (PIECES + 1)


LOST_MODEL = 8
LOST_FRAME = frame_of_state(LOST_MODEL)
# The tip is held by the hand at 1.1 N; without a new model for 67 ms the force drifted by 0.15 N.
LARGEST_DRIFT_N = 0.3
# Between two samples 1 ms apart the path is nearly straight: 5 ticks off 0.1 m/s changing by 10 m/s^2 are 0.03 mm, as much
# as one count of the encoders.
LARGEST_INTERPOLATION_ERROR_M = 1e-4
STATUS_TOO_OLD = 35
FADE_TICKS = 200  # firmware/core/supervisor.hpp
DAMPING_N_S_M = 2.0  # likewise
# Of that damper, at a velocity that is wrong by one encoder count, 30 um, in a tick.
COUNT_N = 2.0 * 0.03


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("good"), scene())


@pytest.fixture(scope="module")
def emergency(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("emergency"), scene("[board.faults]\nemergency_stop_ticks = [500]"))


def row(run_: Run, sequence: int) -> int:
    """The row of /updates of a model."""
    (found,) = np.flatnonzero(run_["updates/sequence"] == sequence)
    return int(found)


def test_a_good_run_has_nothing_to_complain(good):
    summary = good.summary
    assert (summary["ticks"], summary["frames_lost"], summary["models_refused"], summary["faults"]) == (800, 0, 0, 0)
    assert (summary["missed_deadlines"], summary["background_overruns"], summary["interpolated_ticks"]) == (0, 0, 0)
    # All but the last model, which may come too late to be taken.
    assert np.all(good["updates/status"][:-1] == 0)
    assert summary["model_updates"] == np.count_nonzero(good["updates/swap_tick"])
    # A piece has 1,024 bytes and at most 50 of header and framing: the numbers of the frames are what they are taken for.
    assert np.all(np.ceil(good["updates/basis_bytes"] / 1074) == PIECES)


@pytest.mark.parametrize("overlong", [[400], [300, 301, 500]])
def test_an_overlong_tick_is_a_missed_deadline_and_the_run_goes_on(tmp_path, good, overlong):
    late = run(tmp_path, scene(f"[board.faults]\noverlong_ticks = {overlong}"))
    tick, missed = late["ticks/tick"].astype(int), late["ticks/missed_deadlines"].astype(int)
    # 2.5 ticks more: two deadlines are missed, and the tick between them does not happen. One that would have been overlong
    # itself, but fell out, burns nothing.
    happened = [t for t in overlong if t in tick]
    assert late.summary["missed_deadlines"] == missed[-1] == 2 * len(happened)
    assert sorted(set(range(800)) - set(tick)) == [t + 1 for t in happened]
    # Ticks are virtual time: what a missed deadline costs is missing in their numbers.
    np.testing.assert_array_equal(np.diff(tick), np.maximum(1, np.diff(missed[:-1], prepend=0)))
    assert late.summary["faults"] == 0 and late["ticks/enabled"][-1] == 1
    assert late.summary["model_updates"] >= good.summary["model_updates"] - 1
    # The hand goes on in virtual time: where it means to be depends on the tick alone.
    np.testing.assert_array_equal(late["ticks/hand_target_m"], good["ticks/hand_target_m"][tick])


@pytest.mark.parametrize("fault", [f"drop_down = [{LOST_FRAME}]", f"flip_down = [{{ frame = {LOST_FRAME}, bit = 4000 }}]"])
def test_the_old_model_goes_on_when_one_is_lost(tmp_path, good, fault):
    lossy = run(tmp_path, scene(f"[link.faults]\n{fault}"))
    assert lossy.summary["frames_lost"] == 1
    assert lossy.summary["model_updates"] == good.summary["model_updates"] - 1
    at = row(lossy, LOST_MODEL)
    assert (lossy["updates/status"][at], lossy["updates/swap_tick"][at]) == (STATUS_UNKNOWN, 0)
    # Until the next one is there the model before it is rendered; it grows old, but no tick is without force.
    start, end = good["updates/swap_tick"][at], lossy["updates/swap_tick"][at + 1]
    assert np.all(lossy["ticks/model_sequence"][start:end] == LOST_MODEL - 1)
    assert lossy["ticks/model_sequence"][end] == LOST_MODEL + 1
    assert np.all(lossy["ticks/contact_mode"][start:end] != FREE)
    np.testing.assert_allclose(lossy["ticks/force_N"][start:end], good["ticks/force_N"][start:end], atol=LARGEST_DRIFT_N)
    # Up to there both runs are the same.
    np.testing.assert_array_equal(lossy["ticks/force_N"][:start], good["ticks/force_N"][:start])
    assert np.all(lossy["updates/status"][at + 1:-1] == 0)
    assert lossy.summary["faults"] == 0


@pytest.mark.parametrize("piece", [0, 5, PIECES - 1])
def test_a_lost_piece_of_a_basis_is_sent_again(tmp_path, good, piece):
    """The state waits on the board for it."""
    lossy = run(tmp_path, scene(f"[link.faults]\ndrop_down = [{LOST_FRAME - PIECES + piece}]"))
    assert lossy.summary["frames_lost"] == 1
    assert lossy.summary["model_updates"] == good.summary["model_updates"]
    at = row(lossy, LOST_MODEL)
    assert lossy["updates/status"][at] == 0
    late = int(lossy["updates/swap_tick"][at]) - int(good["updates/swap_tick"][at])
    assert 1 <= late <= 25  # there and back, and to catch up with it
    # It goes once more, and only it.
    assert np.array_equal(np.flatnonzero(np.ceil(lossy["updates/basis_bytes"] / 1074) != PIECES), [at + 1])
    assert lossy.summary["faults"] == 0


def test_arming_is_tried_again_when_its_frames_are_lost(tmp_path, good):
    late = run(tmp_path, scene("[link.faults]\ndrop_down = [0]"))
    armed = [int(np.flatnonzero(r["ticks/enabled"])[0]) for r in (good, late)]
    assert armed[0] < armed[1] < 400
    assert np.all(late["ticks/enabled"][armed[1]:] == 1)


def test_a_lost_trace_is_sent_again(tmp_path, good):
    lossy = run(tmp_path, scene("[link.faults]\ndrop_up = [60]"))
    assert (lossy.summary["frames_lost"], lossy.summary["interpolated_ticks"]) == (1, 0)
    assert not np.any(lossy["updates/interpolated_ticks"])
    # Nothing is lost for good: the host's last state is that of a run without loss, for it saw the same tip path.
    assert lossy["updates/tick"][-1] == good["updates/tick"][-1]


def test_a_trace_lost_twice_is_interpolated(tmp_path):
    # Frame 68 is the answer to the request for what was in frame 61.
    lossy = run(tmp_path, scene("[link.faults]\ndrop_up = [61, 68]"))
    flagged, error_m = lossy["updates/interpolated_ticks"], lossy["updates/interpolation_error_m"]
    assert lossy.summary["frames_lost"] == 2
    assert 1 <= lossy.summary["interpolated_ticks"] == flagged.sum() <= 8
    assert np.count_nonzero(flagged) == 1
    assert np.all(error_m[flagged == 0] == 0.0)
    assert 0.0 < error_m[flagged > 0][0] < LARGEST_INTERPOLATION_ERROR_M


def test_a_corrupt_trace_is_refused_and_sent_again(tmp_path):
    lossy = run(tmp_path, scene("[link.faults]\nflip_up = [{ frame = 60, bit = 300 }]"))
    assert (lossy.summary["frames_lost"], lossy.summary["interpolated_ticks"]) == (1, 0)
    assert lossy.summary["faults"] == 0 and lossy.summary["model_updates"] > 15


def test_a_long_silence_of_the_board_is_made_up_for(tmp_path):
    lossy = run(tmp_path, scene(f"[link.faults]\ndrop_up = {list(range(30, 70))}"))
    assert lossy.summary["frames_lost"] == 40
    # Models go on as soon as the host knows the path again.
    assert lossy["updates/status"][-2] == 0 and lossy["updates/tick"][-1] > 700
    assert np.diff(lossy["updates/tick"].astype(int)).max() > 100


def test_emergency_stop_acts_in_its_tick_and_latches(emergency, good):
    assert np.all(emergency["ticks/enabled"][:500] == good["ticks/enabled"][:500])
    assert emergency["ticks/enabled"][499] == 1 and emergency.force_N[499] > 1.0
    assert not np.any(emergency["ticks/enabled"][500:])
    assert not np.any(emergency["ticks/setpoint_A"][500:])
    assert not np.any(emergency["ticks/force_N"][500:])
    assert np.all(emergency["ticks/mode"][500:] == MODE_FAULT)
    assert np.all(emergency["ticks/faults"][500:] == 1)  # latched, though the chain closes again
    # The currents follow at the amplifiers' bandwidth, 1 kHz: gone after 10 ms.
    assert np.abs(emergency["ticks/measured_current_A"][510:]).max() < 1e-6
    assert emergency.summary["faults"] == 1
    assert emergency.summary["rendering_ticks"] == good.summary["rendering_ticks"] - 300


def test_a_latched_fault_is_exit_code_1(tmp_path):
    done = command_line(tmp_path, "run", scene("[board.faults]\nemergency_stop_ticks = [200]", duration_s=0.3))
    assert done.returncode == 1
    assert "palpate run: faults = 0x1: must be 0" in done.stderr.splitlines()
    assert json.loads(done.stdout)["faults"] == 1  # and the results are there all the same
    assert (tmp_path / "out/record.h5").exists()


def test_outputs_are_off_until_armed(good):
    (armed, *_) = np.flatnonzero(good["ticks/enabled"])
    assert 10 < armed < 100
    for path in ("ticks/setpoint_A", "ticks/measured_current_A", "ticks/force_N"):
        assert not np.any(good[path][:armed]), path
    assert np.all(good["ticks/enabled"][armed:] == 1)


def test_no_current_flows_with_offsets_while_disabled(tmp_path):
    run_ = run(tmp_path, scene("[device]\namplifier_offset_A = [0.2, -0.1, 0.1]\n"
                               "[board.faults]\nemergency_stop_ticks = [100]", duration_s=0.2))
    off = run_["ticks/enabled"] == 0
    before = off & (run_["ticks/tick"] < 27)
    assert not np.any(run_["ticks/measured_current_A"][before])
    assert np.abs(run_["ticks/measured_current_A"][120:]).max() < 1e-6
    assert np.abs(run_["ticks/measured_current_A"][90]).max() > 0.05


@pytest.mark.parametrize("baud", [2_000_000, 921_600, 460_800, 115_200, 9_600])
def test_a_slow_link_brings_fewer_models_but_no_harm(tmp_path, good, baud):
    slow = run(tmp_path, scene(f"[link]\nbaud = {baud}", reference=True))
    assert slow.summary["ticks"] == 800 and slow.summary["faults"] == 0
    for way in ("up", "down"):
        assert slow.summary["link_bytes_per_s"][way] <= baud / 10
    assert slow.summary["model_updates"] < good.summary["model_updates"]
    # A model is not sent while the one before it is under way: what can be sent is what the link holds.
    model_ticks = (good["updates/bytes"] + good["updates/basis_bytes"]).mean() * 10 / baud * 1000
    assert slow.summary["models_sent"] <= 800 / model_ticks + 2
    if baud >= 921_600:
        # It takes 150 ms for a model: older than on a fast link, but all are taken.
        assert slow.summary["model_updates"] >= 4 and slow.summary["models_refused"] == 0
        assert np.diff(slow["updates/swap_tick"][slow["updates/swap_tick"] > 0].astype(int)).min() >= model_ticks - 10
    # Nothing pushes where there is no model.
    assert not np.any(slow["ticks/force_N"][slow["ticks/model_sequence"] == 0])


def test_a_model_too_old_for_the_history_is_refused_and_told(tmp_path):
    # 256 ms of tip history, and 300 ms for a model of 13.5 kB.
    slow = run(tmp_path, scene("[link]\nbaud = 460_800"))
    assert slow.summary["models_refused"] >= 1
    assert set(slow["updates/status"]) <= {STATUS_TOO_OLD, STATUS_UNKNOWN}
    assert slow.summary["contact_ticks"] == 0


def test_force_fades_when_the_model_is_older_than_it_may_be(tmp_path):
    # All models from the sixth on are lost: the fifth is of tick 163 and valid for 100 ticks.
    silent = run(tmp_path, scene(f"[model]\nvalid_ticks = 100\n[link.faults]\ndrop_down = {list(range(frame_of_state(5) + 1, 600))}"))
    age, force_N = silent["ticks/model_age_ticks"], silent.force_N
    touching = silent["ticks/contact_mode"] != FREE
    fresh, stale = (age <= 100) & touching, (age > 100 + FADE_TICKS) & touching
    assert force_N[fresh].max() > 0.3
    # What is left is the damper of a silent link: along the tip's way, and as strong as it is quick.
    speed_m_s = np.gradient(silent["ticks/true_tip_m"], axis=0)[stale] * 1e3
    damper_N = DAMPING_N_S_M * np.linalg.norm(speed_m_s, axis=1)
    assert np.any(force_N[stale] > 0.1) and np.all(force_N[stale] <= damper_N + COUNT_N)
    assert np.all(np.sum(silent["ticks/force_N"][stale] * speed_m_s, axis=1) >= -COUNT_N * np.linalg.norm(speed_m_s, axis=1))
    # No drop: in the middle of the fade about half of it is there. The mean, for one count of the encoders is a click.
    middle = (age > 100 + 0.4 * FADE_TICKS) & (age <= 100 + 0.6 * FADE_TICKS)
    assert 0.3 < force_N[middle].mean() / force_N[fresh & (age > 80)].mean() < 0.9


def test_a_loop_that_never_arms_is_exit_code_1(tmp_path):
    done = command_line(tmp_path, "run", scene("[link]\nbaud = 9600"))
    assert done.returncode == 1
    assert "palpate run: rendering_ticks = 0: must be at least 1" in done.stderr.splitlines()


# Outputs go off when the newest model is 200 ms old: horizon, fade and damping. Where the cable goes out it is 15 to 60 (a frame, and
# what link and replay take).
FAULTS_OF_ALL_KINDS = """
[safety]
horizon_s = 0.1
fade_s = 0.05
damp_s = 0.05
[link.faults]
drop_down = [30, 100000]
flip_up = [{ frame = 20, bit = 9 }]
duplicate_up = [{ frame = 40 }]
delay = [{ way = "down", delay_s = 0.005, from_s = 0.1, to_s = 0.3 }]
unplugged = [{ from_s = 0.4, to_s = 0.9 }]
"""


def test_a_run_says_what_was_injected_and_what_came_of_it(tmp_path):
    text = scene(FAULTS_OF_ALL_KINDS, duration_s=1.0, board="native").replace("pictures = false", "pictures = true")
    done = command_line(tmp_path, "run", text)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    down, up = told["link_faults"]["down"], told["link_faults"]["up"]
    assert (down["dropped"], down["flipped"], down["duplicated"], down["not_reached"]) == (1, 0, 0, 1)
    assert (up["dropped"], up["flipped"], up["duplicated"], up["delayed"]) == (0, 1, 1, 0)
    assert down["delayed"] > 0 and down["cut"] > 0 and up["cut"] > 0
    assert down["removed"] == down["cut"] + 1 and up["removed"] == up["cut"] + 1
    assert told["frames_lost"] == down["lost"] + up["lost"] > 0
    assert [span["what"] for span in told["fault_spans"]] == ["delay down", "cable out"]
    off = told["outputs_off"]
    assert off["fault"] == "cable out" and 0.14 <= off["after_s"] <= 0.185 and off["at_s"] == pytest.approx(0.4 + off["after_s"])
    assert off["on_again_s"] is None or off["on_again_s"] > 0.9
    assert told["medium"] == "uart" and told["link_busy_percent"]["down"] > 0.0
    assert told["board_mode"] in ("render", "suspended") and told["fault_names"] == []
    rows = {line[2:44].strip(): line[44:] for line in done.stderr.splitlines() if line.startswith("  ")}
    assert rows["faults injected, to the board"].startswith("dropped 1, delayed ")
    assert rows["outputs off"].startswith(f"at {off['at_s']:g} s, {off['after_s']:g} s after cable out began")
    assert "faults down of frames that the run did not reach: 1; it had " in done.stderr
    marked = matplotlib.image.imread(tmp_path / "out/forces.png")[..., :3]
    orange = np.abs(marked - np.array([0xD9, 0x82, 0x00]) / 255).max(axis=-1) < 0.02
    # The strip of the cable: half of the panel's width, which is most of the picture's.
    assert orange.sum(axis=1).max() > 0.35 * marked.shape[1]


def test_errors_of_a_can_bus_and_a_latched_fault_are_told(tmp_path):
    text = scene(
        '[link]\nmedium = "canfd"\ntrace = "tip"\n[link.faults]\nrandom = [{ way = "up", kind = "flip", chance = 0.9, to_s = 0.3 }]\n'
        "babble = [{ from_s = 0.35, to_s = 0.4 }]\n[board.faults]\nemergency_stop_ticks = [500]",
        duration_s=0.6, board="native",
    )  # fmt: skip
    done = command_line(tmp_path, "run", text)
    assert done.returncode == 1, done.stderr
    told = json.loads(done.stdout)
    faults = told["link_faults"]
    assert faults["up"]["sent_again"] > 50 and faults["up"]["bus_offs"] > 0 and faults["down"]["sent_again"] == 0
    assert faults["foreign_frames"] > 20 and told["medium"] == "canfd"
    assert (told["board_mode"], told["fault_names"]) == ("fault", ["emergency_stop"])
    assert told["outputs_off"] == {"at_s": 0.5, "fault": "emergency stop", "after_s": 0.0, "on_again_s": None}
    assert "fault; latched: emergency_stop (0x1)" in done.stderr


def test_a_tip_in_the_body_without_a_model_is_no_success(tmp_path):
    """Of another schema no model is taken: nothing is felt, and the exit code says so."""
    text = scene("[link.faults]\nother_schema = [{ to_s = 0.5 }]", duration_s=0.5, board="native")
    done = command_line(tmp_path, "run", text)
    assert done.returncode == 1, done.stderr
    told = json.loads(done.stdout)
    assert told["model_updates"] == 0 and told["inside_ticks"] > 50
    assert f"nothing was rendered: the tip was within the body for {told['inside_ticks']} ticks" in done.stderr
    assert done.stderr.count("model_updates = 0") == 1
