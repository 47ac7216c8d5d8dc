"""`palpate bench frontier`: metrics on made-up records with known answers, dominated points, what is kept, bad input."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import fake_core
import numpy as np
import pytest
from command import palpate

from palpate import cli, hil
from palpate.experiment import ProgressBar
from palpate.frontier import bench, command, paths, points, results
from palpate.frontier.bench import Measured
from palpate.frontier.metrics import METRICS, catch_up_ticks, measure
from palpate.frontier.pareto import dominated
from palpate.frontier.ram import Ram, read_sections
from palpate.frontier.references import differences, digest, steps_s
from palpate.paths import SCENES
from palpate.reproduce import late
from palpate.scene import load_scene
from palpate.summary import relative_rms_percent

FREE, STICK, SLIP = 0, 1, 2


@contextmanager
def silent(label: str, unit: str) -> Iterator[ProgressBar]:
    yield lambda done, total: True


# ---- metrics


def made_up_record(ticks: int = 100) -> tuple[dict[str, Any], dict[str, Any]]:
    """A press of 2 N along -z from tick 20 to 79, rendered as it is; one model, taken over in tick 50, 40 ticks old."""
    k = np.arange(ticks)
    touching = (k >= 20) & (k < 80)
    force_N = np.where(touching, -2.0, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    mode = np.where(touching, STICK, FREE).astype(np.uint8)
    lag = np.zeros(ticks, dtype=np.uint32)
    lag[44:50] = [30, 25, 20, 15, 10, 5]
    record = {
        "ticks/tick": k,
        "ticks/force_N": force_N.astype(np.float32),
        "ticks/contact_mode": mode,
        "ticks/model_sequence": np.where(k < 50, 0, 1),
        "ticks/catch_up_ticks": lag,
        "ticks/link_up_bytes": np.full(ticks, 10),
        "ticks/link_down_bytes": np.full(ticks, 20),
        "ticks/tick_count": np.where(touching, 2000, 1000),
        "ticks/busy_count": np.full(ticks, 3000),
        "ticks/background_overruns": np.minimum(k, 3),
        "ticks/faults": np.zeros(ticks, dtype=np.uint32),
        "updates/status": np.array([0], dtype=np.uint8),
        "updates/tick": np.array([10]),
        "updates/swap_tick": np.array([50]),
        "updates/bytes": np.array([400]),
        "updates/basis_bytes": np.array([6600]),
        "updates/modes": np.array([48]),
    }
    return record, {"reference/force_N": force_N, "reference/contact_mode": mode.copy()}


def test_metrics_of_a_perfect_run() -> None:
    record, reference = made_up_record()
    found = measure(record, reference, 5)
    assert list(found) == [metric.name for metric in METRICS]
    json.dumps(found, allow_nan=False)
    assert (found["error_percent"], found["error_all_percent"], found["same_mode_percent"]) == (0.0, 0.0, 100.0)
    assert (found["jump_N"], found["peak_force_N"], found["contact_ticks"]) == (0.0, 2.0, 60)
    assert found["late_ticks"] == {"median": 40.0, "worst": 40.0}
    assert found["catch_up_ticks"] == {"median": 6.0, "worst": 6.0}
    assert (found["link_up_bytes_per_s"], found["link_down_bytes_per_s"]) == (10_000.0, 20_000.0)
    assert (found["state_bytes"], found["basis_bytes"]) == (400.0, 6600)
    assert found["busy_instructions"] == {"p99": 15_000, "worst": 15_000}
    assert (found["models_taken"], found["models_not_taken"], found["background_overruns"]) == (1, 0, 3)


def test_error_counts_ticks_in_the_same_mode_only() -> None:
    record, reference = made_up_record()
    record["ticks/force_N"][20:50] *= 1.1  # 10 % off in half of the contact
    record["ticks/contact_mode"][50:56] = SLIP  # elsewhere in 6 of 60 ticks, and far off there
    record["ticks/force_N"][50:56] = 0.0
    found = measure(record, reference, 5)
    # 30 of the 54 ticks in the same mode are 0.2 N off, of 2 N.
    assert found["error_percent"] == pytest.approx(100 * np.sqrt(30 * 0.2**2 / (54 * 2.0**2)), rel=1e-5)
    assert found["error_all_percent"] == pytest.approx(100 * np.sqrt((30 * 0.2**2 + 6 * 2.0**2) / (60 * 2.0**2)), rel=1e-5)
    assert found["same_mode_percent"] == pytest.approx(90.0)
    assert found["worst_error_N"] == pytest.approx(2.0)
    # In tick 50, in which the model is taken over, the error goes from -0.2 N to 2 N.
    assert found["jump_N"] == pytest.approx(2.2)


def test_contact_of_the_board_alone_is_another_mode() -> None:
    record, reference = made_up_record()
    record["ticks/contact_mode"][80:92] = STICK
    assert measure(record, reference, 5)["same_mode_percent"] == pytest.approx(100 * 60 / 72)


def test_a_run_without_models_or_contact_has_no_such_numbers() -> None:
    record, reference = made_up_record()
    record = {name: values[:0] if name.startswith("updates/") else values for name, values in record.items()}
    for values in (record["ticks/force_N"], reference["reference/force_N"]):
        values[:] = 0.0
    for values in (record["ticks/contact_mode"], reference["reference/contact_mode"]):
        values[:] = FREE
    found = measure(record, reference, None)
    for name in ("error_percent", "error_all_percent", "same_mode_percent", "late_ticks", "catch_up_ticks", "modes"):
        assert found[name] is None
    assert found["tick_instructions"] is None
    assert found["busy_instructions"] is None


def test_instructions_are_those_of_ticks_with_contact() -> None:
    record, reference = made_up_record()
    # A tick's length stands in the row after it: rows 21 to 80 are of ticks in contact.
    record["ticks/tick_count"] = np.full(100, 9999)
    record["ticks/tick_count"][21:81] = np.arange(60)
    found = measure(record, reference, 5)["tick_instructions"]
    assert found == {"p99": int(np.percentile(np.arange(60), 99)) * 5, "worst": 59 * 5}


def test_models_that_were_not_taken_are_counted() -> None:
    record, reference = made_up_record()
    record |= {
        "updates/status": np.array([0, 36, 255], dtype=np.uint8),
        "updates/tick": np.array([10, 40, 70]),
        "updates/swap_tick": np.array([50, 0, 0]),
        "updates/bytes": np.array([1, 3, 2]),
        "updates/basis_bytes": np.zeros(3, int),
        "updates/modes": np.array([48, 96, 48]),
    }
    found = measure(record, reference, 5)
    assert (found["models_taken"], found["models_not_taken"]) == (1, 2)
    assert (found["late_ticks"]["worst"], found["state_bytes"], found["modes"]) == (40.0, 2.0, 96)


def test_catch_up_counts_the_ticks_before_each_take_over() -> None:
    lag = np.array([0, 0, 5, 3, 1, 0, 0, 0, 2, 1, 0, 0])
    assert catch_up_ticks(lag, np.array([5, 10])) == [3, 2]
    assert catch_up_ticks(np.array([4, 3, 0]), np.array([2])) == [2]
    assert catch_up_ticks(np.array([0, 0, 0]), np.array([2])) == [0]


def test_relative_error_of_nothing_is_none() -> None:
    assert relative_rms_percent(np.ones((3, 3)), np.zeros((3, 3))) is None


# ---- the reference


def test_convergence_is_against_the_finest_step() -> None:
    force_N = np.tile([0.0, 0.0, 3.0], (10, 1))
    records = {
        step: {"reference/force_N": factor * force_N, "reference/contact_mode": mode}
        for step, factor, mode in ((1e-4, 1.02, np.ones(10)), (5e-5, 1.01, np.ones(10)), (2.5e-5, 1.0, np.ones(10)))
    }
    records[1e-4]["reference/contact_mode"] = np.array([0] * 4 + [1] * 6)
    coarse, fine = differences(records)
    assert (coarse["step_s"], fine["step_s"]) == (1e-4, 5e-5)
    assert (coarse["difference_percent"], fine["difference_percent"]) == (pytest.approx(2.0), pytest.approx(1.0))
    assert (coarse["other_mode_ticks"], fine["other_mode_ticks"]) == (4, 0)


def test_a_stiff_body_has_a_finer_reference() -> None:
    scene = load_scene(SCENES / "frontier/reference.toml")
    assert steps_s(scene) == (1e-4, 5e-5, 2.5e-5)
    stiff = points.EXPERIMENTS["stiff_1e4"]
    assert steps_s(load_scene(SCENES / "frontier/reference.toml", stiff.overrides)) == pytest.approx((2e-5, 1e-5, 5e-6))


def test_a_longer_step_of_the_body_does_not_coarsen_the_reference() -> None:
    scene = load_scene(SCENES / "frontier/reference.toml", {"integrator.step_s": 2.5e-4})
    assert steps_s(scene) == (1e-4, 5e-5, 2.5e-5)


def test_digest_sees_every_number() -> None:
    one = {"a": [1, 2.0, None], "b": np.array([1.0, 2.0])}
    assert digest(one) == digest({"b": np.array([1.0, 2.0]), "a": [1, 2.0, None]})
    assert digest(one) != digest({**one, "b": np.array([1.0, 2.0 + 1e-15])})
    assert digest(one) != digest({**one, "a": [1, 2.5, None]})


# ---- dominated points


def test_dominated_points() -> None:
    assert dominated([]) == []
    assert dominated([(1.0, 5.0), (2.0, 4.0), (2.0, 5.0), (3.0, 3.0)]) == [False, False, True, False]
    assert dominated([(1.0, 1.0), (1.0, 1.0)]) == [False, False]
    assert dominated([(None, 1.0), (2.0, 1.0)]) == [True, False]
    assert dominated([(float("nan"), 0.0), (2.0, 1.0)]) == [False, False]


def made_up_point(name: str, error: float, down: float, ratio: float = 1.0, **overrides: Any) -> Measured:
    record, reference = made_up_record()
    metrics = {**measure(record, reference, 5), "error_percent": error, "link_down_bytes_per_s": down, **overrides}
    point = points.Point(points.EXPERIMENTS["stick_5mm"], points.BUILDERS[name])
    return Measured(point, "0", metrics, {"kernel_s": 1.0, "model_s": ratio, "first_s": 9.0}, 0.9, [])


def test_points_are_compared_within_an_experiment_and_not_over_delays() -> None:
    good, bad = made_up_point("patch", 1.0, 100.0), made_up_point("hold", 2.0, 100.0)
    elsewhere = replace(bad, point=replace(bad.point, experiment=points.EXPERIMENTS["stick_8mm"]))
    late = replace(bad, point=replace(bad.point, sweep="delay_frames", value="10"))
    found = results.on_frontier([good, bad, elsewhere, late])
    assert found == {good.point.name: True, bad.point.name: False, elsewhere.point.name: True}


def test_each_cost_keeps_a_point_on_the_frontier() -> None:
    base = made_up_point("patch", 1.0, 100.0)
    cheaper = [
        made_up_point("krylov_frame", 2.0, 99.0),
        made_up_point("krylov_rest", 2.0, 101.0, 0.9),
        made_up_point("hold", 2.0, 101.0, 1.0, tick_instructions={"p99": 1, "worst": 2}),
    ]
    assert all(results.on_frontier([base, *cheaper]).values())


def test_goals_of_the_default_builder() -> None:
    bound = points.EXPERIMENTS["stick_5mm"].bounds
    assert (bound.error_percent, bound.jump_N) == (0.3, 0.01)
    default = made_up_point(points.DEFAULT, 0.31, 1.0, jump_N=0.01)
    other = next(name for name in points.BUILDERS if name != points.DEFAULT)
    rows = {goal.metric: goal for goal in results.goals([default, made_up_point(other, 0.1, 1.0)])}
    assert (rows["error_percent"].reached, rows["jump_N"].reached) == (False, True)
    assert (rows["compliance_percent"].measured, rows["compliance_percent"].reached) == (0.9, True)
    slide = replace(default, point=replace(default.point, experiment=points.EXPERIMENTS["slide_3cm_s_mu0"]))
    rows = {goal.metric: goal for goal in results.goals([replace(slide, metrics={**slide.metrics, "same_mode_percent": 98.0})])}
    assert rows["same_mode_percent"].at_least
    assert rows["same_mode_percent"].reached
    # The larger part has the same bounds.
    larger = results.goals([made_up_point(points.LARGER_PART, 0.25, 1.0)])
    assert [goal.reached for goal in larger if goal.metric == "error_percent"] == [True]
    assert not results.Goal("a", "error_percent", 1.0, False, None).reached
    assert not results.Goal("a", "error_percent", 1.0, False, float("nan")).reached


# ---- what is run


def test_every_point_is_a_scene_of_its_own_name() -> None:
    every = points.all_points(quick=False)
    assert len({point.name for point in every}) == len(every)
    assert {point.name for point in points.all_points(quick=True)} <= {point.name for point in every}
    for point in every:
        scene = load_scene(point.run.file, point.run.overrides)
        assert scene.sections.hand.kind == "scripted"
        assert scene.path is not None
        assert scene.path.time_s[-1] < scene.sections.duration_s + 1e-9
        assert "/" not in point.name
    assert points.DEFAULT in points.BUILDERS


def test_the_paths_in_the_folder_are_those_of_the_code(tmp_path: Path) -> None:
    paths.write_all(tmp_path)
    for name in paths.PATHS:
        assert (paths.FOLDER / name).read_text() == (tmp_path / name).read_text(), "run: python -m palpate.frontier.paths"


@pytest.mark.parametrize(("name", "speed_m_s"), [("drag_3cm_s.csv", 0.03), ("drag_10cm_s.csv", 0.1)])
def test_drags_are_3_cm_at_their_speed(name: str, speed_m_s: float) -> None:
    rows = paths.PATHS[name]()
    x_m, z_m = rows[:, 1], rows[:, 3]
    assert x_m[-1] - x_m[0] == pytest.approx(0.03)
    assert paths.TOP_M - z_m.min() == pytest.approx(0.005)
    speed = np.diff(x_m) / np.diff(rows[:, 0])
    assert speed.max() == pytest.approx(speed_m_s)
    fast = (x_m[1:] - x_m[0] > speed_m_s * 0.05) & (x_m[-1] - x_m[:-1] > speed_m_s * 0.05)
    assert np.all(speed[fast] > 0.999 * speed_m_s)
    assert np.all(z_m[1:][fast] == z_m.min())


@pytest.mark.parametrize(("name", "depth_m", "pull_m"), [("poke_5mm.csv", 0.005, 0.005), ("poke_8mm.csv", 0.008, 0.005)])
def test_pokes_go_in_and_then_sideways(name: str, depth_m: float, pull_m: float) -> None:
    rows = paths.PATHS[name]()
    assert paths.TOP_M - rows[:, 3].min() == pytest.approx(depth_m)
    assert np.ptp(rows[:, 1]) == pytest.approx(pull_m)
    moves_sideways = np.abs(np.diff(rows[:, 1])) > 1e-9
    assert np.all(rows[1:, 3][moves_sideways] < paths.TOP_M - depth_m + 1e-6)
    assert np.allclose(rows[0, 1:], rows[-1, 1:])


def test_nothing_is_sent_while_the_tip_is_alone() -> None:
    # The only update before it touches is at 1 s; the next one can be in use no earlier than at 2 s.
    scene = load_scene(SCENES / "frontier/reference.toml", points.EXPERIMENTS["alone_1s"].overrides)
    assert scene.sections.rates.model_update_Hz == 1.0
    assert scene.path is not None
    inside_s = scene.path.time_s[scene.path.position_m[:, 2] < paths.TOP_M]
    assert 1.0 + 0.033 < inside_s[0] < inside_s[-1] < 2.0


# ---- the bench


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """The made-up core and board in place of the real ones, in an empty working directory."""
    import palpate

    monkeypatch.setitem(sys.modules, "palpate._core", fake_core)
    monkeypatch.setattr(palpate, "_core", fake_core, raising=False)
    for name in hil.BOARDS:
        monkeypatch.setitem(hil.BOARDS, name, fake_core.board())
    monkeypatch.setattr(command, "ram_of", lambda core, board: Ram(core.RENDERER_BYTES, 99))
    monkeypatch.chdir(tmp_path)
    return fake_core


class Counter:
    """Calls of the made-up core."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, core: ModuleType) -> None:
        self.runs = self.references = self.costs = 0
        self.fail_at: int | None = None
        run, reference, cost = core.run_closed_loop, core.reference, core.model_cost

        def counted_run(*given: Any) -> Any:
            self.runs += 1
            if self.runs == self.fail_at:
                raise RuntimeError("the third one fails")
            return run(*given)

        def counted_reference(*given: Any) -> Any:
            self.references += 1
            return reference(*given)

        def counted_cost(*given: Any) -> Any:
            self.costs += 1
            return cost(*given)

        monkeypatch.setattr(core, "run_closed_loop", counted_run)
        monkeypatch.setattr(core, "reference", counted_reference)
        monkeypatch.setattr(core, "model_cost", counted_cost)


@pytest.fixture
def counter(monkeypatch: pytest.MonkeyPatch, fake: ModuleType) -> Counter:
    return Counter(monkeypatch, fake)


def run(out: Path) -> list[Measured]:
    return bench.run_points(fake_core, points.all_points(quick=True), out, "native", silent)


def test_what_is_measured_is_not_run_again(counter: Counter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run(tmp_path)
    # Six points; two experiments with three steps of their reference each; two builders that build models.
    assert (counter.runs, counter.references, counter.costs) == (6, 6, 2)
    assert run(tmp_path) == first
    assert counter.runs == 6
    # A point whose numbers are lost or not of this program is run again, and no other.
    lost, broken = (tmp_path / bench.RUNS / point.point.name / bench.METRICS_FILE for point in first[:2])
    lost.unlink()
    broken.write_text("{")
    assert run(tmp_path) == first
    assert (counter.runs, counter.references) == (8, 6)
    monkeypatch.setattr(bench, "program_version", lambda core, board: "another")
    run(tmp_path)
    assert (counter.runs, counter.references) == (14, 12)


def test_another_scene_is_run_again(counter: Counter, tmp_path: Path) -> None:
    plan = points.all_points(quick=True)[:1]
    bench.run_points(fake_core, plan, tmp_path, "native", silent)
    other = [replace(plan[0], overrides={"contact.friction": 0.25})]
    bench.run_points(fake_core, other, tmp_path, "native", silent)
    assert counter.runs == 2


def test_what_was_measured_before_a_failure_is_kept(
    counter: Counter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.os, "sched_getaffinity", lambda pid: {0})
    counter.fail_at = 3
    with pytest.raises(RuntimeError, match="the third one fails"):
        run(tmp_path)
    begun, kept = counter.runs, len(list(tmp_path.glob(f"{bench.RUNS}/*/{bench.METRICS_FILE}")))
    assert kept in (2, 3)  # the next one may have begun already when the third failed
    run(tmp_path)
    assert counter.runs == begun + 6 - kept


def test_the_command_writes_what_it_prints(fake: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", "frontier", "--quick", "--out", "here", "--json"]) == 0
    printed = capsys.readouterr()
    values = json.loads(printed.out)
    assert "Numbers to reach" in printed.err
    written = json.loads(Path("here/frontier.json").read_text())
    assert {**written, "files": values["files"]} == values
    assert all(Path(file).exists() for file in values["files"].values())
    assert len(written["points"]) == 6
    for point in written["points"]:
        assert set(point["metrics"]) == set(written["metrics"])
        assert (point["host"] is None) == (point["builder"] == "hold")
        assert point["compliance_percent"] == (None if point["builder"] == "hold" else 3.0)
    assert written["ram"] == {"renderer": fake.RENDERER_BYTES, "image": 99}
    # Again: it finds its own files, and the same numbers.
    assert cli.main(["bench", "frontier", "--quick", "--out", "here"]) == 0
    assert json.loads(Path("here/frontier.json").read_text()) == written


def test_a_latched_fault_fails(fake: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    plain = fake.run_closed_loop

    def faulty(*given: Any) -> Any:
        values = plain(*given)
        values["ticks/faults"] = np.full(len(values["ticks/tick"]), 128)
        return values

    monkeypatch.setattr(fake, "run_closed_loop", faulty)
    assert cli.main(["bench", "frontier", "--quick", "--out", "here"]) == 1
    assert "the board latched a fault" in capsys.readouterr().err


def test_bad_input_is_refused_on_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for arguments in (
        ["bench"],
        ["bench", "speed"],
        ["bench", "frontier", "--fast"],
        ["bench", "frontier", "--out", str(tmp_path / "file")],
        ["bench", "frontier", "--out", str(tmp_path)],
    ):
        done = palpate(*arguments)
        assert (done.returncode, done.stdout) == (2, ""), arguments
        assert done.stderr.count("\n") == 1
    assert (tmp_path / "file").read_text() == "mine"


def test_ram_is_that_of_the_sections() -> None:
    listing = "a.elf  :\nsection  size  addr\n.text 1000 0\n.stack 16 1\n.data 8 2\n.bss 4 3\n.exchange 999 4\nTotal 2027\n"
    assert read_sections(listing) == 28


# ---- the section of `palpate reproduce`


def made_up_late(error: dict[str, float]) -> dict[str, Any]:
    """Records in which each builder's force is this much too large, in parts of 1."""
    records = {}
    for point in late.POINTS:
        record, reference = made_up_record()
        record["ticks/force_N"] = record["ticks/force_N"] * (1.0 + error[point.builder.name])
        records[point.name] = record | reference
    return records


def test_the_report_judges_patch_and_default_and_lists_every_builder(tmp_path: Path) -> None:
    error = {name: 0.1 for name in late.BUILDERS} | {"hold": 0.4, "patch": 0.2, points.DEFAULT: 0.05}
    records = made_up_late(error)
    found = late.checks(records)
    judged = {check.name: check for check in found if check.passed is not None}
    assert len(judged) == 2 * len(points.QUICK)
    assert [check.measured for check in judged.values()] == pytest.approx([0.5, 0.25] * len(points.QUICK), rel=1e-5)
    assert all(check.passed for check in judged.values())
    for table in late.tables(records):
        assert len(table.names) == len(table.rows) == len(late.BUILDERS)
        assert [row[0] for row in table.rows] == pytest.approx([100 * error[name] for name in late.BUILDERS], rel=1e-5)
        assert sum("(default)" in name for name in table.names) == 1
    late.draw(records, tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 10_000
    # A patch worse than the held force and a default worse than the patch fail.
    worse = made_up_late(error | {"hold": 0.1, points.DEFAULT: 0.3})
    assert sum(check.passed is False for check in late.checks(worse)) == 2 * len(points.QUICK)


def test_the_report_runs_what_the_bench_runs() -> None:
    assert {point.name for point in late.POINTS} <= {point.name for point in points.all_points(quick=False)}
    for run_of_report, point in zip(late.FIGURE.runs, late.POINTS, strict=True):
        scene, same = (load_scene(run.file, run.overrides).to_dict() for run in (run_of_report, point.run))
        assert scene.pop("reference")["enabled"]
        assert not same.pop("reference")["enabled"]
        for given in (scene, same):
            given["path"] = {name: str(value) for name, value in given["path"].items()}
        assert scene == same
