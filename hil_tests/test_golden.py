"""The golden trace (shared/golden): the same bits on x86-64 at -O0 and -O2 and on the emulated Cortex-M4F and M7."""

import subprocess

import pytest
from board_peer import BUILD_AN500, BUILD_HOST, BUILD_MPS2

# What the trace hashes to. A change here says that shared/ computes other numbers than before: records, experiments and
# boards in use change with it. If that is meant, put in what `build/host/shared/golden/golden_o2` prints now, and say in
# the commit why the numbers changed. If it is not meant, or if the programs differ from each other, something is wrong:
# boards/cmake/palpate_targets.cmake has the options that keep the bits equal.
GOLDEN = {
    "model": "d723a0544c9d08f1",
    "near": "d74b79bded87aabb",
    "felt": "81fad6cae408de69",
    "device": "3706e3ad602701cf",
    "math": "578ef55ba4a61af0",
    # No hash: what the board counts as work, by which it divides the replay of a model over ticks.
    "work": "000000001485ccd5",
}

_QEMU = ["qemu-system-arm", "-display", "none", "-monitor", "none", "-serial", "stdio",
         "-semihosting-config", "enable=on,target=native"]
_PROGRAMS = {
    "x86-64 -O0": [str(BUILD_HOST / "shared/golden/golden_o0")],
    "x86-64 -O2": [str(BUILD_HOST / "shared/golden/golden_o2")],
    "Cortex-M4F": [*_QEMU, "-M", "mps2-an386", "-kernel", str(BUILD_MPS2 / "boards/mps2_an386/golden_mps2_an386.elf")],
    "Cortex-M7": [*_QEMU, "-M", "mps2-an500", "-kernel", str(BUILD_AN500 / "boards/mps2_an500/golden_mps2_an500.elf")],
}
# Far above the second that the slowest of them takes: a program that needs it has hung.
_WATCHDOG_S = 60


def hashes(program: str) -> dict[str, str]:
    result = subprocess.run(_PROGRAMS[program], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                            timeout=_WATCHDOG_S, check=True)
    return dict(line.split() for line in result.stdout.splitlines())


def test_all_machines_compute_the_same_bits():
    of_each = {program: hashes(program) for program in _PROGRAMS}
    reference = of_each["x86-64 -O2"]
    assert {program: got for program, got in of_each.items() if got != reference} == {}


@pytest.mark.parametrize("program", _PROGRAMS)
def test_the_bits_are_those_of_before(program):
    assert hashes(program) == GOLDEN
