"""Checks of the paper's figures on made-up records: each passes on what the paper describes and fails on what it denies."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from palpate.reproduce import fig12, fig13, fig14, fig15, fig16, fig17, pulled_node
from palpate.reproduce.checks import Check, all_passed
from palpate.reproduce.figure import Run
from palpate.reproduce.forces import contact_forces, largest_ratio
from palpate.reproduce.results import run_checks
from palpate.reproduce.runner import Done, Job
from palpate.scene import load_scene

Array = NDArray[Any]
UP = np.array([0.0, 0.0, 1.0])
SWING_HZ = 0.6


def verdicts(checks: list[Check]) -> dict[str, bool | None]:
    """By the checks' names; all of them must survive JSON."""
    json.dumps([check.to_dict() for check in checks], allow_nan=False)
    assert len({check.name for check in checks}) == len(checks)
    assert all(check.reason and check.paper_states for check in checks)
    return {check.name: check.passed for check in checks}


def failed(checks: list[Check]) -> list[str]:
    return [name for name, passed in verdicts(checks).items() if passed is False]


# ---- one check


@pytest.mark.parametrize(
    ("measured", "bounds", "passed"),
    [
        (1.0, {}, None),
        (1.0, {"at_most": 1.0}, True),
        (1.1, {"at_most": 1.0}, False),
        (1.0, {"at_least": 1.0}, True),
        (0.9, {"at_least": 1.0}, False),
        (float("nan"), {"at_most": 1.0}, False),
        (float("inf"), {"at_least": 0.0, "at_most": 1.0}, False),
        (-1.0, {"at_least": -2.0, "at_most": 2.0}, True),
    ],
)
def test_a_check_passes_within_its_tolerance(measured: float, bounds: dict[str, float], passed: bool | None) -> None:
    check = Check("a", "b", measured, "N", "c", **bounds)
    assert check.passed is passed
    row = check.to_dict()
    assert row["pass"] is passed
    assert row["tolerance"] == (bounds or None)
    assert row["measured"] == (measured if np.isfinite(measured) else None)
    assert all_passed([check]) == (passed is not False)


COUNTED = ("faults", "missed_deadlines", "frames_lost", "background_overruns")


def checks_of_runs(board: str, **counts: int) -> list[Check]:
    calm = {"board": board, **dict.fromkeys(COUNTED, 0)}
    run = Run("any", "fig15")
    job = Job("fig15", run, load_scene(run.file), Path())
    return run_checks([Done(job, {}, calm), Done(job, {}, {**calm, **counts})])


@pytest.mark.parametrize("key", COUNTED)
def test_a_run_that_is_not_what_its_scene_says_fails_the_figure(key: str) -> None:
    assert failed(checks_of_runs("native")) == []
    assert len(failed(checks_of_runs("native", **{key: 1}))) == 1


def test_what_an_emulated_board_had_no_time_for_is_reported() -> None:
    checks = checks_of_runs("mps2_an386", frames_lost=2, background_overruns=7)
    assert failed(checks) == []
    assert [check.measured for check in checks] == [0, 2, 7]
    assert len(failed(checks_of_runs("mps2_an386", missed_deadlines=1))) == 1
    assert len(failed(checks_of_runs("mps2_an386", faults=16))) == 1


# ---- constants that repeat a scene


def test_constants_are_those_of_the_scenes() -> None:
    twelve, thirteen, sixteen, seventeen = (
        load_scene(figure.FIGURE.runs[0].file).sections for figure in (fig12, fig13, fig16, fig17)
    )
    assert [drive.release_s for drive in twelve.body.drives] == [pulled_node.RELEASE_S]
    assert [drive.release_s for drive in thirteen.body.drives] == [pulled_node.RELEASE_S]
    assert twelve.rates.model_update_Hz == pulled_node.GLOBAL_RATE_HZ
    assert thirteen.rates.model_update_Hz == pulled_node.GLOBAL_RATE_HZ
    assert (sixteen.contact.static_friction, sixteen.contact.kinetic_friction) == (fig16.KINETIC, fig16.KINETIC)
    assert [change.time_s for change in seventeen.hand.grip_changes] == [fig17.LOOSEN_S]
    assert {seventeen.hand.grip} == {fig17.GRIPS[0]} and seventeen.rates.model_update_Hz == 30.0


# ---- records


def drag(
    normal_N: Array, tangential_N: Array, mode: Array, depth_m: Array | None = None, dragging: Array | None = None
) -> dict[str, Array]:
    """A record of a contact whose normal is UP; the tip is depth_m below the surface at z = 0."""
    count = len(normal_N)
    depth_m = np.zeros(count) if depth_m is None else depth_m
    speed_m_s = np.where(np.ones(count, bool) if dragging is None else dragging, 0.02, 0.0)
    force_N = -normal_N[:, None] * UP + tangential_N[:, None] * np.array([1.0, 0.0, 0.0])
    return {
        "ticks/tick": np.arange(count),
        "ticks/force_N": force_N.astype(np.float32),
        "ticks/normal": np.where((mode != 0)[:, None], UP, 0.0).astype(np.float32),
        "ticks/contact_mode": mode,
        "ticks/tip_m": -depth_m[:, None] * UP,
        "ticks/hand_target_m": np.cumsum(1e-3 * speed_m_s)[:, None] * np.array([1.0, 0.0, 0.0]),
        "body/rest_m": np.zeros((1, 3)),
    }


PUSH_N = np.clip(np.sin(np.linspace(0.0, np.pi, 400)), 0.05, None)
ALL = np.ones(400, int)


def test_forces_are_split_in_the_boards_normal() -> None:
    forces = contact_forces(drag(PUSH_N, 0.5 * PUSH_N, ALL))
    np.testing.assert_allclose(forces.normal_N, PUSH_N, rtol=1e-6)
    np.testing.assert_allclose(forces.tangential_N, 0.5 * PUSH_N, rtol=1e-6)


def test_ratios_over_zero() -> None:
    assert largest_ratio(np.array([0.0, 1.0]), np.array([0.0, 2.0])) == 0.5
    assert largest_ratio(np.array([1.0]), np.array([0.0])) == float("inf")
    assert largest_ratio(np.zeros(0), np.zeros(0)) == 0.0


# ---- figure 14


def test_figure_14_passes_on_a_frictionless_drag() -> None:
    record = drag(PUSH_N, 0.0 * PUSH_N, 2 * ALL, depth_m=0.003 * PUSH_N)
    assert failed(fig14.checks({"drag": record})) == []


def test_figure_14_fails_on_friction_on_force_without_depth_and_on_lost_contact() -> None:
    rough = drag(PUSH_N, 2e-6 * PUSH_N, 2 * ALL, depth_m=0.003 * PUSH_N)
    assert failed(fig14.checks({"drag": rough})) == ["largest tangential force relative to the normal force"]
    contrary = drag(PUSH_N, 0.0 * PUSH_N, 2 * ALL, depth_m=0.003 * (1.0 - PUSH_N))
    assert failed(fig14.checks({"drag": contrary})) == ["correlation of the normal force with the depth of the tip"]
    mode = 2 * ALL
    mode[200] = 0
    lost = drag(np.where(mode == 0, 0.0, PUSH_N), 0.0 * PUSH_N, mode, depth_m=0.003 * PUSH_N)
    assert failed(fig14.checks({"drag": lost})) == ["ticks without contact while the hand drags"]


# ---- figure 15


def test_figure_15_passes_where_the_tangential_force_is_mostly_above() -> None:
    record = drag(PUSH_N, np.where(np.arange(400) < 240, 2.0, 0.5) * PUSH_N, ALL)
    rows = {check.name: check for check in fig15.checks({"drag": record})}
    assert failed(list(rows.values())) == []
    assert rows["the same share of all ticks in contact"].measured == pytest.approx(0.6)


def test_figure_15_fails_on_slip_and_on_a_small_tangential_force() -> None:
    slips = drag(PUSH_N, 2.0 * PUSH_N, np.where(np.arange(400) % 50 == 0, 2, 1))
    assert failed(fig15.checks({"drag": slips})) == ["share of the contact that sticks"]
    small = drag(PUSH_N, np.where(np.arange(400) < 160, 2.0, 0.5) * PUSH_N, ALL)
    assert len(failed(fig15.checks({"drag": small}))) == 1
    untouched = drag(0.0 * PUSH_N, 0.0 * PUSH_N, 0 * ALL)
    assert len(failed(fig15.checks({"drag": untouched}))) == 2


def test_figure_15_counts_the_drag_only() -> None:
    above = np.arange(400) < 160
    record = drag(PUSH_N, np.where(above, 2.0, 0.5) * PUSH_N, ALL, dragging=above)
    assert failed(fig15.checks({"drag": record})) == []


# ---- figure 16


def stick_slip(static: float) -> dict[str, Array]:
    """Ten cycles: 30 ticks of stick in which the tangential force rises to `static` times a steady normal force, then 10
    ticks of slip at once that force."""
    normal_N = np.full(400, 0.8)
    phase = np.arange(400) % 40
    sticking = phase < 30
    tangential_N = normal_N * np.where(sticking, static * phase / 30.0, 1.0)
    return drag(normal_N, tangential_N, np.where(sticking, 1, 2))


def test_figure_16_passes_on_coulomb_friction() -> None:
    rows = {check.name: check for check in fig16.checks({"equal": stick_slip(1.0), "static": stick_slip(1.3)})}
    assert failed(list(rows.values())) == []
    assert rows["changes from stick to slip, µ = 1"].measured == 10
    # From 1.3 * 29 / 30 of the normal force to once it.
    assert rows["largest drop, static µ 1.3"].measured == pytest.approx(0.8 * (1.3 * 29 / 30 - 1.0), rel=1e-5)


def test_figure_16_fails_above_the_cone_and_without_events() -> None:
    equal, static = stick_slip(1.0), stick_slip(1.3)
    equal["ticks/force_N"][35] *= np.array([1.00001, 1.0, 1.0], np.float32)
    assert failed(fig16.checks({"equal": equal, "static": static})) == ["largest |f_t| / f_n, µ = 1"]
    static["ticks/force_N"][20, 0] = 0.8 * 1.31
    assert "largest |f_t| / f_n in stick, static µ 1.3" in failed(fig16.checks({"equal": equal, "static": static}))
    calm = drag(PUSH_N, 0.5 * PUSH_N, ALL)
    names = failed(fig16.checks({"equal": calm, "static": calm}))
    assert "changes from stick to slip, µ = 1" in names
    assert "median drop relative to the force before, static µ 1.3" in names


def test_figure_16_lists_each_slip_event() -> None:
    equal, static = fig16.tables({"equal": stick_slip(1.0), "static": stick_slip(1.3)})
    assert len(equal.rows) == len(static.rows) == 10
    for table in (equal, static):
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert [row[0] for row in table.rows] == sorted(row[0] for row in table.rows)
    assert max(row[-1] for row in static.rows) == pytest.approx(0.8 * (1.3 * 29 / 30 - 1.0), rel=1e-5)


def test_a_drop_ends_with_the_slip() -> None:
    record = stick_slip(1.3)
    forces = contact_forces(record)
    np.testing.assert_allclose(fig16.drops_N(forces), 0.8 * (1.3 * 29 / 30 - 1.0), rtol=1e-5)
    ends_in_slip = {name: value[:35] if len(value) == 400 else value for name, value in record.items()}
    assert len(fig16.drops_N(contact_forces(ends_in_slip))) == 1


# ---- figure 12


def swing(step_ms: float, jump_N: float = 0.0) -> dict[str, Array]:
    """A force that swings as the reference does, but in steps of so many ms; jump_N: a sawtooth on top of it."""
    tick = np.arange(4000)
    reference_N = 0.05 + 0.02 * np.sin(2e-3 * np.pi * SWING_HZ * tick)
    held_tick = np.floor(tick / step_ms) * step_ms
    force_N = 0.05 + 0.02 * np.sin(2e-3 * np.pi * SWING_HZ * held_tick) + jump_N * (tick % 33) / 33.0
    return {
        "ticks/tick": tick,
        "ticks/force_N": -force_N[:, None] * UP,
        "reference/force_N": -reference_N[:, None] * UP,
    }


STAIR = swing(1000.0 / 30.0)
# The largest step of the held sinusoid is 2 pi 0.6 / 30 of its amplitude.
STEP_N = 0.02 * 2.0 * np.pi * SWING_HZ / 30.0


def figure_12(**others: dict[str, Array]) -> list[Check]:
    smooth = swing(1.0, 0.1 * STEP_N)
    records = dict.fromkeys(("exact", "paper", "discard", "small"), smooth)
    return fig12.checks({**records, **dict.fromkeys(("hold", "fast", "fast_hold"), STAIR), **others})


def test_figure_12_passes_where_multi_rate_jumps_less() -> None:
    rows = {check.name: check for check in figure_12()}
    assert failed(list(rows.values())) == []
    assert rows["global 30 Hz, held: largest jump"].measured == pytest.approx(1e3 * STEP_N, rel=0.05)
    assert rows["multi-rate: largest jump"].measured == pytest.approx(100.0 * STEP_N, rel=0.05)


def test_figure_12_fails_on_large_jumps_and_errors() -> None:
    assert failed(figure_12(exact=swing(1.0, 0.6 * STEP_N))) == [
        "multi-rate: largest jump relative to that of global 30 Hz"
    ]
    assert len(failed(figure_12(paper=STAIR))) == 1
    assert len(failed(figure_12(exact=swing(100.0)))) == 2


# ---- figure 13


def wave(delay_ms: int, scale: float = 1.0, mode: int = 0) -> dict[str, Array]:
    """A node that swings; the local model has it so much later, and so much larger."""
    tick = np.arange(4000)

    def height_m(at: Array) -> Array:
        return 0.004 * np.exp(-at / 1500.0) * np.cos(2e-3 * np.pi * 2.0 * at)

    return {
        "ticks/tick": tick,
        "ticks/contact_mode": np.full(4000, mode),
        "probe/reference_m": height_m(tick)[:, None] * UP,
        "probe/rendered_m": scale * height_m(tick - delay_ms)[:, None] * UP,
    }


@pytest.mark.parametrize("delay_ms", [-20, 0, 33])
def test_figure_13_finds_the_delay_and_what_remains(delay_ms: int) -> None:
    checks = fig13.checks({"local": wave(delay_ms), "small": wave(delay_ms), "discard": wave(30)})
    rows = {check.name: check for check in checks}
    assert rows["delay of the local model behind the global one at 1 kHz"].measured == delay_ms
    late = rows["delay of the local model behind the global one at 30 Hz, held"].measured
    assert delay_ms - 18 <= late <= delay_ms - 15  # the held samples are half a frame late themselves
    assert failed(checks) == (
        ["delay of the local model behind the global one at 30 Hz, held"] if late < -33 else []
    )


def test_figure_13_fails_on_delay_disagreement_and_touch() -> None:
    late = failed(fig13.checks({"local": wave(60), "small": wave(0), "discard": wave(30)}))
    assert "delay of the local model behind the global one at 1 kHz" in late
    assert len(failed(fig13.checks({"local": wave(0, scale=1.2), "small": wave(0), "discard": wave(30)}))) == 1
    assert failed(fig13.checks({"local": wave(0, mode=1), "small": wave(0), "discard": wave(30)})) == ["ticks with contact"]


# ---- figure 17


CUT = -1.0


def trembling(amplitude_m: float, frequency_Hz: float = 12.0) -> dict[str, Array]:
    """A tip that drifts slowly by 1 mm and trembles with this amplitude, peak to peak; CUT: the board faults."""
    time_s = 1e-3 * np.arange(4000)
    height_m = 1e-3 * time_s / 4.0 + 0.5 * amplitude_m * np.sin(2.0 * np.pi * frequency_Hz * time_s)
    return {
        "ticks/tick": np.arange(4000),
        "ticks/true_tip_m": height_m[:, None] * UP,
        "ticks/faults": np.where(time_s < 2.0, 0, 16 * (amplitude_m == CUT)),
    }


def figure_17(without_m: dict[float, float], with_m: dict[float, float]) -> list[Check]:
    records = {}
    for grip in fig17.GRIPS:
        records[f"without_{grip:g}"] = trembling(without_m.get(grip, 0.0))
        records[f"with_{grip:g}"] = trembling(with_m.get(grip, 0.0))
    return fig17.checks(records)


def test_oscillation_is_measured_without_the_drift() -> None:
    span_m, frequency_Hz = fig17.oscillation(trembling(2e-3))
    assert span_m == pytest.approx(2e-3, rel=0.05)
    assert frequency_Hz == pytest.approx(12.0, abs=1.0)  # a line of the spectrum of one second
    assert fig17.oscillation(trembling(0.0))[0] < 1e-9


def test_figure_17_passes_where_only_the_held_force_oscillates() -> None:
    checks = figure_17({0.1: 2e-3, 0.03: 4e-3}, {0.1: 2e-5})
    rows = {check.name: check.measured for check in checks}
    assert failed(checks) == []
    assert rows["without: largest grip that oscillates or is cut"] == 0.1
    assert np.isnan(rows["with: largest grip that oscillates or is cut"])


def test_a_run_that_was_cut_is_unstable_and_has_no_amplitude() -> None:
    checks = figure_17({0.2: CUT, 0.1: 2e-3}, {})
    rows = {check.name: check.measured for check in checks}
    assert failed(checks) == []
    assert rows["without: largest grip that oscillates or is cut"] == 0.2
    assert len(failed(figure_17({0.1: 2e-3}, {0.1: CUT}))) == 1


def test_the_limit_of_stability_is_bisected() -> None:
    """A made-up arm that swings below a grip of 0.137."""
    limit = 0.137

    def run(grip: float) -> dict[str, Array]:
        return trembling(2e-3 if grip < limit else 0.0)

    records = {f"{kind}_{grip:g}": run(grip) for kind in ("with", "without") for grip in fig17.GRIPS}
    tried = 0
    while runs := fig17.more(records):
        (further,) = runs
        (change,) = further.overrides["hand.grip_changes"]
        records[further.name] = run(change["grip"])
        tried += 1
    assert tried == fig17.BISECTIONS
    low, high = fig17.limit(records, "without")
    assert low < limit <= high
    assert high - low == pytest.approx((0.2 - 0.1) / 2**fig17.BISECTIONS)
    calm = {name: trembling(0.0) for name in records}
    assert fig17.more(calm) == ()


def test_figure_17_fails_where_both_or_none_oscillate() -> None:
    assert len(failed(figure_17({0.1: 2e-3}, {0.0: 2e-4}))) == 1
    assert len(failed(figure_17({0.1: 2e-3}, {1.0: 2e-4}))) == 1
    assert len(failed(figure_17({1.0: 2e-3}, {}))) == 1
