"""The board's own USB on a real Linux kernel: the firmware in QEMU outside, its device in the port of a guest (usb_board.py),
and in the guest the kernel, its drivers, lsusb, and the project's host code over libusb (the session with its body, kernel_session.py)
and the serial line (usb_guest.py)."""

import re
import struct

import pytest
from board_peer import MPS2_USB_IMAGE, REPOSITORY, BoardInfo, LinkCodec, LinkReader, square_model
from kernel_session import TICK_s, pressing_plant, with_a_board
from linux_guest import run_in_guest, usb_port
from usb_board import UsbBoard
from usb_host import SERIAL_IN, SERIAL_OUT, usb_board
from usb_redir import plugged_in

pytestmark = [pytest.mark.slow, pytest.mark.skipif(
    not MPS2_USB_IMAGE.exists(),
    reason="firmware with USB is not built: ./run test does it where cargo has unpacked the crate tinyusb-sys")]
# Far above what the slowest machine needs: a guest that needs it has hung.
DEADLINE_S = 300.0
# usbutils' words for what it cannot make sense of or cannot get.
COMPLAINTS = re.compile(r"can't get|cannot|unrecognized|unknown|warning|invalid|too short|junk|error", re.IGNORECASE)


def test_the_board_on_a_real_kernel(tmp_path):
    """One guest, since its start is most of the time."""
    plant = pressing_plant()
    with usb_board("mps2_usb", tmp_path / "board", plant) as host:
        model = tmp_path / "model"
        packed = square_model(1, 0, schema_hash(host), copies=64)
        model.write_bytes(struct.pack("<I", len(packed.basis)) + packed.basis + packed.state)
        (tmp_path / "guest").mkdir()

        share = tmp_path / "guest/share"

        def is_pulled_out() -> bool:
            """The guest makes a file each time that it wants that, and one when the session begins."""
            if board.plant is None and (share / "session").exists():
                board.move(plant, TICK_s)
            return (share / f"unplug_{board.times_plugged_in}").exists()

        board = UsbBoard(host, is_pulled_out)
        script = f"""until [ -e /dev/ttyACM0 ]; do sleep 0.1; done
lsusb -v -d 1209:0001
export PYTHONPATH={REPOSITORY}/host/python:{REPOSITORY}/hil_tests
{REPOSITORY}/.venv/bin/python {REPOSITORY}/hil_tests/usb_guest.py {model}
touch /run/share/session
{with_a_board("serial", "usb:1209:0001")}
dmesg | grep -E 'usb 1-1|cdc_acm'"""
        with usb_port() as port, plugged_in(board, port):
            guest = run_in_guest(["bash", "-euc", script], tmp_path / "guest", deadline_s=DEADLINE_S, modules=["cdc-acm"], usb=port)
    print(guest.output)
    assert guest.exit_code == 0, guest.output
    # 3 mm deep, where a node meets some 300 N/m.
    assert re.search(r"session: \d+ of \d+ models taken over", guest.output)
    assert board.largest_force_N > 0.3
    descriptors, session = guest.output.split("board mps2_an386", 1)
    assert not COMPLAINTS.search(descriptors), COMPLAINTS.search(descriptors)
    for line in (
        r"idVendor +0x1209", r"idProduct +0x0001", r"iManufacturer +1 palpate", r"iProduct +2 palpate haptic board",
        rf"iSerial +3 {b'mps2_an386'.ljust(16, bytes(1)).hex()}", r"bNumInterfaces +3", r"bInterfaceClass +255", r"bEndpointAddress +0x81",
        r"bEndpointAddress +0x01", r"Interface Association", r"bFunctionSubClass +2 Abstract", r"CDC Union", r"bEndpointAddress +0x82",
        r"PlatformCapabilityUUID +\{d8dd60df-4589-4cc7-9cd2-659d9e648a9f\}",
    ):
        assert re.search(line, descriptors), line
    for line in ("session done", "serial line done", "port reset done", "replugged", r"cdc_acm .*ttyACM0: USB ACM device"):
        assert re.search(line, session), line
    assert board.times_plugged_in == 3
    # The firmware ran through all of it: it is still the one that was started.
    first, second = (int(tick) for tick in re.findall(r"back at tick (\d+)", session))
    assert first < second


def schema_hash(host) -> int:
    """As the board itself says it, on the serial line."""
    host.configure()
    host.set_line_state(True)
    host.send(SERIAL_OUT, LinkCodec.request(LinkCodec.GET_INFO, 0))
    reader = LinkReader()
    while True:
        for frame in reader.feed(host.receive(SERIAL_IN)):
            if frame.port == LinkCodec.GET_INFO:
                return BoardInfo.parse(frame.payload).schema_hash
