"""What carries the link's bytes of the lock-step exchange: the peripheral whose clock the firmware has switched on."""

from typing import Protocol

from palpate.machine import can_record
from palpate.machine.stm32g474 import Stm32g474


class Link(Protocol):
    def receive(self, data: bytes) -> None:
        """Bytes of a tick for the board."""

    def take(self, limit: int) -> bytes:
        """What the board has sent, at most that many bytes: the rest stays."""


def _take(sent: bytearray, limit: int) -> bytes:
    data = bytes(sent[:limit])
    del sent[: len(data)]
    return data


class _Serial:
    """The LPUART's bytes as they are."""

    def __init__(self, chip: Stm32g474) -> None:
        self._uart = chip.lpuart

    def receive(self, data: bytes) -> None:
        self._uart.receive(data)

    def take(self, limit: int) -> bytes:
        return _take(self._uart.sent, limit)


class _Can:
    """Frames as records."""

    def __init__(self, chip: Stm32g474) -> None:
        self._controller = chip.fdcan
        self._reader = can_record.Reader()
        self._sent = bytearray()
        chip.fdcan.on_frame = lambda frame: self._sent.extend(can_record.encode(frame))

    def receive(self, data: bytes) -> None:
        self._controller.receive(self._reader.read(data))

    def take(self, limit: int) -> bytes:
        return _take(self._sent, limit)


class _Usb:
    """The bus, in records."""

    def __init__(self, chip: Stm32g474) -> None:
        self._controller = chip.usb

    def receive(self, data: bytes) -> None:
        self._controller.receive(data)

    def take(self, limit: int) -> bytes:
        return _take(self._controller.answers, limit)


def link_of(chip: Stm32g474) -> Link:
    """The link of a firmware that has started."""
    if chip.has_clock("USB"):
        return _Usb(chip)
    if chip.has_clock("FDCAN2"):
        return _Can(chip)
    return _Serial(chip)
