"""Drivers of the host on a real Linux kernel (linux_guest.py): nothing of the kernel's is imitated, only what is plugged in."""

import os
import re
from pathlib import Path

import linux_guest
import pytest
from board_peer import BUILD_HOST
from gs_usb_adapter import GsUsbAdapter
from linux_guest import CAN_MODULES, GuestError, run_in_guest, usb_port
from usb_redir import BULK_PACKET_BYTES, Identity, UsbDevice, plugged_in

# Far above what the slowest machine needs: a guest that needs it has hung.
DEADLINE_S = 300.0
pytestmark = pytest.mark.slow

VCAN0_UP = "ip link add dev vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up"
# An adapter's interface comes with the adapter. No restart-ms: gs_usb takes none, its adapters come back from bus-off by
# themselves. A short queue, so that it fills.
CAN0_UP = """until ip link show can0 >/dev/null 2>&1; do sleep 0.1; done
ip link set can0 up txqueuelen 2 type can bitrate 1000000 sample-point 0.8 dbitrate 5000000 dsample-point 0.75 fd on"""
# The kernel's hot-plug events reach libusb through it.
UDEV = "/lib/systemd/systemd-udevd --daemon"


def run_script(script, folder, **options):
    """Lines of a shell in a guest; the first that fails ends it."""
    guest = run_in_guest(["bash", "-euc", script], folder, deadline_s=DEADLINE_S, **options)
    print(guest.output)
    assert guest.exit_code == 0, guest.output
    return guest


def link_test(program, environment):
    """The line of a script that runs a GoogleTest program of host/link."""
    return f"{environment} {BUILD_HOST / 'host/link' / program}"


def assert_all_ran(guest):
    assert re.search(r"\[  PASSED  \] [1-9]", guest.output) and "SKIPPED" not in guest.output, guest.output


def watched(interface, script):
    """The script, while can-utils' candump writes what it sees on a CAN interface to the shared folder."""
    return f"""candump -L {interface} >/run/share/candump & watcher=$!
until grep -q {interface} /proc/net/can/rcvlist_all; do sleep 0.1; done
{script}
kill $watcher; wait $watcher || true"""


def frames_seen(folder):
    """Frames of `watched`, as in "1F334455#112233" and, of CAN FD with its flags, "123##1112233"."""
    return [line.split()[2] for line in (folder / "share/candump").read_text("ascii").splitlines()]


def children():
    """Processes that this one has started and not waited for."""
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


def test_a_command_sees_this_machine_and_cannot_change_it(tmp_path):
    mark = linux_guest.REPOSITORY / "written_by_a_guest"
    guest = run_in_guest(
        ["sh", "-c", f"uname -r; id -u; pwd; echo out; echo error >&2; echo kept > /run/share/file; touch {mark}; exit 7"],
        tmp_path, deadline_s=DEADLINE_S)
    release, user, folder, *rest = guest.output.splitlines()
    assert guest.exit_code == 7
    assert release == next(linux_guest.KERNEL.glob("lib/modules/*")).name
    assert user == "0" and folder == str(linux_guest.REPOSITORY)
    assert rest[:2] == ["out", "error"] and "Read-only file system" in rest[2]
    assert not mark.exists()
    assert (tmp_path / "share/file").read_text() == "kept\n"
    print(f"measured: ready after {guest.boot_s} s of its own time")


def test_a_command_that_hangs_is_ended_with_its_guest(tmp_path):
    before = children()
    with pytest.raises(GuestError, match="not done after 5 s"):
        run_in_guest(["sleep", "infinity"], tmp_path, deadline_s=5)
    assert children() == before


def test_a_guest_that_ends_early_says_so(tmp_path):
    with pytest.raises(GuestError, match=r"ended early[^$]*last words"):
        run_in_guest(["sh", "-c", "echo last words; echo o > /proc/sysrq-trigger; sleep infinity"], tmp_path,
                     deadline_s=DEADLINE_S)


def test_what_is_missing_is_named(tmp_path, monkeypatch):
    with pytest.raises(GuestError, match="has no module flux_capacitor"):
        run_in_guest(["true"], tmp_path, deadline_s=DEADLINE_S, modules=["flux-capacitor"])
    monkeypatch.setattr(linux_guest, "KERNEL", tmp_path)
    with pytest.raises(GuestError, match="holds 0 kernels, 1 is needed"):
        run_in_guest(["true"], tmp_path, deadline_s=DEADLINE_S)
    monkeypatch.setattr(linux_guest.os, "defpath", str(tmp_path))
    with pytest.raises(GuestError, match="qemu-system-x86_64 is not installed: ./run installs"):
        linux_guest._program("qemu-system-x86_64")


def test_a_device_that_finds_no_guest_is_let_go(tmp_path, monkeypatch):
    monkeypatch.setattr(linux_guest, "KERNEL", tmp_path)
    with pytest.raises(GuestError, match="kernels"), usb_port() as port, plugged_in(Echo(), port):
        run_in_guest(["true"], tmp_path, deadline_s=DEADLINE_S, usb=port)


def test_a_virtual_can_bus(tmp_path):
    guest = run_script(f"{VCAN0_UP}\n{link_test('socketcan_test', 'PALPATE_TEST_CAN=vcan0')}", tmp_path, modules=CAN_MODULES)
    assert_all_ran(guest)


def test_can_utils_see_the_frames_of_a_virtual_bus(tmp_path):
    script = link_test("socketcan_test", "PALPATE_TEST_CAN=vcan0") + " --gtest_filter=*AnotherProgramSees*"
    guest = run_script(f"{VCAN0_UP}\n{watched('vcan0', script)}", tmp_path, modules=CAN_MODULES)
    assert_all_ran(guest)
    # Flag 1: the data at the data bit rate (CANFD_BRS). Newer kernels also set 4 on every frame of CAN FD.
    classic, fd = frames_seen(tmp_path)
    assert classic == "107D552A#0001020304"
    assert re.fullmatch("00000001##[15]" + bytes(range(64)).hex().upper(), fd)


def test_a_can_adapter_on_usb(tmp_path):
    adapter = GsUsbAdapter()
    script = watched("can0", link_test("socketcan_adapter_test", "PALPATE_TEST_CAN_ADAPTER=can0"))
    with usb_port() as port, plugged_in(adapter, port):
        guest = run_script(f"{CAN0_UP}\n{script}", tmp_path, modules=CAN_MODULES, usb=port)
    assert_all_ran(guest)
    assert adapter.bit_rate("nominal") == 1e6 and adapter.bit_rate("data") == 5e6
    seen = frames_seen(tmp_path)
    for frame in ("00001010#0001020304050607", "00001011#0706050403020100"):
        assert frame in seen
    data = bytes(range(64))
    for identifier, payload in ("00001080", data), ("00001081", data[::-1]):
        assert any(re.fullmatch(f"{identifier}##[15]{payload.hex().upper()}", frame) for frame in seen)


class Echo(UsbDevice):
    """The device of host/link/usb_link_test.cpp: each frame in reverse, once its end has come."""

    identity = Identity(0x1209, 0x0001, "palpate", "usb test device", "SN0001")

    def __init__(self):
        super().__init__()
        self.times_plugged_in = 0
        self._frame = b""

    def on_plugged_in(self):
        self.times_plugged_in += 1
        self._frame = b""

    def on_bulk_out(self, data):
        self._frame += data
        if data and len(data) % BULK_PACKET_BYTES == 0:
            return  # its last packet was full: an empty one must follow
        frame, self._frame = self._frame, b""
        if frame == b"unplug":
            self.unplug()
        elif frame:
            self.send(frame[::-1])


@pytest.mark.parametrize("events", [UDEV, "true"], ids=["hot_plug_events", "no_events"])
def test_a_usb_device(tmp_path, events):
    device = Echo()
    script = link_test("usb_link_test", "PALPATE_TEST_USB=1")
    with usb_port() as port, plugged_in(device, port):
        guest = run_script(f"{events}\n{script}\nlsusb -v -d 1209:0001", tmp_path, usb=port)
    assert_all_ran(guest)
    for line in (r"idVendor +0x1209", r"iManufacturer +1 palpate", r"iProduct +2 usb test device", r"iSerial +3 SN0001",
                 r"bInterfaceClass +255", r"bEndpointAddress +0x81", r"bEndpointAddress +0x01"):
        assert re.search(line, guest.output), line
    assert device.times_plugged_in == 4  # at boot, and after each of the three times that it was pulled out
    # By the kernel, each time; the link leaves the configuration as it is.
    assert device.configurations_set == device.times_plugged_in


def test_the_command_line_runs_a_command_and_ends_with_its_code(monkeypatch, capsys):
    asked = {}

    def run(command, folder, **options):
        asked.update(options, command=command, folder=folder.is_dir())
        return linux_guest.GuestRun(7, "written\n", "")

    monkeypatch.setattr(linux_guest, "run_in_guest", run)
    assert linux_guest.main(["--module", "vcan", "--deadline", "9", "--", "ip", "-d", "link"]) == 7
    assert asked == {"command": ["ip", "-d", "link"], "modules": ["vcan"], "deadline_s": 9.0, "folder": True}
    assert capsys.readouterr().out == "written\n"
    linux_guest.main(["--", "true"])
    assert asked["modules"] == list(CAN_MODULES)

    def fail(*_, **__):
        raise GuestError("no kernel")

    monkeypatch.setattr(linux_guest, "run_in_guest", fail)
    assert linux_guest.main(["--", "true"]) == 2
    assert capsys.readouterr().err == "linux_guest.py: no kernel\n"
    for wrong in ([], ["--deadline", "0", "--", "true"], ["--modul", "--"]):
        with pytest.raises(SystemExit) as ended:
            linux_guest.main(wrong)
        assert ended.value.code == 2
