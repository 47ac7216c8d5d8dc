"""boards/stm32g4/registers.hpp, with what it has from boards/stm32, against ST's description of the part (SVD), which is beside the project where it was fetched."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from palpate.paths import ROOT

SHARED = ROOT / "boards/stm32/registers.hpp"
FAMILIES = {"stm32g4": ROOT / "boards/stm32g4/registers.hpp", "stm32f4": ROOT / "boards/stm32f4/registers.hpp"}
SVD = ROOT.parent / "shared/stm32g474/STM32G474.svd"

BASE = re.compile(r"^inline constexpr Base (\w+)\{(0x[0-9A-F]{8})\};$")
OPEN = re.compile(r"^namespace (\w+) \{$")
ALIAS = re.compile(r"^namespace (\w+) = stm32::(\w+);$")
CLOSE = re.compile(r"^\}  // namespace (\w+)$")
OFFSET = re.compile(r"^inline constexpr Offset (\w+)\{(0x[0-9A-F]+)\};(?:\s+// (.*))?$")
BITS = re.compile(r"^inline constexpr Bits (\w+)\{(\d+)(?:, (\d+))?\};(?:\s+// (.*))?$")
INTERRUPT = re.compile(r"^inline constexpr std::uint32_t (\w+) = (\d+);$")
MEMORY = re.compile(r"^inline constexpr std::uintptr_t \w+ = (0x[0-9A-F]{8});\s+// svd (\w+)$")
NOT_IN_SVD = "not in the SVD"


@dataclass
class Group:
    """A namespace of registers and the peripherals that have them."""

    bases: dict[str, int]
    offsets: dict[str, int] = field(default_factory=dict)
    # Of a register: name in the SVD, lowest bit, width.
    fields: list[tuple[str, str, int, int]] = field(default_factory=list)


@dataclass
class Header:
    groups: dict[str, Group] = field(default_factory=dict)
    interrupts: dict[str, int] = field(default_factory=dict)
    memories: dict[str, int] = field(default_factory=dict)


def read_header(path: Path, shared: "Header | None" = None) -> Header:
    """shared: that of the families' common peripherals, whose registers it may have at addresses of its own."""
    header = Header()
    bases: dict[str, int] = {}
    inside = ""
    for line in path.read_text(encoding="utf-8").splitlines():
        if match := BASE.match(line):
            bases[match[1]] = int(match[2], 16)
        elif (match := OPEN.match(line)) and match[1] != "interrupt":
            inside = match[1]
            header.groups[inside] = Group(bases)
            bases = {}
        elif match := ALIAS.match(line):
            assert shared is not None, line
            header.groups[match[1]] = Group(bases, shared.groups[match[2]].offsets, shared.groups[match[2]].fields)
            bases = {}
        elif match := CLOSE.match(line):
            inside = ""
        elif match := OFFSET.match(line):
            if match[3] != NOT_IN_SVD:
                header.groups[inside].offsets[match[1]] = int(match[2], 16)
        elif match := BITS.match(line):
            if match[4] != NOT_IN_SVD:
                register, name = match[1].split("_", 1)
                if match[4] and match[4].startswith("svd "):
                    name = match[4].removeprefix("svd ")
                header.groups[inside].fields.append((register, name, int(match[2]), int(match[3] or 1)))
        elif (match := INTERRUPT.match(line)) and not match[1].startswith("k"):
            header.interrupts[match[1]] = int(match[2])
        elif match := MEMORY.match(line):
            header.memories[match[2]] = int(match[1], 16)
        else:
            # Nothing of theirs may slip through.
            assert not re.search(r"constexpr (Base|Offset|Bits) ", line), line
    if shared is not None:
        header.groups = {name: group for name, group in shared.groups.items() if group.bases} | header.groups
    return header


def number(element: ElementTree.Element, tag: str) -> int:
    return int(element.findtext(tag, ""), 0)


class Svd:
    def __init__(self, path: Path):
        self._root = ElementTree.parse(path).getroot()
        self._peripherals = {one.findtext("name", ""): one for one in self._root.iter("peripheral")}
        self.interrupts = {(one.findtext("name"), number(one, "value")) for one in self._root.iter("interrupt")}

    def base(self, peripheral: str) -> int:
        return number(self._peripherals[peripheral], "baseAddress")

    def registers(self, peripheral: str) -> dict[str, ElementTree.Element]:
        """By name; a prefix that all of a peripheral's share, as in DAC_CR, is dropped."""
        described = self._peripherals[peripheral]
        described = self._peripherals.get(described.get("derivedFrom", ""), described)
        found = {one.findtext("name", ""): one for one in described.iter("register")}
        prefixes = {name.split("_")[0] for name in found}
        if len(prefixes) == 1 and all("_" in name for name in found):
            return {name.split("_", 1)[1]: one for name, one in found.items()}
        return found


@pytest.fixture(scope="module")
def header() -> Header:
    return read_header(FAMILIES["stm32g4"], read_header(SHARED))


@pytest.fixture(scope="module")
def svd() -> Svd:
    if not SVD.exists():
        pytest.skip(f"{SVD} is not there: the registers are not compared with ST's description")
    return Svd(SVD)


def test_the_header_is_read(header: Header) -> None:
    assert header.groups["rcc"].bases == {"RCC": 0x40021000}
    assert header.groups["rcc"].offsets["PLLCFGR"] == 0x0C
    assert ("PLLCFGR", "PLLN", 8, 7) in header.groups["rcc"].fields
    assert set(header.groups["tim"].bases) == {"TIM2", "TIM3", "TIM4", "TIM5"}
    assert header.interrupts["TIM7"] == 55
    assert header.memories
    assert set(header.groups["gpio"].bases) == {"GPIOA", "GPIOB", "GPIOC", "GPIOF"} and header.groups["gpio"].offsets["BSRR"] == 0x18
    assert set(header.groups["iwdg"].bases) == {"IWDG"}


@pytest.mark.parametrize("family", FAMILIES)
def test_a_part_has_each_register_once(family: str) -> None:
    """Of the STM32F405 there is no description beside the project: what it can be held to is itself."""
    header = read_header(FAMILIES[family], read_header(SHARED))
    bases = [address for group in header.groups.values() for address in group.bases.values()]
    assert len(set(bases)) == len(bases) and all(address % 0x100 == 0 for address in bases)
    for name, group in header.groups.items():
        assert group.bases and all(offset % 4 == 0 for offset in group.offsets.values()), name
        assert len(set(group.offsets.values())) == len(group.offsets), name
        for register, field_name, position, width in group.fields:
            assert register in group.offsets and 0 < position + width <= 32, f"{name} {register}.{field_name}"


def test_addresses(header: Header, svd: Svd) -> None:
    for group in header.groups.values():
        assert group.bases == {name: svd.base(name) for name in group.bases}
    assert header.memories == {name: svd.base(name) for name in header.memories}


def test_registers_and_fields(header: Header, svd: Svd) -> None:
    for group in header.groups.values():
        for peripheral in group.bases:
            registers = svd.registers(peripheral)
            for name, offset in group.offsets.items():
                assert offset == number(registers[name], "addressOffset"), f"{peripheral}_{name}"
            for register, name, position, width in group.fields:
                bits = {one.findtext("name"): one for one in registers[register].iter("field")}
                there = number(bits[name], "bitOffset"), number(bits[name], "bitWidth")
                assert (position, width) == there, f"{peripheral}_{register}.{name}"


def test_interrupts(header: Header, svd: Svd) -> None:
    assert not set(header.interrupts.items()) - {(name, value) for name, value in svd.interrupts if name}
