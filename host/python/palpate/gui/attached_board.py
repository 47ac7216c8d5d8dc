"""What an attached board says of itself before the loop takes its link: who it is, what it keeps of its calibration, and why it started last
(docs/protocol.md, "Registers")."""

from dataclasses import dataclass

from palpate.board_link import BoardLink, BoardLinkError, Register
from palpate.calibration.command import FIELDS
from palpate.reset_record import REGISTER, ResetRecord

# A board answers within some ms; one that does not is looked for by the loop itself.
_TIMEOUT_s = 1.0


@dataclass(frozen=True)
class AttachedBoard:
    """name: as its image is called. registers: three values each, of base, upper arm and forearm. reset: None where it keeps no record.
    trouble: why nothing is known, or ""."""

    name: str = ""
    registers: tuple[Register, ...] = ()
    reset: ResetRecord | None = None
    trouble: str = ""


def ask(address: str) -> AttachedBoard:
    """The board at this address."""
    try:
        with BoardLink(address, timeout_s=_TIMEOUT_s) as board:
            name = board.info().board
            registers = tuple(board.read_register(field) for field in FIELDS)
            kept = board.find_register(REGISTER)
            return AttachedBoard(name, registers, None if kept is None else ResetRecord.of(name, kept.values))
    except (BoardLinkError, ValueError) as error:
        return AttachedBoard(trouble=str(error))
