"""Boards that are attached to this computer: at serial ports that look like one, or where PALPATE_LINK says."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from palpate.board_link import BoardInfo, BoardLink, BoardLinkError

# A link that no search would find: of a board on the network, or a virtual one.
VARIABLE = "PALPATE_LINK"
# ST-LINK's serial ports, as on NUCLEO boards (vendor, products).
_ST_LINK = (0x0483, {0x374B, 0x374E, 0x374F, 0x3752, 0x3753})
_PRODUCT = "palpate"  # what the firmware's own USB port calls itself
_BAUD = 921_600
# Of a port on USB that is no line: hosts pace themselves by the number.
_USB_BAUD = 4_000_000
_PATIENCE_S = 1.0


@dataclass(frozen=True)
class FoundBoard:
    """A board that has answered."""

    address: str
    info: BoardInfo


def addresses(ports: Iterable[Any] | None = None) -> list[str]:
    """Where a board may be. ports: as `serial.tools.list_ports.comports()` has them (the default)."""
    if ports is None:
        try:
            from serial.tools.list_ports import comports
        except ImportError:  # no pyserial: only where it was told
            ports = []
        else:
            ports = comports()
    named = [os.environ[VARIABLE]] if os.environ.get(VARIABLE) else []
    return named + [f"serial:{port.device},{_baud(port)}" for port in ports if _may_be_a_board(port)]


def _baud(port: Any) -> int:
    return _USB_BAUD if _is_ours(port) else _BAUD


def _is_ours(port: Any) -> bool:
    return _PRODUCT in (port.product or "").lower()


def _may_be_a_board(port: Any) -> bool:
    """Others are left alone: bytes may mean something to them."""
    vendor, products = _ST_LINK
    return _is_ours(port) or (port.vid == vendor and port.pid in products)


def find_boards(patience_s: float = _PATIENCE_S, but: str | None = None) -> list[FoundBoard]:
    """Those that answer within patience_s each, and have this host's message definitions. `but`: an address that is in use."""
    found = []
    for address in addresses():
        if address == but:
            continue
        try:
            with BoardLink(address, timeout_s=patience_s) as board:
                found.append(FoundBoard(address, board.info()))
        except BoardLinkError:
            continue
    return found
