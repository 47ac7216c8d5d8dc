"""The other end of an emulated board, for tests: plant and host in a few lines, independent of the project's own host.

Frames are those of boards/lockstep/exchange.hpp; link frames are Cyphal/serial as docs/protocol.md describes them.
"""

import contextlib
import os
import pathlib
import re
import select
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
import serial
from link_codec import FORM_FULL, FORM_TIP, LinkCodec, LinkFrame, LinkReader

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent
BUILD_HOST = REPOSITORY / os.environ.get("PALPATE_BUILD_HOST", "build/host")
BUILD_MPS2 = REPOSITORY / os.environ.get("PALPATE_BUILD_MPS2", "build/mps2_an386")
NATIVE_IMAGE = BUILD_HOST / "boards/native/palpate_native"
MPS2_IMAGE = BUILD_MPS2 / "boards/mps2_an386/palpate_mps2_an386.elf"
NATIVE_USB_IMAGE = NATIVE_IMAGE.with_name("palpate_native_usb")
MPS2_USB_IMAGE = MPS2_IMAGE.with_name("palpate_mps2_an386_usb.elf")
BUILD_AN500 = REPOSITORY / os.environ.get("PALPATE_BUILD_AN500", "build/mps2_an500")
BUILD_NUCLEO = REPOSITORY / os.environ.get("PALPATE_BUILD_NUCLEO", "build/nucleo_g474re")
NUCLEO_IMAGE = BUILD_NUCLEO / "boards/nucleo_g474re/palpate_nucleo_g474re.elf"
AN500_IMAGE = BUILD_AN500 / "boards/mps2_an500/palpate_mps2_an500.elf"

# boards/lockstep/exchange.hpp
EMERGENCY_STOP, SHUTDOWN, BURN_CYCLES, CRASH, SUPPLY_LOW = 1, 2, 4, 8, 32
EXIT_SHUTDOWN, EXIT_USAGE, EXIT_NO_CHANNEL, EXIT_PEER_CLOSED, EXIT_PROTOCOL_ERROR, EXIT_PROCESSOR_FAULT = range(6)
LINK_BYTES_PER_TICK = 2048
_SENSOR_MAGIC, _ACTUATOR_MAGIC = 0x314E5350, 0x31434150
_SENSOR = struct.Struct("<II3i3fII")
ACTUATOR_FRAME = np.dtype([
    ("magic", "<u4"), ("tick", "<u4"), ("next_tick", "<u4"), ("setpoint_A", "<f4", 3), ("enabled", "<u4"),
    ("tip_m", "<f4", 3), ("force_N", "<f4", 3), ("contact_mode", "<u4"), ("triangle", "<u4"),
    ("barycentric", "<f4", 3), ("normal", "<f4", 3), ("mode", "<u4"), ("faults", "<u4"), ("model_sequence", "<u4"),
    ("model_age_ticks", "<u4"), ("catch_up_ticks", "<u4"), ("missed_deadlines", "<u4"), ("background_overruns", "<u4"),
    ("tick_count", "<u4"), ("busy_count", "<u4"), ("clock_Hz", "<u4"), ("link_length", "<u4"),
    ("link", "u1", LINK_BYTES_PER_TICK)])
assert _SENSOR.size == 40 and ACTUATOR_FRAME.itemsize == 128 + LINK_BYTES_PER_TICK

# shared/status.hpp and palpate.BoardStatus
OK, PORT_UNKNOWN, SCHEMA_MISMATCH, TOKEN_WRONG = 0, 16, 18, 49
MODE_BOOT, MODE_IDLE, MODE_CALIBRATE, MODE_RENDER, MODE_FAULT, MODE_DIRECT, MODE_SUSPENDED = range(7)
FAULT_EMERGENCY_STOP, FAULT_STOP_COMMAND, FAULT_ENCODER_JUMP, FAULT_SUPPLY_LOW = 1, 2, 8, 1 << 13
# palpate.Command
ARM_REQUEST, ARM_CONFIRM, DISARM, CALIBRATE, CLEAR_FAULT, STOP = range(1, 7)

# A board that does not answer within this has hung: far above what the slowest machine needs for one tick.
_WATCHDOG_S = 20.0


BOARD_STATUS = np.dtype([
    ("sequence", "<u4"), ("schema_hash", "<u8"), ("tick", "<u4"), ("mode", "u1"), ("last_status", "u1"),
    ("faults", "<u2"), ("token", "<u4"), ("models_taken", "<u4"), ("models_refused", "<u4"),
    ("frames_received", "<u4"), ("frames_refused", "<u4"), ("frames_lost", "<u4"), ("frames_unsent", "<u4"),
    ("missed_deadlines", "<u4"), ("worst_tick_count", "<u4"), ("clock_Hz", "<u4"),
    ("trace_form", "u1"), ("trace_ticks", "u1")])
SERVO_SAMPLE = np.dtype([("tip_m", "<f4", 3), ("force_N", "<f4", 3), ("mode", "u1"), ("flags", "u1"),
                         ("triangle", "<u2")])


@dataclass(frozen=True)
class BoardInfo:
    """palpate.GetInfo response."""

    schema_hash: int
    board: str
    firmware: str
    max_modes: int
    max_basis: int
    max_nodes: int
    max_triangles: int
    max_springs: int
    max_basis_bytes: int
    basis_slots: int
    tick_rate_Hz: int
    tip_history_ticks: int

    @classmethod
    def parse(cls, payload: bytes) -> "BoardInfo":
        (schema_hash,), at = struct.unpack_from("<Q", payload), 8
        texts = []
        for _ in range(2):
            length = payload[at]
            texts.append(payload[at + 1:at + 1 + length].decode())
            at += 1 + length
        return cls(schema_hash, *texts, *struct.unpack_from("<HHBBBIBHI", payload, at))


def parse_status(payload: bytes) -> np.void:
    return np.frombuffer(payload, BOARD_STATUS, 1)[0]


def parse_trace(payload: bytes) -> tuple[int, int, np.ndarray]:
    """Returns sequence, first tick and samples."""
    sequence, first_tick, count = struct.unpack_from("<IIB", payload)
    return sequence, first_tick, np.frombuffer(payload, SERVO_SAMPLE, count, 9)


def parse_tips(payload: bytes) -> tuple[int, int, np.ndarray]:
    """Returns first tick, exponent of a step in metres, and positions (ticks, 3) in m."""
    first_tick, x, y, z, exponent, count = struct.unpack_from("<IfffbB", payload)
    offsets = np.frombuffer(payload, "<i2", 3 * count, 18).reshape(count, 3)
    steps = np.vstack([np.zeros((1, 3)), offsets])
    return first_tick, exponent, np.array([x, y, z]) + 2.0**exponent * steps


# Offsets in a basis and in a state (docs/protocol.md).
BASIS_BYTES_AT, MODES_AT, SURFACE_AT, ORIGIN_AT, RADIUS_AT, STIFFNESS_AT, DAMPING_AT = 8, 12, 20, 24, 36, 40, 44
BASIS_HEADER_BYTES = 48
SCHEMA_AT, TICK_AT, BASIS_ID_AT, KIND_AT, TIP_SOURCE_AT, CONTACT_AT, STEPS_AT = 4, 12, 16, 24, 25, 26, 86


@dataclass(frozen=True)
class Model:
    """A local model as it crosses the link: the bytes of its basis, and a palpate.ModelState."""

    basis: bytes
    state: bytes

    def with_basis(self, basis: bytes) -> "Model":
        """Another basis, and the state that belongs to it."""
        state = bytearray(self.state)
        struct.pack_into("<I", state, BASIS_ID_AT, LinkCodec.crc32c(basis))
        return Model(basis, bytes(state))

    def parts(self) -> list[bytes]:
        """The basis as palpate.ModelPart messages of 1,024 bytes."""
        number = struct.unpack_from("<I", self.state, BASIS_ID_AT)[0]
        pieces = [self.basis[at:at + 1024] for at in range(0, len(self.basis), 1024)]
        return [struct.pack("<IIHH", number, len(self.basis), 4 * i, len(piece)) + piece for i, piece in enumerate(pieces)]

    def frames(self, transfer_id: int) -> bytes:
        """Basis and state; the models of a test, as long as each other, count their transfers from 0."""
        parts = self.parts()
        return b"".join(
            [LinkCodec.encode(LinkCodec.MODEL_PART, transfer_id * len(parts) + i, part) for i, part in enumerate(parts)]
            + [LinkCodec.encode(LinkCodec.MODEL_STATE, transfer_id, self.state)])


def square_model(sequence: int, tick: int, schema_hash: int, copies: int = 1, height_m: float = -0.002) -> Model:
    """A soft flat square of 16 nodes that moves as one body: 4 cm wide, below the reference pose, at rest.

    Its three modes, one an axis, have 10 g, 400 N/m and 2 N s/m; with `copies` each is split into that many equal ones,
    which changes nothing but the work (3 * copies modes).
    """
    mass_kg, stiffness_N_m, damping_N_s_m = 0.01, 400.0, 2.0
    nodes, modes = 16, 3 * copies
    grid = np.stack(np.meshgrid(*[np.linspace(-0.02, 0.02, 4)] * 2, indexing="xy"), -1).reshape(-1, 2)
    position_m = np.column_stack([grid, np.zeros(nodes)])
    corners = [corner for row in range(3) for column in range(3) for n in [4 * row + column]
               for corner in (n, n + 1, n + 5, n, n + 5, n + 4)]
    triangles = len(corners) // 3
    # One step of q'' = -(k q + d q')/m + u, exactly: matrix exponential with the input as a third, constant state.
    exponential = scipy.linalg.expm(1e-3 * np.array(
        [[0, 1, 0], [-stiffness_N_m / mass_kg, -damping_N_s_m / mass_kg, 1], [0, 0, 0]]))
    step = exponential - np.eye(3)
    coefficient = np.tile([step[0, 0], step[0, 1], step[1, 0], step[1, 1], step[0, 2], step[1, 2]], modes)
    basis = np.zeros((nodes, 3, copies, 3), int)
    for axis in range(3):
        basis[:, axis, :, axis] = 32767
    scale = 1 / np.sqrt(mass_kg * copies) / 32767

    def array(kind: str, values) -> bytes:
        data = np.asarray(values, kind).tobytes()
        return data + bytes(-len(data) % 4)

    arrays = b"".join([
        array("<f4", position_m), array("<f4", coefficient), array("<f4", np.full(modes, scale)), array("<f4", [0.5]),
        array("<f4", [0.4]), array("<i2", basis), array("<u2", np.arange(triangles)), array("u1", corners),
        array("u1", np.zeros(triangles))])
    header = struct.pack("<QIH7B3x6f", schema_hash, BASIS_HEADER_BYTES + len(arrays), modes, nodes, nodes, triangles,
                         1, 0, 0, 0, 0, 0, height_m, 0, 0, 0)
    assert len(header) == BASIS_HEADER_BYTES
    state = struct.pack("<IQIIHHBB", sequence, schema_hash, tick, 0, 1000, 0xFFFF, 0, 0)
    # No contact, no steps, and no array: at rest.
    return Model(b"", state + bytes(60 + 16 + 4)).with_basis(header + arrays)


@dataclass
class Lockstep:
    """A running board, tick by tick."""

    process: subprocess.Popen
    actuator_fd: int
    sensor_fd: int
    answer_ticks: int = 3
    reader: LinkReader = field(default_factory=LinkReader)
    next_tick: int = 0
    sent: bytearray = field(default_factory=bytearray)  # everything that the board wrote
    frames: list[LinkFrame] = field(default_factory=list)

    def send(self, flags: int = 0, encoder: tuple = (0, 0, 0), current_A: tuple = (0.0, 0.0, 0.0), link: bytes = b"",
             tick: int | None = None) -> None:
        frame = _SENSOR.pack(_SENSOR_MAGIC, self.next_tick if tick is None else tick, *encoder, *current_A, flags,
                             len(link))
        os.write(self.sensor_fd, frame + link.ljust(LINK_BYTES_PER_TICK, b"\0"))

    def receive(self) -> np.void | None:
        """The next ActuatorFrame; None at the end of the stream."""
        data = b""
        deadline = time.monotonic() + _WATCHDOG_S
        while len(data) < ACTUATOR_FRAME.itemsize:
            if not select.select([self.actuator_fd], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise TimeoutError("the board does not answer")
            part = os.read(self.actuator_fd, ACTUATOR_FRAME.itemsize - len(data))
            if not part:
                return None
            data += part
        frame = np.frombuffer(data, ACTUATOR_FRAME, 1)[0]
        assert frame["magic"] == _ACTUATOR_MAGIC
        self.sent += data
        self.next_tick = int(frame["next_tick"])
        self.frames += self.reader.feed(bytes(frame["link"][:frame["link_length"]]))
        return frame

    def tick(self, **inputs) -> np.void:
        expected = self.next_tick
        self.send(**inputs)
        frame = self.receive()
        assert frame is not None and frame["tick"] == expected
        return frame

    def run(self, ticks: int, **inputs) -> np.void:
        for _ in range(ticks):
            frame = self.tick(**inputs)
        return frame

    def hang_up(self) -> None:
        """Closes the sensor stream; the descriptor stays ours."""
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), self.sensor_fd)

    def take(self, port: int) -> list[LinkFrame]:
        """Frames received so far on a subject or service; forgets them."""
        taken = [frame for frame in self.frames if frame.port == port]
        self.frames = [frame for frame in self.frames if frame.port != port]
        return taken

    def answer(self, request: bytes, port: int, **inputs) -> LinkFrame:
        """Sends a request in one tick and returns the response, which comes within answer_ticks."""
        self.tick(link=request, **inputs)
        self.run(self.answer_ticks - 1, **inputs)
        responses = [frame for frame in self.take(port) if frame.is_response]
        assert len(responses) == 1
        return responses[0]

    def shut_down(self) -> tuple[np.void, int]:
        frame = self.tick(flags=SHUTDOWN)
        return frame, self.process.wait(_WATCHDOG_S)


def qemu_command(*arguments: str, icount: str = "shift=3,sleep=off", program_arguments: str = "",
                 machine: str = "mps2-an386", image: pathlib.Path = MPS2_IMAGE) -> list[str]:
    """QEMU with the firmware; 8 ns an instruction unless icount says otherwise. The first serial line of `arguments` is the console, the second the
    link's UART."""
    return ["qemu-system-arm", "-M", machine, "-icount", icount, "-display", "none", "-monitor", "none",
            *arguments, "-semihosting-config", "enable=on,target=native" + program_arguments, "-kernel", str(image)]


def lockstep_command(board: str) -> list[str]:
    """Starts a board in lock-step; the FIFOs act.fifo and sen.fifo are in the working directory."""
    if board in ("native", "native_usb"):
        return [str(NATIVE_IMAGE if board == "native" else NATIVE_USB_IMAGE), "--lockstep", "act.fifo", "sen.fifo"]
    if board.startswith("mps2_can_"):
        return qemu_command("-serial", "file:console.txt", image=MPS2_IMAGE.with_name(f"palpate_mps2_an386_{board[5:]}.elf"))
    if board == "mps2_usb":
        return qemu_command("-serial", "file:console.txt", image=MPS2_USB_IMAGE)
    if board == "mps2_an500":
        return qemu_command("-serial", "file:console.txt", icount="shift=1,sleep=off", machine="mps2-an500",
                            image=AN500_IMAGE)
    if board.startswith("nucleo"):
        image = NUCLEO_IMAGE.with_stem(NUCLEO_IMAGE.stem + board.removeprefix("nucleo"))
        return [sys.executable, "-m", "palpate.machine.lockstep", str(image), "act.fifo", "sen.fifo"]
    return qemu_command("-serial", "file:console.txt")


def _open_fifo(process: subprocess.Popen, path: pathlib.Path, flags: int) -> int:
    """Opens our end as soon as the board has opened the other."""
    deadline = time.monotonic() + _WATCHDOG_S
    while time.monotonic() < deadline and process.poll() is None:
        try:
            return os.open(path, flags | os.O_NONBLOCK)
        except OSError:  # ENXIO: nobody reads yet
            time.sleep(0.005)
    raise RuntimeError(f"the board does not open {path.name} (exit code {process.poll()})")


@contextlib.contextmanager
def lockstep(board: str, folder: pathlib.Path) -> Iterator[Lockstep]:
    """Runs a board ("native", "mps2" for mps2_an386, or "mps2_an500"; "native_usb", "mps2_usb", "mps2_can_classic", "mps2_can_fd";
    "nucleo", "nucleo_usb", ... for nucleo_g474re) in `folder`, which must not hold the files of another run."""
    folder.mkdir(exist_ok=True)
    for name in ("act.fifo", "sen.fifo"):
        os.mkfifo(folder / name)
    with contextlib.ExitStack() as stack:
        process = stack.enter_context(_running(lockstep_command(board), folder))
        descriptors = []
        for name, flags in (("act.fifo", os.O_RDONLY), ("sen.fifo", os.O_WRONLY)):
            descriptors.append(_open_fifo(process, folder / name, flags))
            stack.callback(os.close, descriptors[-1])
            os.set_blocking(descriptors[-1], True)
        # Where the link is a line on which bytes take their time, an answer does.
        yield Lockstep(process, *descriptors, answer_ticks=12 if board == "nucleo" else 3)


@contextlib.contextmanager
def _running(command: list[str], folder: pathlib.Path, **options) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, **options)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class SerialHost:
    """A host on a real serial line; waits for what it expects, up to the watchdog."""

    def __init__(self, port: serial.Serial):
        self.port = port
        self._reader = LinkReader(synchronized=False)
        self._frames: list[LinkFrame] = []

    def wait_for(self, port: int, accept=lambda frame: True) -> LinkFrame:
        """The next frame on a subject or service that `accept` takes; others on that port are dropped."""
        deadline = time.monotonic() + _WATCHDOG_S
        while time.monotonic() < deadline:
            while self._frames:
                frame = self._frames.pop(0)
                if frame.port == port and accept(frame):
                    return frame
            self._frames += self._reader.feed(self.port.read(self.port.in_waiting or 1))
        raise TimeoutError(f"nothing on port {port}")


@contextlib.contextmanager
def serial_terminal(board: str, folder: pathlib.Path) -> Iterator[str]:
    """Runs a board in real time without a plant; the pseudo-terminal that is its link."""
    if board == "native":
        command, pattern = [str(NATIVE_IMAGE), "--pty"], r"^(\S+)$"
    else:
        command = qemu_command("-serial", "file:console.txt", "-serial", "pty", icount="shift=3,sleep=on",
                               program_arguments=",arg=uart")
        pattern = r"redirected to (\S+) \(label serial1\)"
    with _running(command, folder, stdout=subprocess.PIPE, text=True) as process:
        match = None
        while match is None:
            line = process.stdout.readline()  # ends when the process does
            assert line, "the board does not name its terminal"
            match = re.search(pattern, line)
        yield match[1]


@contextlib.contextmanager
def on_serial_line(board: str, folder: pathlib.Path) -> Iterator[SerialHost]:
    """The same with its terminal opened."""
    # The speed is the line's business: a pseudo-terminal has none.
    with serial_terminal(board, folder) as terminal, serial.Serial(terminal, 115200, timeout=0.1) as port:
        yield SerialHost(port)
