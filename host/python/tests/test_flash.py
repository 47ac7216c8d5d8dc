"""`palpate flash`: the command lines of the programs that write a part, what they get, and what is said when they fail."""

import json
import os
import stat
from pathlib import Path

import pytest

from palpate import cli, hil
from palpate.flash import BOARD, flat
from palpate.machine.part import Image

IMAGE = hil.BOARDS[BOARD].image
pytestmark = pytest.mark.skipif(not IMAGE.exists(), reason="the image for nucleo_g474re is not built: ./run does it")


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is the whole PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


def make_tool(folder: Path, name: str, code: int = 0) -> Path:
    """A program that notes its arguments, and keeps the last file that it is given."""
    notes = folder / f"{name}.notes"
    script = f'#!/bin/sh\nfor one; do echo "$one" >>{notes}; case "$one" in *.bin) /bin/cp "$one" {folder}/written.bin;; esac; done\necho no probe >&2\nexit {code}\n'
    (folder / name).write_text(script)
    (folder / name).chmod(stat.S_IRWXU)
    return notes


def test_openocd_programs_verifies_and_starts_the_image(tools: Path) -> None:
    notes = make_tool(tools, "openocd")
    make_tool(tools, "st-flash")
    assert cli.main(["flash", "--board", BOARD]) == cli.OK
    said = notes.read_text().split("\n")
    assert said[:5] == ["-f", "interface/stlink.cfg", "-f", "target/stm32g4x.cfg", "-c"]
    assert said[5] == f"program {{{IMAGE}}} verify reset exit"


@pytest.mark.parametrize(("tool", "place"), [("st-flash", "0x08000000"), ("dfu-util", "0x08000000:leave")])
def test_others_get_the_image_as_it_lies_in_flash(tools: Path, tool: str, place: str, capsys: pytest.CaptureFixture[str]) -> None:
    notes = make_tool(tools, tool)
    assert cli.main(["flash", "--board", BOARD, "--medium", "canfd", "--json"]) == cli.OK
    assert place in notes.read_text().split("\n")
    image = Image.read(IMAGE.with_stem(f"{IMAGE.stem}_can_fd"))
    assert (tools / "written.bin").read_bytes() == flat(image)
    answer = json.loads(capsys.readouterr().out)
    assert answer["tool"] == tool and answer["succeeded"] and answer["image_bytes"] == len(flat(image))
    assert answer["identity"].startswith(f"palpate {BOARD} ")


def test_a_failure_is_told_with_what_the_program_said(tools: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_tool(tools, "st-flash", code=1)
    assert cli.main(["flash", "--board", BOARD]) == cli.FAILED
    assert "st-flash has failed; it said:\nno probe" in capsys.readouterr().err


def test_without_a_program_nothing_is_done(tools: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["flash", "--board", BOARD, "--by", "dfu-util"]) == cli.BAD_INPUT
    assert "palpate flash: dfu-util: no such program: must be one of openocd, st-flash, dfu-util, on the PATH" in capsys.readouterr().err


def test_openocd_itself_knows_the_part_and_misses_the_probe(capsys: pytest.CaptureFixture[str]) -> None:
    """The real program, as far as it goes without hardware: it reads its files for the part, and finds no ST-LINK."""
    if any("0483" in file.read_text() for file in Path("/sys/bus/usb/devices").glob("*/idVendor")) or "PALPATE_PROBE" in os.environ:
        pytest.skip("an ST-LINK is there: it would be flashed")
    assert cli.main(["flash", "--board", BOARD, "--by", "openocd"]) == cli.FAILED
    said = capsys.readouterr().err
    assert "Open On-Chip Debugger" in said and "open failed" in said
