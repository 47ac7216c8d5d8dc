"""What an attached board keeps of its calibration, for the window: read once, before the loop takes its link (docs/protocol.md,
"Registers")."""

from dataclasses import dataclass

from palpate.board_link import BoardLink, BoardLinkError, Register
from palpate.calibration.command import FIELDS

# A board answers within some ms; one that does not is looked for by the loop itself.
_TIMEOUT_s = 1.0


@dataclass(frozen=True)
class BoardRegisters:
    """registers: three values each, of base, upper arm and forearm. trouble: why there are none, or ""."""

    registers: tuple[Register, ...] = ()
    trouble: str = ""


def read_registers(address: str) -> BoardRegisters:
    """Of the board at this address."""
    try:
        with BoardLink(address, timeout_s=_TIMEOUT_s) as board:
            return BoardRegisters(tuple(board.read_register(name) for name in FIELDS))
    except BoardLinkError as error:
        return BoardRegisters(trouble=str(error))
