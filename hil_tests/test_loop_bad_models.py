"""A model that cannot be used: Status and counter on the board, the old model goes on, the host is told."""

import struct

import pytest
from board_peer import LinkCodec, BoardInfo, lockstep, parse_status, square_model

OK, PAYLOAD_MALFORMED, SCHEMA_MISMATCH, TOO_LARGE, NOT_FINITE, INCONSISTENT, TOO_OLD, FROM_FUTURE = (
    0, 17, 18, 32, 33, 34, 35, 37)
_TICK_AT, _FRICTION_AT, _MODES_AT, _SURFACE_AT = 12, 415, 18, 38
_RADIUS_AT, _STIFFNESS_AT, _DAMPING_AT, _TIP_SOURCE_AT, _CONTACT_AT = 34, 39, 43, 47, 49


def patched(model: bytes, at: int, kind: str, value: float) -> bytes:
    data = bytearray(model)
    struct.pack_into(kind, data, at, value)
    return bytes(data)


def in_contact(model: bytes, stretch_m: float = 0.0, inset_m: float = 0.0) -> bytes:
    """The model with a contact that slips in a corner of triangle 0."""
    data = bytearray(model)
    struct.pack_into("<BxH3f3f3ff3ff", data, _CONTACT_AT,
                     2, 0, 1, 0, 0, 0, 0, 0, stretch_m, 0, 0, inset_m, 0, 0, 0, 0)
    return bytes(data)


BAD = {
    "not a number in the friction": (lambda m: patched(m, _FRICTION_AT, "<f", float("nan")), {NOT_FINITE, INCONSISTENT}),
    "infinite basis scale": (lambda m: m[:-2 - 16 * 3 * 3 * 2 - 4] + struct.pack("<f", float("inf"))
                             + m[-2 - 16 * 3 * 3 * 2:], {NOT_FINITE}),
    "other schema": (lambda m: patched(m, 4, "<Q", 1), {SCHEMA_MISMATCH}),
    "more modes than fit": (lambda m: patched(m, _MODES_AT, "<H", 1000), {TOO_LARGE}),
    "unknown kind of surface": (lambda m: patched(m, _SURFACE_AT, "<B", 7), {INCONSISTENT}),
    "unknown source of the tip": (lambda m: patched(m, _TIP_SOURCE_AT, "<B", 2), {INCONSISTENT}),
    "tip too large": (lambda m: patched(m, _RADIUS_AT, "<f", 0.06), {INCONSISTENT}),
    "negative stiffness": (lambda m: patched(m, _STIFFNESS_AT, "<f", -1.0), {INCONSISTENT}),
    "stiffness whose inverse is infinite": (lambda m: patched(m, _STIFFNESS_AT, "<f", 1e-44), {INCONSISTENT}),
    "stiffness is not a number": (lambda m: patched(m, _STIFFNESS_AT, "<f", float("nan")), {INCONSISTENT}),
    "negative damping": (lambda m: patched(m, _DAMPING_AT, "<f", -1.0), {INCONSISTENT}),
    "damping is not a number": (lambda m: patched(m, _DAMPING_AT, "<f", float("nan")), {INCONSISTENT}),
    "stretch is not a number": (lambda m: in_contact(m, stretch_m=float("nan")), {NOT_FINITE}),
    "inset is not a number": (lambda m: in_contact(m, inset_m=float("nan")), {NOT_FINITE}),
    "inset beyond the arm's reach": (lambda m: in_contact(m, inset_m=1e20), {INCONSISTENT}),
    "cut off": (lambda m: m[:100], {PAYLOAD_MALFORMED, INCONSISTENT}),
    "of the future": (lambda m: patched(m, _TICK_AT, "<I", 100_000), {FROM_FUTURE}),
}


@pytest.mark.parametrize("board", ["native", "mps2"])
@pytest.mark.parametrize("name", BAD)
def test_a_bad_model_is_refused_and_the_old_one_goes_on(tmp_path, board, name):
    change, statuses = BAD[name]
    with lockstep(board, tmp_path / "board") as running:
        info = BoardInfo.parse(running.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO).payload)
        good = square_model(1, running.next_tick - 1, info.schema_hash)
        running.tick(link=LinkCodec.encode(LinkCodec.LOCAL_MODEL, 0, good))
        assert running.run(10)["model_sequence"] == 1
        bad = change(square_model(2, running.next_tick - 1, info.schema_hash))
        running.tick(link=LinkCodec.encode(LinkCodec.LOCAL_MODEL, 1, bad))
        assert running.run(110)["model_sequence"] == 1
        reports = [struct.unpack("<IB3xII", frame.payload)[:2] for frame in running.take(LinkCodec.MODEL_REPORT)]
        assert len(reports) == 2 and reports[0] == (1, OK) and reports[1][1] in statuses, reports
        status = parse_status(running.take(LinkCodec.BOARD_STATUS)[-1].payload)
        assert (status["models_taken"], status["models_refused"]) == (1, 1)
        assert status["last_status"] == reports[1][1]
        later = square_model(3, running.next_tick - 1, info.schema_hash)
        running.tick(link=LinkCodec.encode(LinkCodec.LOCAL_MODEL, 2, later))
        assert running.run(10)["model_sequence"] == 3
