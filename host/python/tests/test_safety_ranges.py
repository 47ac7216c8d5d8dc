"""A scene's [safety] says the same ranges as the firmware, which refuses what lies beyond."""

import re

import pytest
from command import ROOT

from palpate.scene_checks import BOARDS_OWN_s, LINK_SILENT_s
from palpate.scene_schema import Number, key_specs
from palpate.scene_sections import TICK_S, Safety

LIMITS = {
    "horizon_s": "model_horizon_ticks",
    "fade_s": "model_fade_ticks",
    "damp_s": "damping_ticks",
    "resume_within_s": "link_lost_ticks",
}


def ticks(text: str) -> int:
    return int(text.replace("'", ""))


@pytest.mark.parametrize("name", [name for name, _ in key_specs(Safety)])
def test_ranges_are_those_of_the_firmware(name):
    source = (ROOT / "firmware" / "core" / "limit_ranges.hpp").read_text()
    found = re.search(rf'"{LIMITS[name]}", &Limits::{LIMITS[name]}, ([\d\']+), ([\d\']+)}}', source)
    assert found, f"limit_ranges.hpp has no {LIMITS[name]}"
    kind = dict(key_specs(Safety))[name].kind
    assert isinstance(kind, Number)
    assert [round(kind.low / TICK_S), round(kind.high / TICK_S)] == [ticks(bound) for bound in found.groups()]


@pytest.mark.parametrize(("limit", "own_s"), [
    *((LIMITS[name], own_s) for name, own_s in BOARDS_OWN_s.items()), ("link_silent_ticks", LINK_SILENT_s),
])
def test_what_a_scene_leaves_out_is_the_boards_own(limit, own_s):
    source = (ROOT / "firmware" / "core" / "supervisor.hpp").read_text()
    found = re.search(rf"uint32_t {limit} = ([\d']+);", source)
    assert found and ticks(found[1]) == round(own_s / TICK_S)
    # No emulated board has times of its own.
    for board in ("native", "mps2_an386", "mps2_an500"):
        assert limit not in (ROOT / "boards" / board / "limits.hpp").read_text()
    texts = [spec.default_text for name, spec in key_specs(Safety) if LIMITS[name] == limit]
    assert texts in ([], [f"the board's: {own_s:g}"])
