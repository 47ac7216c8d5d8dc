"""Runs in a guest of linux_guest.py, beside a board in its USB port (test_usb_guest.py): what a host does with it, by the
kernel's drivers. Prints what it measures; an error ends it.

    usb_guest.py MODEL    the bytes of a board_peer.Model: the length of its basis (4), basis, state
"""

import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import serial
from link_codec import LinkCodec, LinkReader

from palpate import BoardLink, BoardState, _core

ADDRESS = "usb:1209:0001"
TERMINAL = "/dev/ttyACM0"
DEADLINE_S = 60.0  # only a failure waits for it
ROUND_TRIPS = 100
MEASURED_S = 0.5
STATE_TICK_AT = 12
PIECE_BYTES = 1024


def wait(what: str, done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while not done():
        assert time.monotonic() < deadline_s, what
        time.sleep(0.01)


def open_link() -> _core.Transport:
    """As soon as the device is there."""
    deadline_s = time.monotonic() + DEADLINE_S
    while True:
        try:
            return _core.Transport(ADDRESS)
        except RuntimeError:
            assert time.monotonic() < deadline_s, "it does not come again"
            time.sleep(0.01)


def send_model(link: BoardLink, file: Path) -> BoardState:
    """A basis, and states that are the present until one of them has come before it was too old. Returns the board's state."""
    packed = file.read_bytes()
    (length,) = struct.unpack_from("<I", packed)
    basis, model = packed[4:4 + length], bytearray(packed[4 + length:])
    for number, at in enumerate(range(0, length, PIECE_BYTES)):
        piece = basis[at:at + PIECE_BYTES]
        part = struct.pack("<IIHH", LinkCodec.crc32c(basis), length, at // 256, len(piece)) + piece
        assert link._link.write(LinkCodec.encode(LinkCodec.MODEL_PART, number, part))
    deadline_s = time.monotonic() + DEADLINE_S
    sequence = 0
    while (state := link.state()).models_taken == 0:
        assert time.monotonic() < deadline_s, state
        struct.pack_into("<I", model, 0, sequence + 1)
        struct.pack_into("<I", model, STATE_TICK_AT, state.tick)
        assert link._link.write(LinkCodec.encode(LinkCodec.MODEL_STATE, sequence, bytes(model)))
        sequence += 1
    return state


def a_session(model: Path) -> None:
    """The project's host code over libusb: who it is, a round trip, arming, a model and its fate, traces."""
    with BoardLink(ADDRESS, timeout_s=DEADLINE_S) as link:
        info = link.info()
        print(f"board {info.board}")
        while link.state().mode == "boot":
            pass
        begun_s = time.monotonic()
        for _ in range(ROUND_TRIPS):
            link.info()
        print(f"measured: {ROUND_TRIPS / (time.monotonic() - begun_s):.0f} round trips a second")
        link.arm(DEADLINE_S)
        state = link.state()
        assert state.mode == "render", state
        begun_s = time.monotonic()
        send_model(link, model)
        print(f"measured: a model of {model.stat().st_size} bytes taken after {time.monotonic() - begun_s:.2f} s")
        first, begun_s = link.state(), time.monotonic()
        while time.monotonic() < begun_s + MEASURED_S:
            last = link.state()
        print(f"measured: {(last.tick - first.tick) / MEASURED_S:.0f} ticks of the board a second")
        assert last.tip_m is not None and last.force_N is not None
        assert (last.mode, last.faults, last.frames_refused) == ("render", 0, 0), last
        counters = link._endpoint.counters
        print(f"host's counters: {counters}")
    print("session done")


def the_serial_line() -> None:
    with serial.Serial(TERMINAL, 4_000_000, timeout=DEADLINE_S) as port:
        port.reset_input_buffer()
        # The first frame may have begun before the line was open.
        reader, frames = LinkReader(synchronized=False), []
        port.write(LinkCodec.request(LinkCodec.GET_INFO, 1))
        deadline_s = time.monotonic() + DEADLINE_S
        while not any(frame.port == LinkCodec.GET_INFO for frame in frames):
            assert time.monotonic() < deadline_s, "no answer on the serial line"
            frames += reader.feed(port.read(port.in_waiting or 1))
        while sum(frame.port == LinkCodec.SERVO_TRACE for frame in frames) < 20:
            assert time.monotonic() < deadline_s, "no traces on the serial line"
            frames += reader.feed(port.read(port.in_waiting or 1))
    print("serial line done")


def a_port_reset() -> None:
    done = subprocess.run(["usbreset", "1209:0001"], capture_output=True, text=True, check=False)
    print(done.stdout + done.stderr)
    assert done.returncode == 0
    with BoardLink(ADDRESS, timeout_s=DEADLINE_S) as link:
        link.info()
    print("port reset done")


def pulled_out_while_it_talks() -> None:
    for time_out in range(1, 3):
        link = open_link()
        Path(f"/run/share/unplug_{time_out}").touch()
        number, deadline_s = 10, time.monotonic() + DEADLINE_S
        while link.is_open:
            assert time.monotonic() < deadline_s, "pulled out, and the link is open"
            link.write(LinkCodec.request(LinkCodec.GET_INFO, number))
            link.read(0.001)
            number += 1
        assert not link.write(b"\0")
        del link
        again = open_link()
        del again
        with BoardLink(ADDRESS, timeout_s=DEADLINE_S) as board:
            print(f"back at tick {board.state().tick}: {board.info().board}")
    wait("no terminal after it came again", Path(TERMINAL).exists)
    print("replugged")


wait("no terminal", Path(TERMINAL).exists)
a_session(Path(sys.argv[1]))
the_serial_line()
a_port_reset()
pulled_out_while_it_talks()
