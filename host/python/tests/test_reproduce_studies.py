"""Figures and tables that rest on reductions: from end to end on a small body, and their checks on made-up records."""

import contextlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate import _core
from palpate.reduce.state_space import NORM_MARGIN
from palpate.reproduce import command, fig4, fig5, fig8, frontier, locality, table1, table2
from palpate.reproduce.checks import Check
from palpate.reproduce.figure import PaperFigure, Record, Records, Study, Table
from palpate.reproduce.reductions import collect, collect_undamped_contact, factors
from palpate.reproduce.studies import study
from palpate.scene import load_scene

SMALL = {"body.nodes": [5, 5]}


def failed(checks: list[Check]) -> list[str]:
    """Names of the checks that fail; all of them must survive JSON."""
    json.dumps([check.to_dict() for check in checks], allow_nan=False)
    assert len({check.name for check in checks}) == len(checks)
    assert all(check.reason and check.paper_states for check in checks)
    return [check.name for check in checks if check.passed is False]


# ---- a figure without runs


def draw(records: Records, file: Path) -> None:
    file.write_bytes(b"PNG, made up")


def small_figure() -> PaperFigure:
    return PaperFigure(
        "table1",
        "A small one",
        (("A claim", "2.2"),),
        ("What was done.",),
        "A caption",
        lambda records: [Check("states", "76", int(records["small"]["states"]), "", "equal", at_least=76, at_most=76)],
        draw,
        studies=(Study("small", "square", SMALL, order=8, collect=collect),),
        tables=lambda records: [Table("Rows", ("a", "b"), ((1, float("nan")),), main=True)],
    )


@pytest.mark.parametrize("hil", [False, True])
def test_a_study_needs_no_board(tmp_path: Path, hil: bool) -> None:
    phases: list[tuple[str, int, int]] = []

    @contextlib.contextmanager
    def progress(label: str, unit: str) -> Any:
        def update(done: int, total: int) -> bool:
            phases.append((label, done, total))
            return True

        yield update

    (result,), page = command.reproduce(_core, [small_figure()], tmp_path, hil, progress)
    assert phases == [("1 reductions", 1, 1), ("figures", 1, 1)]
    assert [check.name for check in result.checks] == ["states"] and result.passed
    stored = json.loads((tmp_path / "table1/results.json").read_text(encoding="utf-8"))
    assert stored == result.to_dict()
    assert stored["runs"] == [] and stored["tables"][0]["rows"] == [[1, None]]
    (described,) = stored["studies"]
    assert (described["scene"], described["overrides"]) == ("scenes/reproduce/square.toml", SMALL)
    text = page.read_text(encoding="utf-8")
    for words in ("Table 1. A small one", "without device and firmware", "<details open>", "./run reduce --scene"):
        assert words in text, words
    for words in ("--hil", "the firmware ran", "--board"):
        assert words not in text, words
    # A second time, over its own results.
    command.reproduce(_core, [small_figure()], tmp_path, hil, progress)


# ---- the tables' records


def test_a_record_has_the_errors_of_the_order_asked() -> None:
    record = study(_core, Study("small", "square", SMALL, order=8, dense=True, collect=collect_undamped_contact))
    hankel = record["hankel"]
    assert (int(record["states"]), int(record["order"]), len(hankel)) == (76, 8, 76)
    assert record["next_singular_value"] == pytest.approx(100 * hankel[8])
    assert record["tail_sum"] == pytest.approx(100 * hankel[8:].sum() / hankel.sum())
    # Twice the singular values left out bound the error, and the first of them is below it.
    largest = hankel[0] * record["tail_sum"] / record["next_singular_value"]
    assert largest > 0 and record["relative_h_infinity"] > 0
    # The damper at the contact carries a part of the response: without it the number is another one.
    assert abs(float(record["undamped_contact"] / record["tail_sum"]) - 1.0) > 0.01


def test_a_factor_is_off_to_both_sides() -> None:
    assert factors([1.0, 4.0, 1.0], [1.0, 2.0, 3.0]) == pytest.approx([1.0, 2.0, 3.0])


# ---- Table 1


def table1_records(factor: float = 1.0, **changed: Any) -> dict[str, Record]:
    records: dict[str, Record] = {}
    for case in table1.FIGURE.studies:
        dimension, n = case.name.split("D")[0], int(case.name.split()[1])
        states, _, error = table1.PAPER[int(dimension)][n]
        records[case.name] = {
            "states": np.array(states),
            "order": np.array(case.order),
            "relative_h_infinity": np.array(2.0 * error),
            "next_singular_value": np.array(3.0 * error),
            "tail_sum": np.array(error if n < 25 else factor * error),
            "projection_error": np.array(1e-6 * error),
            "time_s": np.array(1.0),
        } | changed
    return records


def test_table_1_passes_on_the_papers_numbers() -> None:
    records = table1_records()
    assert failed(table1.checks(records)) == []
    for table in table1.tables(records):
        assert all(len(row) == len(table.columns) for row in table.rows)
    errors, times, closed = table1.tables(records)
    paper = [row for rows in table1.PAPER.values() for row in rows.values()]
    assert [row[3] for row in errors.rows] == [row[3] for row in closed.rows] == [error for _, _, error in paper]
    assert [row[2:4] for row in times.rows] == [(states, seconds) for states, seconds, _ in paper]


@pytest.mark.parametrize("factor", [5.2, 1 / 5.2])
def test_table_1_fails_on_a_judged_row_that_is_more_than_a_factor_of_5_off(factor: float) -> None:
    assert any("sum of the singular values" in name for name in failed(table1.checks(table1_records(factor))))


def test_table_1_fails_on_other_states_another_trend_and_a_coarse_projection() -> None:
    assert len(failed(table1.checks(table1_records(states=np.array(76))))) == 1
    assert len(failed(table1.checks(table1_records(projection_error=np.array(1.0))))) == 1
    assert any("coarser" in name for name in failed(table1.checks(table1_records(0.6))))  # 25 x 25 below 20 x 20
    records = table1_records()
    records["2D 10 dense"] = {**records["2D 10 dense"], "next_singular_value": np.array(1.0)}
    assert len(failed(table1.checks(records))) == 1


# ---- Table 2


def table2_records(tail_sum: dict[float, float], **changed: Any) -> dict[str, Record]:
    def record(error: float) -> dict[str, Any]:
        return {
            "states": np.array(524),
            "relative_h_infinity": np.array(8.0 * error),
            "next_singular_value": np.array(9.0 * error),
            "tail_sum": np.array(error),
            "undamped_contact": np.array(error),
            "projection_error": np.array(1e-9 * error),
            "hankel": np.array([1.0, 0.1, 1e-5, 1e-9]),
        }

    records: dict[str, Record] = {}
    for case in table2.FIGURE.studies:
        ratio = float(case.overrides.get("body.damping_ratio", 1.0))
        records[case.name] = record(tail_sum[ratio]) | changed
    return records


def test_table_2_passes_on_the_papers_numbers() -> None:
    records = table2_records(table2.PAPER)
    assert failed(table2.checks(records)) == []
    for table in table2.tables(records):
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert [row[1] for row in table.rows] == list(table2.PAPER.values())


@pytest.mark.parametrize("factor", [5.2, 1 / 5.2])
def test_table_2_fails_on_a_row_that_is_more_than_a_factor_of_5_off(factor: float) -> None:
    names = failed(table2.checks(table2_records({**table2.PAPER, 2.0: factor * table2.PAPER[2.0]})))
    assert [name for name in names if "tail" in name or "sum of the singular" in name] != []


def test_table_2_fails_on_another_trend_another_body_and_another_nearest_definition() -> None:
    rising = {**table2.PAPER, 0.7: 1.1 * table2.PAPER[0.6]}
    assert len(failed(table2.checks(table2_records(rising)))) == 1
    assert len(failed(table2.checks(table2_records(table2.PAPER, states=np.array(528))))) == 1
    near = {key: value * 3.0 for key, value in table2.PAPER.items()}
    records = table2_records(near)
    for name, record in records.items():
        records[name] = {**record, "next_singular_value": record["tail_sum"] / 3.0}
    assert len(failed(table2.checks(records))) == 1


def test_table_2_fails_where_stiffness_matters() -> None:
    records = table2_records(table2.PAPER)
    records["stiffness 10"] = {**records["stiffness 10"], "hankel": np.array([1.0, 0.1001, 1e-5, 1e-9])}
    assert len(failed(table2.checks(records))) == 1


# ---- Figure 4


def fig4_records() -> dict[str, Record]:
    def record(cross: float) -> dict[str, Any]:
        full = np.full((len(fig4.FREQUENCY_Hz), 2, 2), cross, dtype=np.complex128)
        full[:, [0, 1], [0, 1]] = 100.0 + 5.0j
        return {"states": np.array(524), "order": np.array(20), "full": full, "reduced": full * 1.005}

    return {fig4.ONE_EDGE: record(10.0), fig4.THREE_EDGES: record(1e-14)}


def test_figure_4_passes_on_what_the_paper_describes() -> None:
    assert failed(fig4.checks(fig4_records())) == []


@pytest.mark.parametrize("name", [fig4.ONE_EDGE, fig4.THREE_EDGES])
def test_figure_4_fails_where_one_response_is_more_than_1_percent_off(name: str) -> None:
    records = fig4_records()
    reduced = records[name]["reduced"].copy()
    reduced[1, 1, 1] *= 1.01
    records[name] = {**records[name], "reduced": reduced}
    assert len(failed(fig4.checks(records))) == 1


def test_figure_4_fails_on_a_response_across_and_on_another_order() -> None:
    records = fig4_records()
    reduced = records[fig4.THREE_EDGES]["reduced"].copy()
    reduced[2, 0, 1] = 1e-9  # -180 dB
    records[fig4.THREE_EDGES] = {**records[fig4.THREE_EDGES], "reduced": reduced, "order": np.array(18)}
    assert len(failed(fig4.checks(records))) == 2


# ---- Figure 5


def fig5_record(power: float) -> Record:
    """Components that go with this power of the distance, on a half plane of nodes, two states."""
    i, k = np.meshgrid(np.arange(13), np.arange(1, 13), indexing="ij")
    place = np.stack([i.ravel(), k.ravel()], axis=1)
    place = place[(place != [6, 12]).any(axis=1)]
    distance = np.linalg.norm(place - [6, 12], axis=1)
    squared = distance ** (2.0 * power)
    share = np.stack([squared, squared], axis=1) / squared.sum()
    return {
        "place": place,
        "size": np.array([13, 13]),
        "contact": np.array([6, 12]),
        "distance": distance,
        "share": share,
        "left_share": share,
        "weight": np.array([0.7, 0.3]),
    }


def test_figure_5_passes_on_an_inverse_square_and_fails_on_even_states() -> None:
    for power, failures in ((-2.0, 0), (0.0, 2)):
        records = {fig5.THREE_EDGES: fig5_record(power), fig5.ONE_EDGE: fig5_record(0.0)}
        assert len(failed(fig5.checks(records))) == failures
        assert fig5.exponent(records[fig5.THREE_EDGES]) == pytest.approx(power, abs=0.2)


def test_figure_5_shares_are_those_of_the_reduction() -> None:
    case = Study("small", "square", {"body.nodes": [7, 7]}, order=8, dense=True, collect=fig5.collect)
    dense = study(_core, case)
    assert dense["share"].shape == dense["left_share"].shape == (7 * 6 - 1, 8)
    for name in ("share", "left_share"):
        assert dense[name].sum(axis=0) == pytest.approx(np.ones(8))
    assert dense["weight"].sum() == pytest.approx(1.0)
    # The contact node is in the mesh's axis, so each state is the same on both sides of it.
    mirrored = {(6 - i, k): share for (i, k), share in zip(dense["place"].tolist(), dense["share"], strict=True)}
    for (i, k), share in zip(dense["place"].tolist(), dense["share"], strict=True):
        assert share == pytest.approx(mirrored[i, k], abs=1e-6)
    # A projection finds the same.
    projected = study(_core, replace(case, dense=False, tolerance=1e-9))
    assert projected["share"][:, :4] == pytest.approx(dense["share"][:, :4], abs=1e-5)
    assert projected["left_share"][:, :4] == pytest.approx(dense["left_share"][:, :4], abs=1e-5)


# ---- Figure 8


def fig8_records(high: float = 0.05, low: float = 0.5) -> dict[str, Record]:
    """A local model that is off by `low` below 50 Hz and by `high` above."""
    full = np.tile(100.0 * np.eye(2, dtype=np.complex128), (len(fig8.FREQUENCY_Hz), 1, 1))
    off = np.where(fig8.FREQUENCY_Hz < 50.0, low, high)
    record = {
        "states": np.array(524),
        "projection_error": np.array(1e-10),
        "full": full,
        "local": full * (1.0 + off[:, None, None]),
        "balanced": full * 1.001,
        "spot_error": np.array([1e-9]),
    }
    return {
        name: record | {"order": np.array(states), "local_states": np.array(states)}
        for name, states in fig8.LOCAL_STATES.items()
    }


def test_figure_8_passes_on_what_the_paper_describes() -> None:
    records = fig8_records()
    assert failed(fig8.checks(records)) == []
    for record in records.values():
        assert fig8.close_from_Hz(record) == pytest.approx(50.0, rel=0.05)
        assert fig8.largest_decibel(record, fig8.FREQUENCY_Hz > 10.0) == pytest.approx(20.0 * np.log10(1.5))
    for table in fig8.tables(records):
        assert all(len(row) == len(table.columns) for row in table.rows)


@pytest.mark.parametrize(
    ("changed", "records"),
    [
        ({}, fig8_records(high=0.2)),
        ({}, fig8_records(low=0.05)),
        ({"balanced": fig8_records()[fig8.SHEET]["full"] * 1.02}, fig8_records()),
        ({"spot_error": np.array([1e-3])}, fig8_records()),
        ({"local_states": np.array(32)}, fig8_records()),
    ],
)
def test_figure_8_fails_on_what_the_paper_denies(changed: dict[str, Any], records: dict[str, Record]) -> None:
    records[fig8.SHEET] = {**records[fig8.SHEET], **changed}
    assert len(failed(fig8.checks(records))) == 1


def test_figure_8_compares_models_of_one_body() -> None:
    case = Study("small", "square", {"body.nodes": [7, 7]}, order=28, dense=True, collect=fig8.collect)
    record = study(_core, case)
    assert int(record["local_states"]) == 28
    assert record["spot_error"].max() < 1e-9
    assert fig8.relative_error(record["balanced"], record["full"]).max() < 1e-4
    local = fig8.relative_error(record["local"], record["full"])
    # All springs and dampers at the contact node are in the patch, so that it is exact at high frequency.
    assert local[0] > 0.1 > 1e-3 > local[-1]


# ---- the speed study


def frontier_records() -> dict[str, Record]:
    certified = np.array([10.0 ** -(0.2 * order) for order in frontier.ORDERS])
    record = {
        "states": np.array(9000),
        "projected": np.array(120),
        "projection_error": np.array(1e-12),
        "order": np.array(frontier.ORDERS),
        "certified": certified,
        "a_priori": 3.0 * certified,
        "processor_s": np.array(0.5),
    }
    records = {frontier.mesh_name(*mesh): record for mesh in frontier.MESHES}
    return records | {name: {**record, "states": np.array(states)} for name, states in frontier.PAPER_STATES.items()}


def test_the_frontier_passes_where_more_states_are_better() -> None:
    records = frontier_records()
    assert failed(frontier.checks(records)) == []
    for table in frontier.tables(records):
        assert all(len(row) == len(table.columns) for row in table.rows)


@pytest.mark.parametrize("changed", ["rises", "above its bound", "inaccurate", "another mesh"])
def test_the_frontier_fails_on_each_of_its_statements(changed: str) -> None:
    records = frontier_records()
    record = dict(records["25 x 25"])
    if changed == "rises":
        record["certified"] = np.where(record["order"] == 40, 2.0 * record["certified"][-3], record["certified"])
        record["a_priori"] = record["certified"]
    elif changed == "above its bound":
        record["a_priori"] = 0.9 * record["certified"]
    elif changed == "inaccurate":
        record["certified"] = record["a_priori"] = 0.02 * np.linspace(2.0, 1.0, len(frontier.ORDERS))
    else:
        record["states"] = np.array(2400)
    assert len(failed(frontier.checks({**records, "25 x 25": record}))) == 1


def test_steps_end_where_the_projections_error_takes_over() -> None:
    record = {"certified": np.array([1e-2, 1e-4, 1.5e-6, 1.6e-6]), "projection_error": np.array(1e-6)}
    assert frontier.steps(record) == pytest.approx([1e-2])


def test_one_reduction_gives_every_order_that_a_new_one_would() -> None:
    at_20 = study(_core, Study("small", "square", {"body.nodes": [8, 8]}, order=20, collect=frontier.collect))
    assert np.all(at_20["certified"] <= at_20["a_priori"])
    assert float(at_20["processor_s"]) > 0.0
    for order in (4, 10):
        alone = study(_core, Study("small", "square", {"body.nodes": [8, 8]}, order=order, collect=collect))
        certified = 0.01 * ((1.0 + NORM_MARGIN) * float(alone["relative_h_infinity"]) + float(alone["projection_error"]))
        assert frontier.certified_at(at_20, order) == pytest.approx(certified, rel=1e-5)


# ---- locality


def locality_records(homogeneous: float = 0.12, soft: float = 0.2, skin: float = 1.0) -> dict[str, Record]:
    def record(error: float) -> Record:
        return {
            "states": np.array(8706),
            "order": np.array(20),
            "certified": np.array(0.004),
            "patch": np.array([(4, 2), (6, 3)]),
            "modes": np.array([96, 324]),
            "fits": np.array([True, False]),
            "in_band": np.array([error, 0.5 * error]),
            "error": np.array([[error] * 8, [0.5 * error] * 8]),
            "frequency_Hz": np.geomspace(0.3, 500.0, 8),
            "reduced_error": np.full(8, 1e-3),
            "share": np.linspace(0.0, 1.0, 144).reshape(12, 12),
            "first": np.array([3, 10, 4, 2, 5]),
            "state_share": np.array(0.75),
        }

    return dict(zip(locality.WORDS, (record(homogeneous), record(soft), record(skin)), strict=True))


def test_locality_passes_on_what_the_paper_says() -> None:
    records = locality_records()
    assert failed(locality.checks(records)) == []
    for table in locality.tables(records):
        assert all(len(row) == len(table.columns) for row in table.rows)


@pytest.mark.parametrize("off", [{"homogeneous": 0.16}, {"soft": 0.14}, {"skin": 0.14}])
def test_locality_fails_on_another_verdict(off: dict[str, float]) -> None:
    assert len(failed(locality.checks(locality_records(**off)))) == 1


def test_the_bodies_are_judged_at_the_rate_of_their_scenes() -> None:
    for case in locality.FIGURE.studies:
        assert load_scene(case.file).sections.rates.model_update_Hz == locality.UPDATE_RATE_Hz


def test_locality_of_a_small_body() -> None:
    overrides = {"body.nodes": [7, 7, 6]}
    case = Study("small", locality.HOMOGENEOUS, overrides, folder="reduce", order=None, collect=locality.collect)
    record = study(_core, case)
    assert record["share"].shape == (6, 7) and record["share"].max() == 1.0
    assert record["error"].shape == (len(record["patch"]), len(record["frequency_Hz"]))
    # A larger patch that contains a smaller one is nearer to the body.
    names = [locality.patch_name(record, i) for i in range(len(record["patch"]))]
    assert record["in_band"][names.index("6x6x3")] < record["in_band"][names.index("4x4x2")]


# ---- pictures


def test_pictures_are_drawn(tmp_path: Path) -> None:
    drawn: list[tuple[PaperFigure, Records]] = [
        (fig4.FIGURE, fig4_records()),
        (table1.FIGURE, table1_records()),
        (table2.FIGURE, table2_records(table2.PAPER)),
        (fig5.FIGURE, {name: {**fig5_record(-1.0), **six_states()} for name in (fig5.THREE_EDGES, fig5.ONE_EDGE)}),
        (fig8.FIGURE, fig8_records()),
        (frontier.FIGURE, frontier_records()),
        (locality.FIGURE, locality_records()),
    ]
    for figure, records in drawn:
        file = tmp_path / f"{figure.name}.png"
        figure.draw(records, file)
        assert file.read_bytes().startswith(b"\x89PNG") and file.stat().st_size > 10_000


def six_states() -> Record:
    share = np.repeat(fig5_record(-1.0)["share"][:, :1], 6, axis=1)
    return {"share": share, "left_share": share, "weight": np.full(6, 1.0 / 6.0)}
