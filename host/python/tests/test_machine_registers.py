"""The register models (palpate.machine) against ST's description of the part, which is beside the project where it was
fetched: addresses, offsets, reset values, interrupts."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip("unicorn", reason="Unicorn, which runs the image for the STM32G474, is not installed: ./run does it")

from palpate.machine.peripheral import Peripheral
from palpate.machine.part import Image
from palpate.machine.stm32g474 import Stm32g474
from palpate.paths import ROOT

SVD = ROOT.parent / "shared/stm32g474/STM32G474.svd"
# Ours -> name there.
PERIPHERALS = {"USB": "USB_FS_device", "FDCAN2": "FDCAN"}
# No peripherals there: the part's number, and memories.
NOT_IN_SVD = {"UID", "USB_memory", "FDCAN_memory"}
REGISTERS_NOT_IN_SVD = {("USB", "LPMCSR"), ("USB", "BCDR")}
# Reset values that differ, with the reason.
RESETS = {
    ("RCC", "CR"): "there the internal oscillator is off, with which the part starts (RM0440, 7.4.1)",
    ("RCC", "CSR"): "the cause of the reset",
    ("FLASH", "OPTR"): "option bytes: as they leave the factory",
    ("USB", "CNTR"): "powered down and in reset (RM0440, 45.6.1)",
}


def number(element: ElementTree.Element, tag: str) -> int:
    return int(element.findtext(tag, ""), 0)


def described(root: ElementTree.Element) -> dict[str, ElementTree.Element]:
    return {p.findtext("name", ""): p for p in root.iter("peripheral")}


@pytest.fixture(scope="module")
def peripherals() -> tuple[Peripheral, ...]:
    """Of a part whose flash holds a vector table and nothing else."""
    vectors = (0x20001000).to_bytes(4, "little") + (0x08000009).to_bytes(4, "little") + b"\xfe\xe7"
    return Stm32g474(Image(((0x08000000, vectors),), {})).peripherals


@pytest.fixture(scope="module")
def svd() -> dict[str, ElementTree.Element]:
    if not SVD.exists():
        pytest.skip("ST's description of the STM32G474 (../shared/stm32g474) is not beside the project")
    return described(ElementTree.parse(SVD).getroot())


def test_every_register_is_where_the_part_has_it(
    peripherals: tuple[Peripheral, ...], svd: dict[str, ElementTree.Element]
) -> None:
    wrong = []
    for ours in peripherals:
        if ours.name in NOT_IN_SVD:
            continue
        theirs = svd[PERIPHERALS.get(ours.name, ours.name)]
        base = svd[ours.name] if ours.name in svd else theirs
        assert ours.base == number(base, "baseAddress"), ours.name
        if theirs.get("derivedFrom"):
            theirs = svd[theirs.get("derivedFrom", "")]
        registers = {
            (r.findtext("name") or "").removeprefix(prefix): r
            for prefix in (f"{ours.name}_", f"{ours.name[:-1]}_", f"{theirs.findtext('name')}_")
            for r in theirs.iter("register")
            if (r.findtext("name") or "").startswith(prefix) or "_" not in (r.findtext("name") or "")
        }
        for name, (offset, reset) in ours.REGISTERS.items():
            if (ours.name, name) in REGISTERS_NOT_IN_SVD:
                continue
            register = registers.get(name)
            if register is None:
                wrong.append(f"{ours.name}_{name}: not there; there are {sorted(registers)}")
                continue
            if offset != number(register, "addressOffset"):
                wrong.append(f"{ours.name}_{name} at {offset:#x}: there at {register.findtext('addressOffset')}")
            if (ours.name, name) in RESETS or register.findtext("resetValue") is None:
                continue
            if ours.value[name] != number(register, "resetValue"):
                wrong.append(f"{ours.name}_{name} = {ours.value[name]:#x} after a reset: there {register.findtext('resetValue')}")
    assert not wrong, "\n".join(wrong)


def test_interrupts_are_those_of_the_part(
    peripherals: tuple[Peripheral, ...], svd: dict[str, ElementTree.Element]
) -> None:
    numbers = {
        name: {i.findtext("name", ""): number(i, "value") for i in theirs.iter("interrupt")} for name, theirs in svd.items()
    }
    by_name = {ours.name: ours for ours in peripherals}
    found = {ours: vars(one)["_interrupt"] for ours, one in by_name.items() if "_interrupt" in vars(one)}
    assert len(found) == 9
    for ours, interrupt in found.items():
        # The SVD lists some interrupts with other peripherals.
        everywhere = {value for these in numbers.values() for value in these.values()}
        own = numbers.get(PERIPHERALS.get(ours, ours), {}) | numbers.get(ours, {})
        assert interrupt in (set(own.values()) or everywhere), (ours, interrupt, own)
