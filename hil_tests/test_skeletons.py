"""The images of boards that are no more than skeletons: they build within their budgets, and say what they lack."""

import re
import struct
import subprocess

import pytest
from board_peer import REPOSITORY
from test_nucleo_images import build, symbols

BOARD = "feather_stm32f405"
IMAGE = REPOSITORY / "build" / BOARD / "boards" / BOARD / f"palpate_{BOARD}.elf"
# boards/feather_stm32f405/CMakeLists.txt: half of the flash, and 112 of the 128 KiB of RAM in one piece.
FLASH_BYTES, RAM_BYTES = 512 * 1024, 112 * 1024
FLASH, RAM = 0x08000000, 0x20000000
INTERRUPTS, TIM7 = 82, 55


@pytest.fixture(scope="module")
def built() -> subprocess.CompletedProcess:
    return build("--board", BOARD)


def test_it_builds_within_its_budgets_and_says_what_it_lacks(built: subprocess.CompletedProcess) -> None:
    assert built.returncode == 0, built.stderr
    for name, budget in (("flash", FLASH_BYTES), ("RAM, stack included", RAM_BYTES)):
        (row,) = re.findall(rf"^  {name} +([\d,]+) +([\d,]+) ", built.stdout, re.MULTILINE)
        used, allowed = (int(number.replace(",", "")) for number in row)
        assert used <= allowed == budget
    assert "worst tick: not measured: no emulation here runs this board's image with a host\n" in built.stdout
    assert "cannot be armed: it has no driver for encoders, current set-points, current monitors\n" in built.stderr


def test_vectors_and_memory(built: subprocess.CompletedProcess, tmp_path) -> None:
    raw = tmp_path / "image.bin"
    subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", IMAGE, raw], check=True)
    content = raw.read_bytes()
    vectors = struct.unpack_from(f"<{16 + INTERRUPTS}I", content)
    known = symbols(IMAGE)
    assert RAM < vectors[0] == known["palpate_stack_top"][0]
    assert vectors[1] == known["reset_handler"][0] + 1
    assert vectors[16 + TIM7] == known["tim7_handler"][0] + 1
    others = {vector for number, vector in enumerate(vectors[2:], start=2) if number not in (2, 3, 16 + TIM7)}
    assert others == {known["unexpected_handler"][0] + 1}


def test_a_folder_that_is_a_skeleton_and_armed_is_refused(tmp_path) -> None:
    """The list of boards alone (boards/cmake/known_boards.cmake), of a tree with such a folder."""
    for file in ("both/limits.hpp", "both/skeleton.txt", "one/limits.hpp", "other/skeleton.txt"):
        (tmp_path / "boards" / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "boards" / file).touch()
    (tmp_path / "CMakeLists.txt").write_text(
        f'cmake_minimum_required(VERSION 3.25)\nproject(try LANGUAGES NONE)\ninclude("{REPOSITORY}/boards/cmake/known_boards.cmake")\n'
        'message("known ${PALPATE_KNOWN_BOARDS}, skeletons ${PALPATE_SKELETON_BOARDS}")\n'
    )

    def configure() -> subprocess.CompletedProcess:
        return subprocess.run(["cmake", "-S", tmp_path, "-B", tmp_path / "build"], capture_output=True, text=True, check=False)

    refused = configure()
    assert refused.returncode != 0 and "boards/both has limits.hpp and skeleton.txt" in " ".join(refused.stderr.split())
    (tmp_path / "boards/both/skeleton.txt").unlink()
    assert "known both;one, skeletons other\n" in configure().stderr
