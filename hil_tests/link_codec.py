"""Cyphal/serial frames as docs/protocol.md describes them, independent of the project's own code; the standard library alone."""

import struct
from dataclasses import dataclass

# palpate.TraceRequest
FORM_FULL, FORM_TIP = 0, 1


def _crc16_of(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1) ^ (0x1021 if crc & 0x8000 else 0)
    return crc & 0xFFFF


def _crc32c_of(byte: int) -> int:
    crc = byte
    for _ in range(8):
        crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc


_CRC16 = [_crc16_of(byte) for byte in range(256)]
_CRC32C = [_crc32c_of(byte) for byte in range(256)]


class LinkCodec:
    """Cyphal/serial frames of single-frame transfers: 00 | COBS(header | payload | CRC-32C) | 00."""

    HOST_NODE, BOARD_NODE, BROADCAST = 10, 42, 0xFFFF
    SERVO_TRACE, BOARD_STATUS, MODEL_REPORT, BASIS_REPORT, TIP_TRACE = 1600, 1601, 1602, 1603, 1604
    MODEL_STATE, TRACE_REQUEST, MODEL_PART = 1610, 1611, 1612
    COMMAND, GET_INFO = 300, 301
    _HEADER = struct.Struct("<BBHHHQIH")

    @staticmethod
    def crc16(data: bytes) -> int:
        """CRC-16/CCITT-FALSE."""
        crc = 0xFFFF
        for byte in data:
            crc = (crc << 8 & 0xFFFF) ^ _CRC16[crc >> 8 ^ byte]
        return crc

    @staticmethod
    def crc32c(data: bytes) -> int:
        crc = 0xFFFFFFFF
        for byte in data:
            crc = crc >> 8 ^ _CRC32C[crc & 0xFF ^ byte]
        return crc ^ 0xFFFFFFFF

    @staticmethod
    def cobs_encode(data: bytes) -> bytes:
        out = bytearray()
        for group in data.split(b"\0"):
            while len(group) >= 254:
                out += b"\xff" + group[:254]
                group = group[254:]
            out += bytes([len(group) + 1]) + group
        return bytes(out)

    @staticmethod
    def cobs_decode(data: bytes) -> bytes:
        out, at = bytearray(), 0
        while at < len(data):
            code = data[at]
            out += data[at + 1:at + code]
            at += code
            if code != 0xFF and at < len(data):
                out.append(0)
        return bytes(out)

    @classmethod
    def encode(cls, specifier: int, transfer_id: int, payload: bytes, destination: int = BOARD_NODE) -> bytes:
        header = cls._HEADER.pack(1, 4, cls.HOST_NODE, destination, specifier, transfer_id, 0x80000000, 0)
        header += struct.pack(">H", cls.crc16(header))
        return b"\0" + cls.cobs_encode(header + payload + struct.pack("<I", cls.crc32c(payload))) + b"\0"

    @classmethod
    def request(cls, service: int, transfer_id: int, payload: bytes = b"") -> bytes:
        return cls.encode(0xC000 | service, transfer_id, payload)

    @classmethod
    def command(cls, transfer_id: int, action: int, token: int = 0) -> bytes:
        return cls.request(cls.COMMAND, transfer_id, struct.pack("<B3xI", action, token))

    @classmethod
    def trace_request(cls, transfer_id: int, first_tick: int, count: int, form: int = FORM_FULL, ticks: int = 4) -> bytes:
        return cls.encode(cls.TRACE_REQUEST, transfer_id, struct.pack("<IHBB", first_tick, count, form, ticks))


@dataclass(frozen=True)
class LinkFrame:
    """A frame from the board; `port` is the subject or service."""

    port: int
    transfer_id: int
    payload: bytes
    is_response: bool


class LinkReader:
    """Bytes from the board in, frames out; every frame must be good. Not synchronized: all but the first, of which only
    the end may have arrived."""

    def __init__(self, synchronized: bool = True) -> None:
        self._buffer = bytearray()
        self._synchronized = synchronized

    def feed(self, data: bytes) -> list[LinkFrame]:
        self._buffer += data
        frames = []
        while (end := self._buffer.find(0)) >= 0:
            raw = LinkCodec.cobs_decode(bytes(self._buffer[:end]))
            del self._buffer[:end + 1]
            if raw and self._synchronized:
                frames.append(self._parse(raw))
            self._synchronized = True
        return frames

    @staticmethod
    def _parse(raw: bytes) -> LinkFrame:
        payload = raw[24:-4]
        assert LinkCodec.crc16(raw[:22]) == int.from_bytes(raw[22:24], "big"), "header CRC"
        assert LinkCodec.crc32c(payload) == int.from_bytes(raw[-4:], "little"), "payload CRC"
        version, _, source, _, specifier, transfer_id, index, _ = LinkCodec._HEADER.unpack(raw[:22])
        assert (version, source, index) == (1, LinkCodec.BOARD_NODE, 0x80000000)
        assert specifier < 0xC000, "the board sends no requests"
        return LinkFrame(specifier & 0x3FFF, transfer_id, payload, bool(specifier & 0x8000))
