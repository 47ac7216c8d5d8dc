"""The register models (palpate.machine) refuse what the part does not allow: each check of docs/flashed_image.md, broken once."""

from collections.abc import Callable

import pytest

pytest.importorskip("unicorn", reason="Unicorn, which runs the image for the STM32G474, is not installed: ./run does it")

from palpate.machine.peripheral import MachineError
from palpate.machine.part import Image
from palpate.machine.stm32g474 import Stm32g474

RCC, FLASH, PWR = 0x40021000, 0x40022000, 0x40007000
TIM2, DAC1, ADC1, IWDG, FDCAN2, USB = 0x40000000, 0x50000800, 0x50000000, 0x40003000, 0x40006800, 0x40005C00
CR, CFGR, PLLCFGR, AHB2ENR, APB1ENR1 = RCC, RCC + 0x08, RCC + 0x0C, RCC + 0x4C, RCC + 0x58
# Crystal by 6, times 85, by 2: 170 MHz.
PLL_170_MHz = 3 | 5 << 4 | 85 << 8 | 1 << 24
DATA = 0x0807F000  # of the flash, behind the code


@pytest.fixture
def chip() -> Stm32g474:
    """Waits for interrupts: `wfi; b .-2`."""
    code = (0x20001000).to_bytes(4, "little") + (0x08000009).to_bytes(4, "little") + bytes.fromhex("30bffde7")
    return Stm32g474(Image(((0x08000000, code),), {}))


def run(chip: Stm32g474, cycles: int = 10_000) -> None:
    chip.run(lambda: False, cycles)


def clocks(chip: Stm32g474) -> None:
    """Of all peripherals."""
    for register in (RCC + 0x48, AHB2ENR, APB1ENR1, RCC + 0x5C, RCC + 0x60):
        chip.core.write_register(register, 0xFFFFFFFF)


def pll(chip: Stm32g474) -> None:
    clocks(chip)
    chip.core.write_register(CR, 1 << 16 | 1 << 8)
    run(chip)
    chip.core.write_register(PLLCFGR, PLL_170_MHz)
    chip.core.write_register(CR, 1 << 24 | 1 << 16 | 1 << 8)
    run(chip)


def slow_flash(chip: Stm32g474) -> None:
    pll(chip)
    chip.core.write_register(PWR + 0x80, 0)  # boost
    chip.core.write_register(FLASH, 3)
    chip.core.write_register(CFGR, 3)


def no_boost(chip: Stm32g474) -> None:
    pll(chip)
    chip.core.write_register(FLASH, 4)
    chip.core.write_register(CFGR, 3)


def moving_pll(chip: Stm32g474) -> None:
    pll(chip)
    chip.core.write_register(PLLCFGR, PLL_170_MHz + (1 << 8))


def busy_dac(chip: Stm32g474) -> None:
    clocks(chip)
    chip.core.write_register(DAC1 + 0x3C, 2 << 14)
    chip.core.write_register(DAC1, 1)
    chip.core.write_register(DAC1 + 0x3C, 0)


def early_adc(chip: Stm32g474) -> None:
    clocks(chip)
    chip.core.write_register(ADC1 + 0x08, 1 << 28)
    chip.core.write_register(ADC1 + 0x08, 1 << 28 | 1)
    chip.core.write_register(ADC1 + 0x08, 1 << 28 | 1 | 1 << 2)


def format_with_its_key(chip: Stm32g474) -> None:
    clocks(chip)
    chip.core.write_register(FDCAN2 + 0x18, 1)
    chip.core.write_register(FDCAN2 + 0x18, 1 << 8 | 1 << 1 | 1)


def unkeyed_bit_times(chip: Stm32g474) -> None:
    clocks(chip)
    chip.core.write_register(FDCAN2 + 0x1C, 0)


def usb_without_clock(chip: Stm32g474) -> None:
    clocks(chip)
    chip.core.write_register(USB + 0x58, 1 << 15)


def locked_flash(chip: Stm32g474) -> None:
    chip.flash.program(DATA, bytes(4))


def odd_word(chip: Stm32g474) -> None:
    clocks(chip)
    for key in (0x45670123, 0xCDEF89AB):
        chip.core.write_register(FLASH + 0x08, key)
    chip.core.write_register(FLASH + 0x14, 1)
    chip.flash.program(DATA + 4, bytes(4))


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (lambda chip: chip.core.read_register(TIM2 + 0x24), "access to TIM2 while its clock is off .*APB1ENR1, bit 0"),
        (lambda chip: chip.core.read_register(0x40007C00), "access to 0x40007c00 .*nothing is modelled there"),
        (lambda chip: chip.core.read_register(RCC + 0x90), "load from RCC . 0x90 .*no model has this register"),
        (lambda chip: chip.core.write_register(CFGR, 3), "RCC_CFGR: SW = 3 chooses a clock that is not ready"),
        (lambda chip: chip.core.write_register(IWDG + 0x04, 3), "IWDG_PR is written without its key"),
        (slow_flash, "170000000 Hz with 3 wait states"),
        (no_boost, "SYSCLK of 170000000 Hz: over 150 MHz only with boost"),
        (moving_pll, "RCC_PLLCFGR is written while the PLL is on"),
        (busy_dac, "DAC1_MCR is written while a channel is on"),
        (early_adc, "ADC1_CR: started before it was ready"),
        (format_with_its_key, "FDCAN_CCCR: the format is changed without CCE"),
        (unkeyed_bit_times, "FDCAN_NBTP is written without INIT and CCE"),
        (usb_without_clock, "USB_BCDR: the bus is pulled up without a clock of 48 MHz"),
        (locked_flash, "store to flash at 0x0807f000 while it is locked"),
        (odd_word, "a double word begins at a multiple of 8"),
    ],
)
def test_what_the_part_does_not_allow_ends_the_run(chip: Stm32g474, fault: Callable[[Stm32g474], object], said: str) -> None:
    with pytest.raises(MachineError, match=said):
        fault(chip)


def test_the_crystals_clock_is_170_MHz(chip: Stm32g474) -> None:
    pll(chip)
    chip.core.write_register(PWR + 0x80, 0)
    chip.core.write_register(FLASH, 4)
    chip.core.write_register(CFGR, 3)
    assert chip.rcc.system_Hz == 170_000_000


def test_without_a_crystal_it_never_gets_ready(chip: Stm32g474) -> None:
    chip.rcc.has_crystal = False
    chip.core.write_register(CR, 1 << 16 | 1 << 8)
    run(chip)
    assert not chip.core.read_register(CR) >> 17 & 1
