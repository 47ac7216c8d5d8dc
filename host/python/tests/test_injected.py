"""What is said of the faults that a scene asks for, against cases that can be worked out by hand."""

import re
from pathlib import Path

import numpy as np
import pytest
from command import ROOT

from palpate import injected
from palpate.injected import FaultSpan
from palpate.record_layout import BOARD_FAULTS
from palpate.scene import Scene, SceneError, load_scene

FAULTS = """
duration_s = 2.0
[link]
medium = "uart"
[link.faults]
drop_up = [3, 400]
flip_down = [{ frame = 7, bit = 1 }]
random = [{ way = "up", kind = "drop", chance = 0.25, from_s = 0.5 }]
delay = [{ way = "down", jitter_s = 0.01, from_s = 0.25, to_s = 0.75 }]
unplugged = [{ from_s = 1.0, to_s = 1.5 }, { from_s = 1.75, to_s = 1.8 }]
[board.faults]
emergency_stop_ticks = [1901, 1900, 1902, 1950]
"""


def scene(tmp_path: Path, text: str = FAULTS) -> Scene:
    (tmp_path / "scene.toml").write_text(f"{text}\n[body]\nnodes = [3, 3, 3]\nfixed_faces = [\"z-\"]\n")
    return load_scene(tmp_path / "scene.toml")


def test_spans_are_in_order_and_end_with_the_scene(tmp_path: Path) -> None:
    assert [span.to_dict() for span in injected.fault_spans(scene(tmp_path).sections)] == [
        {"what": "jitter down", "from_s": 0.25, "to_s": 0.75},
        {"what": "drop 25 % up", "from_s": 0.5, "to_s": 2.0},
        {"what": "cable out", "from_s": 1.0, "to_s": 1.5},
        {"what": "cable out", "from_s": 1.75, "to_s": 1.8},
        {"what": "emergency stop", "from_s": 1.9, "to_s": 1.903},
        {"what": "emergency stop", "from_s": 1.95, "to_s": 1.951},
    ]


def test_counts_are_null_without_faults_and_know_what_did_not_come_up(tmp_path: Path) -> None:
    troubles = {way: {"frames": 350, "dropped": 1, "flipped": 1} for way in injected.WAYS} | {"foreign_frames": 4}
    link = {
        "troubles": troubles, "down": {"attempts_failed": 2, "bus_offs": 0}, "up": {"attempts_failed": 0, "bus_offs": 1},
        "frames_removed_down": 1, "frames_removed_up": 2,
    }  # fmt: skip
    counters = {"frames_lost_down": 5, "frames_lost_up": 6}
    found = injected.counts(scene(tmp_path).sections, link, counters)
    assert found is not None and found["foreign_frames"] == 4
    assert found["down"] == {"frames": 350, "dropped": 1, "flipped": 1, "sent_again": 2, "bus_offs": 0, "removed": 1, "lost": 5, "not_reached": 0}
    assert (found["up"]["lost"], found["up"]["bus_offs"], found["up"]["not_reached"]) == (6, 1, 1)
    assert injected.counts(scene(tmp_path, "duration_s = 2.0").sections, link, counters) is None


def test_the_time_to_outputs_off() -> None:
    tick = np.array([0, 1, 2, 3, 5, 6, 7])  # 4 fell out
    spans = [FaultSpan("drop", 0.001, 0.002), FaultSpan("cable out", 0.002, 0.003), FaultSpan("flood", 0.006, 0.007)]
    enabled = np.array([0, 1, 1, 1, 0, 0, 1])
    off = injected.outputs_off(tick, enabled, spans)
    assert off == {"at_s": 0.005, "fault": "cable out", "after_s": 0.003, "on_again_s": 0.007}
    assert injected.outputs_off(tick, enabled[:6], spans[2:]) is not None
    assert injected.outputs_off(tick[:6], enabled[:6], spans[2:]) == {"at_s": 0.005, "fault": None, "after_s": None, "on_again_s": None}
    assert injected.outputs_off(tick, np.array([0, 0, 1, 1, 1, 1, 1]), spans) is None
    assert injected.off_spans(tick, enabled) == [FaultSpan("outputs off", 0.005, 0.007)]
    assert injected.off_spans(tick, 0 * enabled) == []


def test_names_of_faults_are_those_of_the_firmware() -> None:
    source = (ROOT / "firmware/core/supervisor.hpp").read_text()
    assert re.findall(r"^  (\w+) = 1u << \d+,", source, re.MULTILINE) == list(BOARD_FAULTS)
    assert injected.fault_names(1 << 9 | 1) == ["emergency_stop", "link_lost"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[link.faults]\nunplugged = [{ from_s = 2.0, to_s = 3.0 }]", ("link.faults.unplugged[0].from_s = 2", "duration_s = 2")),
        ("[link.faults]\nflood = [{ to_s = 1.0 }, { from_s = 9.0, to_s = 10.0 }]", ("link.faults.flood[1].from_s = 9",)),
        ("[board.faults]\nemergency_stop_ticks = [1999, 2000]", ("board.faults.emergency_stop_ticks[1] = 2000", "less than 2000")),
        ("[board.faults]\nencoder_slips = [{ tick = 5000, joint = 0, count = 9 }]", ("board.faults.encoder_slips[0].tick = 5000",)),
        ("[safety]\nfade_s = 0.0205", ("safety.fade_s = 0.0205", "whole number of servo ticks")),
        ("[safety]\ndamp_s = 0.0004", ("safety.damp_s = 0.0004",)),
    ],
)
def test_what_would_never_show_is_refused(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as refused:
        scene(tmp_path, f"duration_s = 2.0\n{text}")
    assert all(word in str(refused.value) for word in words), refused.value


def test_a_device_refuses_faults_that_it_does_not_inject(tmp_path: Path) -> None:
    from palpate.virtual_device import VirtualDevice

    for text, name in (("[link.faults]\ndrop_up = [1]", "link.faults"), ("[board.faults]\nreset_ticks = [5]", "board.faults")):
        with pytest.raises(SceneError, match=f"{name}: given, but a device without hardware injects no faults"):
            VirtualDevice(scene(tmp_path, f"duration_s = 2.0\n{text}"))
    VirtualDevice(scene(tmp_path, "duration_s = 2.0\n[link.faults]\nseed = 5"))


def test_whole_ticks_pass_whatever_their_rounding(tmp_path: Path) -> None:
    for ms in (*range(20, 100), 301, 999, 1999, 2000):
        assert scene(tmp_path, f"duration_s = 2.0\n[safety]\nfade_s = {ms / 1000}").sections.safety.fade_s == ms / 1000
