"""The numbers of an experiment, computed from its record. Every key is declared here; docs/records.md is generated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.injected import FaultSpan, fault_names, outputs_off
from palpate.record_layout import BOARD_MODES

TICKS_PER_SECOND = 1000
_FREE, _STICK, _SLIP = 0, 1, 2


@dataclass(frozen=True)
class Key:
    """One key of summary.json, or of a point's metrics in frontier.json."""

    name: str
    unit: str
    definition: str


RUN_KEYS = (
    Key("command", "", "`run`, `demo` or `replay`"),
    Key("title", "", "the scene's title"),
    Key("board", "", "where the firmware ran"),
    Key(
        "ticks",
        "ticks",
        "servo ticks that the board computed, one a millisecond of virtual time; overlong ones cost others",
    ),
    Key("missed_deadlines", "", "deadlines that servo ticks missed; a tick that takes 3 ms misses two"),
    Key("background_overruns", "", "ticks whose background work was not done when the next began"),
    Key(
        "worst_tick_instructions",
        "instructions",
        "longest servo tick, from interrupt entry to exit: its clock counts times the instructions per count "
        "(5 on mps2_an386, 20 on mps2_an500: 125 and 500 million instructions per second against a clock of 25 MHz; 5/9 on "
        "nucleo_g474re, of whose 170 MHz an instruction is taken to last 1.8 cycles); null on native",
    ),
    Key(
        "worst_busy_instructions",
        "instructions",
        "the same for a servo tick and the background runs that ended in it",
    ),
    Key("model_updates", "", "local models that the board took over"),
    Key("models_sent", "", "local models that the host sent"),
    Key("models_refused", "", "local models that the board refused or dropped"),
    Key("basis_waits", "", "updates at which the modes of the patch that the model should be on were not there yet"),
    Key(
        "model_age_ticks",
        "ticks",
        "{median, worst}: age of the rendered model's own state, over ticks with one",
    ),
    Key(
        "link_bytes_per_s", "bytes/s", "{up, down}: bytes that crossed the link, per second of virtual time"
    ),
    Key("medium", "", "what carried the link: `link.medium`"),
    Key(
        "link_busy_percent",
        "%",
        "{up, down}: of the virtual time, that for which the medium carried what it brought, overhead included; on a bus, "
        "which both directions share, the two together are at most 100",
    ),
    Key("frames_lost", "", "frames lost or refused on the link, both directions"),
    Key(
        "link_faults",
        "",
        "{down, up, foreign_frames}, what `[link.faults]` did; null where the scene asks for none. Of each direction how many {frames} there "
        "were (on a CAN bus frames of the bus), and how many of them were {dropped, flipped, truncated, duplicated, reordered}; {delayed}: submissions that waited; {cut}: "
        "frames that a cable that was out kept; {sent_again, bus_offs}: on a CAN bus attempts that an error hit, and times that the sender "
        "was off the bus; {removed}: frames, on a CAN bus transfers, that did not come whole for these; {lost}: what the receiving end "
        "missed or refused; {not_reached}: faults of frames by number that did not come up in the run. `foreign_frames`: of a second host, a flood or a babbling node",
    ),
    Key(
        "fault_spans",
        "s",
        "list of {what, from_s, to_s}: faults of link and board that have a time in the scene, cut off at its end, by their beginning; "
        "forces.png marks them",
    ),
    Key("interpolated_ticks", "ticks", "ticks whose tip position the host had to interpolate"),
    Key("contact_ticks", "ticks", "ticks with contact"),
    Key("stick_to_slip", "", "ticks with slip right after one with stick"),
    Key("slip_to_stick", "", "ticks with stick right after one with slip"),
    Key("peak_force_N", "N", "largest magnitude of the rendered force"),
    Key(
        "rms_force_N", "N", "root mean square of that magnitude over the ticks with contact; null without any"
    ),
    Key(
        "rms_force_error_percent",
        "%",
        "root mean square of |force - reference force| divided by that of |reference force|, both over all ticks; the "
        "reference is the full non-linear body with contact, stepped at `reference.step_s` along the same tip path; "
        "null without a reference or where that never feels a force",
    ),
    Key(
        "contact_mode_divergence_ticks",
        "ticks",
        "ticks whose contact mode differs from the reference's; null without one",
    ),
    Key(
        "largest_force_jump_N",
        "N",
        "over the ticks k that render another model than tick k - 1: largest magnitude of (force[k] - force[k-1]) - "
        "(reference[k] - reference[k-1]), the jump beyond the reference's own change; null without a reference",
    ),
    Key(
        "correction_energy_J",
        "J",
        "{sum, injected, largest} of `/updates/correction_energy_J`: of all, of the positive ones, the largest one (0 "
        "where none is positive); positive: the hand was given more than the corrected model would have given",
    ),
    Key("faults", "", "bits of all faults that the board latched; 0: none"),
    Key("fault_names", "", "names of these bits (safety.md)"),
    Key("board_mode", "", "the board's mode in the last tick, as `render`, `suspended` or `fault` (safety.md)"),
    Key(
        "outputs_off",
        "s",
        "{at_s, fault, after_s, on_again_s}: when the amplifiers first went off after they had been on, which of `fault_spans` had begun last "
        "by then and how long before (null where none had), and when they were on again (null: not any more); null where they stayed on",
    ),
    Key("rendering_ticks", "ticks", "ticks with the amplifiers enabled"),
    Key("inside_ticks", "ticks", "ticks with outputs on whose tip is within the box of the body at rest: with no local model ever in use nothing is felt there"),
    Key(
        "choice",
        "",
        "{chosen, inputs, expected, reasons}: what stood for `\"auto\"` in the scene, by key; what it was chosen by; what the rule "
        "expects of it; its checks, a line each (decisions/model_choice.md); null where nothing was `\"auto\"`",
    ),
    Key("record_hash", "", 'SHA-256 over the record (see "record_hash" below)'),
    Key(
        "wall_clock", "s", "{run_s, reference_s}: seconds on this machine; all other figures are virtual time"
    ),
)

SIMULATE_KEYS = (
    Key("command", "", "`simulate`"),
    Key("title", "", "the scene's title"),
    Key("ticks", "ticks", "servo ticks of 1 ms of virtual time"),
    Key("nodes", "", "nodes of the body"),
    Key("exported_times", "", "times at which node positions and velocities were exported"),
    Key("contact_ticks", "ticks", "ticks with contact; null without a path"),
    Key("stick_to_slip", "", "ticks with slip right after one with stick; null without a path"),
    Key("slip_to_stick", "", "ticks with stick right after one with slip; null without a path"),
    Key("peak_force_N", "N", "largest magnitude of the tip force; null without a path"),
    Key(
        "rms_force_N", "N", "root mean square of that magnitude over the ticks with contact; null without any"
    ),
    Key("record_hash", "", 'SHA-256 over the record (see "record_hash" below)'),
    Key("wall_clock", "s", "{simulate_s}: seconds on this machine"),
)

# Those of a replay beside RUN_KEYS. "Common ticks" are those that both the record and the replay have.
REPLAY_KEYS = (
    Key("source", "", "the record that was replayed"),
    Key("source_record_hash", "", "its `record_hash`; null where it has none"),
    Key("source_board", "", "where its firmware ran"),
    Key("changes", "", "list of what the replay has otherwise, as `key=value`; empty: nothing"),
    Key(
        "interpolated_inputs",
        "ticks",
        "ticks of the replay that the record does not have: their encoder counts lie on a straight line",
    ),
    Key("compared_ticks", "ticks", "common ticks"),
    Key(
        "identical",
        "",
        "true: in all common ticks, and there are no others, encoder counts, currents, set-points, forces, contact points, "
        "models and link bytes are the same to the bit",
    ),
    Key(
        "rms_force_difference_N",
        "N",
        "root mean square over the common ticks of |force - recorded force|",
    ),
    Key(
        "rms_force_difference_percent",
        "%",
        "that divided by the root mean square of |recorded force|; null where that never feels a force",
    ),
    Key("peak_force_difference_N", "N", "largest |force - recorded force|; `--tolerance-N` is about this one"),
    Key("source_peak_force_N", "N", "largest magnitude of the recorded force in the common ticks"),
    Key(
        "equal_contact_modes_percent",
        "%",
        "ticks with the same contact mode, of the common ticks in which either has contact; null without any",
    ),
    Key(
        "largest_tip_difference_m",
        "m",
        "largest distance of the tip positions that the boards computed; 0 where both have the same reference pose",
    ),
    Key(
        "largest_swap_step_N",
        "N",
        "{source, replay}: largest |force[k] - force[k-1]| over the ticks k that render another model than tick k - 1; what "
        "the body itself changes in a tick is in it",
    ),
    Key(
        "source_rms_force_error_percent",
        "%",
        "`rms_force_error_percent` of the recorded force in the common ticks: against the record's own reference, or the "
        "replay's where body, contact, coupling, tool and reference are unchanged; else null",
    ),
)

# What `palpate plot --json` prints.
PLOT_KEYS = (
    Key("command", "", "`plot`"),
    Key("source", "", "the record"),
    Key("kind", "", "`run`: with a board in the loop; `simulate`: without"),
    Key("closed", "", "false: the recording was interrupted"),
    Key("ticks", "ticks", "ticks that are drawn"),
    Key("from_s", "s", "time of the first"),
    Key("to_s", "s", "time of the last"),
    Key("dropped_ticks", "ticks", "ticks that the disk was too slow for, in the whole recording"),
    Key("files", "", "the pictures by name"),
)

# Boot, calibration and arming take 27 ticks over a fast link; a lost command is sent again 200 ticks later.
_ARMING_TICKS = 500
_GRAZE_TICKS = 100


def transitions(mode: NDArray[Any], before: int, after: int) -> int:
    """How often `after` follows right upon `before`. mode: (n,)."""
    return int(np.count_nonzero((mode[:-1] == before) & (mode[1:] == after)))


def magnitude(vectors: NDArray[Any]) -> NDArray[np.float64]:
    """Lengths (n,) of vectors (n, 3)."""
    lengths: NDArray[np.float64] = np.linalg.norm(vectors.astype(np.float64), axis=1)
    return lengths


def root_mean_square(values: NDArray[np.float64]) -> float:
    """Of a non-empty array."""
    return float(np.sqrt(np.mean(np.square(values))))


def largest_jump_N(force_N: NDArray[Any], reference_N: NDArray[Any], model_sequence: NDArray[Any]) -> float:
    """Largest change of force at a change of model beyond the reference's own change; 0 without a change of model.

    force_N, reference_N: (n, 3); model_sequence: (n,).
    """
    swaps = np.flatnonzero(np.diff(model_sequence.astype(np.int64)) != 0) + 1
    if len(swaps) == 0:
        return 0.0
    error_N = force_N.astype(np.float64) - reference_N
    return float(np.max(magnitude(error_N[swaps] - error_N[swaps - 1])))


def relative_rms_percent(force_N: NDArray[Any], reference_N: NDArray[Any]) -> float | None:
    """Root mean square of |force - reference force| over that of |reference force|; None where that never feels a force.

    force_N, reference_N: (n, 3).
    """
    base = float(np.sum(np.square(reference_N, dtype=np.float64)))
    if base == 0.0:
        return None
    error = float(np.sum(np.square(force_N.astype(np.float64) - reference_N)))
    return 100.0 * float(np.sqrt(error / base))


# Of /ticks: what says of two runs that they are one.
_IDENTITY = (
    "encoder_count", "measured_current_A", "setpoint_A", "enabled", "tip_m", "force_N", "contact_mode", "triangle", "barycentric",
    "normal", "mode", "faults", "model_sequence", "model_age_ticks", "link_up_bytes", "link_down_bytes",
)  # fmt: skip


def largest_swap_step_N(force_N: NDArray[Any], model_sequence: NDArray[Any]) -> float:
    """Largest change of force at a change of model; 0 without one. force_N: (n, 3); model_sequence: (n,)."""
    return largest_jump_N(force_N, np.zeros(force_N.shape), model_sequence)


def compare_runs(recorded: Mapping[str, NDArray[Any]], replayed: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """The keys of REPLAY_KEYS from `compared_ticks` to `largest_swap_step_N`. Both: the datasets /ticks in the common ticks,
    row by row."""
    force_N, again_N = (values["ticks/force_N"].astype(np.float64) for values in (recorded, replayed))
    mode, mode_again = recorded["ticks/contact_mode"], replayed["ticks/contact_mode"]
    difference_N = magnitude(again_N - force_N)
    touching = (mode != _FREE) | (mode_again != _FREE)
    tip_m = recorded["ticks/tip_m"].astype(np.float64) - replayed["ticks/tip_m"]
    return {
        "compared_ticks": len(force_N),
        "identical": all(
            recorded[f"ticks/{name}"].tobytes() == replayed[f"ticks/{name}"].tobytes() for name in _IDENTITY
        ),
        "rms_force_difference_N": root_mean_square(difference_N) if len(difference_N) else 0.0,
        "rms_force_difference_percent": relative_rms_percent(again_N, force_N),
        "peak_force_difference_N": float(np.max(difference_N, initial=0.0)),
        "source_peak_force_N": float(np.max(magnitude(force_N), initial=0.0)),
        "equal_contact_modes_percent": (
            100.0 * float(np.mean((mode == mode_again)[touching])) if np.any(touching) else None
        ),
        "largest_tip_difference_m": float(np.max(magnitude(tip_m), initial=0.0)),
        "largest_swap_step_N": {
            "source": largest_swap_step_N(force_N, recorded["ticks/model_sequence"]),
            "replay": largest_swap_step_N(again_N, replayed["ticks/model_sequence"]),
        },
    }


def _force_summary(mode: NDArray[Any], force_N: NDArray[Any]) -> dict[str, Any]:
    force = magnitude(force_N)
    touching = mode != _FREE
    return {
        "contact_ticks": int(np.count_nonzero(touching)),
        "stick_to_slip": transitions(mode, _STICK, _SLIP),
        "slip_to_stick": transitions(mode, _SLIP, _STICK),
        "peak_force_N": float(np.max(force, initial=0.0)),
        "rms_force_N": root_mean_square(force[touching]) if np.any(touching) else None,
    }


def _inside_ticks(values: Mapping[str, NDArray[Any]]) -> int:
    rest_m, tip_m = values["body/rest_m"], values["ticks/tip_m"].astype(np.float64)
    inside = np.all((tip_m > rest_m.min(axis=0)) & (tip_m < rest_m.max(axis=0)), axis=1)
    return int(np.count_nonzero(inside & (values["ticks/enabled"] != 0)))


def _energy_summary(correction_J: NDArray[Any]) -> dict[str, float]:
    injected_J = np.maximum(correction_J.astype(np.float64), 0.0)
    return {
        "sum": float(np.sum(correction_J, dtype=np.float64)),
        "injected": float(np.sum(injected_J)),
        "largest": float(np.max(injected_J, initial=0.0)),
    }


def summarize_run(
    values: Mapping[str, NDArray[Any]],
    counters: Mapping[str, int | float],
    *,
    command: str,
    title: str,
    board: str,
    instructions_per_count: float | None,
    record_hash: str,
    wall_clock_s: Mapping[str, float],
    choice: Mapping[str, Any] | None = None,
    medium: str,
    busy_ticks: Mapping[str, float],
    link_faults: Mapping[str, Any] | None = None,
    fault_spans: Sequence[FaultSpan] = (),
) -> dict[str, Any]:
    """summary.json of a run: exactly the keys of RUN_KEYS. `values` are the datasets of a record, `counters` those of
    RUN_COUNTERS."""
    ticks = len(values["ticks/tick"])
    duration_s = (int(values["ticks/tick"][-1]) + 1) / TICKS_PER_SECOND
    mode, force_N = values["ticks/contact_mode"], values["ticks/force_N"]
    age = values["ticks/model_age_ticks"][values["ticks/model_sequence"] != 0]
    faults = int(np.bitwise_or.reduce(values["ticks/faults"]))

    def worst_instructions(name: str) -> int | None:
        return None if instructions_per_count is None else round(int(values[name].max()) * instructions_per_count)

    summary: dict[str, Any] = {
        "command": command,
        "title": title,
        "board": board,
        "ticks": ticks,
        "missed_deadlines": int(values["ticks/missed_deadlines"][-1]),
        "background_overruns": int(values["ticks/background_overruns"][-1]),
        "worst_tick_instructions": worst_instructions("ticks/tick_count"),
        "worst_busy_instructions": worst_instructions("ticks/busy_count"),
        "model_updates": int(counters["models_taken"]),
        "models_sent": int(counters["models_sent"]),
        "models_refused": int(counters["models_refused"]),
        "basis_waits": int(counters["basis_waits"]),
        "model_age_ticks": {"median": float(np.median(age)), "worst": int(age.max())} if len(age) else None,
        "link_bytes_per_s": {
            "up": float(values["ticks/link_up_bytes"].sum(dtype=np.int64)) / duration_s,
            "down": float(values["ticks/link_down_bytes"].sum(dtype=np.int64)) / duration_s,
        },
        "medium": medium,
        "link_busy_percent": {
            way: 100.0 * busy_ticks[way] / (int(values["ticks/tick"][-1]) + 1) for way in ("up", "down")
        },
        "frames_lost": int(counters["frames_lost_up"]) + int(counters["frames_lost_down"]),
        "link_faults": None if link_faults is None else dict(link_faults),
        "fault_spans": [span.to_dict() for span in fault_spans],
        "interpolated_ticks": int(values["updates/interpolated_ticks"].sum(dtype=np.int64)),
        **_force_summary(mode, force_N),
        "rms_force_error_percent": None,
        "contact_mode_divergence_ticks": None,
        "largest_force_jump_N": None,
        "correction_energy_J": _energy_summary(values["updates/correction_energy_J"]),
        "faults": faults,
        "fault_names": fault_names(faults),
        "board_mode": BOARD_MODES[int(values["ticks/mode"][-1])],
        "outputs_off": outputs_off(values["ticks/tick"], values["ticks/enabled"], fault_spans),
        "rendering_ticks": int(np.count_nonzero(values["ticks/enabled"])),
        "inside_ticks": _inside_ticks(values),
        "choice": None if choice is None else dict(choice),
        "record_hash": record_hash,
        "wall_clock": dict(wall_clock_s),
    }
    if "reference/force_N" in values:
        reference_N = values["reference/force_N"]
        summary["rms_force_error_percent"] = relative_rms_percent(force_N, reference_N)
        summary["contact_mode_divergence_ticks"] = int(
            np.count_nonzero(mode != values["reference/contact_mode"])
        )
        summary["largest_force_jump_N"] = largest_jump_N(force_N, reference_N, values["ticks/model_sequence"])
    return summary


def summarize_simulation(
    values: Mapping[str, NDArray[Any]],
    *,
    title: str,
    ticks: int,
    record_hash: str,
    wall_clock_s: Mapping[str, float],
) -> dict[str, Any]:
    """summary.json of a simulation: exactly the keys of SIMULATE_KEYS."""
    forces: dict[str, Any] = dict.fromkeys(
        ("contact_ticks", "stick_to_slip", "slip_to_stick", "peak_force_N", "rms_force_N")
    )
    if "tip/force_N" in values:
        forces = _force_summary(values["tip/contact_mode"], values["tip/force_N"])
    return {
        "command": "simulate",
        "title": title,
        "ticks": ticks,
        "nodes": len(values["body/rest_m"]),
        "exported_times": len(values["nodes/time_s"]),
        **forces,
        "record_hash": record_hash,
        "wall_clock": dict(wall_clock_s),
    }


def board_failures(summary: Mapping[str, Any]) -> list[str]:
    """What went wrong on the board, in any run: a fault that it latched, outputs that it never switched on although there
    was time; empty when nothing did."""
    failures = []
    if summary["faults"] != 0:
        failures.append(f"faults = {summary['faults']:#x}: must be 0")
    if summary["rendering_ticks"] == 0 and summary["ticks"] > _ARMING_TICKS:
        failures.append("rendering_ticks = 0: must be at least 1")
    if _felt_nothing(summary):
        failures.append(
            f"model_updates = {summary['model_updates']}: nothing was rendered: the tip was within the body for {summary['inside_ticks']} ticks and no local "
            f"model ever gave a force, of {summary['models_sent']} sent; a link or a computer that is too slow, or models that the board refuses, do that"
        )
    return failures


def _felt_nothing(summary: Mapping[str, Any]) -> bool:
    # Among the models taken over may be such as say that nothing is near; a graze is no touch.
    least_ticks = 1 if summary["model_updates"] == 0 else _GRAZE_TICKS
    return bool(summary["peak_force_N"] == 0.0 and summary["inside_ticks"] >= least_ticks)


def suspicions(summary: Mapping[str, Any]) -> list[str]:
    """What should not be in a run that was meant to touch a body, but may be meant; empty when nothing is."""
    found = []
    if summary["missed_deadlines"] > 0:
        found.append(f"missed_deadlines = {summary['missed_deadlines']}: must be 0")
    if summary["model_updates"] == 0 and not _felt_nothing(summary):
        found.append("model_updates = 0: must be at least 1")
    for way in ("down", "up") if summary["link_faults"] else ():
        faults = summary["link_faults"][way]
        if faults["not_reached"]:
            found.append(
                f"link.faults: faults {way} of frames that the run did not reach: {faults['not_reached']}; it had {faults['frames']:,}"
            )
    if summary["contact_ticks"] == 0:
        found.append("contact_ticks = 0: must be at least 1")
    return found
