"""Cycles of a Cortex-M4F from what QEMU executes: the rules one by one, and the bound of docs/decisions/cycles.md."""

import sys
from itertools import pairwise

import pytest
from board_peer import BUILD_MPS2, REPOSITORY

sys.path.insert(0, str(REPOSITORY / "host/bench"))
import contact_tick
import servo_rate
import tick_cycles
from tick_cycles import Instruction, cycles

_IMAGE = BUILD_MPS2 / "boards/mps2_an386/contact_tick_mps2_an386.elf"
# docs/decisions/cycles.md: of a tick of more than 10,000 instructions.
_MOST_PER_INSTRUCTION = 1.8
_SITUATIONS = 3
# The clock counts every fifth instruction, and a call stands between its readings.
_INSTRUCTIONS_OF_THE_CLOCK = 25
_NOP = ("nop", "")


# Most and typical, as the Technical Reference Manual has them: a taken branch 1 + P, of several registers 1 + N.
@pytest.mark.parametrize(("one", "after", "is_taken", "most", "typical"), [
    (("adds", "r0, #1"), _NOP, False, 1, 1),
    (("adds", "r0, #1"), ("ldr", "r1, [r0, #4]"), False, 2, 2),
    (("adds", "r0, #1"), ("ldr", "r1, [r2, r0]"), False, 2, 2),
    (("cmp", "r0, #1"), ("ldr", "r1, [r0, #4]"), False, 1, 1),
    (("ldr.w", "r0, [r1, #4]"), _NOP, False, 2, 2),
    (("ldr", "r0, [r1, #4]"), ("ldr", "r2, [r3, #0]"), False, 2, 1),
    (("ldr", "r0, [r1, #4]"), ("ldr", "r2, [r0, #0]"), False, 2, 2),
    (("ldr", "r0, [pc, #4]"), _NOP, False, 3, 2),
    (("vldr", "s0, [r1, #4]"), _NOP, False, 2, 2),
    (("vldr", "d7, [r1, #4]"), _NOP, False, 3, 3),
    (("str", "r0, [r1, #4]"), _NOP, False, 2, 1),
    (("ldmia.w", "r0!, {r1, r2, r3}"), _NOP, False, 4, 4),
    (("ldrd", "r1, r2, [r0]"), _NOP, False, 3, 3),
    (("push", "{r4, r5, lr}"), _NOP, False, 4, 4),
    (("vpush", "{d8-d9}"), _NOP, False, 5, 5),
    (("vldmia", "r0!, {s0-s3}"), _NOP, False, 5, 5),
    (("pop", "{r4, pc}"), _NOP, True, 6, 5),
    (("bne.n", "26e <start>"), _NOP, False, 1, 1),
    (("bne.n", "26e <start>"), _NOP, True, 4, 3),
    (("bl", "26e <start>"), _NOP, True, 4, 3),
    (("vmul.f32", "s0, s1, s2"), ("vadd.f32", "s3, s4, s5"), False, 1, 1),
    (("vmul.f32", "s0, s1, s2"), ("vadd.f32", "s3, s0, s5"), False, 2, 2),
    (("vmul.f32", "s0, s1, s2"), ("vstr", "s0, [r0]"), False, 2, 2),
    (("vmla.f32", "s0, s1, s2"), _NOP, False, 3, 3),
    (("vdiv.f32", "s0, s1, s2"), _NOP, False, 14, 14),
    (("vsqrt.f32", "s0, s1"), ("vcmp.f32", "s0, #0.0"), False, 15, 15),
    (("udiv", "r0, r1, r2"), _NOP, False, 12, 12),
    (("smlald", "r0, r1, r2, r3"), ("ldr", "r4, [r1, #0]"), False, 2, 2),
], ids=lambda value: value[0] if isinstance(value, tuple) else None)
def test_an_instruction_takes_what_the_manual_says(one, after, is_taken, most, typical):
    one, after = Instruction(4, *one), Instruction(4, *after)
    assert (cycles(one, after, is_taken, True), cycles(one, after, is_taken, False)) == (most, typical)


def test_ticks_stay_below_the_bound_and_have_the_instructions_of_the_clock():
    code, symbols = tick_cycles.disassemble(_IMAGE)
    long = 0
    for line, tick in zip(contact_tick.run(_SITUATIONS, _IMAGE),
                          tick_cycles.executed(_IMAGE, _SITUATIONS, code, symbols), strict=True):
        instructions, most, typical = tick_cycles.count(code, tick)
        clock = contact_tick.INSTRUCTIONS_PER_COUNT * int(line.split()[4], 16)
        assert abs(instructions - clock) <= _INSTRUCTIONS_OF_THE_CLOCK
        assert instructions <= typical <= most
        if instructions > tick_cycles.LONG:
            long += 1
            assert most <= _MOST_PER_INSTRUCTION * instructions
    assert long > _SITUATIONS


def test_servo_ticks_are_read_from_a_log():
    def trace(at):
        return f"Trace 0: 0x7f00 [00800408/{at:08x}/00000110/ff020201] f\n".encode()

    log = [
        trace(0x10), b"...taking pending nonsecure exception 24\n", b"...loaded new PC 0x715\n",
        trace(0x714), trace(0x716), trace(0x716), trace(0x718),
        b"Exception return: magic PC fffffff9 previous exception 24\n", trace(0x12),
        b"...taking pending nonsecure exception 16\n", b"...loaded new PC 0x815\n", trace(0x814),
        b"Exception return: magic PC fffffff9 previous exception 16\n",
    ]
    ticks = list(tick_cycles.servo_ticks(log))
    assert ticks == [[0x714, 0x716, 0x718]]
    assert all(a != b for tick in ticks for a, b in pairwise(tick))


def test_a_patch_of_eight_nodes_is_in_time_at_4_kHz():
    """docs/decisions/cycles.md, "A faster servo", has its row; within what a change of the firmware elsewhere may add."""
    measured = servo_rate.measure(servo_rate.MODELS["patch, 2 x 2 x 2 nodes"])
    assert (measured["modes"], measured["nodes"]) == (24, 4)
    assert measured["worst_tick_cycles"] == pytest.approx(38_754, rel=0.03)
    assert measured["worst_tick_cycles"] < servo_rate.CLOCK_HZ / 4000
