"""What the faults that a scene asks for did in a run: spans of time, counts by kind, and what became of the outputs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.record_layout import BOARD_FAULTS
from palpate.scene_sections import TICK_S, LinkFaults, SceneFile

WAYS = ("down", "up")
# Tables of link.faults that have no kind of their own, and what a person calls them.
_NAMED = {
    "unplugged": "cable out",
    "host_stopped": "host stopped",
    "other_schema": "other schema",
    "second_host": "second host",
    "flood": "flood",
    "babble": "babbling node",
    "refused": "device refuses",
}

_COUNTED = ("dropped", "flipped", "truncated", "duplicated", "reordered", "delayed", "cut", "sent_again", "bus_offs")


@dataclass(frozen=True)
class FaultSpan:
    """One fault from from_s on, before to_s, in s of virtual time."""

    what: str
    from_s: float
    to_s: float

    def to_dict(self) -> dict[str, Any]:
        """For summary.json."""
        return {"what": self.what, "from_s": round(self.from_s, 6), "to_s": round(self.to_s, 6)}


def has_link_faults(faults: LinkFaults) -> bool:
    """Does a scene ask for any?"""
    return any(getattr(faults, name) for name in vars(faults) if name != "seed")


def faulty_sections(scene: SceneFile) -> list[str]:
    """The sections of a scene that ask for faults."""
    board = scene.board.faults
    return ["link.faults"] * has_link_faults(scene.link.faults) + ["board.faults"] * any(getattr(board, name) for name in vars(board))


def fault_spans(scene: SceneFile) -> list[FaultSpan]:
    """The faults that have a time in the scene, cut off at its end, by their beginning. Frames by number have none."""
    spans = [*_link_spans(scene.link.faults), *_board_spans(scene)]
    in_time = [FaultSpan(s.what, s.from_s, min(s.to_s, scene.duration_s)) for s in spans if s.from_s < scene.duration_s]
    return sorted(in_time, key=lambda s: (s.from_s, s.to_s, s.what))


def _link_spans(faults: LinkFaults) -> Iterator[FaultSpan]:
    for fault in faults.random:
        yield FaultSpan(f"{fault.kind} {100.0 * fault.chance:g} % {fault.way}", fault.from_s, fault.to_s)
    for late in faults.delay:
        yield FaultSpan(f"{'delay' if late.delay_s or not late.jitter_s else 'jitter'} {late.way}", late.from_s, late.to_s)
    for name, what in _NAMED.items():
        for span in getattr(faults, name):
            yield FaultSpan(what, span.from_s, span.to_s)


def _board_spans(scene: SceneFile) -> Iterator[FaultSpan]:
    faults = scene.board.faults
    for what, ticks in (
        ("emergency stop", faults.emergency_stop_ticks), ("supply low", faults.supply_low_ticks),
        ("overlong tick", faults.overlong_ticks), ("board reset", faults.reset_ticks)
    ):  # fmt: skip
        for first, last in runs(sorted(ticks)):
            yield FaultSpan(what, TICK_S * first, TICK_S * (last + 1))
    for slip in faults.encoder_slips:
        yield FaultSpan("encoder slip", TICK_S * slip.tick, scene.duration_s)


def runs(ticks: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of each run of numbers without a gap. ticks: ascending."""
    found: list[tuple[int, int]] = []
    for tick in ticks:
        if found and tick <= found[-1][1] + 1:
            found[-1] = (found[-1][0], tick)
        else:
            found.append((tick, tick))
    return found


def counts(scene: SceneFile, link: Mapping[str, Any], counters: Mapping[str, int | float]) -> dict[str, Any] | None:
    """`link_faults` of summary.json; None where the scene asks for none. link: `LoopRun.link`."""
    if not has_link_faults(scene.link.faults):
        return None
    troubles = link["troubles"]
    of_ways = {
        way: {
            **{kind: int(number) for kind, number in troubles[way].items()},
            "sent_again": int(link[way]["attempts_failed"]),
            "bus_offs": int(link[way]["bus_offs"]),
            "removed": int(link[f"frames_removed_{way}"]),
            "lost": int(counters[f"frames_lost_{way}"]),
            "not_reached": sum(frame >= troubles[way]["frames"] for frame in planned_frames(scene.link.faults, way)),
        }
        for way in WAYS
    }
    return {**of_ways, "foreign_frames": int(troubles["foreign_frames"])}


def planned_frames(faults: LinkFaults, way: str) -> list[int]:
    """The numbers of the frames that a scene asks faults of."""
    tables = (getattr(faults, f"{kind}_{way}") for kind in ("flip", "duplicate", "reorder"))
    return [*getattr(faults, f"drop_{way}"), *(fault.frame for table in tables for fault in table)]


def fault_names(bits: int) -> list[str]:
    """Of BoardStatus.faults."""
    return [name for bit, name in enumerate(BOARD_FAULTS) if bits >> bit & 1]


def outputs_off(tick: NDArray[Any], enabled: NDArray[Any], spans: Sequence[FaultSpan]) -> dict[str, Any] | None:
    """`outputs_off` of summary.json: the first time that outputs went off after they had been on. tick, enabled: (ticks,)."""
    fell = np.flatnonzero((enabled[:-1] != 0) & (enabled[1:] == 0)) + 1
    if not len(fell):
        return None
    row = int(fell[0])
    at_s = float(tick[row]) * TICK_S
    back = np.flatnonzero(enabled[row:] != 0)
    before = [span for span in spans if span.from_s <= at_s + 0.5 * TICK_S]
    return {
        "at_s": round(at_s, 6),
        "fault": before[-1].what if before else None,
        "after_s": round(at_s - before[-1].from_s, 6) if before else None,
        "on_again_s": round(float(tick[row + int(back[0])]) * TICK_S, 6) if len(back) else None,
    }


def off_spans(tick: NDArray[Any], enabled: NDArray[Any]) -> list[FaultSpan]:
    """Outputs off, from the first time on that they have been on."""
    on = np.flatnonzero(enabled != 0)
    if not len(on):
        return []
    off = [int(t) for t in np.asarray(tick)[on[0] :][np.asarray(enabled)[on[0] :] == 0]]
    return [FaultSpan("outputs off", TICK_S * first, TICK_S * (last + 1)) for first, last in runs(off)]


def rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Rows (label, text) of a run's table: what was injected, and what came of it."""
    found: list[tuple[str, str]] = []
    faults = summary.get("link_faults")
    for way, to in (("down", "the board"), ("up", "the host")):
        if not faults:
            break
        of = faults[way]
        hit = [f"{kind.replace('_', ' ')} {of[kind]:,}" for kind in _COUNTED if of[kind]]
        frames = f" (of {of['frames']:,} frames)" if of["frames"] else ""  # on USB packets are hit, and frames not looked at
        text = f"{', '.join(hit) or 'none'}{frames}; did not come {of['removed']:,}, missed {of['lost']:,}"
        found.append((f"faults injected, to {to}", text))
    if faults and faults["foreign_frames"]:
        found.append(("frames of other nodes", f"{faults['foreign_frames']:,}"))
    for i, span in enumerate(summary.get("fault_spans") or ()):
        found.append(("faults in time" if i == 0 else "", f"{span['what']}, {span['from_s']:g} to {span['to_s']:g} s"))
    if "outputs_off" in summary:
        found.append(("outputs off", _off_text(summary["outputs_off"])))
        names = ", ".join(summary["fault_names"])
        found.append(("board at the end", summary["board_mode"] + (f"; latched: {names} ({summary['faults']:#x})" if names else "")))
    return found


def _off_text(off: Mapping[str, Any] | None) -> str:
    if off is None:
        return "not before the end"
    after = f", {off['after_s']:g} s after {off['fault']} began" if off["fault"] is not None else ""
    again = "not on again" if off["on_again_s"] is None else f"on again at {off['on_again_s']:g} s"
    return f"at {off['at_s']:g} s{after}; {again}"
