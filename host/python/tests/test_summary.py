"""The numbers of summary.json against cases that can be worked out by hand."""

from typing import Any

import numpy as np
import pytest
from synthetic import run_values, sheet_values, simulate_values

from palpate import record, record_layout, summary

# Forces are stored in 32 bits: relative rounding 6e-8, with room for a few operations.
FLOAT32 = 1e-6


def summarize(
    values: dict[str, Any], counters: dict[str, int], instructions_per_count: int | None = 5
) -> dict[str, Any]:
    ticks = int(values["ticks/tick"][-1]) + 1
    return summary.summarize_run(
        record.conform(record_layout.RUN, values),
        counters,
        command="run",
        title="",
        board="mps2_an386",
        instructions_per_count=instructions_per_count,
        record_hash="0",
        wall_clock_s={},
        medium="can",
        busy_ticks={"up": 0.25 * ticks, "down": 0.125 * ticks},
    )


def still(ticks: int) -> tuple[dict[str, Any], dict[str, int]]:
    """A run in which nothing happens, to be changed by a test."""
    values, counters = run_values(ticks=ticks)
    for path, array in values.items():
        if path.startswith(("ticks/", "reference/")):
            values[path] = np.zeros_like(array)
    values["ticks/tick"] = np.arange(ticks)
    return values, counters


def test_keys_are_those_that_are_documented() -> None:
    numbers = summarize(*run_values(ticks=400))
    assert list(numbers) == [key.name for key in summary.RUN_KEYS]
    simulated = summary.summarize_simulation(
        record.conform(record_layout.SIMULATE, simulate_values()),
        title="",
        ticks=300,
        record_hash="",
        wall_clock_s={},
    )
    assert list(simulated) == [key.name for key in summary.SIMULATE_KEYS]


def test_forces_and_transitions() -> None:
    values, counters = still(8)
    values["ticks/contact_mode"] = np.array([0, 1, 2, 2, 1, 2, 0, 1])
    values["ticks/force_N"][1:6] = [[3, 0, 4], [0, 0, 2], [0, 0, 2], [0, 0, 2], [0, 0, 2]]
    numbers = summarize(values, counters)
    assert numbers["contact_ticks"] == 6
    assert (numbers["stick_to_slip"], numbers["slip_to_stick"]) == (2, 1)
    assert numbers["peak_force_N"] == pytest.approx(5.0, rel=FLOAT32)
    assert numbers["rms_force_N"] == pytest.approx(np.sqrt((25 + 4 * 4) / 6), rel=FLOAT32)


def test_comparison_with_the_reference() -> None:
    values, counters = still(6)
    values["ticks/force_N"][:, 2] = [0, 1, 2, 4, 4, 4]
    values["reference/force_N"][:, 2] = [0, 1, 2, 3, 4, 4]
    values["ticks/contact_mode"] = np.array([0, 1, 1, 2, 2, 2])
    values["reference/contact_mode"] = np.array([0, 1, 1, 1, 2, 1])
    values["ticks/model_sequence"] = np.array([1, 1, 1, 2, 2, 2])
    numbers = summarize(values, counters)
    assert numbers["rms_force_error_percent"] == pytest.approx(
        100 * np.sqrt(1 / (1 + 4 + 9 + 16 + 16)), rel=FLOAT32
    )
    assert numbers["contact_mode_divergence_ticks"] == 2
    # force rises by 2 at the swap, the reference by 1
    assert numbers["largest_force_jump_N"] == pytest.approx(1.0, rel=FLOAT32)
    # the change back in the next tick is none at a swap
    values["ticks/model_sequence"] = np.ones(6)
    assert summarize(values, counters)["largest_force_jump_N"] == 0.0


def test_energies_that_were_given_are_counted_apart_from_those_that_were_taken() -> None:
    values, counters = run_values(ticks=400)
    energy_J = np.zeros(len(values["updates/status"]))
    energy_J[1:5] = [2e-3, -5e-3, 3e-3, -1e-3]
    values["updates/correction_energy_J"] = energy_J
    numbers = summarize(values, counters)["correction_energy_J"]
    assert numbers == pytest.approx({"sum": -1e-3, "injected": 5e-3, "largest": 3e-3}, rel=FLOAT32)
    values["updates/correction_energy_J"] = -np.abs(energy_J)
    assert summarize(values, counters)["correction_energy_J"]["largest"] == 0.0


def test_only_a_tip_in_the_body_with_outputs_on_is_inside() -> None:
    values, counters = still(5)
    low_m, high_m = values["body/rest_m"].min(axis=0), values["body/rest_m"].max(axis=0)
    values["ticks/tip_m"] = np.array([high_m + 1e-3, 0.5 * (low_m + high_m), 0.5 * (low_m + high_m), low_m - 1e-3, high_m - 1e-4])
    values["ticks/enabled"] = np.array([1, 0, 1, 1, 1])
    assert summarize(values, counters)["inside_ticks"] == 2


def test_jump_sees_the_direction() -> None:
    force_N = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    assert summary.largest_jump_N(force_N, np.zeros((2, 3)), np.array([1, 2])) == pytest.approx(np.sqrt(2))


def test_rates_and_counts() -> None:
    values, counters = still(2000)
    values["ticks/link_up_bytes"] = np.full(2000, 50)
    values["ticks/link_down_bytes"] = np.full(2000, 7)
    values["ticks/missed_deadlines"] = np.repeat([0, 3], 1000)
    values["ticks/tick_count"][7] = 900
    values["ticks/busy_count"][8] = 2000
    values["ticks/faults"][[5, 6]] = [1, 6]
    values["ticks/model_sequence"][10:] = 1
    values["ticks/model_age_ticks"][10:] = np.arange(1990)
    counters |= {"frames_lost_up": 2, "frames_lost_down": 3}
    numbers = summarize(values, counters)
    assert numbers["ticks"] == 2000
    assert numbers["link_bytes_per_s"] == {"up": 50_000.0, "down": 7_000.0}
    assert numbers["missed_deadlines"] == 3
    assert numbers["worst_tick_instructions"] == 4500
    assert numbers["worst_busy_instructions"] == 10_000
    assert numbers["faults"] == 7
    assert numbers["frames_lost"] == 5
    assert numbers["model_age_ticks"] == {"median": 994.5, "worst": 1989}
    assert summarize(values, counters, None)["worst_tick_instructions"] is None


def test_what_is_not_known_is_null() -> None:
    values, counters = still(10)
    numbers = summarize(values, counters)
    assert numbers["rms_force_N"] is None
    assert numbers["rms_force_error_percent"] is None
    assert numbers["model_age_ticks"] is None
    without = {path: array for path, array in values.items() if not path.startswith("reference/")}
    assert summarize(without, counters)["largest_force_jump_N"] is None
    sheet = summary.summarize_simulation(
        record.conform(record_layout.SIMULATE, sheet_values()),
        title="",
        ticks=1,
        record_hash="",
        wall_clock_s={},
    )
    assert sheet["peak_force_N"] is None


def test_checks() -> None:
    numbers = summarize(*run_values(ticks=400))
    assert summary.board_failures(numbers) == summary.suspicions(numbers) == []
    numbers["inside_ticks"] = 0
    for key, value in {"missed_deadlines": 1, "model_updates": 0, "contact_ticks": 0}.items():
        (found,) = summary.suspicions({**numbers, key: value})
        assert found.startswith(f"{key} = ")
        assert summary.board_failures({**numbers, key: value}) == []
    assert summary.board_failures({**numbers, "faults": 4}) == ["faults = 0x4: must be 0"]
    never = {**numbers, "rendering_ticks": 0, "ticks": 1000}
    assert summary.board_failures(never) == ["rendering_ticks = 0: must be at least 1"]
    assert summary.board_failures({**never, "ticks": 20}) == []  # no time to arm
    (nothing,) = summary.board_failures({**numbers, "model_updates": 0, "peak_force_N": 0.0, "inside_ticks": 7})
    assert "nothing was rendered" in nothing and "within the body for 7 ticks" in nothing
    # One model was taken over that said that nothing is near; a graze is let pass.
    told = {**numbers, "model_updates": 1, "peak_force_N": 0.0}
    (nothing,) = summary.board_failures({**told, "inside_ticks": 300})
    assert nothing.startswith("model_updates = 1: nothing was rendered")
    assert summary.board_failures({**told, "inside_ticks": 20}) == []
    late = {**numbers, "link_faults": {way: {"frames": 9, "not_reached": int(way == "up")} for way in ("down", "up")}}
    (found,) = summary.suspicions(late)
    assert found == "link.faults: faults up of frames that the run did not reach: 1; it had 9"
