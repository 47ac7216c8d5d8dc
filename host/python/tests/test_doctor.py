"""Versions, and `palpate doctor`: what is there is told, what is missing is named with a remedy."""

import grp
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import fake_core
import pytest
from command import ROOT, palpate

from palpate import __version__, cli, doctor, kernel_links, versions
from palpate.doctor import Check, Tool
from palpate.hil import BOARDS
from palpate.versions import Firmware


def test_version_names_host_schema_and_firmware() -> None:
    done = palpate("--version")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[0] == f"palpate {__version__}"
    schema = versions.schema_text(versions.host_schema())
    assert lines[1] == f"message schema {schema}"
    assert f"firmware native: {__version__}, schema {schema}" in lines
    assert len(lines) == 2 + len(BOARDS)


def test_the_version_stands_in_one_file() -> None:
    assert (ROOT / "host/python/palpate/VERSION").read_text() == f"{__version__}\n"
    assert "host/python/palpate/VERSION" in (ROOT / "CMakeLists.txt").read_text()


def test_the_hosts_schema_is_that_of_the_definitions() -> None:
    sys.path.insert(0, str(ROOT / "shared/wire"))
    try:
        from schema_hash import schema_hash
    finally:
        sys.path.pop(0)
    assert versions.host_schema() == schema_hash(ROOT / "shared/wire/dsdl/palpate")


def identified(program: str) -> Firmware:
    """What a board is taken for that prints by this Python program."""
    return versions.identify(replace(fake_core.board(), identify=lambda _: [sys.executable, "-c", program]))


def test_images_say_what_they_are() -> None:
    assert versions.identify(fake_core.board()) == Firmware("fake", "0.1", 0x0123456789ABCDEF)
    assert "does not say" in identified("print('hello')").problem
    assert "does not say" in identified("pass").problem
    assert "calls itself other" in identified("print('palpate other 1 schema 0123456789abcdef')").problem
    gone = versions.identify(fake_core.board(image=Path("/nowhere/image.elf")))
    assert (gone.version, gone.problem) == (None, "image.elf is not built")


def test_an_image_that_goes_on_is_ended() -> None:
    said = identified("import time; print('palpate fake 2 schema 0000000000000001', flush=True); time.sleep(1000)")
    assert said == Firmware("fake", "2", 1)


def test_schemas_and_versions_that_differ_are_problems() -> None:
    good = Firmware("native", __version__, 7)
    assert doctor.check_firmware(good, 7).ok
    other = doctor.check_firmware(good, 8)
    assert not other.ok and "not the host's, 0000000000000008" in other.found and other.remedy
    assert not doctor.check_firmware(replace(good, version="0.0.1"), 7).ok
    missing = doctor.check_firmware(Firmware("native", None, None, "x is not built"), 7)
    assert not missing.ok and missing.needed and "x is not built" in missing.line() and missing.remedy in missing.line()


def test_a_board_that_run_does_not_build_is_not_needed() -> None:
    by_run = {board for board in BOARDS if doctor.check_firmware(Firmware(board, None, None, "not built"), 7).needed}
    script = (ROOT / "run").read_text("utf-8")
    built = re.search(r"for board in (mps2_[\w ]+); do\n +build \$board", script)
    assert built and by_run == {"native", *built[1].split()}
    nucleo = doctor.check_firmware(Firmware("nucleo_g474re", None, None, "not built"), 7)
    assert "-> ./run build --board nucleo_g474re builds it" in nucleo.line()


def test_tools() -> None:
    found = doctor.check_tool(Tool("cmake", "cmake", "building", True))
    assert found.ok and found.found[0].isdigit()
    lost = doctor.check_tool(Tool("no-such-program", "no-such-package", "nothing", False))
    assert not lost.ok and not lost.needed
    assert lost.line() == "problem no-such-program: not found; for nothing -> apt-get install no-such-package"


def test_packages_against_the_pins() -> None:
    pinned = doctor.pinned_packages("deb cmake\npip numpy==1.0\npip pytest[x]==2\npip no-such-thing==3\n# pip a==4\n")
    assert pinned == [("numpy", "1.0"), ("pytest", "2"), ("no-such-thing", "3")]
    checks = list(doctor.check_packages(pinned))
    assert [check.ok for check in checks] == [False, False, False, False]
    assert checks[2].found == "not installed, pinned is 3"
    assert "no-such-thing==3" in checks[2].remedy
    here = doctor.pinned_packages((ROOT / "dependencies.txt").read_text())
    assert {"numpy", "pycyphal"} <= {name for name, _ in here}


def test_display(tmp_path: Path) -> None:
    assert not doctor.check_display({}).ok
    assert not doctor.check_display({"DISPLAY": ":987654"}).ok
    assert doctor.check_display({"DISPLAY": "remote:0"}).ok
    assert doctor.check_display({"WAYLAND_DISPLAY": "wayland-0"}).ok
    assert not doctor.check_display({}).needed


class Port:
    """As pyserial lists it."""

    def __init__(self, device: str, vid: int | None) -> None:
        self.device, self.vid, self.pid, self.description = device, vid, vid, "a board"


def test_serial_ports(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from serial.tools import list_ports

    port = tmp_path / "tty"
    port.write_text("")
    monkeypatch.setattr(list_ports, "comports", lambda: [Port(str(port), 0x483), Port("/dev/ttyS0", None)])
    assert [(check.ok, check.needed) for check in doctor.check_serial_ports()] == [(True, False)]
    monkeypatch.setattr(doctor.os, "access", lambda *_: False)
    (refused,) = doctor.check_serial_ports()
    assert not refused.ok and "adduser" in refused.remedy
    monkeypatch.setattr(list_ports, "comports", lambda: [])
    assert [check.ok for check in doctor.check_serial_ports()] == [True]


def test_only_what_is_needed_decides(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    good, wish = Check("a", True, "1"), Check("b", False, "none", "get it", needed=False)
    monkeypatch.setattr(doctor, "examine", lambda: [good, wish])
    assert cli.main(["doctor"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("there; 1 more that only some commands want")
    monkeypatch.setattr(doctor, "examine", lambda: [good, replace(wish, needed=True)])
    assert cli.main(["doctor", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is False and [check["name"] for check in told["checks"]] == ["a", "b"]


def test_here_all_that_is_needed_is_there() -> None:
    done = palpate("doctor", "--json")
    told = json.loads(done.stdout)
    problems = [check for check in told["checks"] if check["needed"] and not check["ok"]]
    assert (done.returncode, problems) == (0, [])
    assert done.stderr.splitlines()[-1].startswith("palpate doctor: all that is needed is there")


# As iproute2 6.1 prints them: `ip -details -json link show` of can0 (candleLight), can1 (FD), vcan0 and a network card.
IP_SAYS = [
    {"ifname": "eth0", "flags": ["UP"], "mtu": 1500, "link_type": "ether"},
    {
        "ifname": "can0", "flags": ["NOARP", "UP", "ECHO"], "mtu": 16, "operstate": "UP", "link_type": "can",
        "linkinfo": {"info_kind": "can", "info_data": {"state": "BUS-OFF", "restart_ms": 0, "bittiming": {"bitrate": 1000000}}},
    },
    {
        "ifname": "can1", "flags": ["NOARP", "UP", "LOWER_UP", "ECHO"], "mtu": 72, "operstate": "UP", "link_type": "can",
        "linkinfo": {"info_kind": "can", "info_data": {
            "ctrlmode": ["FD"], "state": "ERROR-ACTIVE", "restart_ms": 100, "bittiming": {"bitrate": 1000000},
            "data_bittiming": {"bitrate": 5000000}}},
    },
    {"ifname": "can2", "flags": ["NOARP", "ECHO"], "mtu": 16, "link_type": "can", "linkinfo": {"info_kind": "can", "info_data": {"state": "STOPPED"}}},
    {"ifname": "vcan0", "flags": ["NOARP", "UP", "LOWER_UP"], "mtu": 72, "link_type": "can", "linkinfo": {"info_kind": "vcan"}},
]  # fmt: skip


def test_can_interfaces_are_told_as_the_kernel_has_them(monkeypatch: pytest.MonkeyPatch) -> None:
    found = kernel_links.can_interfaces(IP_SAYS)
    assert [one.text() for one in found] == [
        "up, bus-off, classic CAN, 1,000,000 bit/s",
        "up, error-active, CAN FD, 1,000,000 bit/s and 5,000,000 bit/s",
        "down, stopped, classic CAN",
        "up, virtual, CAN FD",
    ]
    monkeypatch.setattr(kernel_links, "ask_ip", lambda: found)
    checks = list(doctor.check_can())
    assert [(check.name[-5:].strip(), check.ok, check.needed) for check in checks] == [
        ("can0", False, False), ("can1", True, False), ("can2", False, False), ("vcan0", True, False)
    ]  # fmt: skip
    assert "type can restart" in checks[0].remedy and "can2 up type can bitrate" in checks[2].remedy
    monkeypatch.setattr(kernel_links, "ask_ip", lambda: None)
    assert [check.ok for check in doctor.check_can()] == [False]
    monkeypatch.setattr(kernel_links, "ask_ip", lambda: [])
    assert [check.ok for check in doctor.check_can()] == [True]


def test_what_ip_says_here_is_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("ip", path=f"{os.environ['PATH']}:/usr/sbin:/sbin"):
        assert kernel_links.ask_ip() is not None
    monkeypatch.setattr(kernel_links.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 0, stdout="no JSON"))
    assert kernel_links.ask_ip() is None


def test_usb_devices_and_the_rule(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, values in {
        "1-1": {"idVendor": "1209", "idProduct": "0001", "busnum": "1", "devnum": "12"},
        "1-2": {"idVendor": "1209", "idProduct": "0002", "busnum": "1", "devnum": "13"},
        "usb1": {},
    }.items():
        (tmp_path / name).mkdir()
        for file, text in values.items():
            (tmp_path / name / file).write_text(f"{text}\n")
    devices = kernel_links.usb_devices(tmp_path)
    assert devices == [Path("/dev/bus/usb/001/012")]
    assert kernel_links.usb_devices(tmp_path / "none") == []
    monkeypatch.setattr(kernel_links, "usb_devices", lambda: devices)
    monkeypatch.setattr(kernel_links, "installed_rule", lambda: None)
    (refused,) = doctor.check_usb()  # there is no such device here
    assert not refused.ok and not refused.needed and f"sudo cp {ROOT / kernel_links.RULE} /etc/udev/rules.d/" in refused.remedy
    monkeypatch.setattr(doctor.os, "access", lambda *_: True)
    assert [check.ok for check in doctor.check_usb()] == [True]
    (tmp_path / "70-palpate.rules").write_text("")
    monkeypatch.undo()
    assert kernel_links.installed_rule([str(tmp_path / "none"), str(tmp_path)]) == tmp_path / "70-palpate.rules"
    assert kernel_links.installed_rule([str(tmp_path / "none")]) is None


def test_the_rule_is_about_the_boards_identifiers() -> None:
    source = (ROOT / "firmware/usb/descriptors.hpp").read_text()
    vendor, product = kernel_links.BOARD_USB
    assert re.search(rf"0x{vendor}\b", source) and re.search(rf"0x{product}\b", source, re.IGNORECASE)
    lines = [line for line in (ROOT / kernel_links.RULE).read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == 2 and all(f'=="{vendor}"' in line and f'=="{product}"' in line and 'TAG+="uaccess"' in line for line in lines)
    assert int(Path(kernel_links.RULE).name[:2]) < 73
    assert kernel_links.RULE in (ROOT / "docs/links.md").read_text()


def test_the_kernel_for_tests(tmp_path: Path) -> None:
    missing = doctor.check_guest_kernel(tmp_path)
    assert not missing.ok and not missing.needed and missing.remedy
    unpacked = tmp_path / ".venv/unpacked/linux-image-amd64"
    (unpacked / "boot").mkdir(parents=True)
    (unpacked / "boot/vmlinuz-6.1.0").write_text("")
    assert not doctor.check_guest_kernel(tmp_path).ok  # without its modules
    (unpacked / "lib/modules/6.1.0").mkdir(parents=True)
    (unpacked / "lib/modules/6.1.0/modules.builtin").write_text("")
    assert doctor.check_guest_kernel(tmp_path).found == "6.1.0"


def test_who_may_open_serial_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor.os, "geteuid", lambda: 1000)
    monkeypatch.setattr(doctor.os, "getgroups", lambda: [1000])
    assert not doctor.may_open("dialout") and not doctor.may_open("no_such_group")
    monkeypatch.setattr(doctor.os, "getgroups", lambda: [1000, grp.getgrnam("dialout").gr_gid])
    assert doctor.may_open("dialout")
