"""`palpate bench faults`: its rules on made-up runs with known answers, bad input, and the short matrix as a gate."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import palpate

from palpate import docs
from palpate.faults import cases, command, groups, picture, rules
from palpate.faults.rules import Run, judge
from palpate.paths import ROOT
from palpate.record_layout import BOARD_MODES
from palpate.scene import SceneError, load_scene

VALID_TICKS = 200
TICKS = 3000


def made_run(**changed: Any) -> Run:
    """The tip is held 5 mm deep at 2 N for 3 s, a model every 30 ticks."""
    tick = np.arange(TICKS)
    values = {
        "ticks/tick": tick,
        "ticks/force_N": np.tile([0.0, 0.0, -2.0], (TICKS, 1)),
        "ticks/setpoint_A": np.full((TICKS, 3), 1.0),
        "ticks/true_tip_m": np.tile([0.0, 0.0, -0.025], (TICKS, 1)),
        "ticks/enabled": np.ones(TICKS, dtype=np.uint8),
        "ticks/mode": np.full(TICKS, rules.RENDER),
        "ticks/faults": np.zeros(TICKS, dtype=np.uint32),
        "ticks/model_age_ticks": np.full(TICKS, 30),
        "reference/force_N": np.tile([0.0, 0.0, -2.0], (TICKS, 1)),
        "updates/swap_tick": tick[30::30],
        "updates/sent_tick": tick[25:-5:30],
        "updates/status": np.zeros(len(tick[30::30]), dtype=np.uint8),
    }
    run = Run(values, {"frames_lost_down": 0, "frames_lost_up": 0}, {"down": 0, "up": 0})
    for change in changed.values():
        change(run)
    return run


def case(**more: Any) -> cases.Case:
    return replace(cases.Case("made", "made", {}, 1.0, 1.5), **more)


def broken(run: Run, one: cases.Case | None = None) -> str:
    return "; ".join(judge(one or case(), made_run(), run, VALID_TICKS).broken)


def test_a_run_like_that_without_faults_breaks_no_rule():
    result = judge(case(), made_run(), made_run(), VALID_TICKS)
    assert result.broken == ()
    assert result.numbers["rise_N"] == 0.0
    assert result.numbers["excess_N"] == pytest.approx(-rules.FORCE_SLACK_N)
    assert result.numbers["recovery_ticks"] == 0 and result.numbers["ends_in"] == "render"


@pytest.mark.parametrize(
    ("name", "rows", "value", "said"),
    [
        ("ticks/setpoint_A", 1200, 7.1, "current_A = 7.1: must be at most 7"),
        ("ticks/force_N", slice(1200, 1300), -2.2, "must be at most 0.5"),  # and back, each component by 2.2 N
        ("ticks/enabled", slice(1200, 1300), 0, "set-points while outputs are off"),
        ("ticks/mode", -1, 6, "ends in mode suspended, faults 0x0: must be render, 0x0"),
        ("ticks/faults", -1, 512, "faults 0x200"),
        ("ticks/model_age_ticks", -1, 201, "the model at the end is too old"),
        ("ticks/true_tip_m", 1200, 0.0, "speed_m_s"),
    ],
)
def test_each_limit_is_watched(name, rows, value, said):
    def change(run: Run) -> None:
        run.values[name][rows] = value

    assert said in broken(made_run(change=change))


TOLD = "force 0.1 N above that of the body, and of the run without the fault in the same tick"


def rise(run: Run, most_N: float, since: int = 1000) -> None:
    """Slowly, so that no step shows it."""
    run.values["ticks/force_N"][since:, 2] = -2.0 - np.minimum(most_N, np.arange(TICKS - since) * 0.01)


def test_more_force_than_without_the_fault_is_told_and_a_slow_rise_too():
    assert broken(made_run(change=lambda run: rise(run, 0.6))) == TOLD
    assert broken(made_run(change=lambda run: rise(run, 0.49))) == ""

    def true(run: Run) -> None:  # the tip has gone where the body has more
        rise(run, 0.6)
        run.values["reference/force_N"][:, 2] = -2.2

    assert broken(made_run(change=true)) == ""


def test_a_contact_that_is_found_anew_has_a_history_of_its_own():
    def back(run: Run, fading: bool) -> None:
        if fading:
            run.values["ticks/model_age_ticks"][1000:1500] = np.arange(500)
        rise(run, 0.6, since=1500)

    assert TOLD in broken(made_run(change=lambda run: back(run, False)))
    assert TOLD not in broken(made_run(change=lambda run: back(run, True)))


SILENT = case(silent=True, first_s=1.0, end_s=2.9)
REFUSED = case(refused=True, first_s=1.0, end_s=2.9)


def fade(run: Run, end: int) -> None:
    """From 1.0 s on models only age, and their force fades."""
    age_ticks = np.arange(end - 1000) + 30
    run.values["ticks/model_age_ticks"][1000:end] = age_ticks
    run.values["ticks/force_N"][1000:end, 2] = -2.0 * np.clip(1.0 - (age_ticks - VALID_TICKS) / rules.FADE_TICKS, 0.0, 1.0)
    run.values["ticks/force_N"][end:, 2] = -0.5


def silence(run: Run) -> None:
    """As documented: faded, damped, switched off until a model comes again."""
    fade(run, 2900)
    for name in ("ticks/enabled", "ticks/setpoint_A"):
        run.values[name][2400:2900] = 0
    run.values["ticks/mode"][2400:2900] = 6


def refusal(run: Run, missed: int = 0) -> None:
    """As documented: every model refused, which is the same to the force and the outputs."""
    silence(run)
    sent = run.values["updates/sent_tick"]
    run.values["updates/status"][(sent >= 1000 + missed) & (sent < 2900)] = rules.SCHEMA_MISMATCH


def swell(run: Run, first: int, end: int, most_N: float) -> None:
    """A force that comes and goes so slowly that no step shows it."""
    i = np.arange(end - first)
    run.values["ticks/force_N"][first:end, 2] = -np.minimum(most_N, 0.02 * np.minimum(i, end - first - 1 - i))


def test_silence_must_end_the_force_and_the_outputs_in_time():
    assert "force gone after None ticks: must be at most 400; outputs off after None ticks: must be at most 1500" in broken(
        made_run(), SILENT
    )
    result = judge(SILENT, made_run(), made_run(change=silence), VALID_TICKS)
    assert result.broken == ()
    assert (result.numbers["force_gone_ticks"], result.numbers["outputs_off_ticks"]) == (370, 1400)


def test_under_silence_force_and_outputs_must_stay_gone():
    def force_back(run: Run) -> None:
        silence(run)
        swell(run, 1600, 2300, 2.0)

    assert broken(made_run(change=force_back), SILENT) == "force gone after 1249 ticks: must be at most 400"

    def damped(run: Run) -> None:  # the damper's force is no model's
        silence(run)
        swell(run, 1600, 2300, rules.DAMPING_FORCE_N)

    assert broken(made_run(change=damped), SILENT) == ""

    def on_again(run: Run, end: int = 2600) -> None:
        silence(run)
        run.values["ticks/enabled"][2500:end] = 1

    assert broken(made_run(change=on_again), SILENT) == "outputs off after 1600 ticks: must be at most 1500"
    assert "outputs off after None ticks" in broken(made_run(change=lambda run: on_again(run, 2900)), SILENT)


def test_of_refused_models_force_and_outputs_must_stay_gone():
    def force_back(run: Run) -> None:
        refusal(run)
        swell(run, 1500, 1900, 1.9)

    # The last tick with more than the damper's newton.
    assert broken(made_run(change=force_back), REFUSED) == "force gone after 849 ticks: must be at most 400"

    def on_again(run: Run) -> None:
        refusal(run)
        run.values["ticks/enabled"][2500:2600] = 1

    assert broken(made_run(change=on_again), REFUSED) == "outputs off after 1600 ticks: must be at most 1500"


def test_a_tip_whose_model_is_young_is_not_damped():
    """Where nothing is felt without the fault, the damper's newton is allowed to a faded model alone, and no slack on top of it."""
    good = made_run()
    good.values["ticks/force_N"][:] = 0.0
    good.values["reference/force_N"][:] = 0.0

    def run_of(most_N: float, faded: bool = True) -> Run:
        run = made_run(change=silence)
        if not faded:
            run.values["ticks/model_age_ticks"][:] = VALID_TICKS + rules.FADE_TICKS - 1
        run.values["ticks/force_N"][:] = 0.0
        run.values["reference/force_N"][:] = 0.0
        swell(run, 1600, 2300, most_N)
        return run

    def said(most_N: float, faded: bool = True) -> str:
        return "; ".join(judge(replace(SILENT, silent=False), good, run_of(most_N, faded), VALID_TICKS).broken)

    assert said(0.99) == ""
    assert "force 0.2 N above that of the body" in said(1.2)
    assert "force 0.49 N above that of the body, and of the run without the fault in the same tick" in said(0.99, faded=False)


@pytest.mark.parametrize(
    ("removed", "lost", "loss", "good"),
    [
        (10, 10, cases.EXACT, True),
        (10, 9, cases.EXACT, False),
        (10, 11, cases.EXACT, False),
        (4, 0, cases.EXACT, False),
        (0, 9999, cases.EXACT, False),
        (74, 10, cases.MODULO, True),
        (74, 42, cases.MODULO, True),
        (74, 74, cases.MODULO, True),
        (76, 8, cases.MODULO, False),
        (79, 10, cases.MODULO, False),
        (74, 106, cases.MODULO, False),
        (64, 0, cases.MODULO, False),
    ],
)
def test_losses_must_show(removed, lost, loss, good):
    ways = {"removed": dict.fromkeys(("down", "up"), removed), "counters": dict.fromkeys(("frames_lost_down", "frames_lost_up"), lost)}
    assert (broken(replace(made_run(), **ways), case(loss=loss)) == "") is good
    # Whatever it ends in.
    assert ("frames_lost" not in broken(replace(made_run(), **ways), case(loss=loss, ends_mode="fault"))) is good


def test_what_a_full_queue_drops_must_show_but_for_the_last_of_a_flood():
    def said(dropped: int, lost: int, one: cases.Case) -> str:
        counters = {"frames_lost_down": lost, "frames_lost_up": 0}
        return broken(replace(made_run(), dropped={"down": dropped, "up": 0}, counters=counters), one)

    assert said(100, 99, case()) == "frames_lost_down = 99: 100 were removed"
    assert said(100, 100 - cases.MOST_FLOOD, case(unseen=cases.MOST_FLOOD)) == ""
    assert "35: 100 were removed" in said(100, 99 - cases.MOST_FLOOD, case(unseen=cases.MOST_FLOOD))
    assert "101: 100 were removed" in said(100, 101, case(unseen=cases.MOST_FLOOD))
    assert "1: 0 were removed" in said(0, 1, case(unseen=cases.MOST_FLOOD))
    source = (ROOT / "host/session/troubled_link.cpp").read_text("utf-8")
    assert re.findall(r"kMostFlood = (\d+);", source) == [str(cases.MOST_FLOOD)]


def test_models_that_another_hosts_displace_must_show():
    def said(lost: int) -> str:
        counters = {"frames_lost_down": lost, "frames_lost_up": 0, "models_sent": 9, "models_taken": 5, "models_refused": 1}
        return broken(replace(made_run(), counters=counters), case(displaces=True))

    assert said(3) == ""
    assert "2: 3 were removed" in said(2) and "4: 3 were removed" in said(4)


def test_bits_that_flip_must_have_flipped():
    flips = case(group="flip")
    assert broken(made_run(), flips) == "no bit has flipped"
    assert broken(replace(made_run(), sent_again=1), flips) == ""
    assert judge(flips, made_run(), replace(made_run(), sent_again=3, bus_offs=1), VALID_TICKS).numbers["bus_offs"] == 1


def test_a_fault_that_is_to_cut_must_cut_in_its_tick():
    cut = case(kind=cases.CUT, end_s=1.0, ends_mode="fault", faults=1)

    def stop(run: Run, off: int) -> None:
        run.values["ticks/faults"][1000:] = 1
        run.values["ticks/mode"][1000:] = BOARD_MODES.index("fault")
        for name in ("ticks/force_N", "ticks/setpoint_A", "ticks/enabled"):
            run.values[name][off:] = 0

    assert broken(made_run(change=lambda run: stop(run, 1000)), cut) == ""
    assert "outputs off after 1 ticks" in broken(made_run(change=lambda run: stop(run, 1001)), cut)

    def come_back(run: Run) -> None:
        stop(run, 1000)
        run.values["ticks/enabled"][1500] = 1

    assert broken(made_run(change=come_back), cut) == "outputs on again, though nobody has armed"


def test_a_board_that_starts_again_is_off_in_its_first_tick_and_found_by_the_host():
    reset = case(kind=cases.CUT, end_s=1.0, ends_mode="idle", restarts=1)

    def restart(run: Run, off: int) -> None:
        run.values["ticks/mode"][1000:1020] = rules.BOOT
        run.values["ticks/mode"][1020:] = BOARD_MODES.index("idle")
        for name in ("ticks/force_N", "ticks/setpoint_A", "ticks/enabled"):
            run.values[name][off:] = 0

    found = replace(made_run(change=lambda run: restart(run, 1000)), restarts=1)
    assert broken(found, reset) == ""
    assert broken(replace(found, restarts=0), reset) == "the host found 0 restarts of the board: there were 1"
    late = replace(made_run(change=lambda run: restart(run, 1001)), restarts=1)
    assert "outputs off after 1 ticks, fault or boot after 0" in broken(late, reset)


def test_models_that_the_board_must_refuse_are_refused_and_fade():
    result = judge(REFUSED, made_run(), made_run(change=refusal), VALID_TICKS)
    assert result.broken == () and result.numbers["refused_models"] == 63 and result.numbers["outputs_off_ticks"] == 1400
    assert "62 of 63 models of another schema were refused" in broken(made_run(change=lambda run: refusal(run, 20)), REFUSED)
    assert "0 of 63 models" in broken(made_run(), REFUSED)


def test_the_picture_gives_each_case_its_own_limit():
    stiff = made_run()
    stiff.values["ticks/force_N"][1200:, 2] -= 0.4  # changes by 0.4 N in a tick
    results = [judge(case(), good, good, VALID_TICKS) for good in (made_run(), stiff)]
    (axes,) = (one for one in picture.cases_figure(results).axes if "largest change" in one.get_xlabel())
    drawn_N = [[float(line[0, 0]) for line in lines.get_segments()] for lines in axes.collections]
    np.testing.assert_allclose(drawn_N, [[0.0, 0.4], [rules.FORCE_STEP_N, rules.FORCE_STEP_N + 0.4]], atol=1e-6)


def test_limits_are_those_of_the_firmware():
    text = (ROOT / "firmware/core/supervisor.hpp").read_text("utf-8").split("struct Limits {")[1].split("\n};")[0]

    def limit(name: str) -> float:
        (value,) = re.findall(rf" {name}(?: = |{{)([0-9.']+)", text)
        return float(value.replace("'", ""))

    assert rules.PEAK_FORCE_N == limit("peak_force_N") and rules.MOTOR_CURRENT_A == limit("motor_current_A")
    assert rules.TIP_SPEED_M_S == limit("tip_speed_m_s") and rules.FORCE_STEP_N == limit("force_step_N")
    assert rules.FADE_TICKS == limit("model_fade_ticks") and rules.SILENT_TICKS == limit("link_silent_ticks")
    assert rules.DAMPING_TICKS == limit("damping_ticks") and rules.DAMPING_FORCE_N == limit("damping_force_N")
    status = (ROOT / "shared/status.hpp").read_text("utf-8")
    assert re.findall(r"schema_mismatch = (\d+)", status) == [str(rules.SCHEMA_MISMATCH)]
    joint = (ROOT / "shared/device/parameters.hpp").read_text("utf-8")
    (lines, ratio) = re.findall(r"counts_per_rad\((\d+)\.0f, ([\d.]+)f\)", joint)[0]
    assert pytest.approx(4 * int(lines) * float(ratio) / (2.0 * np.pi)) == cases.COUNTS_PER_RAD
    # What the encoder's cases turn at once.
    assert 0.06 > limit("joint_step_rad") > 0.02
    # Silence is longer than signs of life may be apart, and 30 ms of jitter no matter.
    assert rules.SILENT_TICKS > 2 * rules.SIGN_TICKS + 30


def test_a_folder_that_cannot_be_written_is_told_before_anything_runs(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="--out = .*/file/out: Not a directory: must be a folder that can be made or written"):
        command.check_folder(tmp_path / "file/out")
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(SceneError, match="holds file, which palpate bench faults does not write"):
        command.check_folder(tmp_path)


def test_names_of_cases_are_unique_and_wrong_ones_are_told():
    for medium in cases.MEDIA:
        names = [one.name for one in cases.all_cases(medium)]
        assert len(set(names)) == len(names)
    assert {one.group for one in command.choose(["drop", "second host"], False)} == {"drop", "second host"}
    (quick,) = command.choose(["drop", "duplicate"], True)
    assert quick.name == "drop 50 %"
    with pytest.raises(SceneError, match="--only nothing: must be a group"):
        command.choose(["nothing"], False)
    with pytest.raises(SceneError, match="--only truncate: must be a group"):
        command.choose(["truncate"], False, "can")


def test_bad_input_is_exit_code_2(tmp_path):
    (tmp_path / "mine.txt").write_text("")
    for options, said in (
        (["faults", "--out", str(tmp_path)], "holds mine.txt"),
        (["faults", "--only", "sunshine"], "--only sunshine: must be a group"),
        (["frontier", "--only", "drop"], "unrecognized arguments: --only drop"),
        (["faults", "--only", "duplicate", "--quick"], "none of these is a quick case; those are drop 50 %"),
    ):
        done = palpate("bench", *options)
        assert done.returncode == 2 and said in done.stderr, done.stderr


def test_the_short_matrix_on_a_can_bus_breaks_no_rule(tmp_path):
    done = palpate("bench", "faults", "--medium", "canfd", "--quick", "--out", str(tmp_path / "out"), "--json")
    assert done.returncode == 0, done.stderr
    values = json.loads(done.stdout)
    assert values["passed"] and values["medium"] == "canfd"
    numbers = {one["name"]: one for one in values["cases"]}
    assert numbers["flip 10 %"]["sent_again"] > 100 and numbers["babbling node 2 s, peak"]["outputs_off_ticks"] is not None


def test_the_short_matrix_on_usb_breaks_no_rule(tmp_path):
    done = palpate("bench", "faults", "--medium", "usb", "--quick", "--out", str(tmp_path / "out"), "--json")
    assert done.returncode == 0, done.stderr
    values = json.loads(done.stdout)
    assert values["passed"] and values["medium"] == "usb" and len(values["cases"]) == 4
    numbers = {one["name"]: one for one in values["cases"]}
    assert numbers["flip 10 %"]["sent_again"] > 100
    out = numbers["unplugged 2 s, peak"]
    # Traces of 2 s and of what it takes to come back; settling, reset and recovery are 120 ms of that.
    assert out["lost_up"] == out["removed_up"] > 2000 / 4 and out["lost_down"] == out["removed_down"] > 10
    assert 120 < out["recovery_ticks"] < 300
    assert numbers["refused 2 s, peak"]["removed_down"] == 0 < numbers["refused 2 s, peak"]["lost_up"]
    assert numbers["board reset, peak"]["board_restarts"] == 1


def test_a_board_that_starts_again_need_not_know_what_it_missed():
    ways = {"removed": {"down": 4, "up": 0}, "counters": {"frames_lost_down": 0, "frames_lost_up": 0}}
    assert broken(replace(made_run(), **ways), case(loss=cases.RESTART)) == ""
    more = {**ways, "counters": {"frames_lost_down": 5, "frames_lost_up": 0}}
    assert "frames_lost_down = 5: 4 were removed" in broken(replace(made_run(), **more), case(loss=cases.RESTART))
    # The host has counted all the time.
    up = {"removed": {"down": 0, "up": 4}, "counters": {"frames_lost_down": 0, "frames_lost_up": 3}}
    assert "frames_lost_up = 3: 4 were removed" in broken(replace(made_run(), **up), case(loss=cases.RESTART))


def test_the_matrix_breaks_no_rule(tmp_path):
    """The gate: runs the firmware as a Linux process (and once in QEMU) through the whole matrix of a serial line."""
    done = palpate("bench", "faults", "--out", str(tmp_path / "out"), "--json", timeout_s=500.0)
    assert done.returncode == 0, done.stderr
    values = json.loads(done.stdout)
    assert values["passed"] and len(values["cases"]) == len(cases.all_cases())
    kept = json.loads(Path(values["files"]["faults.json"]).read_text("utf-8"))
    assert kept == {key: value for key, value in values.items() if key != "files"}
    for name in ("faults.png", "forces.png"):
        assert Path(values["files"][name]).stat().st_size > 10_000
    page = Path(values["files"]["index.html"]).read_text("utf-8")
    assert page.count("data:image/png;base64,") == 2 and 'src="http' not in page
    for one in values["cases"]:
        assert f"<td>{one['name']}</td>" in page
    # What is left is by the case that comes closest, and nothing else has less.
    assert all(margin["left"] >= -rules.ROUNDING for margin in values["margins"])
    largest_N = max(one["step_N"] for one in values["cases"])
    assert [margin["value"] for margin in values["margins"] if margin["rule"] == 2 and margin["unit"] == "N"] == [largest_N]
    # What is removed is there to be removed, or the rules hold for nothing.
    lossy = {one["name"]: one["removed_down"] + one["removed_up"] for one in values["cases"]}
    assert lossy["drop 50 %"] > 500 and lossy["flip 25 %"] > 200 and lossy["unplugged 2 s, peak"] > 400
    assert lossy["truncate 25 %"] > 200 and lossy["flood 1.5 of the link"] > 30_000
    assert_documented(values)


def assert_documented(values: dict[str, Any]) -> None:
    """docs/faults.md shows this run, to the digits that it has; other machines' mathematical functions round otherwise."""
    shown = json.loads(docs.FAULTS.read_text("utf-8"))["media"][values["medium"]]
    rows = groups.by_group(values["cases"])
    again = "measure again: python host/bench/fault_numbers.py, then python -m palpate.docs"
    assert [row.pop("group") for row in rows] == [row.pop("group") for row in shown["groups"]], again
    for row, kept in zip(rows, shown["groups"], strict=True):
        numbers = {name: value for name, value in kept.items() if value is not None}
        assert {name: value for name, value in row.items() if value is not None} == pytest.approx(numbers, rel=1e-3, abs=5e-3), again


def test_groups_have_the_largest_of_their_cases():
    free = {"force_gone_ticks": None, "outputs_off_ticks": None, "recovery_ticks": None, "lost_down": 1, "lost_up": 0, "removed_down": 1, "removed_up": 2}
    first = {**free, "name": "a 1", "group": "a", "step_N": 0.2, "rise_N": 0.1, "excess_N": -0.5}
    second = {**free, "name": "a 2", "group": "a", "step_N": 0.1, "rise_N": 0.3, "excess_N": -0.1, "outputs_off_ticks": 7}
    other = {**first, "name": "b 1", "group": "b"}
    a, b = groups.by_group([first, other, second])
    assert a == {"group": "a", "cases": 2, "step_N": 0.2, "rise_N": 0.3, "force_gone_ticks": None, "outputs_off_ticks": 7,
                 "recovery_ticks": None, "left_N": 0.1, "lost": 2, "removed": 6}  # fmt: skip
    assert (b["group"], b["cases"], b["step_N"]) == ("b", 1, 0.2)
    assert groups.closest([first, other, second])["name"] == "a 2"


def test_the_picture_of_forces_says_which_curve_is_whose_and_how_long_each_fault_lasts():
    run = made_run()
    results = [judge(replace(case(), name=name, group=group), run, run, 200) for name, group in (("drop 1 %", "drop"), ("drop 5 %", "drop"), ("host killed, peak", "host killed"))]
    first, second = (axes for axes in picture.forces_figure(results).axes if axes.get_visible())
    assert [text.get_text() for text in first.get_legend().get_texts()] == ["1 %", "5 %"]
    assert [text.get_text() for text in second.get_legend().get_texts()] == ["peak"]
    assert len(first.get_lines()) == 5  # without faults, and of each case its curve and its bar
    bar_s = first.get_lines()[2].get_xdata()
    assert list(bar_s) == [case().first_s, case().end_s]
