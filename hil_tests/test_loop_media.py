"""The closed loop over every medium that a scene can name, the firmware on its boards with the framing of each."""

import dataclasses
import json

import numpy as np
import pytest
from loop_scene import STATUS_UNKNOWN, Run, command_line, run, scene

from palpate import hil

MEDIA = ("uart", "usb", "canfd", "can")


def text(medium: str, board: str = "native", extra: str = "") -> str:
    return scene(f'[model]\nbuilder = "hybrid"\n[link]\nmedium = "{medium}"\ntrace = "tip"\n{extra}', board=board)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    folder = tmp_path_factory.mktemp("media")
    return {medium: run(folder / medium, text(medium)) for medium in MEDIA}


@pytest.mark.parametrize("medium", MEDIA)
def test_models_cross_and_nothing_is_lost(runs, medium):
    done = runs[medium]
    assert done.summary["medium"] == medium
    assert done.summary["faults"] == 0 and done.summary["frames_lost"] == 0 and done.summary["interpolated_ticks"] == 0
    # 23 are due in the 0.75 s after arming; on classic CAN the first basis alone takes 0.4 s (docs/protocol.md).
    assert done.summary["model_updates"] >= (3 if medium == "can" else 18)
    taken = done["updates/status"] != STATUS_UNKNOWN
    assert np.all(done["updates/status"][taken] == 0)


@pytest.mark.parametrize("medium", MEDIA)
def test_the_medium_is_busy_for_what_crossed_it(runs, medium):
    """Bounds from the media's own definitions: 10 bits a byte; at least 13 + n of 1,500 bytes for a packet of n of 64; at least
    1 bit a bit on CAN, and never more than all of the time."""
    busy, bytes_per_s = runs[medium].summary["link_busy_percent"], runs[medium].summary["link_bytes_per_s"]
    assert busy["up"] + busy["down"] <= 100.0
    for way in ("up", "down"):
        crossed = bytes_per_s[way]
        if medium == "uart":
            assert busy[way] == pytest.approx(100.0 * crossed * 10 / 12e6)
        elif medium == "usb":
            assert 100.0 * crossed / 1.5e6 * 77 / 64 <= busy[way] <= 100.0 * crossed / 1.5e6 * 14
        else:
            assert busy[way] >= 100.0 * crossed * 8 / (1e6 if medium == "can" else 8e6)


@pytest.mark.parametrize("medium", MEDIA)
def test_a_state_is_in_use_no_earlier_than_it_can_have_crossed(runs, medium):
    done = runs[medium]
    taken = done["updates/status"] == 0
    late_ticks = done["updates/swap_tick"][taken].astype(int) - done["updates/sent_tick"][taken]
    least_bits = 8 * done["updates/bytes"][taken]
    rate_Hz = {"uart": 12e6 * 8 / 10, "usb": 12e6, "canfd": 5e6, "can": 1e6}[medium]
    assert np.all(late_ticks >= least_bits / rate_Hz * 1e3)


@pytest.mark.parametrize("medium", ["uart", "usb", "canfd"])  # on classic CAN the drag is over when the basis is there
def test_the_body_is_felt(runs, medium):
    assert runs[medium].summary["peak_force_N"] > 1.0  # pressed 3 mm


@pytest.mark.parametrize("medium", ["canfd", "usb"])
def test_both_boards_give_one_record(runs, tmp_path, medium):
    """With the same firmware: on USB its stack and a device controller in software."""
    emulated = run(tmp_path / "emulated", text(medium, "mps2_an386"))
    assert emulated.summary["background_overruns"] == emulated.summary["missed_deadlines"] == 0
    assert emulated.summary["record_hash"] == runs[medium].summary["record_hash"]


def test_on_usb_a_board_is_enumerated_first(runs):
    """Reset and recovery take 20 ms, each of 13 stages of control transfers two ticks, an address two: only then is there a link."""
    first = runs["usb"]["updates/sent_tick"].min()
    heard = np.flatnonzero(runs["usb"]["ticks/link_up_bytes"])[0]
    assert 48 <= heard <= 70 < first


def test_over_usb_the_force_is_that_of_the_line(runs):
    """Where both have models: they are taken at other ticks, and each is wrong by what a frame's age makes of it."""
    line, usb = runs["uart"], runs["usb"]
    both = (line["ticks/model_sequence"] > 0) & (usb["ticks/model_sequence"] > 0)
    difference_N = np.linalg.norm(line["ticks/force_N"] - usb["ticks/force_N"], axis=1)[both]
    assert np.count_nonzero(both) > 500
    print(difference_N.max(), np.sqrt(np.mean(difference_N**2)), line.force_N.max())
    assert np.sqrt(np.mean(difference_N**2)) < 0.05 * line.force_N.max()


def test_usb_without_its_image_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(hil.BOARDS, "native", dataclasses.replace(hil.BOARDS["native"], image=tmp_path / "palpate_native"))
    with pytest.raises(hil.BoardError, match="palpate_native_usb does not exist: it has a USB stack where TinyUSB's sources are"):
        run(tmp_path / "none", text("usb"))


def test_bad_packets_are_repeated_and_change_no_message(runs, tmp_path):
    noisy = text("usb", extra='[[link.faults.random]]\nway = "up"\nkind = "flip"\nchance = 0.2\n'
                              '[[link.faults.random]]\nway = "down"\nkind = "flip"\nchance = 0.2')
    done = run(tmp_path / "noisy", noisy)
    assert done.summary["frames_lost"] == done.summary["models_refused"] == done.summary["interpolated_ticks"] == 0
    assert done.summary["model_updates"] >= 18
    assert done.summary["record_hash"] != runs["usb"].summary["record_hash"]  # they take their time
    assert run(tmp_path / "again", noisy).summary["record_hash"] == done.summary["record_hash"]


def test_the_command_line_chooses_the_medium_and_refuses_what_does_not_go(tmp_path):
    brief = ("--set", "duration_s=0.1", "--medium", "can")
    done = command_line(tmp_path, "run", text("uart"), *brief)
    assert done.returncode == 0 and '"medium": "can"' in done.stdout, done.stderr
    faults = command_line(tmp_path, "run", text("uart", extra="[link.faults]\ndrop_up = [3]"), *brief)
    assert faults.returncode == 2
    assert 'link.faults.drop_up: given together with link.medium = "can"' in faults.stderr
    lossy = '[[link.faults.random]]\nway = "up"\nkind = "drop"\nchance = 0.2\nto_s = 0.1'
    taken = command_line(tmp_path, "run", text("uart", extra=lossy), *brief, out="lossy")
    assert taken.returncode == 0, taken.stderr
    assert json.loads(taken.stdout)["frames_lost"] > 0
