"""The report of `palpate reproduce`, and the words on the command line."""

import html.parser
import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from command import ROOT, palpate

from palpate.cli import build_parser
from palpate.paths import SCENES
from palpate.reproduce import command, report
from palpate.reproduce.catalogue import FIGURES
from palpate.reproduce.checks import Check
from palpate.reproduce.figure import PaperFigure, Run, Study
from palpate.reproduce.folders import clear
from palpate.reproduce.results import FigureResult
from palpate.scene import SceneError, load_scene
from palpate.scene_overrides import parse_override

NAMES = ["fig4", "table1", "table2", "fig5", "fig8", "frontier", "locality"]
NAMES += ["fig12", "fig13", "fig14", "fig15", "fig16", "fig17", "late"]
PNG = b"\x89PNG, made up"
VOID = {"meta", "img", "br"}


class Page(html.parser.HTMLParser):
    """Checks that tags are balanced; collects text, and every address that the page refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.references += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "action", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def result(tmp_path: Path, measured: float = 0.5) -> FigureResult:
    plot = tmp_path / "plot.png"
    plot.write_bytes(PNG)
    figure = PaperFigure(
        "fig12",
        "Title & more",
        (("A claim <with> signs", "5.1"),),
        ("What was done.",),
        "A caption",
        lambda records: [],
        lambda records, file: None,
        (Run("plain", "fig12"), Run("other", "fig12", {"model.feedback": "hold", "model.patch_nodes": [4, 4, 2]})),
    )
    checks = [
        Check("a ratio", "is <small>", measured, "N", "a reason", at_most=1.0),
        Check("a count", "nothing", 12345, "", "reported only"),
        Check("a gap", "nothing", float("nan"), "", "reported only"),
    ]
    summary = {"board": "native", "record_hash": "0"}
    return FigureResult(figure, checks, plot, {"plain": summary, "other": summary})


def read(file: Path) -> Page:
    page = Page()
    page.feed(file.read_text(encoding="utf-8"))
    assert page.open == []
    return page


def test_the_page_needs_no_other_file(tmp_path: Path) -> None:
    file = report.write_report(tmp_path / "out/index.html", [result(tmp_path)], hil=False)
    text = file.read_text(encoding="utf-8")
    page = read(file)
    for reference in page.references:
        assert reference.startswith(("#", "data:image/png;base64,")), reference
    assert "http" not in text and "url(" not in text and "@import" not in text and "<script" not in text
    assert 'name="viewport"' in text


def test_the_page_says_claim_numbers_verdicts_and_commands(tmp_path: Path) -> None:
    page = read(report.write_report(tmp_path / "index.html", [result(tmp_path)], hil=False))
    for words in (
        "“A claim <with> signs” (section 5.1)",
        "0.5 N",
        "at most 1 N",
        "12,345",
        "1 of 1",
        "./run reproduce fig12",
        "./run run scenes/reproduce/fig12.toml --board native\n",
        "--set 'model.feedback=hold' --set 'model.patch_nodes=[4, 4, 2]'",
    ):
        assert words in page.text, words
    assert "FAIL" not in page.text


def test_a_failed_check_fails_the_figure(tmp_path: Path) -> None:
    failed = result(tmp_path, measured=2.0)
    assert not failed.passed
    page = read(report.write_report(tmp_path / "index.html", [failed], hil=True))
    assert page.text.count("FAIL") == 3  # in the overview, at the figure, and at the number
    assert "0 of 1" in page.text
    assert "./run reproduce fig12 --hil" in page.text
    assert "--board mps2_an386" in page.text
    assert "FAIL a ratio: 2 N (at most 1)" in command.format_results([failed])


def test_json_of_results(tmp_path: Path) -> None:
    values: dict[str, Any] = json.loads(json.dumps(command.to_dict([result(tmp_path)], tmp_path), allow_nan=False))
    assert values["pass"] is True
    assert values["figures"]["fig12"]["checks"][2]["measured"] is None
    assert values["figures"]["fig12"]["runs"][1]["overrides"] == {"model.feedback": "hold", "model.patch_nodes": [4, 4, 2]}


def test_commands_of_runs_are_read_back_as_they_are() -> None:
    for figure in FIGURES.values():
        for case in figure.cases:
            command_name, *words = shlex.split(report.format_command(case, hil=False))
            assert command_name == "./run"
            arguments = build_parser().parse_args(words)
            overrides = dict(parse_override(text) for text in arguments.set)
            assert overrides == dict(case.overrides)
            locality = isinstance(case, Study) and case.order is None
            assert ROOT / (arguments.check_locality if locality else arguments.scene) == case.file
            load_scene(case.file, overrides)
            if isinstance(case, Study):
                assert (arguments.order, arguments.dense) == (case.order, case.dense)
                assert case.dense or arguments.tolerance == case.tolerance


def test_every_figure_of_the_paper_has_scenes_and_claims() -> None:
    assert list(FIGURES) == NAMES
    for figure in FIGURES.values():
        assert figure.claims and figure.setting and figure.caption
        assert figure.cases and len({case.name for case in figure.cases}) == len(figure.cases)
    used = {case.file for figure in FIGURES.values() for case in figure.cases}
    assert used == {file for folder in ("reproduce", "reduce", "frontier") for file in (SCENES / folder).glob("*.toml")}


def test_names_are_selected_in_the_papers_order() -> None:
    assert [figure.name for figure in command.select(["fig16", "table2", "fig12", "fig16"])] == ["table2", "fig12", "fig16"]
    assert [figure.label for figure in command.select(["fig12", "table2"])] == ["Table 2", "Figure 12"]
    assert [figure.label for figure in command.select(["locality", "frontier"])] == ["Frontier", "Locality"]
    assert command.select([]) == command.select(["all"]) == list(FIGURES.values())
    with pytest.raises(SceneError, match="fig11"):
        command.select(["fig12", "fig11"])


def test_an_unknown_figure_is_refused_on_one_line_with_the_known_ones() -> None:
    done = palpate("reproduce", "fig18")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"palpate reproduce: fig18: unknown figure; must be one of {', '.join(NAMES)}, all\n"
    )


FIFTEEN = [FIGURES["fig15"]]


def test_only_results_are_deleted(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run = out / "fig15/drag"
    run.mkdir(parents=True)
    for file in (out / "fig15/plot.png", out / "fig15/results.json", run / "record.h5", run / "summary.json"):
        file.write_bytes(b"old")
    report.write_report(out / "index.html", [result(tmp_path)], hil=False)
    other = out / "fig16/mine.txt"
    other.parent.mkdir()
    other.write_text("mine")
    clear(out, FIFTEEN)
    assert not (out / "fig15").exists() and not (out / "index.html").exists()
    assert other.read_text() == "mine"
    clear(out, FIFTEEN)  # nothing there


@pytest.mark.parametrize("mine", ["fig15/mine.txt", "fig15/drag/mine.txt", "fig15/drag/deep/record.h5", "index.html", "fig15"])
def test_nothing_is_deleted_where_other_files_are(tmp_path: Path, mine: str) -> None:
    if mine != "fig15":
        (tmp_path / "fig15/drag").mkdir(parents=True)
        (tmp_path / "fig15/results.json").write_text("{}")
    file = tmp_path / mine
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    done = palpate("reproduce", "fig15", "--out", str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1 and "not a result of palpate reproduce" in done.stderr
    assert str(tmp_path / mine).startswith(done.stderr.split(": ")[1])
    assert sorted(tmp_path.rglob("*")) == before and file.read_text() == "mine"


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "results.json").write_text("{}")
    (tmp_path / "fig15").symlink_to(elsewhere)
    with pytest.raises(SceneError, match="fig15"):
        clear(tmp_path, FIFTEEN)
    assert (elsewhere / "results.json").exists()


@pytest.mark.slow
def test_all_figures_from_end_to_end(tmp_path: Path) -> None:
    done = palpate("reproduce", "all", "--out", str(tmp_path / "out"), "--json", cwd=ROOT, timeout_s=1800)
    assert done.returncode == 0, done.stdout + done.stderr
    printed = json.loads(done.stdout)
    assert printed["pass"] is True and list(printed["figures"]) == list(FIGURES)
    for name, figure in FIGURES.items():
        folder = tmp_path / "out" / name
        stored = json.loads((folder / "results.json").read_text(encoding="utf-8"))
        assert printed["figures"][name] == stored
        assert stored["pass"] is True
        assert (folder / "plot.png").stat().st_size > 0
        names = [run["name"] for run in stored["runs"]]
        assert names[: len(figure.runs)] == [run.name for run in figure.runs]
        assert sorted(entry.name for entry in folder.iterdir() if entry.is_dir()) == sorted(names)
        assert [study["name"] for study in stored["studies"]] == [study.name for study in figure.studies]
        for run in names:
            for file in ("record.h5", "summary.json"):
                assert (folder / run / file).stat().st_size > 0
    page = read(Path(printed["report"]))
    assert "FAIL" not in page.text
