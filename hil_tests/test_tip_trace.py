"""The closed loop with `link.trace = "tip"`: the host hears of the tip's path alone, in steps."""

import numpy as np
import pytest
from loop_scene import FREE, Run, run, scene

# How far the forces may be apart, derived before it was measured, N:
# - a tip within SPEED_M_S in the axis that moves most goes 0.48 mm from the first tick of 4 to the last, 1.1 mm of 8: steps of
#   2^-26 m at most, or 2^-24, so that a position is off by sqrt(3) * 0.502 * 15 nm = 13 nm, or 52. The host's contact point
#   has at most 1.13e5 N a metre of that (host/session/tip_trace_session_test.cpp): 1.5 mN, or 5.9;
# - a state that differs a little may round to the next step of its message: of 5 mm of displacement that is 0.15 um at a
#   node, between springs of 51 * 100 N/m twice: 1.6 mN;
# - friction adds 0.6 of both.
SPEED_M_S, FRICTION = 0.16, 0.6
BOUND_N = {4: (1.5e-3 + 1.6e-3) * (1.0 + FRICTION), 8: (5.9e-3 + 1.6e-3) * (1.0 + FRICTION)}
# The tip is on its path whatever the force: equal paths, so that forces can be compared tick by tick.
SCRIPTED = "[hand]\nkind = \"scripted\"\n"
CASES = [("patch", 4), ("hybrid", 4), ("hybrid", 8)]


def traces(form: str, ticks: int = 4) -> str:
    return f"[link]\ntrace = \"{form}\"\ntrace_ticks = {ticks}\n"


def text(builder: str, link: str = "", board: str = "native") -> str:
    return scene(f"{SCRIPTED}[model]\nbuilder = \"{builder}\"\nbasis_cache_MB = 0\n{link}", friction=FRICTION, reference=True,
                 board=board)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    folder = tmp_path_factory.mktemp("tips")
    wanted = {f"{builder} {form} {ticks}": text(builder, traces(form, ticks)) for builder, ticks in CASES for form in ("full", "tip")}
    wanted["mps2"] = text("patch", traces("tip"), board="mps2_an386")
    return {name: run(folder / name, scene_) for name, scene_ in wanted.items()}


@pytest.mark.parametrize(("builder", "ticks"), CASES)
def test_the_force_is_that_with_full_traces(runs, builder, ticks):
    full, tips = runs[f"{builder} full {ticks}"], runs[f"{builder} tip {ticks}"]
    for path in ("ticks/tick", "ticks/encoder_count", "updates/tick", "updates/sent_tick"):
        np.testing.assert_array_equal(tips[path], full[path])
    speed_m_s = np.abs(np.diff(full["ticks/tip_m"], axis=0)).max() / 1e-3
    assert speed_m_s < SPEED_M_S
    apart_N = np.linalg.norm(tips["ticks/force_N"] - full["ticks/force_N"], axis=1)
    assert 0.0 < np.sqrt(np.mean(apart_N**2)) < BOUND_N[ticks]
    # The error is a force divided by that of the reference, whose tip has gone the same way.
    np.testing.assert_array_equal(tips["reference/force_N"], full["reference/force_N"])
    force_N = np.sqrt(np.mean(np.sum(full["reference/force_N"]**2, axis=1)))
    errors = [r.summary["rms_force_error_percent"] for r in (full, tips)]
    assert abs(errors[1] - errors[0]) < 100.0 * BOUND_N[ticks] / force_N


def test_it_takes_less_than_half_of_the_bytes(runs):
    up = {form: runs[f"patch {form} 4"].summary["link_bytes_per_s"]["up"] for form in ("full", "tip")}
    assert up["tip"] < 0.5 * up["full"]


def test_the_record_has_what_it_has_with_full_traces(runs):
    """Force, mode, triangle and place of the contact come from the emulated board."""
    full, tips = runs["patch full 4"], runs["patch tip 4"]
    assert set(tips.record) == set(full.record)
    touched = tips["ticks/contact_mode"] != FREE
    assert np.count_nonzero(touched) > 100
    assert np.all(np.abs(tips["ticks/barycentric"][touched].sum(axis=1) - 1.0) < 1e-5)


def test_both_boards_give_one_record(runs):
    assert runs["mps2"].summary["background_overruns"] == runs["mps2"].summary["missed_deadlines"] == 0
    assert runs["mps2"].summary["record_hash"] == runs["patch tip 4"].summary["record_hash"]


def test_a_lost_tip_trace_is_sent_again(tmp_path):
    lossy = run(tmp_path, text("patch", traces("tip") + "[link.faults]\ndrop_up = [60]"))
    assert (lossy.summary["frames_lost"], lossy.summary["interpolated_ticks"]) == (1, 0)
    assert lossy.summary["faults"] == lossy.summary["models_refused"] == 0


@pytest.mark.parametrize("fault", ["drop_down = [0]", "flip_down = [{ frame = 0, bit = 200 }]"])
def test_a_lost_wish_is_told_again(tmp_path, runs, fault):
    """The first frame down asks for tips; without it the traces stay full until the next status: the board's at the end of
    its boot, after 20 ticks."""
    late = run(tmp_path, text("patch", traces("tip") + f"[link.faults]\n{fault}"))
    up, full, tips = (r["ticks/link_up_bytes"] for r in (late, runs["patch full 4"], runs["patch tip 4"]))
    assert up[4:18].sum() == full[4:18].sum() > tips[4:18].sum()
    assert up[30:400].sum() == tips[30:400].sum() < full[30:400].sum()
