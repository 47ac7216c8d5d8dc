"""The image for the Feather STM32F405, a skeleton, on register models of the part (palpate.machine.stm32f405): it starts, ticks and answers, and
cannot be armed. Nothing here has run on silicon."""

import pytest
from board_peer import (
    ARM_CONFIRM, ARM_REQUEST, CALIBRATE, CLEAR_FAULT, FAULT_EMERGENCY_STOP, FAULT_SUPPLY_LOW, MODE_FAULT, OK, REPOSITORY, BoardInfo, parse_status,
)  # fmt: skip
from link_codec import LinkCodec, LinkFrame, LinkReader

pytest.importorskip("unicorn", reason="Unicorn is not installed: ./run does it")

from palpate.machine.part import Image
from palpate.machine.peripheral import MachineError
from palpate.machine.stm32f405 import CLOCK_Hz, FLASH_BYTES, POWER_RESET, SOFTWARE_RESET, UNIQUE_ID, WATCHDOG_RESET, Stm32f405

BOARD = "feather_stm32f405"
IMAGE = REPOSITORY / "build" / BOARD / "boards" / BOARD / f"palpate_{BOARD}.elf"
pytestmark = pytest.mark.skipif(not IMAGE.exists(), reason=f"the image for {BOARD} is not built: ./run does it")

MILLISECOND = CLOCK_Hz // 1000
ENABLE, EMERGENCY_STOP = 6, 7  # pins of port C
FAULTS_WITHOUT_DRIVERS = 4 | FAULT_SUPPLY_LOW  # not_a_number: nobody measures currents, nor watches the supply
RECORD_PROCESSOR = 1


class Board:
    """The part with its chain closed and a host on its line. `enables`: levels that its enable pin has been driven to."""

    def __init__(self, has_crystal: bool = True) -> None:
        self.part = Stm32f405(Image.read(IMAGE, FLASH_BYTES))
        self.part.rcc.has_crystal = has_crystal
        self.ticks = 0
        self.enables: set[bool | None] = set()
        port = self.part.gpio["C"]
        port.outside[EMERGENCY_STOP] = False
        port.changed = lambda: self.enables.add(port.driven(ENABLE))
        self.part.tick_timer.on_update = self._count
        self._reader, self._transfer = LinkReader(), 0

    def _count(self) -> None:
        self.ticks += 1

    def run(self, ticks: int) -> None:
        """Until that many more have begun; at most twice their time, and what a start takes."""
        until = self.ticks + ticks
        assert self.part.run(lambda: self.ticks >= until, (2 * ticks + 100) * MILLISECOND)

    def hear(self) -> list[LinkFrame]:
        """What has come since the last call."""
        frames = self._reader.feed(bytes(self.part.usart.sent))
        self.part.usart.sent.clear()
        return frames

    def word(self, symbol: str, index: int = 0) -> int:
        return int.from_bytes(self.part.core.load(self.part.image.symbols[symbol] + 4 * index, 4), "little")

    def answer(self, service: int, payload: bytes = b"") -> LinkFrame:
        self._transfer += 1
        self.part.usart.receive(LinkCodec.request(service, self._transfer, payload))
        for _ in range(50):
            self.run(1)
            for frame in self.hear():
                if frame.is_response and (frame.port, frame.transfer_id) == (service, self._transfer):
                    return frame
        raise AssertionError(f"no answer to service {service}")

    def command(self, action: int) -> int:
        return self.answer(LinkCodec.COMMAND, action.to_bytes(8, "little")).payload[0]

    def status(self):
        """The next one: ten a second."""
        self.hear()
        self.run(110)
        return parse_status([frame for frame in self.hear() if frame.port == LinkCodec.BOARD_STATUS][-1].payload)


@pytest.fixture(scope="module")
def board() -> Board:
    board = Board()
    board.run(2)  # until its receiver is on
    return board


@pytest.mark.parametrize("has_crystal", [True, False])
def test_starts_at_168_MHz_and_ticks_each_millisecond(has_crystal: bool) -> None:
    board = Board(has_crystal)
    board.run(2)
    assert board.part.rcc.system_Hz == 168_000_000 and board.part.rcc.apb1_divider == 4
    assert board.part.rcc.value["PLLCFGR"] >> 22 & 1 == has_crystal
    assert board.word("palpate_clock_source") == (not has_crystal)
    first = board.part.cycle
    board.run(100)
    assert board.part.cycle - first == pytest.approx(100 * MILLISECOND, abs=MILLISECOND // 100)
    assert board.part.resets == 0
    assert board.part.usart.baud == pytest.approx(921_600, rel=0.01)
    assert board.word("palpate_boot_report") == POWER_RESET


def test_says_who_it_is(board: Board) -> None:
    info = BoardInfo.parse(board.answer(LinkCodec.GET_INFO).payload)
    assert (info.board, info.max_modes, info.tick_rate_Hz) == (BOARD, 96, 1000)
    node = board.answer(430).payload  # uavcan.node.GetInfo
    assert b"".join(word.to_bytes(4, "little") for word in UNIQUE_ID) + b"F405" in node
    assert board.part.usart.lost == 0


def test_cannot_be_armed(board: Board) -> None:
    """Not by a host that asks no matter what the board is called."""
    status = board.status()
    assert (status["mode"], status["faults"]) == (MODE_FAULT, FAULTS_WITHOUT_DRIVERS)
    assert status["missed_deadlines"] == 0 and status["clock_Hz"] == CLOCK_Hz // 2
    for action in (CLEAR_FAULT, CALIBRATE, ARM_REQUEST, ARM_CONFIRM):
        assert board.command(action) != OK, action
    status = board.status()
    assert (status["mode"], status["faults"], status["token"]) == (MODE_FAULT, FAULTS_WITHOUT_DRIVERS, 0)
    assert board.enables <= {None, False} and board.part.gpio["C"].driven(ENABLE) is False


def test_a_broken_wire_of_the_emergency_stop_is_seen(board: Board) -> None:
    assert not board.status()["faults"] & FAULT_EMERGENCY_STOP
    board.part.gpio["C"].outside[EMERGENCY_STOP] = None
    assert board.status()["faults"] == FAULTS_WITHOUT_DRIVERS | FAULT_EMERGENCY_STOP


def test_the_watchdog_bites_when_the_tick_stops() -> None:
    board = Board()
    board.run(5)
    before = board.part.cycle
    board.part.core.stall(30 * MILLISECOND)
    board.run(3)
    assert board.part.resets == 1
    assert board.part.cycle_of_reset - before >= 15 * MILLISECOND
    assert board.word("palpate_boot_report") & WATCHDOG_RESET


def test_a_processor_fault_resets_and_leaves_a_record() -> None:
    board = Board()
    board.run(5)
    board.part.core.crash()
    board.run(3)
    assert board.part.resets == 1
    assert board.word("palpate_boot_report") & SOFTWARE_RESET
    assert board.word("palpate_boot_report", 2) == RECORD_PROCESSOR  # behind the flags: check, reason


@pytest.mark.parametrize(
    ("address", "value", "message"),
    [
        (0x40023C00, 0x700, "too few"),  # FLASH_ACR without wait states, found when the clock is chosen
        (0x40007000, 0, "scale 1"),  # PWR_CR
    ],
)
def test_the_models_are_strict(address: int, value: int, message: str) -> None:
    """What start_clock() has set is taken back before SW is written: the model of the RCC notices."""
    board = Board()
    board.run(2)
    part = board.part
    part.core.write_register(address, value)
    with pytest.raises(MachineError, match=message):
        part.core.write_register(0x40023808, part.rcc.value["CFGR"])


def test_a_stream_with_old_flags_does_not_start(board: Board) -> None:
    dma = board.part.dma
    dma.value["S3CR"] = 0
    dma.value["LISR"] |= 1 << 27
    with pytest.raises(MachineError, match="flags of its last transfer"):
        dma._write_control(3, 1 << 10 | 1)
    dma.value["LISR"] = 0
