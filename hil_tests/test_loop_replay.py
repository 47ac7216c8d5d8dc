"""`palpate replay`: with nothing changed it repeats a run to the bit, with something changed it differs by that."""

import json
import pathlib

import h5py
import numpy as np
import pytest
from loop_scene import Run, command_line, no_progress, read_record, run, scene

from palpate import _core, replay

# Board inputs (counts, currents, link bytes) and all that the board makes of them; not the plant's own hand.
EXACT = [
    "tick", "encoder_count", "measured_current_A", "setpoint_A", "enabled", "tip_m", "force_N", "contact_mode", "triangle",
    "barycentric", "normal", "mode", "faults", "model_sequence", "model_age_ticks", "catch_up_ticks", "true_tip_m",
    "link_up_bytes", "link_down_bytes",
]  # fmt: skip


def replayed(folder: pathlib.Path, overrides: dict[str, object] | None = None, board: str | None = None) -> Run:
    """The replay of folder/out/record.h5."""
    source = replay.load_source(folder / "out/record.h5", overrides or {}, board)
    outcome = replay.replay(_core, source, folder / "replay", no_progress)
    return Run(outcome.summary, read_record(outcome.files["record.h5"]))


def assert_equal_to_the_bit(recorded: Run, again: Run) -> None:
    for name in EXACT:
        assert recorded[f"ticks/{name}"].tobytes() == again[f"ticks/{name}"].tobytes(), name
    for path in recorded.record:
        if path.startswith("updates/"):
            assert recorded[path].tobytes() == again[path].tobytes(), path
    assert again.summary["identical"] is True
    assert again.summary["changes"] == []
    assert again.summary["peak_force_difference_N"] == again.summary["rms_force_difference_N"] == 0.0
    assert again.summary["interpolated_inputs"] == 0


# Deadlines that are missed leave ticks out; frames that are lost make the host interpolate; an e-stop ends the forces.
TROUBLE = """
[board.faults]
overlong_ticks = [120, 400, 401]
emergency_stop_ticks = [640]
[link.faults]
drop_down = [60, 61]
drop_up = [30, 100]
"""


@pytest.mark.parametrize(
    ("extra", "board"),
    [
        ("", "mps2_an386"),
        ("", "native"),
        ('[hand]\nkind = "scripted"\n', "native"),
        ("[rates]\nhost_delay_ticks = 12\nmodels_under_way = 2\n[device]\namplifier_bandwidth_Hz = 300.0\n", "native"),
    ],
    ids=["qemu", "native", "scripted", "delay"],
)
def test_nothing_changed_gives_the_same_bits(tmp_path: pathlib.Path, extra: str, board: str) -> None:
    recorded = run(tmp_path, scene(extra, board=board, reference=True))
    assert recorded.summary["peak_force_N"] > 1.0 and recorded.summary["stick_to_slip"] > 0
    again = replayed(tmp_path)
    assert_equal_to_the_bit(recorded, again)
    assert again.summary["source_record_hash"] == recorded.summary["record_hash"]
    assert again.summary["source_rms_force_error_percent"] == recorded.summary["rms_force_error_percent"]
    assert again.summary["rms_force_error_percent"] == recorded.summary["rms_force_error_percent"]
    assert again["reference/force_N"].tobytes() == recorded["reference/force_N"].tobytes()


def test_lost_ticks_and_frames_come_again(tmp_path: pathlib.Path) -> None:
    text = scene().replace('[board]\nname = "mps2_an386"', '[board]\nname = "mps2_an386"\n' + TROUBLE.strip())
    recorded = run(tmp_path, text)
    assert len(recorded["ticks/tick"]) < 800 and recorded.summary["frames_lost"] > 0
    assert_equal_to_the_bit(recorded, replayed(tmp_path))


def test_another_board_gives_the_same_bits_on_the_same_inputs(tmp_path: pathlib.Path) -> None:
    recorded = run(tmp_path, scene(board="mps2_an386"))
    again = replayed(tmp_path, board="native")
    assert again.summary["identical"] is True
    assert again.summary["changes"] == ['board.name="native"']
    assert (again.summary["source_board"], again.summary["board"]) == ("mps2_an386", "native")
    assert recorded["ticks/force_N"].tobytes() == again["ticks/force_N"].tobytes()


def test_a_replay_of_an_overridden_run_keeps_what_was_overridden(tmp_path: pathlib.Path) -> None:
    done = command_line(tmp_path, "run", scene(board="native"), "--set", "contact.friction=0.30000000000000004", "--set", "rates.host_delay_ticks=3")
    assert done.returncode == 0, done.stderr
    again = replayed(tmp_path)
    assert again.summary["identical"] is True and again.summary["changes"] == []


def test_an_interrupted_recording_gives_the_same_bits_as_far_as_it_goes(tmp_path: pathlib.Path) -> None:
    recorded = run(tmp_path, scene(board="native"))
    rows = 450
    with h5py.File(tmp_path / "out/record.h5", "r+") as h5:  # as a Recorder leaves it whose program was killed
        h5.attrs.update({"closed": np.uint8(0), "ticks": rows, "updates": 5, "dropped_ticks": 0, "dropped_updates": 0})
        del h5["body"]
    source = replay.load_source(tmp_path / "out/record.h5", {}, None)
    outcome = replay.replay(_core, source, tmp_path / "replay", no_progress)
    again = Run(outcome.summary, read_record(outcome.files["record.h5"]))
    assert again.summary["identical"] is True and again.summary["compared_ticks"] == rows
    assert recorded["ticks/force_N"][:rows].tobytes() == again["ticks/force_N"].tobytes()
    assert any("was not closed: 450 ticks are whole" in warning for warning in outcome.warnings)


# The tip sticks to the body in `recorded`, whose friction is 1; at 0.1 it slides. Same tip path, so same pressing, about.
def test_friction_that_is_changed_shows_in_force_and_mode(tmp_path: pathlib.Path) -> None:
    recorded = run(tmp_path, scene(board="native", friction=1.0, reference=True))
    again = replayed(tmp_path, {"contact.friction": 0.1})
    assert again.summary["changes"] == ["contact.friction=0.1"]
    assert again.summary["identical"] is False
    np.testing.assert_array_equal(again["ticks/encoder_count"], recorded["ticks/encoder_count"])
    np.testing.assert_array_equal(again["ticks/tip_m"], recorded["ticks/tip_m"])
    assert again.summary["largest_tip_difference_m"] == 0.0
    normal_N = -again["ticks/force_N"][:, 2]
    sliding = again["ticks/contact_mode"] == 2
    assert np.count_nonzero(sliding) > 100
    tangential_N = np.linalg.norm(again["ticks/force_N"][:, :2], axis=1)
    # Of the normal component; the surface is dented by 3 mm in 10 mm cells, so that its normal leans by 0.3 rad at most.
    assert np.median(tangential_N[sliding] / normal_N[sliding]) < 0.1 + np.tan(0.3)
    assert again.summary["rms_force_difference_N"] > 0.1 * recorded.summary["rms_force_N"]
    # Each against its own body: that of the record has the record's friction.
    assert again.summary["source_rms_force_error_percent"] == recorded.summary["rms_force_error_percent"]


def test_a_better_model_is_nearer_to_the_body_on_the_same_path(tmp_path: pathlib.Path) -> None:
    run(tmp_path, scene(board="native", reference=False))
    again = replayed(tmp_path, {"model.builder": "krylov", "reference.enabled": True})
    # The record has no reference, but the body is the same: the replay's is the record's too.
    assert again.summary["rms_force_error_percent"] < 0.5 * again.summary["source_rms_force_error_percent"]


def test_a_record_that_begins_late_is_replayed_from_there(tmp_path: pathlib.Path) -> None:
    recorded = run(tmp_path, scene(board="native"))
    first = 200
    with h5py.File(tmp_path / "out/record.h5", "r+") as h5:
        for name, column in list(h5["ticks"].items()):
            attributes, rows = dict(column.attrs), column[first:]
            del h5[f"ticks/{name}"]
            h5[f"ticks/{name}"] = rows
            h5[f"ticks/{name}"].attrs.update(attributes)
        for group in ("body", "reference"):
            if group in h5:
                del h5[group]
    source = replay.load_source(tmp_path / "out/record.h5", {}, None)
    outcome = replay.replay(_core, source, tmp_path / "replay", no_progress)
    again = Run(outcome.summary, read_record(outcome.files["record.h5"]))
    assert again["ticks/tick"][0] == 0 and len(again["ticks/tick"]) == 800 - first
    np.testing.assert_array_equal(again["ticks/encoder_count"], recorded["ticks/encoder_count"][first:])
    assert any("begins at tick 200" in warning for warning in outcome.warnings)


def test_the_command_line(tmp_path: pathlib.Path) -> None:
    assert command_line(tmp_path, "run", scene(board="native")).returncode == 0
    text = scene(board="native")

    def replay_command(*options: str):
        return command_line(tmp_path, "replay", text, *options, argument="out/record.h5", out="again")

    done = replay_command("--tolerance-N", "0")
    assert done.returncode == 0, done.stderr
    numbers = json.loads(done.stdout)
    assert numbers["command"] == "replay" and numbers["identical"] is True and numbers["source"] == "out/record.h5"
    assert {"record.h5", "summary.json"} <= set(numbers["files"])
    changed = replay_command("--set", "contact.friction=0.05", "--tolerance-N", "0.001")
    assert changed.returncode == 1
    assert "peak_force_difference_N = " in changed.stderr and "must be at most 0.001" in changed.stderr
    assert replay_command("--set", "contact.friction=0.05").returncode == 0
