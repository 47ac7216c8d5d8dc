"""A Cortex-M4F: Unicorn runs the instructions, this runs time, exceptions and the bus.

Time is counted in cycles of the processor's clock. An instruction takes a fixed number of them (docs/decisions/cycles.md has the bound),
and what happens outside happens between blocks of code, so that a run is repeatable to the bit.
"""

import ctypes
import heapq
import itertools
import struct
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import unicorn as _unicorn
from unicorn import arm_const as arm
from unicorn.unicorn_py3 import unicorn as binding

from palpate.machine.nvic import HARD_FAULT, SVCALL, Nvic
from palpate.machine.peripheral import MachineError, Responder

# Without types.
unicorn: Any = _unicorn
_COUNTER = Path(__file__).with_name("palpate_block_counter.so")
_NEVER = 1 << 62
_PAGE = 0x100
_THREAD = 0
_NOTHING_THERE = 0xB0000000
# EXC_RETURN: to thread or handler mode on the main stack, with or without a frame of the FPU.
_RETURN_THREAD, _RETURN_HANDLER, _WITHOUT_FPU = 0xFFFFFFE9, 0xFFFFFFE1, 0x10
_FPCA = 1 << 2  # of CONTROL
# Unicorn's numbers: undefined instruction, aborts of a fetch and of data, usage faults.
_INTERRUPT_SVC, _INTERRUPT_EXCEPTION_EXIT, _INTERRUPT_FAULTS = 2, 8, (1, 3, 4, 10, 18)
_FRAME = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR)
_SINGLES = tuple(arm.UC_ARM_REG_S0 + i for i in range(16))


class _BlockCounter(ctypes.Structure):
    """As in host/machine/block_counter.cpp."""

    _fields_ = [
        ("instructions", ctypes.c_uint64),
        ("limit", ctypes.c_uint64),
        ("address", ctypes.c_uint32),
        ("stopped", ctypes.c_uint32),
        ("code", ctypes.c_void_p),
        ("base", ctypes.c_uint32),
        ("size", ctypes.c_uint32),
        ("stop", ctypes.c_void_p),
    ]


class Core:
    """Processor, flash and RAM. The last data_bytes of the flash, multiples of 4 KiB, hold no code: loads and stores go to load_flash and program_flash. ram: bytes by address.
    cycles_per_instruction: of every instruction alike."""

    def __init__(
        self, flash_base: int, flash: bytearray, data_bytes: int, ram: dict[int, int], cycles_per_instruction: Fraction
    ) -> None:
        self.flash_base, self.flash = flash_base, flash
        self._cycles, self._instructions = cycles_per_instruction.as_integer_ratio()
        self._slept_cycles = 0
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._pages: dict[int, Responder] = {}
        self._failure: BaseException | None = None
        self._left_by: int | None = None  # Unicorn's number of what ended a run, see _on_interrupt
        self._asleep = False
        self._held_off = False  # an exception waits that PRIMASK keeps out
        self.nvic = Nvic(self)
        self.on_return: Callable[[int], None] = lambda number: None  # an exception's handler has ended

        self._uc: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        uc = self._uc
        uc.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M4)
        self._flash_memory = (ctypes.c_char * len(flash)).from_buffer(flash)
        code_bytes = len(flash) - data_bytes
        for base_address in (flash_base, 0):  # the processor boots from an alias
            uc.mem_map_ptr(base_address, code_bytes, unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC, self._flash_memory)
        self.program_flash: Callable[[int, bytes], None] = self._no_programming
        self.load_flash: Callable[[int, int], bytes] = self.load
        uc.mmio_map(flash_base + code_bytes, data_bytes, self._load_data, code_bytes, self._store_data, code_bytes)
        for base, size in ram.items():
            uc.mem_map(base, size)
        uc.hook_add(unicorn.UC_HOOK_INTR, self._on_interrupt)
        self._counter = counter = _BlockCounter()
        counter.code = ctypes.addressof(self._flash_memory)
        counter.base, counter.size = flash_base, len(flash)
        counter.stop = ctypes.cast(binding.uclib.uc_emu_stop, ctypes.c_void_p).value
        if not _COUNTER.exists():
            raise MachineError(f"{_COUNTER.name} is missing beside {__name__}: ./run builds it")
        library = ctypes.CDLL(str(_COUNTER))
        hook = ctypes.c_size_t()
        status = binding.uclib.uc_hook_add(
            uc._uch,
            ctypes.byref(hook),
            ctypes.c_int(unicorn.UC_HOOK_BLOCK),
            ctypes.cast(library.palpate_count_block, ctypes.c_void_p),
            ctypes.byref(counter),
            ctypes.c_uint64(1),  # begin after end: everywhere
            ctypes.c_uint64(0),
        )
        if status != unicorn.UC_ERR_OK:
            raise MachineError(f"Unicorn takes no hook: {status}")

    # Time

    @property
    def instructions(self) -> int:
        """Run so far, by whole blocks."""
        return int(self._counter.instructions)

    @property
    def cycle(self) -> int:
        """Since power came on."""
        return self._slept_cycles + self._counter.instructions * self._cycles // self._instructions  # type: ignore[no-any-return]

    def after(self, cycles: int, action: Callable[[], None]) -> None:
        """Calls `action` that many cycles from now, between two blocks of code."""
        heapq.heappush(self._events, (self.cycle + max(cycles, 0), next(self._order), action))
        self.look_again()

    def stall(self, cycles: int) -> None:
        """Time passes in which no instruction is executed."""
        self._slept_cycles += cycles
        self.look_again()

    def look_again(self) -> None:
        """Something has changed: ends the present block's successors until events and interrupts are looked at."""
        self._counter.limit = 0

    # Memory

    def attach(self, peripheral: Responder) -> None:
        """Its registers answer from now on. Ranges are multiples of 256 bytes."""
        for page in range(peripheral.base // _PAGE, (peripheral.base + peripheral.BYTES - 1) // _PAGE + 1):
            if page in self._pages:
                raise MachineError(f"{peripheral.name} lies where {self._pages[page].name} is")
            self._pages[page] = peripheral

    def map_bus(self, base: int, size: int) -> None:
        """Loads and stores of this range go to peripherals."""

        def load(_: Any, offset: int, length: int, __: Any) -> int:
            return self._guarded(lambda: self.read_register(base + offset, length))

        def store(_: Any, offset: int, length: int, value: int, __: Any) -> None:
            self._guarded(lambda: self.write_register(base + offset, value, length))

        self._uc.mmio_map(base, size, load, None, store, None)

    def _load_data(self, _: Any, offset: int, length: int, first: int) -> int:
        return self._guarded(lambda: int.from_bytes(self.load_flash(self.flash_base + first + offset, length), "little"))

    def _store_data(self, _: Any, offset: int, length: int, value: int, first: int) -> None:
        self._guarded(lambda: self.program_flash(self.flash_base + first + offset, value.to_bytes(length, "little")))

    def _no_programming(self, address: int, data: bytes) -> None:
        raise MachineError(f"store of {len(data)} bytes to flash at {address:#010x}")

    def _at(self, address: int) -> Responder:
        peripheral = self._pages.get(address // _PAGE)
        if peripheral is None:
            raise MachineError(f"access to {address:#010x} from {self._counter.address:#010x}: nothing is modelled there")
        return peripheral

    def read_register(self, address: int, length: int = 4) -> int:
        """As the processor loads it. Raises MachineError for what no model knows."""
        peripheral = self._at(address)
        return peripheral.read(address - peripheral.base, length)

    def write_register(self, address: int, value: int, length: int = 4) -> None:
        """As the processor stores it. Raises MachineError for what no model knows."""
        peripheral = self._at(address)
        peripheral.write(address - peripheral.base, length, value)

    def _guarded(self, action: Callable[[], Any]) -> int:
        # An exception in a callback from C would be lost: kept, and raised by run().
        try:
            return action() or 0
        except BaseException as error:
            self._failure = self._failure or error
            self._uc.emu_stop()
            return 0

    def load(self, address: int, length: int) -> bytes:
        """Bytes of flash or RAM."""
        if self.flash_base <= address < self.flash_base + len(self.flash):
            return bytes(self.flash[address - self.flash_base : address - self.flash_base + length])
        return bytes(self._uc.mem_read(address, length))

    def store(self, address: int, data: bytes) -> None:
        """Into RAM, as DMA does."""
        self._uc.mem_write(address, data)

    # Execution

    def reset(self) -> None:
        """Registers and exceptions as after a reset; memory stays as it is."""
        self.nvic.reset()
        self._events.clear()
        self._asleep = False
        stack, start = struct.unpack("<II", self.load(self.flash_base, 8))
        for register in (*_FRAME, *(arm.UC_ARM_REG_R4 + i for i in range(8))):
            self._uc.reg_write(register, 0)
        for register, value in (
            (arm.UC_ARM_REG_IPSR, 0),
            (arm.UC_ARM_REG_CONTROL, 0),
            (arm.UC_ARM_REG_PRIMASK, 0),
            (arm.UC_ARM_REG_BASEPRI, 0),
            (arm.UC_ARM_REG_FPSCR, 0),
            (arm.UC_ARM_REG_SP, stack),
            (arm.UC_ARM_REG_LR, 0xFFFFFFFF),
            (arm.UC_ARM_REG_PC, start),
        ):
            self._uc.reg_write(register, value)

    def crash(self) -> None:
        """The next instruction is where nothing is."""
        self._uc.reg_write(arm.UC_ARM_REG_PC, _NOTHING_THERE | 1)

    def run(self, until: Callable[[], bool], limit_cycles: int) -> bool:
        """Runs until `until` is true between two blocks, at most for limit_cycles; false: not in that time. Raises MachineError for what no
        model knows, SystemReset when the firmware asks for one."""
        end = self.cycle + limit_cycles
        while not until():
            now = self.cycle
            if now >= end:
                return False
            if self._events and self._events[0][0] <= now:
                heapq.heappop(self._events)[2]()
                continue
            if self._take_exception():
                continue
            next_event = min(self._events[0][0] if self._events else _NEVER, end)
            if self._asleep:
                self._slept_cycles += next_event - now
                continue
            # One that is held off is taken as soon as it is let: looked at after each block.
            self._execute(1 if self._held_off else next_event - now)
        return True

    def _execute(self, cycles: int) -> None:
        counter = self._counter
        counter.limit = counter.instructions + max(1, -(-cycles * self._instructions // self._cycles))
        counter.stopped = 0
        self._left_by = None
        pc = self._uc.reg_read(arm.UC_ARM_REG_PC)
        try:
            self._uc.emu_start(pc | 1, 0xFFFFFFFF)
        except unicorn.UcError as error:
            self._raise_failure()
            self._fault(str(error))
            return
        self._raise_failure()
        if self._left_by == _INTERRUPT_EXCEPTION_EXIT:
            self._leave(self._uc.reg_read(arm.UC_ARM_REG_PC))
        elif self._left_by == _INTERRUPT_SVC:
            self._enter(SVCALL)
        elif self._left_by in _INTERRUPT_FAULTS:
            self._fault(f"exception {self._left_by} of the processor")
        elif self._left_by is not None:
            raise MachineError(f"Unicorn's interrupt {self._left_by} at {self._uc.reg_read(arm.UC_ARM_REG_PC):#010x}")
        elif not counter.stopped:
            self._asleep = True  # WFI is what else ends a run

    def _fault(self, what: str) -> None:
        """All faults are hard faults: the others are not enabled."""
        at = self._uc.reg_read(arm.UC_ARM_REG_PC)
        self.nvic.note_bus_fault(at)
        if self.nvic.active and self.nvic.active[-1] == HARD_FAULT:
            raise MachineError(f"lock-up: {what} at {at:#010x} in the hard-fault handler")
        self._enter(HARD_FAULT)

    def _raise_failure(self) -> None:
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def _on_interrupt(self, _: Any, number: int, __: Any) -> None:
        self._left_by = number
        self._uc.emu_stop()

    # Exceptions (Armv7-M manual, B1.5)

    def _take_exception(self) -> bool:
        self._held_off = False
        number = self.nvic.highest_pending()
        if number is None:
            return False
        self._asleep = False  # also where PRIMASK holds it off
        if self._uc.reg_read(arm.UC_ARM_REG_PRIMASK) & 1:
            self._held_off = True
            return False
        base_priority = self._uc.reg_read(arm.UC_ARM_REG_BASEPRI)
        if not self.nvic.preempts(number, base_priority):
            return False
        self.nvic.acknowledge(number)
        self._enter(number)
        return True

    def _enter(self, number: int) -> None:
        uc = self._uc
        self._asleep = False
        with_fpu = bool(uc.reg_read(arm.UC_ARM_REG_CONTROL) & _FPCA)
        stack = uc.reg_read(arm.UC_ARM_REG_SP)
        status = uc.reg_read(arm.UC_ARM_REG_XPSR)
        aligned = stack & 4
        frame = struct.pack(
            "<8I",
            *(uc.reg_read(register) for register in _FRAME),
            uc.reg_read(arm.UC_ARM_REG_PC),
            status & ~(1 << 9) | (1 << 9 if aligned else 0),
        )
        if with_fpu:
            singles = (uc.reg_read(register) for register in _SINGLES)
            frame += struct.pack("<18I", *singles, uc.reg_read(arm.UC_ARM_REG_FPSCR), 0)
        stack = stack - aligned - len(frame)
        self.store(stack, frame)
        uc.reg_write(arm.UC_ARM_REG_SP, stack)
        came_from = _RETURN_HANDLER if self.nvic.active else _RETURN_THREAD
        uc.reg_write(arm.UC_ARM_REG_LR, came_from if with_fpu else came_from | _WITHOUT_FPU)
        uc.reg_write(arm.UC_ARM_REG_CONTROL, uc.reg_read(arm.UC_ARM_REG_CONTROL) & ~_FPCA)
        uc.reg_write(arm.UC_ARM_REG_FPSCR, self.nvic.default_fpscr)
        self.nvic.active.append(number)
        uc.reg_write(arm.UC_ARM_REG_IPSR, number)
        (handler,) = struct.unpack("<I", self.load(self.nvic.vector_table + 4 * number, 4))
        uc.reg_write(arm.UC_ARM_REG_PC, handler)

    def _leave(self, return_code: int) -> None:
        uc = self._uc
        number = self.nvic.active.pop()
        stack = uc.reg_read(arm.UC_ARM_REG_SP)
        words = struct.unpack("<8I", self.load(stack, 32))
        length = 32
        # Its lowest bit is gone from the program counter.
        if not return_code & _WITHOUT_FPU:
            floats = struct.unpack("<17I", self.load(stack + 32, 68))
            for register, word in zip(_SINGLES, floats, strict=False):
                uc.reg_write(register, word)
            uc.reg_write(arm.UC_ARM_REG_FPSCR, floats[16])
            length = 104
        status = words[7]
        for register, word in zip(_FRAME, words, strict=False):
            uc.reg_write(register, word)
        uc.reg_write(arm.UC_ARM_REG_SP, stack + length + (4 if status & 1 << 9 else 0))
        uc.reg_write(arm.UC_ARM_REG_IPSR, self.nvic.active[-1] if self.nvic.active else _THREAD)
        control = uc.reg_read(arm.UC_ARM_REG_CONTROL) & ~_FPCA
        uc.reg_write(arm.UC_ARM_REG_CONTROL, control if return_code & _WITHOUT_FPU else control | _FPCA)
        uc.reg_write(arm.UC_ARM_REG_XPSR_NZCVQG, status)
        uc.reg_write(arm.UC_ARM_REG_PC, words[6] | 1)
        self.nvic.returned(number)
        self.on_return(number)


