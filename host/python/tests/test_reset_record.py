"""palpate.reset_record: words of a register into words of a person, held against the firmware and the manuals."""

import re
import xml.etree.ElementTree as ElementTree

import pytest

from palpate.machine import clock
from palpate.paths import ROOT
from palpate.reset_record import CAUSES, REASONS, WORDS, ResetRecord

SVD = ROOT.parent / "shared/stm32g474/STM32G474.svd"
SOFTWARE, PIN = 1 << 28, 1 << 26


def record(*words: int, board: str = "nucleo_g474re") -> ResetRecord:
    return ResetRecord.of(board, [*words, *[0] * (WORDS - len(words))])


def test_reasons_are_those_of_the_firmware() -> None:
    text = (ROOT / "boards/cortex_m/fault_record.hpp").read_text("utf-8")
    enumeration = text[text.index("enum class FaultReason") : text.index("struct FaultRecord")]
    numbers = {int(number) for number in re.findall(r"^  \w+ = (\d+),", enumeration, re.MULTILINE)}
    assert numbers == {0, *REASONS}


def test_causes_are_those_of_the_part() -> None:
    bits = CAUSES["nucleo_g474re"]
    for flag, text in ((clock.PIN_RESET, "reset pin"), (clock.BROWN_OUT_RESET, "power was low or off"), (clock.SOFTWARE_RESET, "software"), (clock.WATCHDOG_RESET, "watchdog")):
        assert bits[flag.bit_length() - 1] == text
    if not SVD.exists():
        pytest.skip(f"{SVD.name} is not beside the project")
    rcc = next(p for p in ElementTree.parse(SVD).getroot().iter("peripheral") if p.findtext("name") == "RCC")
    csr = next(r for r in rcc.iter("register") if r.findtext("name") == "RCC_CSR")
    flags = {int(f.findtext("bitOffset") or -1): f.findtext("name") or "" for f in csr.iter("field") if (f.findtext("name") or "").endswith("RSTF")}
    assert set(flags) == set(bits), flags
    assert [flags[bit] for bit in (25, 26, 27, 28, 29, 30, 31)] == ["OBLRSTF", "PINRSTF", "BORRSTF", "SFTRSTF", "IWDGRSTF", "WWDGRSTF", "LPWRRSTF"]


def test_what_it_says() -> None:
    said = record(SOFTWARE | PIN, 1, 3, 0x08001234, 0x8200, 0x40000000, 0xB0000000, 0, 12_345, 1 << 6 | 1)
    assert said.cause == "software, reset pin"
    assert said.fault == "processor fault at 0x08001234, CFSR 0x8200, HFSR 0x40000000, BFAR 0xb0000000"
    assert said.before == "last tick 12,345, latched: emergency stop, over current"
    assert record(SOFTWARE, 5, 700).fault == "background stuck, at tick 700"
    assert record(SOFTWARE, 3).fault == "clock lost"
    assert record(PIN, 4, 0x40021000, 0, 0, 0, 0, 2).fault == "a peripheral was not ready, waiting for register 0x40021000; 2 failed starts in a row"
    assert record(PIN, 99).fault == "reason 99"


def test_of_nothing_it_says_nothing() -> None:
    quiet = record(1 << 27 | PIN)
    assert quiet.fault == "" and "without power" in quiet.before
    assert record(0, board="another").cause == "flags 0x00000000"
    assert record(PIN, 0, 0, 0, 0, 0, 0, 0, 17).before == "last tick 17, no fault latched"


def test_bits_come_as_signed_numbers() -> None:
    assert ResetRecord.of("nucleo_g474re", [-(1 << 31), *[0.0] * 9]).cause == "low power"
    with pytest.raises(ValueError, match=r"reset\.record of nucleo_g474re: 3 values: must be 10"):
        ResetRecord.of("nucleo_g474re", [0, 0, 0])
