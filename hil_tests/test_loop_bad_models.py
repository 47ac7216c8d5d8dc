"""A model that cannot be used: Status and counter on the board, the old model goes on, the host is told."""

import struct

import pytest
from board_peer import (
    BASIS_BYTES_AT, BASIS_HEADER_BYTES, CONTACT_AT, DAMPING_AT, KIND_AT, MODES_AT, RADIUS_AT, SCHEMA_AT, STEPS_AT,
    STIFFNESS_AT, SURFACE_AT, TICK_AT, TIP_SOURCE_AT, BoardInfo, LinkCodec, Model, lockstep, parse_status, square_model,
)

OK, PAYLOAD_MALFORMED, SCHEMA_MISMATCH, TOO_LARGE, NOT_FINITE, INCONSISTENT, FROM_FUTURE = (
    0, 17, 18, 32, 33, 34, 37)
BASIS_MISSING, PART_INVALID, CRC_MISMATCH = 38, 39, 40
# square_model has 16 nodes, 3 modes and one pair of friction coefficients.
_SCALE_AT = BASIS_HEADER_BYTES + 4 * 3 * 16 + 4 * 6 * 3
_FRICTION_AT = _SCALE_AT + 4 * 3


def patched(data: bytes, at: int, kind: str, value: float) -> bytes:
    data = bytearray(data)
    struct.pack_into(kind, data, at, value)
    return bytes(data)


def state(at: int, kind: str, value: float):
    return lambda model: Model(model.basis, patched(model.state, at, kind, value))


def basis(at: int, kind: str, value: float):
    return lambda model: model.with_basis(patched(model.basis, at, kind, value))


def in_contact(model: Model, stretch_m: float = 0.0, inset_m: float = 0.0) -> Model:
    """The model with a contact that slips in a corner of triangle 0."""
    data = bytearray(model.state)
    struct.pack_into("<BxH3f3f3ff3ff", data, CONTACT_AT,
                     2, 0, 1, 0, 0, 0, 0, 0, stretch_m, 0, 0, inset_m, 0, 0, 0, 0)
    return Model(model.basis, bytes(data))


NAN = float("nan")
BAD = {
    "not a number in the friction": (basis(_FRICTION_AT, "<f", NAN), {NOT_FINITE, INCONSISTENT}),
    "infinite basis scale": (basis(_SCALE_AT, "<f", float("inf")), {NOT_FINITE}),
    "other schema": (state(SCHEMA_AT, "<Q", 1), {SCHEMA_MISMATCH}),
    "basis of another schema": (basis(0, "<Q", 1), {SCHEMA_MISMATCH}),
    "basis of another length": (basis(BASIS_BYTES_AT, "<I", 100), {INCONSISTENT}),
    "more modes than fit": (basis(MODES_AT, "<H", 1000), {TOO_LARGE}),
    "fewer modes than there are": (basis(MODES_AT, "<H", 2), {INCONSISTENT}),
    "unknown kind of surface": (basis(SURFACE_AT, "<B", 7), {INCONSISTENT}),
    "unknown source of the tip": (state(TIP_SOURCE_AT, "<B", 2), {INCONSISTENT}),
    "unknown kind": (state(KIND_AT, "<B", 3), {INCONSISTENT}),
    "step that is not a number": (state(STEPS_AT, "<f", NAN), {NOT_FINITE}),
    "tip too large": (basis(RADIUS_AT, "<f", 0.06), {INCONSISTENT}),
    "negative stiffness": (basis(STIFFNESS_AT, "<f", -1.0), {INCONSISTENT}),
    "stiffness whose inverse is infinite": (basis(STIFFNESS_AT, "<f", 1e-44), {INCONSISTENT}),
    "stiffness is not a number": (basis(STIFFNESS_AT, "<f", NAN), {INCONSISTENT}),
    "negative damping": (basis(DAMPING_AT, "<f", -1.0), {INCONSISTENT}),
    "damping is not a number": (basis(DAMPING_AT, "<f", NAN), {INCONSISTENT}),
    "stretch is not a number": (lambda m: in_contact(m, stretch_m=NAN), {NOT_FINITE}),
    "inset is not a number": (lambda m: in_contact(m, inset_m=NAN), {NOT_FINITE}),
    "inset beyond the arm's reach": (lambda m: in_contact(m, inset_m=1e20), {INCONSISTENT}),
    "cut off": (lambda m: Model(m.basis, m.state[:90]), {PAYLOAD_MALFORMED}),
    "of the future": (state(TICK_AT, "<I", 100_000), {FROM_FUTURE}),
}


@pytest.mark.parametrize("board", ["native", "mps2"])
@pytest.mark.parametrize("name", BAD)
def test_a_bad_model_is_refused_and_the_old_one_goes_on(tmp_path, board, name):
    change, statuses = BAD[name]
    with lockstep(board, tmp_path / "board") as running:
        info = BoardInfo.parse(running.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO).payload)
        good = square_model(1, running.next_tick - 1, info.schema_hash)
        running.tick(link=good.frames(0))
        assert running.run(10)["model_sequence"] == 1
        bad = change(square_model(2, running.next_tick - 1, info.schema_hash))
        running.tick(link=bad.frames(1))
        assert running.run(110)["model_sequence"] == 1
        reports = [struct.unpack("<IB3xIIf", frame.payload)[:2] for frame in running.take(LinkCodec.MODEL_REPORT)]
        assert len(reports) == 2 and reports[0] == (1, OK) and reports[1][1] in statuses, reports
        status = parse_status(running.take(LinkCodec.BOARD_STATUS)[-1].payload)
        assert (status["models_taken"], status["models_refused"]) == (1, 1)
        assert status["last_status"] == reports[1][1]
        later = square_model(3, running.next_tick - 1, info.schema_hash)
        running.tick(link=later.frames(2))
        assert running.run(10)["model_sequence"] == 3


@pytest.mark.parametrize("board", ["native", "mps2"])
def test_a_state_whose_basis_has_not_come_waits(tmp_path, board):
    """A piece is lost: the board says which blocks it misses, and the state is taken when they have come. Damaged and
    misplaced pieces are refused and said."""
    with lockstep(board, tmp_path / "board") as running:
        info = BoardInfo.parse(running.answer(LinkCodec.request(LinkCodec.GET_INFO, 5), LinkCodec.GET_INFO).payload)
        assert (info.max_springs, info.basis_slots) == (192, 3) and info.max_basis_bytes > 20_000

        def basis_reports() -> list[tuple]:
            reports = []
            for frame in running.take(LinkCodec.BASIS_REPORT):
                number, status, length, count = struct.unpack_from("<IB3xIB", frame.payload)
                held = struct.unpack_from(f"<{frame.payload[13 + count]}I", frame.payload, 14 + count)
                reports.append((number, status, length, frame.payload[13:13 + count], held))
            return reports

        model = square_model(1, running.next_tick - 1, info.schema_hash, copies=8)
        number = LinkCodec.crc32c(model.basis)
        first, *others = model.parts()
        transfers = iter(range(100))

        def send_part(part: bytes) -> None:
            running.tick(link=LinkCodec.encode(LinkCodec.MODEL_PART, next(transfers), part))
            running.run(2)

        running.tick(link=LinkCodec.encode(LinkCodec.MODEL_STATE, 0, model.state))
        running.run(2)
        assert basis_reports() == [(number, BASIS_MISSING, 0, b"", ())]
        for part in others:
            send_part(part)
        (report,) = basis_reports()
        assert report[:3] == (number, BASIS_MISSING, len(model.basis))
        assert report[3][0] == 0x0F and not any(report[3][1:])
        damaged = patched(first, 200, "<B", first[200] ^ 1)
        send_part(damaged)
        assert [report[:2] for report in basis_reports()] == [(number, CRC_MISMATCH)]
        send_part(patched(first, 8, "<H", 300))
        assert [report[:2] for report in basis_reports()] == [(number, PART_INVALID)]
        assert running.run(1)["model_sequence"] == 0
        for part in model.parts():
            send_part(part)
        assert basis_reports() == [(number, OK, len(model.basis), b"", (number,))]
        assert running.run(10)["model_sequence"] == 1
