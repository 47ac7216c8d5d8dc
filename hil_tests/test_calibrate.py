"""`palpate calibrate` in virtual time: the firmware as a process beside an arm with encoders, monitors and amplifiers that are wrong, and an operator who
moves it as he is asked (calibration_bench.py). What is found is held against what the arm was given."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from board_peer import EMERGENCY_STOP, lockstep, serial_terminal
from calibration_bench import Bench, FaultyArm, Operator

from palpate import cli
from palpate.board_link import BoardLink, BoardLinkError
from palpate.calibration import command
from palpate.calibration.fit import JointFit
from palpate.calibration.session import Calibration, Sample, StepError
from palpate.calibration.steps import STEPS

FAULTY = FaultyArm(encoder_sign=(1, -1, -1), monitor_offset_A=(0.2, -0.1, 0.05), monitor_noise_A=0.01, setpoint_offset_A=(0.03, -0.04, 0.02),
                   setpoint_gain=(1.25, 0.8, 1.0))  # fmt: skip
# shared/device/parameters.hpp and what follows from it (firmware/core/tuning.hpp).
COULOMB_N_m, GRAVITY_N_m = (8.6e-3, 8.6e-3, 6.8e-3), (0.0, -0.01629, -0.07374)
# Of 100 readings with 0.01 A of noise each the mean is 1 mA off; three of that.
MONITOR_BOUND_A = 3e-3
# Of 8,000 readings it is 0.1 mA; the monitors' own offset comes on top.
SETPOINT_BOUND_A = 4e-3
# 0.01 A are 2.6 to 3.1 mN m of a reading. A fit to one sweep with 300 draws of that noise scatters by 0.15 mN m (Coulomb friction), by
# 0.25 mN m s/rad (viscous) about a mean of 0.29, and by 0.59 mN m (forearm's weight): three of each.
COULOMB_BOUND_N_m = 0.5e-3
GRAVITY_BOUND_N_m = 1.8e-3
VISCOUS_BOUND_N_m_s = 1.1e-3
# Held by 0.22 to 0.9 N m/rad against friction of at most 8.6 mN m: the forearm within 31 mrad, the others less.
STRAYED_RAD = 0.04


@pytest.fixture
def bench_of(tmp_path):
    """Makes a board with such an arm, 50 ticks after its start, and a calibration with its operator."""
    import contextlib

    with contextlib.ExitStack() as stack:

        def make(faults: FaultyArm, patience_s: float = 2.0) -> tuple[Calibration, Operator]:
            board = stack.enter_context(lockstep("native", tmp_path / f"board{len(list(tmp_path.iterdir()))}"))
            bench = Bench(board, faults)
            for _ in range(50):
                bench.tick()
            operator = Operator(bench)
            link = BoardLink("bench", over=bench, clock=bench.clock)
            return Calibration(link, operator.ask, patience_s), operator

        yield make


def registers(calibration: Calibration) -> dict[str, list[float]]:
    return {name: one["values"] for name, one in command.registers(calibration.board).items()}


def test_the_command_writes_its_report(bench_of, tmp_path):
    """All steps; what they find against what the arm was given, on the board afterwards, and in the report."""
    calibration, operator = bench_of(FAULTY)
    said: list[str] = []
    gains = [("setpoint.gain", FAULTY.setpoint_gain)]  # which an ammeter has told
    values = command.calibrate(calibration.board, tuple(STEPS), gains, operator.ask, said.append, 2.0, tmp_path / "out")
    assert values["ok"], said
    assert [one["step"] for one in values["steps"]] == list(STEPS)
    assert operator.keys == ["base", "upper arm", "forearm", "zero", "hold", "release", "take"]
    assert operator.strayed_rad < STRAYED_RAD
    found = registers(calibration)
    assert found["encoder.sign"] == [1, -1, -1]
    np.testing.assert_allclose(found["monitor.offset_a"], FAULTY.monitor_offset_A, atol=MONITOR_BOUND_A)
    np.testing.assert_allclose(found["setpoint.offset_a"], FAULTY.setpoint_offset_A, atol=SETPOINT_BOUND_A)
    np.testing.assert_allclose(found["friction.coulomb_n_m"], COULOMB_N_m, atol=COULOMB_BOUND_N_m)
    assert all(0 <= value <= VISCOUS_BOUND_N_m_s for value in found["friction.viscous_n_m_s"])
    np.testing.assert_allclose(found["gravity.torque_n_m"], GRAVITY_N_m, atol=GRAVITY_BOUND_N_m)
    assert found["friction.compensated_share"] == [0, 0, 0]  # whose decision is the user's
    report = json.loads((tmp_path / "out" / command.RESULTS).read_text("utf-8"))
    assert report["before"]["encoder.sign"]["values"] == [1, 1, 1]
    assert {name: one["values"] for name, one in report["after"].items()} == found
    assert not report["after"]["encoder.sign"]["persistent"]  # a process keeps nothing
    assert (tmp_path / "out" / command.PICTURE).stat().st_size > 10_000

    # With half of the friction compensated the arm stays where it is let go: no motion comes of it.
    calibration.board.write_register("friction.compensated_share", [0.5] * 3)
    bench = operator.bench
    calibration.board.arm(direct=True)
    bench.plant.set_grip(0.0)
    for _ in range(50):
        calibration.board.push(np.zeros(3))
        calibration.sample()
    before = bench.plant.joint_rad.copy()
    for _ in range(100):
        calibration.board.push(np.zeros(3))
        calibration.sample()
    # The plant's joints creep instead of sticking, at 5 mrad/s times what is left of weight over friction, 15 % of 8 mN m: 1 mrad/s over 0.3 s.
    assert np.abs(bench.plant.joint_rad - before).max() < 1e-3
    assert calibration.board.state().mode == "direct"
    calibration.board.disarm()


def fails(calibration: Calibration, step: str, why: str) -> None:
    """The step says why, and the board has what it had."""
    before = registers(calibration)
    with pytest.raises(StepError, match=why):
        STEPS[step](calibration)
    assert registers(calibration) == before


def test_each_step_says_why_it_fails_and_leaves_the_board_as_it_was(bench_of):
    calibration, operator = bench_of(FaultyArm(dead=(1,)))
    fails(calibration, "direction", "upper arm did not move: counts .* must be at least 438")
    operator.overrides = {"base": lambda bench: bench.move_hand((0.0, 0.0, 0.15))}
    fails(calibration, "direction", "base was asked for, but forearm moved")
    operator.bench.move_hand((0.0, 0.0, 0.0))
    for _ in range(500):  # 2.6 cm
        operator.bench.tick()
    operator.overrides = {"base": lambda bench: bench.move_hand((0.12, 0.0, -0.1))}
    fails(calibration, "direction", "more than base moved: counts .* at most 50 % of its angle")
    calibration, operator = bench_of(FaultyArm(exchanged=(0, 2)))
    fails(calibration, "direction", "base was asked for, but forearm moved: .*exchanged")
    operator.overrides = {"zero": lambda bench: bench.move_hand((0.3, 0.2, 0.1))}
    fails(calibration, "zero", "hold the arm still|off their zero")
    calibration, operator = bench_of(FaultyArm(monitor_noise_A=0.3))
    fails(calibration, "monitors", "noise of the monitors .* must be at most 0.1 A")
    calibration, operator = bench_of(FaultyArm(monitor_offset_A=(2.0, 0.0, 0.0)))
    fails(calibration, "monitors", "monitor.offset_a of the base would be 2 A: must be from -1.2 to 1.2 A")
    fails(calibration, "gravity", "there are no sweeps")
    operator.overrides = {"hold": lambda bench: bench.move_hand((0.6, 0.0, 0.0)) or [bench.tick() for _ in range(3000)]}
    fails(calibration, "sweep", r"the joints are at \+0\.\d+, .* must be within 0.35 rad")


def test_a_tool_that_is_held_gives_no_friction(bench_of):
    calibration, operator = bench_of(FaultyArm())
    operator.overrides = {"release": lambda bench: None}
    before = registers(calibration)
    try:
        STEPS["sweep"](calibration)
        with pytest.raises(StepError, match="held|touched"):
            STEPS["friction"](calibration)
    except StepError as error:
        assert "does not follow" in str(error)
    assert calibration.board.state().mode == "idle"
    assert registers(calibration)["friction.coulomb_n_m"] == before["friction.coulomb_n_m"]


def fails_while_sweeping(calibration: Calibration, why: str) -> None:
    """As `fails`, with outputs off."""
    fails(calibration, "sweep", why)
    assert not calibration.sweeps
    assert calibration.board.state().mode != "direct"


def test_a_sweep_ends_within_a_second_where_the_board_no_longer_obeys(bench_of, tmp_path):
    """Its emergency stop, its start from the beginning, a clock that stands; the operator is not asked to take what hangs free."""
    calibration, operator = bench_of(FaultyArm())
    bench = operator.bench
    released = []

    def stop(bench: Bench) -> None:
        released.append(bench.ticks)
        bench.flags = EMERGENCY_STOP

    operator.overrides = {"release": stop}
    fails_while_sweeping(calibration, r"the board went to mode fault with faults 0x1: must be direct")
    assert bench.ticks < released[0] + 1000
    assert operator.keys == ["hold", "release"]

    calibration, operator = bench_of(FaultyArm())
    with lockstep("native", tmp_path / "again") as again:

        def start_again(bench: Bench) -> None:
            bench.board = again

        operator.overrides = {"release": start_again}
        fails_while_sweeping(calibration, r"the board has started again: its clock went from \d+\.\d+ s back to")

    calibration, operator = bench_of(FaultyArm())
    bench = operator.bench
    measured = calibration.sample
    stands_s = []

    def standing() -> Sample:
        now = measured()
        stands_s.append(now.time_s)
        return dataclasses.replace(now, time_s=stands_s[0])

    calibration.sample = standing
    begun = bench.ticks
    fails_while_sweeping(calibration, "the board's clock has gone on by 0.000 s while 5.2 s passed here")
    assert bench.ticks < begun + 10_000


def test_a_motor_that_is_reversed_or_missing_is_found_in_the_hand(bench_of):
    """Before the arm is let go."""
    for sign, why in (((1, -1, 1), "motor of the upper arm is reversed"), ((1, 1, -1), "motor of the forearm is reversed"), ((0, 1, 1), "the base does not move")):
        calibration, operator = bench_of(FaultyArm(motor_sign=sign))
        fails_while_sweeping(calibration, why)
        assert operator.keys == ["hold"]
    calibration, operator = bench_of(FaultyArm())
    operator.overrides = {"hold": lambda bench: None}  # firmly
    fails_while_sweeping(calibration, "the base does not move .* hold the tool loosely")


def test_what_fails_is_told_although_disarming_fails_too(bench_of):
    calibration, operator = bench_of(FaultyArm())

    def refuses() -> None:
        raise BoardLinkError("bench: no Command within 5 s")

    disarm = calibration.board.disarm
    calibration.board.disarm = refuses
    operator.overrides = {"release": lambda bench: bench.__setattr__("flags", EMERGENCY_STOP)}
    with pytest.raises(StepError, match="the board went to mode fault") as failure:
        STEPS["sweep"](calibration)
    assert "no Command within 5 s" in failure.value.__notes__[0]
    calibration.board.disarm = disarm


def test_arming_that_is_refused_asks_for_no_hand(bench_of):
    calibration, operator = bench_of(FaultyArm())
    operator.overrides = {"hold": lambda bench: bench.__setattr__("flags", EMERGENCY_STOP)}
    with pytest.raises(BoardLinkError, match="refused in mode"):
        STEPS["sweep"](calibration)
    assert operator.keys == ["hold"]


def test_friction_is_written_whole_or_not_at_all(bench_of):
    calibration, _ = bench_of(FaultyArm())
    calibration.fits += [JointFit(8e-3, 1e-4, 1e-3, 0.0, 1e-4, 0.5, 1000)] * 3
    calibration.write("friction.coulomb_n_m", [1e-3, 2e-3, 3e-3])
    write = calibration.board.write_register

    def lossy(name, values):
        if name == "friction.viscous_n_m_s":
            raise BoardLinkError("bench: no RegisterAccess within 5 s")
        return write(name, values)

    calibration.board.write_register = lossy
    before = registers(calibration)
    with pytest.raises(BoardLinkError, match="no RegisterAccess"):
        STEPS["friction"](calibration)
    assert registers(calibration) == before


def test_a_setting_out_of_range_is_refused_with_the_range(bench_of):
    calibration, _ = bench_of(FaultyArm())
    with pytest.raises(BoardLinkError, match=r"setpoint.gain = 2, 1, 1: refused, it is still 1, 1, 1; must be from 0.75"):
        calibration.board.write_register("setpoint.gain", [2, 1, 1])
    with pytest.raises(BoardLinkError, match="no register 'no.such': it has encoder.sign"):
        calibration.board.read_register("no.such")
    with pytest.raises(BoardLinkError, match="can only be read"):
        calibration.board.write_register("arm.sample", [1, 1, 1])


@pytest.mark.real_time
def test_the_command_at_a_board_in_real_time(tmp_path, capsys):
    with serial_terminal("native", tmp_path) as terminal:
        out = ["--out", str(tmp_path / "out")]
        assert cli.main(["calibrate", terminal, "--set", "setpoint.gain=1.02,0.99,1", "--json", *out]) == 0
        values = json.loads(capsys.readouterr().out)
        np.testing.assert_allclose(values["after"]["setpoint.gain"]["values"], [1.02, 0.99, 1.0], rtol=1e-6)
        assert values["steps"] == []
        assert cli.main(["calibrate", terminal, "--show", "--json"]) == 0
        np.testing.assert_allclose(json.loads(capsys.readouterr().out)["after"]["setpoint.gain"]["values"], [1.02, 0.99, 1.0], rtol=1e-6)
        # Nobody moves the encoders of a board without a plant.
        assert cli.main(["calibrate", terminal, "--steps", "direction", "--yes", "--patience", "0.2", *out]) == 1
        assert "base did not move" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "why"),
    [(["--set", "setpoint.gain=1,2"], "three numbers"), (["--set", "no.such=1,1,1"], "must be one of"), (["--steps", "dance"], "must be one of direction"),
     (["--patience", "0"], "must be in"), (["--yes"], "not with zero, sweep, friction, gravity"), (["--yes", "--steps", "zero"], "not with zero"),
     (["--yes", "--steps", "direction", "sweep"], "not with sweep")],
)  # fmt: skip
def test_bad_input_is_told_before_a_board_is_asked(arguments, why, capsys, tmp_path: Path):
    assert cli.main(["calibrate", str(tmp_path / "nothing"), *arguments]) == 2
    assert why in capsys.readouterr().err
