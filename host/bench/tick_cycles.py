#!/usr/bin/env python3
"""Cycles of a Cortex-M4F that the contact tick takes, from the instructions that QEMU executes, in JSON.

Runs boards/mps2_an386/contact_tick_main.cpp in QEMU, which lists every instruction, and adds up their cycles by the tables of the
Cortex-M4 Technical Reference Manual (docs/decisions/cycles.md: rules, sources, assumptions): `most`, which a part without wait
states does not exceed, and `typical`.
"""

import argparse
import json
import re
import statistics
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import contact_tick
from contact_tick import KINDS, SIZES, SURFACES

# QEMU then lists each instruction that it executes, and exceptions.
LOGGED = ("-singlestep", "-d", "exec,nochain,int")
# The timer's, that begins a servo tick.
SERVO_EXCEPTION = b"24"
# Instructions of a tick from which on it does more than without contact: 4,500.
LONG = 10_000
STEP = "_ZN7palpate5bench17ContactSituations4stepEv"

_LINE = re.compile(r"^\s*([0-9a-f]+):\t([0-9a-f ]+?)\s*\t(\S+)(?:\t([^;@]*))?")
_SYMBOL = re.compile(r"^([0-9a-f]+) <(\S+)>:$")
_EXCEPTION = re.compile(rb"taking pending nonsecure exception (\d+)")
_EXECUTED = re.compile(rb"\[[0-9a-f]+/([0-9a-f]+)/")
_CONDITION = "(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?"
_BRANCH = re.compile(rf"(b{_CONDITION}|bl|blx|bx|cbn?z|tb[bh])$")
_LOAD = re.compile(rf"(ldrs?[bh]?|vldr){_CONDITION}$")
_STORE = re.compile(rf"(str[bh]?|vstr){_CONDITION}$")
_MANY = re.compile(rf"(ldm|stm|vldm|vstm)(ia|db)?{_CONDITION}$|(push|pop|vpush|vpop|ldrd|strd){_CONDITION}$")
_FLOAT_ARITHMETIC = re.compile(rf"v(add|sub|mul|nmul|div|sqrt|mla|mls|nmla|nmls|fma|fms|fnma|fnms|cvt){_CONDITION}\.")


@dataclass(frozen=True)
class Instruction:
    """One of the image. operands: as objdump writes them; size: in bytes."""

    size: int
    name: str
    operands: str

    @property
    def base(self) -> str:
        """Without its width."""
        return self.name.removesuffix(".n").removesuffix(".w")

    def registers(self) -> list[str]:
        return re.findall(r"\b(?:r\d+|s\d+|d\d+|sp|lr|pc|ip|fp|sl)\b", self.operands)

    def address_registers(self) -> list[str]:
        """That the address of a load or store is made of."""
        if "[" in self.operands:
            return re.findall(r"\b(?:r\d+|sp|lr|ip|fp|sl)\b", self.operands[self.operands.index("["):])
        if self.base in ("push", "pop", "vpush", "vpop"):
            return ["sp"]
        return self.registers()[:1] if _MANY.match(self.base) else []


def disassemble(image: Path) -> tuple[dict[int, Instruction], dict[str, int]]:
    """Instructions and symbols of an image, by address and name."""
    text = subprocess.run(["arm-none-eabi-objdump", "-d", str(image)], capture_output=True, text=True, check=True).stdout
    code, symbols = {}, {}
    for line in text.splitlines():
        if found := _LINE.match(line):
            size = len(found[2].replace(" ", "")) // 2
            code[int(found[1], 16)] = Instruction(size, found[3], (found[4] or "").strip())
        elif found := _SYMBOL.match(line):
            symbols[found[2]] = int(found[1], 16)
    return code, symbols


def _listed(operands: str) -> int:
    """Words of a register list or a pair of registers."""
    if "{" not in operands:
        return 2
    words = 0
    for part in operands[operands.index("{") + 1:operands.index("}")].split(","):
        first, _, last = part.strip().partition("-")
        count = int(last[1:]) - int(first[1:]) + 1 if last else 1
        words += 2 * count if first.startswith("d") else count
    return words


def cycles(one: Instruction, after: Instruction, is_taken: bool, most: bool) -> int:
    """Of an instruction, with what the next one waits for it. is_taken: the next one does not follow it in memory."""
    name = one.base
    refill = (3 if most else 2) if is_taken else 0
    if _MANY.match(name):
        count = 1 + _listed(one.operands)
    elif _LOAD.match(name):
        wide = 1 if name.startswith("vldr") and one.operands.startswith("d") else 0
        literal = 1 if most and "[pc" in one.operands else 0
        count = 2 + wide + literal
        # A load right behind it overlaps.
        if not most and _LOAD.match(after.base) and one.registers()[0] not in after.address_registers():
            count -= 1
    elif _STORE.match(name):
        wide = 1 if name.startswith("vstr") and one.operands.startswith("d") else 0
        count = (2 if most else 1) + wide
    elif name.startswith(("vdiv", "vsqrt")):
        count = 14
    elif re.match(r"v(n?ml|fn?m)[as]", name):
        count = 3
    elif name in ("udiv", "sdiv"):
        count = 12
    elif name.startswith("vmov") and re.search(r"\b(r\d+|ip|lr|fp|sl)\b", one.operands):
        count = 2
    elif name in ("tbb", "tbh"):
        count = 3
    else:
        count = 1
    return count + refill + _stall(one, after)


def _is_single(one: Instruction) -> bool:
    return bool(_LOAD.match(one.base) or _STORE.match(one.base))


def _stall(one: Instruction, after: Instruction) -> int:
    """Cycles for which the next instruction waits for the result of this one."""
    written = one.registers()[:1]
    if _FLOAT_ARITHMETIC.match(one.name):
        used = after.registers() if _STORE.match(after.base) or after.name.startswith("vcmp") else after.registers()[1:]
        return 1 if after.name.startswith("v") and written[0] in used else 0
    if _is_single(one) or _MANY.match(one.base) or _BRANCH.match(one.base) or one.name.startswith(("v", "cm", "t", "it")):
        return 0
    if re.match(r"[us]m(ul|la)l", one.name):
        written = one.registers()[:2]
    return 1 if set(written) & set(after.address_registers()) else 0


def executed(
    image: Path, situations: int, code: dict[int, Instruction], symbols: dict[str, int]
) -> Iterator[list[int]]:
    """Addresses of the instructions of each tick, in order; last that which it returns to."""
    first = symbols[STEP]
    returns = {at + call.size for at, call in code.items() if call.base == "bl" and STEP in call.operands}
    command = ["qemu-system-arm", "-M", "mps2-an386", "-icount", "shift=3,sleep=off", "-display", "none", "-monitor", "none",
               "-serial", "null", "-semihosting-config", f"enable=on,target=native,arg={situations}", "-kernel", str(image),
               *LOGGED, "-D", "/dev/stdout"]
    tick: list[int] | None = None
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as qemu:
        assert qemu.stdout is not None
        for line in qemu.stdout:
            found = _EXECUTED.search(line)
            if found is None:
                continue
            at = int(found[1], 16)
            if tick is None:
                tick = [at] if at == first else None
            elif at != tick[-1]:  # an instruction that QEMU began twice stands there twice
                tick.append(at)
                if at in returns:
                    yield tick
                    tick = None


def count(code: dict[int, Instruction], tick: list[int]) -> tuple[int, int, int]:
    """Instructions of a tick, most and typical cycles."""
    most = typical = 0
    for (at, then), times in Counter(pairwise(tick)).items():
        one, after = code[at], code[then]
        is_taken = then != at + one.size
        most += times * cycles(one, after, is_taken, True)
        typical += times * cycles(one, after, is_taken, False)
    return len(tick) - 1, most, typical


def _statistics(ticks: list[tuple[int, int, int]]) -> dict[str, Any]:
    """Of ticks as count() gives them. Cycles per instruction: of long ticks."""
    names = ("instructions", "most_cycles", "typical_cycles")
    columns = {name: [tick[k] for tick in ticks] for k, name in enumerate(names)}
    long = [tick for tick in ticks if tick[0] > LONG]
    return {
        "ticks": len(ticks),
        **{name: {"median": round(statistics.median(of)), "worst": max(of)} for name, of in columns.items()},
        "most_per_instruction": round(max((tick[1] / tick[0] for tick in long), default=0.0), 3),
        "typical_per_instruction": round(max((tick[2] / tick[0] for tick in long), default=0.0), 3),
    }


def measure(image: Path, situations: int) -> dict[str, Any]:
    """Of the contact tick, per surface, size and kind of tick."""
    code, symbols = disassemble(image)
    found: dict[tuple[int, int, int], list[tuple[int, int, int]]] = defaultdict(list)
    # The same ticks without the list of instructions say what each of them was.
    for line, tick in zip(contact_tick.run(situations, image), executed(image, situations, code, symbols), strict=True):
        size, surface, _, kind, _ = line.split()
        found[int(surface), int(size), int(kind)].append(count(code, tick))
    result: dict[str, Any] = {}
    for (surface, size, kind), ticks in sorted(found.items()):
        result.setdefault(SURFACES[surface], {}).setdefault(SIZES[size], {})[KINDS[kind]] = _statistics(ticks)
    return result


def servo_ticks(log: Iterable[bytes]) -> Iterator[list[int]]:
    """The same of each servo tick of the whole firmware, from the log of a QEMU that was given LOGGED."""
    tick: list[int] | None = None
    taken = b""
    for line in log:
        if found := _EXECUTED.search(line):
            at = int(found[1], 16)
            if tick is not None and (not tick or at != tick[-1]):
                tick.append(at)
        elif found := _EXCEPTION.search(line):
            taken = found[1]
        elif line.startswith(b"...loaded new PC") and taken == SERVO_EXCEPTION:
            tick = []
        elif line.startswith(b"Exception return") and line.split()[-1] == SERVO_EXCEPTION and tick:
            yield tick
            tick = None


def measure_log(log: Iterable[bytes], image: Path) -> dict[str, Any]:
    """Of the servo ticks in a log, instructions and cycles, without the interrupt's own entry and exit."""
    code, _ = disassemble(image)
    return _statistics([count(code, tick) for tick in servo_ticks(log)])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--situations", type=int, default=100, help="of each size of model and each surface")
    parser.add_argument("--image", type=Path, default=contact_tick.IMAGE, help="of target contact_tick_mps2_an386")
    parser.add_argument("--log", type=Path, help="of a QEMU that ran the image, the whole firmware's then, with "
                        f"{' '.join(LOGGED)}: its servo ticks instead")
    options = parser.parse_args()
    if options.log:
        with options.log.open("rb") as log:
            report = measure_log(log, options.image)
    else:
        report = {"situations": options.situations, "cycles": measure(options.image, options.situations)}
    print(json.dumps(report, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
