"""Versions, and `palpate doctor`: what is there is told, what is missing is named with a remedy."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import fake_core
import pytest
from command import ROOT, palpate

from palpate import __version__, cli, doctor, versions
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
