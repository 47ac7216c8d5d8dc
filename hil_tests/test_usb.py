"""The board's link on USB: TinyUSB in the firmware, on the native board and in QEMU, behind a host controller in Python
(usb_host.py). What a kernel and its drivers make of it: test_usb_guest.py."""

import struct
import sys

import pytest
from board_peer import (
    ARM_CONFIRM, ARM_REQUEST, BoardInfo, LinkCodec, LinkReader, MODE_IDLE, MODE_RENDER, MPS2_USB_IMAGE, NATIVE_USB_IMAGE, OK,
    REPOSITORY,
    parse_status, parse_trace, square_model)
from usb_host import PACKET_BYTES, SERIAL_IN, SERIAL_OUT, Status, Transfer, UsbError, UsbHost, VENDOR_IN, VENDOR_OUT, usb_board

sys.path.insert(0, str(REPOSITORY / "host/bench"))
import usb_cost

from palpate.machine.stm32g474 import UNIQUE_ID

pytestmark = pytest.mark.skipif(
    not NATIVE_USB_IMAGE.exists() or not MPS2_USB_IMAGE.exists(),
    reason="firmware with USB is not built: ./run test does it where cargo has unpacked the crate tinyusb-sys")
BOOT_TICKS = 25  # a few more than the firmware's 20
BOARDS = {"native_usb": "native", "mps2_usb": "mps2_an386", "nucleo_usb": "nucleo_g474re"}
# Numbers of the parts: an emulated board makes one of its name.
UNIQUE_IDS = {name: name.encode().ljust(16, b"\0") for name in BOARDS.values()} | {
    "nucleo_g474re": struct.pack("<3I", *UNIQUE_ID) + b"G474"}


class Link:
    """Cyphal over one of the board's two functions."""

    def __init__(self, host: UsbHost, out: int = VENDOR_OUT, into: int = VENDOR_IN):
        self.host, self.out, self.into = host, out, into
        self.reader = LinkReader()
        self.transfers: list[bytes] = []  # received
        self.frames = []
        self.commands = 0
        self._read()

    def _read(self, *_) -> None:
        self.host.submit(Transfer(self.into, length=16384, on_done=self._take))

    def _take(self, transfer: Transfer) -> None:
        if transfer.status is not Status.DONE:
            return
        self.transfers.append(transfer.received)
        self.frames += self.reader.feed(transfer.received)
        self._read()

    def send(self, frames: bytes) -> Transfer:
        return self.host.submit(Transfer(self.out, data=frames, zero_packet=True))

    def wait_for(self, port: int, ticks: int = 500, accept=lambda frame: True):
        for _ in range(ticks):
            while self.frames:
                frame = self.frames.pop(0)
                if frame.port == port and accept(frame):
                    return frame
            self.host.tick()
        raise TimeoutError(f"nothing on port {port}")

    def info(self, transfer_id: int) -> BoardInfo:
        self.send(LinkCodec.request(LinkCodec.GET_INFO, transfer_id))
        return BoardInfo.parse(self.wait_for(LinkCodec.GET_INFO, accept=lambda one: one.transfer_id == transfer_id).payload)

    def command(self, action: int, token: int = 0) -> bytes:
        """The answer."""
        self.commands += 1
        self.send(LinkCodec.command(self.commands, action, token))
        return self.wait_for(LinkCodec.COMMAND, accept=lambda one: one.transfer_id == self.commands).payload

    def status(self):
        return parse_status(self.wait_for(LinkCodec.BOARD_STATUS).payload)


@pytest.fixture(params=list(BOARDS))
def host(request, tmp_path):
    with usb_board(request.param, tmp_path) as one:
        one.name = BOARDS[request.param]
        yield one


def test_enumeration(host):
    host.reset()
    device = host.descriptor(1)
    assert struct.unpack_from("<HH", device, 8) == (0x1209, 0x0001)
    configuration = host.descriptor(2)
    assert len(configuration) == struct.unpack_from("<H", configuration, 2)[0]
    texts = [host.descriptor(3, index)[2:].decode("utf-16-le") for index in device[14:17]]
    assert texts == ["palpate", "palpate haptic board", UNIQUE_IDS[host.name].hex()]
    store = host.descriptor(15)
    microsoft = host.control(0xC0, store[31], 0, 7, 4096)
    assert len(microsoft) == struct.unpack_from("<H", store, 29)[0] and b"WINUSB" in microsoft
    with pytest.raises(UsbError, match="stalled"):
        host.control(0xC0, 0x55, length=4)
    with pytest.raises(UsbError, match="not answered"):
        host.receive(VENDOR_IN)
    host.configure()
    assert host.control(0x80, 8, length=1) == b"\1"
    assert host.receive(VENDOR_IN) == b""


def test_a_session_over_bulk_transfers(host):
    """Who it is, arming, a model with its basis (24 kB), the trace of every tick; a frame a transfer."""
    host.configure()
    link = Link(host)
    info = link.info(0)
    assert info.board == host.name
    host.run(BOOT_TICKS)
    unsent = link.status()["frames_unsent"]  # said before there was a host
    challenge = link.command(ARM_REQUEST)
    status, mode, token = struct.unpack("<BBxxI", challenge)
    assert (status, mode) == (OK, MODE_IDLE)
    assert struct.unpack_from("<BB", link.command(ARM_CONFIRM, token)) == (OK, MODE_RENDER)
    link.transfers.clear()
    began = host.board.next_tick
    model = square_model(1, began, info.schema_hash, copies=info.max_modes // 3)
    sent = link.send(model.frames(0))
    link.wait_for(LinkCodec.MODEL_REPORT)
    assert sent.status is Status.DONE
    took = host.board.next_tick - began
    # Full speed carries 19 packets in a tick, and this host model sends 16 every second tick.
    assert len(model.frames(0)) / PACKET_BYTES / 19 < took < 200
    ticks = set()
    for _ in range(50):
        _, first, samples = parse_trace(link.wait_for(LinkCodec.SERVO_TRACE).payload)
        ticks |= set(range(first, first + len(samples)))
    assert len(ticks) == max(ticks) - min(ticks) + 1
    asked = min(ticks) - 20
    link.send(LinkCodec.trace_request(0, asked, 16))
    again = link.wait_for(LinkCodec.SERVO_TRACE, accept=lambda one: parse_trace(one.payload)[1] == asked)
    assert len(parse_trace(again.payload)[2]) == 16
    status = link.status()
    assert (status["models_taken"], status["models_refused"]) == (1, 0)
    assert (status["frames_refused"], status["frames_lost"], status["frames_unsent"]) == (0, 0, unsent)
    assert all(one[0] == one[-1] == 0 and 0 not in one[1:-1] for one in link.transfers)


def test_the_serial_line_and_back(host):
    host.configure()
    vendor = Link(host)
    assert vendor.info(0).board == host.name
    host.set_line_state(True)
    serial = Link(host, SERIAL_OUT, SERIAL_IN)
    assert serial.info(1).board == host.name
    host.run(20)
    vendor.frames.clear()
    host.run(50)
    assert vendor.frames == [] and len(serial.frames) > 10
    # Who asks is answered where he asks.
    assert vendor.info(2).board == host.name
    host.set_line_state(False)
    assert vendor.status()["frames_refused"] == 0


def test_pulled_out_while_it_talks(host):
    host.configure()
    for time in range(3):
        link = Link(host)
        assert link.info(2 * time).board == host.name
        link.send(LinkCodec.request(LinkCodec.GET_INFO, 2 * time + 1) * 50)
        host.run(1 + time)
        host.unplug()
        host.run(300)
        host.configure()
    again = Link(host)
    assert again.info(6).board == host.name
    # A trace every 4 ticks and more, three times for 300 of them.
    assert 3 * 300 / 4 <= again.status()["frames_unsent"] < 2 * 3 * 300 / 4


def test_a_run_repeats_to_the_byte_and_boards_say_the_same(tmp_path):
    def once(board, number):
        with usb_board(board, tmp_path / f"{board}_{number}") as host:
            host.configure()
            link = Link(host)
            link.info(0)
            host.run(200)
            host.set_line_state(True)
            host.run(100)
            traces = [frame.payload for frame in link.frames if frame.port == LinkCodec.SERVO_TRACE]
            return bytes(host.board.sent), traces

    first, second, native = once("mps2_usb", 1), once("mps2_usb", 2), once("native_usb", 1)
    assert first == second
    assert len(first[1]) > 40 and first[1] == native[1]


def test_what_a_packet_costs_the_board(tmp_path):
    """Instructions in QEMU, which counts the same every time; docs/links.md has them. A tenth more is room for the compiler's."""
    cost = usb_cost.measure(tmp_path)
    print(cost)
    assert cost["per_packet_sent"] < 1.1 * 2455
    assert cost["more_per_packet_received"] < 1.1 * 2340
    assert 0 < cost["background_per_tick_nobody_reads"] - cost["background_per_tick_on_bytes"] < 1.1 * 1028
