"""CAN frames as bytes, as the lock-step exchange carries them (shared/wire/can_record.hpp)."""

import binascii

from palpate.machine.fdcan import LENGTHS, CanFrame

_EXTENDED, _FD, _ZERO = 1 << 31, 1 << 30, 1 << 29
_HEAD_BYTES, _CHECK_BYTES = 5, 2
_CRC_START = 0xFFFF


def encode(frame: CanFrame) -> bytes:
    code = LENGTHS.index(len(frame.data))
    head = (frame.identifier | _EXTENDED | (_FD if frame.is_fd else 0)).to_bytes(4, "little")
    record = head + bytes((code | (~code & 15) << 4,)) + frame.data
    return record + binascii.crc_hqx(record, _CRC_START).to_bytes(2, "big")


class Reader:
    """Bytes to frames; bytes that are no record are passed over."""

    def __init__(self) -> None:
        self._held = b""

    def read(self, data: bytes) -> list[CanFrame]:
        self._held += data
        frames = []
        at = 0
        while len(self._held) - at >= _HEAD_BYTES:
            word, lengths = int.from_bytes(self._held[at : at + 4], "little"), self._held[at + 4]
            code = lengths & 15
            end = at + _HEAD_BYTES + LENGTHS[code] + _CHECK_BYTES
            if lengths >> 4 != ~code & 15 or not word & _EXTENDED or word & _ZERO:
                at += 1
            elif end > len(self._held):
                break
            elif binascii.crc_hqx(self._held[at:end], _CRC_START) != 0:
                at += 1
            else:
                frames.append(CanFrame(word & 0x1FFFFFFF, self._held[at + _HEAD_BYTES : end - _CHECK_BYTES], bool(word & _FD)))
                at = end
        self._held = self._held[at:]
        return frames
