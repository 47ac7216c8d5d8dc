"""Numbers of one run of the firmware against the reference: error, contact modes, jumps, catch-up, link, instructions. Every
key is declared here; docs/frontier.md is generated."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.summary import TICKS_PER_SECOND, Key, largest_jump_N, magnitude, relative_rms_percent

Record = Mapping[str, NDArray[Any]]

_FREE = 0
_TAKEN = 0  # palpate::Status::ok

METRICS = (
    Key(
        "error_percent",
        "%",
        "root mean square of |force - reference force| over that of |reference force|, both over the ticks in which "
        "board and reference have the same contact mode; null where those have no force",
    ),
    Key("error_all_percent", "%", "the same over all ticks; null where the reference never feels a force"),
    Key("worst_error_N", "N", "largest |force - reference force| of any tick"),
    Key(
        "same_mode_percent",
        "%",
        "ticks with the same contact mode (free, stick, slip) as the reference, of those in which either has contact; null "
        "without any",
    ),
    Key(
        "jump_N",
        "N",
        "largest change of force at a change of model beyond the reference's own change (`largest_force_jump_N` in "
        "records.md); 0 without a change of model",
    ),
    Key("peak_force_N", "N", "largest magnitude of the reference force"),
    Key("contact_ticks", "ticks", "ticks in which either has contact"),
    Key("models_taken", "", "local models that the board took over"),
    Key("models_not_taken", "", "local models that it refused, dropped, or never reported"),
    Key(
        "late_ticks",
        "ticks",
        "{median, worst}: from a model's own tick to that in which the board took it over; null without any",
    ),
    Key(
        "catch_up_ticks",
        "ticks",
        "{median, worst}: ticks in which the background replayed a model, up to its take-over; null without any",
    ),
    Key("state_bytes", "bytes", "median length of a state's frame on the link; null without any"),
    Key("basis_bytes", "bytes", "frames with pieces of bases, all together"),
    Key("modes", "", "largest number of modes of a model; null without any"),
    Key("link_up_bytes_per_s", "bytes/s", "bytes to the host per second of virtual time"),
    Key("link_down_bytes_per_s", "bytes/s", "bytes to the board per second of virtual time"),
    Key(
        "tick_instructions",
        "instructions",
        "{p99, worst}: length of a servo tick in which the board has contact, from interrupt entry to exit; null on native",
    ),
    Key(
        "busy_instructions",
        "instructions",
        "{p99, worst}: servo tick and background work of one tick together, over all ticks; null on native",
    ),
    Key("background_overruns", "ticks", "ticks whose background work was not done when the next began"),
    Key("faults", "", "bits of all faults that the board latched; 0: none"),
)


def catch_up_ticks(lag_ticks: NDArray[Any], swap_rows: NDArray[Any]) -> list[int]:
    """Ticks right up to each take-over in which a model was being replayed. lag_ticks: (n,), by which it lagged at the end
    of each tick, 0 for none; swap_rows: rows of the first tick rendered from each model."""
    counts = []
    for row in swap_rows.tolist():
        before = np.flatnonzero(lag_ticks[:row] == 0)
        counts.append(int(row - 1 - (before[-1] if len(before) else -1)))
    return counts


def _spread(values: NDArray[Any] | list[int]) -> dict[str, float] | None:
    return {"median": float(np.median(values)), "worst": float(np.max(values))} if len(values) else None


def _instructions(counts: NDArray[Any], per_count: float | None) -> dict[str, int] | None:
    if per_count is None or len(counts) == 0:
        return None
    return {"p99": round(int(np.percentile(counts, 99.0)) * per_count), "worst": round(int(counts.max()) * per_count)}


def measure(record: Record, reference: Record, instructions_per_count: float | None) -> dict[str, Any]:
    """The numbers of METRICS. record: of a run; reference: `reference/force_N`, `reference/contact_mode` of the same ticks;
    instructions_per_count: of the board's clock, None where it has none."""
    force_N, reference_N = record["ticks/force_N"], reference["reference/force_N"]
    mode, reference_mode = record["ticks/contact_mode"], reference["reference/contact_mode"]
    touching = (mode != _FREE) | (reference_mode != _FREE)
    same = mode == reference_mode
    taken = record["updates/status"] == _TAKEN
    swapped = taken & (record["updates/swap_tick"] > 0)
    swap_tick = record["updates/swap_tick"][swapped].astype(np.int64)
    swap_rows = np.searchsorted(record["ticks/tick"], swap_tick)
    duration_s = (int(record["ticks/tick"][-1]) + 1) / TICKS_PER_SECOND
    # The length of a tick is known in the next one.
    tick_count = record["ticks/tick_count"][1:][mode[:-1] != _FREE]
    sent = len(record["updates/status"]) > 0
    return {
        "error_percent": relative_rms_percent(force_N[same], reference_N[same]),
        "error_all_percent": relative_rms_percent(force_N, reference_N),
        "worst_error_N": float(np.max(magnitude(force_N.astype(np.float64) - reference_N))),
        "same_mode_percent": 100.0 * float(np.mean(same[touching])) if np.any(touching) else None,
        "jump_N": largest_jump_N(force_N, reference_N, record["ticks/model_sequence"]),
        "peak_force_N": float(np.max(magnitude(reference_N))),
        "contact_ticks": int(np.count_nonzero(touching)),
        "models_taken": int(np.count_nonzero(taken)),
        "models_not_taken": int(np.count_nonzero(~taken)),
        "late_ticks": _spread(swap_tick - record["updates/tick"][swapped].astype(np.int64)),
        "catch_up_ticks": _spread(catch_up_ticks(record["ticks/catch_up_ticks"], swap_rows)),
        "state_bytes": float(np.median(record["updates/bytes"])) if sent else None,
        "basis_bytes": int(record["updates/basis_bytes"].sum(dtype=np.int64)),
        "modes": int(record["updates/modes"].max()) if sent else None,
        "link_up_bytes_per_s": float(record["ticks/link_up_bytes"].sum(dtype=np.int64)) / duration_s,
        "link_down_bytes_per_s": float(record["ticks/link_down_bytes"].sum(dtype=np.int64)) / duration_s,
        "tick_instructions": _instructions(tick_count, instructions_per_count),
        "busy_instructions": _instructions(record["ticks/busy_count"], instructions_per_count),
        "background_overruns": int(record["ticks/background_overruns"][-1]),
        "faults": int(np.bitwise_or.reduce(record["ticks/faults"])),
    }
