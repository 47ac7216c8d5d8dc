"""The images for the NUCLEO-G474RE: their budgets, and where they lie in the part. What they do: test_nucleo.py.
"""

import json
import re
import struct
import subprocess

import pytest
from board_peer import REPOSITORY

from palpate.scene_checks import NUCLEO_BAUD, NUCLEO_MAX_MODES

BOARD = "nucleo_g474re"
FOLDER = REPOSITORY / "build" / BOARD / "boards" / BOARD
FLASH, RAM = 0x08000000, 0x20000000
FIRST_BANK_BYTES, RAM_BUDGET_BYTES = 256 * 1024, 112 * 1024
SRAM1_END = 0x20014000
INTERRUPTS = 102
TIM7 = 55


def build(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        ["bash", REPOSITORY / "run", "build", *arguments], capture_output=True, text=True, check=False, timeout=600
    )


@pytest.fixture(scope="module")
def table() -> str:
    done = build("--board", BOARD)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def images(table: str) -> list:
    names = re.findall(r"^(\S+\.elf)", table, re.MULTILINE)
    wanted = {f"palpate_{BOARD}.elf", f"palpate_{BOARD}_can_classic.elf", f"palpate_{BOARD}_can_fd.elf"}
    assert wanted <= set(names) <= wanted | {f"palpate_{BOARD}_usb.elf"}, "with USB where there is TinyUSB"
    return [FOLDER / name for name in names]


def test_each_image_keeps_its_budgets(table: str, images: list) -> None:
    for name, budget in (("flash", FIRST_BANK_BYTES), ("RAM, stack included", RAM_BUDGET_BYTES)):
        rows = re.findall(rf"^  {name} +([\d,]+) +([\d,]+) ", table, re.MULTILINE)
        assert len(rows) == len(images)
        for used, allowed in rows:
            assert int(used.replace(",", "")) <= int(allowed.replace(",", "")) == budget


def test_the_worst_tick_is_measured_and_keeps_its_budget(table: str) -> None:
    pytest.importorskip("palpate._core", reason="the host is not built: ./run does it")
    assert "worst tick, slide at 10 cm/s " in table
    used, allowed = (int(number.replace(",", "")) for number in re.search(r"^  servo +([\d,]+) +([\d,]+) ", table, re.MULTILINE).groups())
    assert 60_000 < used <= allowed == 119_000  # 70 % of 170,000; the design's goal is missed (docs/decisions/cycles.md)


def test_interrupts_of_one_priority_do_not_add_up(table: str) -> None:
    """Each context that may interrupt the others brings a frame of 108 bytes; the two of the serial link are one."""
    serial = table.split(".elf")[1]
    depths = [int(depth.replace(",", "")) for depth in re.findall(r"^    \w+ +([\d,]+)$", serial, re.MULTILINE)]
    assert len(depths) == 5 and "    or dma1_channel2_handler\n" in serial
    deepest = int(re.search(r"deepest stack +([\d,]+)", serial)[1].replace(",", ""))
    assert deepest == sum(depths) + 108 * (len(depths) - 1)


def test_scenes_know_its_capacities() -> None:
    preset = next(one for one in json.loads((REPOSITORY / "CMakePresets.json").read_text())["configurePresets"] if one["name"] == BOARD)
    assert f"PALPATE_MAX_MODES={NUCLEO_MAX_MODES};" in preset["cacheVariables"]["PALPATE_CAPACITIES"]
    driver = (REPOSITORY / "boards/stm32g4/lpuart_link.hpp").read_text().replace("'", "")
    assert re.search(rf"kBaud\w* = {NUCLEO_BAUD};", driver)


def test_build_wants_a_board_that_it_knows() -> None:
    for arguments in ((), ("--board",), ("--board", "arduino"), (BOARD,)):
        done = build(*arguments)
        assert done.returncode == 2
        assert f"wants --board NAME, with NAME one of: feather_stm32f405, mps2_an386, mps2_an500, {BOARD}" in done.stderr


def symbols(image) -> dict[str, tuple[int, str]]:
    """Address and kind by name."""
    lines = subprocess.run(["arm-none-eabi-nm", image], capture_output=True, text=True, check=True).stdout.splitlines()
    found = [line.split() for line in lines]
    return {words[2]: (int(words[0], 16), words[1]) for words in found if len(words) == 3}


def test_vectors_and_memory(images: list, tmp_path) -> None:
    for image in images:
        raw = tmp_path / "image.bin"
        subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", image, raw], check=True)
        content = raw.read_bytes()
        assert len(content) <= FIRST_BANK_BYTES
        vectors = struct.unpack_from(f"<{16 + INTERRUPTS}I", content)
        known = symbols(image)
        # The stack lies at the bottom of RAM, and grows downwards out of it.
        assert vectors[0] == known["palpate_stack_top"][0] > RAM
        for vector in vectors[1:]:
            assert vector & 1 and FLASH <= vector < FLASH + len(content)
        assert vectors[1] == known["reset_handler"][0] + 1
        assert vectors[16 + TIM7] == known["tim7_handler"][0] + 1
        assert known["palpate_dma_end"][0] <= SRAM1_END


def test_what_a_debugger_reads_has_a_name(images: list) -> None:
    for image in images:
        known = symbols(image)
        for name in ("last_tick_report", "encoder_index", "fault_record", "boot_report", "clock_source"):
            address, kind = known[f"palpate_{name}"]
            assert kind in "BD" and address >= RAM
