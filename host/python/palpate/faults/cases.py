"""The cases of the fault matrix: what goes wrong, when, and what is to come of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

# Of scenes/faults.toml: when the tip is free, sticks, slips and presses hardest.
PHASES_S = {"free": 0.2, "stick": 1.0, "slip": 1.7, "peak": 2.8}
# Faults that are not of one phase last from the first contact to the last one, which is without them.
WHOLE_S = (0.4, 4.3)
# What the scene needs to hold on a medium: tips alone are half of a trace, and on classic CAN fewer models of a smaller patch,
# whose basis crosses in time.
MEDIA: dict[str, dict[str, Any]] = {
    "uart": {},
    "can": {"link.medium": "can", "link.trace": "tip", "rates.model_update_Hz": 20.0, "model.patch_nodes": [3, 3, 2]},
    "canfd": {"link.medium": "canfd", "link.trace": "tip"},
    "usb": {"link.medium": "usb", "link.trace": "tip"},
}
# Of joint 0, shared/device/parameters.hpp; a test holds it against it.
COUNTS_PER_RAD = 4 * 1024 * 13.3 / (2.0 * math.pi)
# Frames of a flood in a tick, host/session/troubled_link.cpp; a test holds it against it.
MOST_FLOOD = 64
LINK, CUT = "link", "cut"
EXACT, MODULO, RESTART = "exact", "modulo", "restart"


@dataclass(frozen=True)
class Case:
    """One row of the matrix.

    kind: LINK, whose force is ramped, or CUT, whose outputs go off in the tick of the fault. first_s, end_s: of the fault.
    ends_mode: that the board is in at the end of the run. faults: latched then. silent: nothing of the host arrives. refused: its
    models do, and the board takes none of them. restarts: of the board, that the host must find.
    loss: how frames that were removed show as lost: each one (EXACT) or, on CAN, whose transfers have numbers of 5 bits, all but so
    many times 32 (MODULO); a board that has started again counts from there, so that what was removed need not show at it (RESTART). unseen: so many of those that a full queue has dropped need not, for nothing of their sender comes after them.
    rare: frames of ports on which nothing comes regularly (commands, pieces of bases, requests for traces), of which the last need not show either.
    displaces: on classic CAN the board has room for one model at a time, so that another host's take the place of ours, and each of ours
    that is not answered is lost.  duration_s: of the run. board: the only
    one that can show it; the firmware gives the same record on all.
    """

    name: str
    group: str
    keys: dict[str, Any]
    first_s: float
    end_s: float
    kind: str = LINK
    ends_mode: str = "render"
    faults: int = 0
    silent: bool = False
    refused: bool = False
    restarts: int = 0
    loss: str = EXACT
    unseen: int = 0
    rare: int = 0
    displaces: bool = False
    duration_s: float | None = None
    board: str | None = None
    quick: bool = False
    levels: dict[str, float] = field(default_factory=dict)


def _span(first_s: float, end_s: float, **more: Any) -> dict[str, Any]:
    return {"from_s": first_s, "to_s": end_s, **more}


def _both(**fault: Any) -> list[dict[str, Any]]:
    return [{"way": way, **fault} for way in ("down", "up")]


def _random(kind: str, percent: float, *, quick: bool = False, loss: str = EXACT) -> Case:
    first_s, end_s = WHOLE_S
    return Case(
        f"{kind} {percent:g} %",
        kind,
        {"link.faults.random": _both(kind=kind, chance=percent / 100.0, from_s=first_s, to_s=end_s)},
        first_s,
        end_s,
        loss=loss,
        quick=quick,
        levels={"percent": percent},
    )


def _delay(delay_ms: float, jitter_ms: float, *, quick: bool = False) -> Case:
    first_s, end_s = WHOLE_S
    what = f"delay {delay_ms:g} ms" if jitter_ms == 0 else f"jitter {jitter_ms:g} ms"
    fault = _span(first_s, end_s, delay_s=delay_ms / 1e3, jitter_s=jitter_ms / 1e3)
    return Case(what, "delay" if jitter_ms == 0 else "jitter", {"link.faults.delay": _both(**fault)}, first_s, end_s,
                quick=quick, levels={"delay_ms": delay_ms, "jitter_ms": jitter_ms})  # fmt: skip


def _silence(key: str, phase: str, length_s: float, *, quick: bool = False, loss: str = EXACT) -> Case:
    first_s = PHASES_S[phase]
    what = {"unplugged": "unplugged", "host_stopped": "host stopped", "babble": "babbling node", "refused": "refused"}[key]
    return Case(f"{what} {length_s:g} s, {phase}", what, {f"link.faults.{key}": [_span(first_s, first_s + length_s)]}, first_s,
                first_s + length_s, silent=True, quick=quick, loss=loss, levels={"length_s": length_s})  # fmt: skip


def _other_schema(phase: str, *, quick: bool = False) -> Case:
    first_s, length_s = PHASES_S[phase], 2.0
    return Case(f"other schema {length_s:g} s, {phase}", "schema", {"link.faults.other_schema": [_span(first_s, first_s + length_s)]},
                first_s, first_s + length_s, refused=True, quick=quick, levels={"length_s": length_s})  # fmt: skip


def _encoder(what: str, angle_rad: float, faults: int) -> Case:
    peak_s = PHASES_S["peak"]
    slip = {"tick": round(peak_s * 1000), "joint": 0, "count": round(angle_rad * COUNTS_PER_RAD)}
    return Case(f"{what}, peak", "sensor", {"board.faults.encoder_slips": [slip]}, peak_s, peak_s, kind=CUT, ends_mode="fault",
                faults=faults, levels={"angle_rad": angle_rad})  # fmt: skip


def _flood(load: float) -> Case:
    first_s, end_s = WHOLE_S
    return Case(f"flood {load:g} of the link", "flood", {"link.faults.flood": [_span(first_s, end_s, load=load)]}, first_s, end_s,
                unseen=MOST_FLOOD, levels={"load": load})  # fmt: skip


def _host_killed() -> Case:
    """Silence that latches, and time to see that it stays so."""
    peak_s, lost_s = PHASES_S["peak"], 11.5
    return Case("host killed, peak", "host killed", {"link.faults.host_stopped": [_span(peak_s, 600.0)]}, peak_s, 600.0, silent=True,
                ends_mode="fault", faults=1 << 9, duration_s=peak_s + lost_s)  # fmt: skip


def _board_reset() -> Case:
    peak_s = PHASES_S["peak"]
    return Case("board reset, peak", "board reset", {"board.faults.reset_ticks": [round(peak_s * 1000)]}, peak_s, peak_s, kind=CUT,
                ends_mode="idle", restarts=1, quick=True)  # fmt: skip


def _second_host() -> Case:
    first_s, end_s = WHOLE_S
    return Case("second host", "second host", {"link.faults.second_host": [_span(first_s, end_s)]}, first_s, end_s, displaces=True)


def all_cases(medium: str = "uart") -> tuple[Case, ...]:
    """Every case of a medium, by group."""
    return {"uart": serial_cases, "usb": usb_cases}.get(medium, can_cases)()


def serial_cases() -> tuple[Case, ...]:
    """The whole matrix."""
    peak_s = PHASES_S["peak"]
    peak_tick = round(peak_s * 1000)
    return (
        *(_random("drop", percent, quick=percent == 50) for percent in (1, 5, 10, 25, 50)),
        *(_delay(ms, 0) for ms in (10, 50, 100, 200, 500)),
        *(_delay(0, ms, quick=ms == 30) for ms in (10, 30, 100, 500)),
        *(_random("reorder", percent) for percent in (10, 50)),
        *(_random("duplicate", percent) for percent in (10, 50)),
        *(_random("flip", percent, quick=percent == 25) for percent in (5, 25)),
        *(replace(_random("truncate", percent), rare=1) for percent in (5, 25)),
        *(_flood(load) for load in (0.5, 0.9, 1.5)),
        replace(_second_host(), quick=True),
        *(
            _silence("unplugged", phase, length_s, quick=phase == "peak" and length_s == 2.0)
            for phase in PHASES_S
            for length_s in (0.1, 0.5, 2.0)
        ),
        *(_silence("host_stopped", phase, length_s) for phase in PHASES_S for length_s in (0.5, 2.0)),
        _host_killed(),
        Case("unplugged 10.5 s, stick", "unplugged", {"link.faults.unplugged": [_span(1.0, 11.5)]}, 1.0, 11.5, silent=True,
             ends_mode="fault", faults=1 << 9, duration_s=12.5),
        *(_other_schema(phase, quick=phase == "peak") for phase in ("slip", "peak")),
        # Of the limit of 0.05 rad a tick: a fifth more, and less than half, which is still faster than the tip may be.
        _encoder("encoder jump", 0.06, 1 << 3 | 1 << 4),
        _encoder("over-speed", 0.02, 1 << 4),
        _board_reset(),
        Case("emergency stop, peak", "emergency stop", {"board.faults.emergency_stop_ticks": [peak_tick]}, peak_s, peak_s,
             kind=CUT, ends_mode="fault", faults=1, quick=True),
        Case("ticks overrun, peak", "overrun", {"board.faults.overlong_ticks": [peak_tick + 4 * i for i in range(4)]}, peak_s,
             peak_s + 0.02, kind=CUT, ends_mode="fault", faults=1 << 8, duration_s=3.0, board="mps2_an386"),
    )  # fmt: skip


def can_cases() -> tuple[Case, ...]:
    """What is otherwise on a CAN bus: `drop`, `duplicate` and `flip` are of its frames, of which a transfer has many."""
    return (
        *(_random("drop", percent, loss=MODULO) for percent in (0.1, 1, 5)),
        *(_random("duplicate", percent) for percent in (10,)),
        *(_random("flip", percent, quick=percent == 10) for percent in (1, 10, 25)),
        *(_delay(ms, 0) for ms in (50, 200)),
        _delay(0, 30),
        *(_flood(load) for load in (0.5, 0.9, 1.0)),
        _second_host(),
        *(_silence("unplugged", phase, length_s, loss=MODULO) for phase, length_s in (("stick", 0.5), ("slip", 2.0), ("peak", 2.0))),
        *(_silence("host_stopped", phase, 2.0) for phase in ("slip", "peak")),
        _silence("babble", "stick", 0.5),
        _silence("babble", "peak", 2.0, quick=True),
    )


def usb_cases() -> tuple[Case, ...]:
    """What a USB bus can do: it has one host, and repeats what an error has hit."""
    lengths_s = {"free": 2.0, "stick": 0.5, "slip": 2.0, "peak": 2.0}
    # The heartbeat of the board's start goes before there is a host, so that those of 1 and 2 s, in the first phase, are not missed.
    heartbeats = {"free": 2, "stick": 0, "slip": 0, "peak": 0}
    return (
        *(_random("flip", percent, quick=percent == 10) for percent in (1, 10, 25)),
        *(_delay(ms, 0) for ms in (50, 200)),
        _delay(0, 30),
        *(
            replace(_silence(key, phase, length_s, quick=key == "unplugged" and phase == "peak"), rare=heartbeats[phase])
            for key in ("unplugged", "host_stopped")
            for phase, length_s in lengths_s.items()
        ),
        _host_killed(),
        *(_silence("refused", phase, lengths_s[phase], quick=phase == "peak") for phase in ("stick", "peak")),
        _other_schema("peak"),
        replace(_board_reset(), loss=RESTART),
    )


def chosen(names: Sequence[str] | None, quick: bool, medium: str = "uart") -> tuple[Case, ...]:
    """Those of the names, or of the groups with them; `quick`: some that stand for the rest. Empty where none is meant."""
    every = all_cases(medium)
    named = [case for case in every if not names or case.name in names or case.group in names]
    return tuple(case for case in named if case.quick or not quick)
