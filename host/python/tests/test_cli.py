"""The command line: help, version, wrong usage, reports, and the order of the test stages."""

import json
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import fake_core
import numpy as np
import pytest
from command import ROOT, palpate

from palpate import cli, hil
from palpate.cli_examples import EXAMPLES
from palpate.experiment import Outcome

SCENE = ROOT / "scenes/press.toml"


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """The made-up core and board in place of the real ones, in an empty working directory."""
    import palpate

    monkeypatch.setitem(sys.modules, "palpate._core", fake_core)
    monkeypatch.setattr(palpate, "_core", fake_core, raising=False)
    for name in hil.BOARDS:
        monkeypatch.setitem(hil.BOARDS, name, fake_core.board())
    monkeypatch.chdir(tmp_path)
    return fake_core


def test_help_lists_the_commands() -> None:
    done = palpate("--help")
    assert done.returncode == 0
    for command in ("demo", "run", "replay", "plot", "simulate", "reproduce", "reduce", "bench", "choose", "gui", "device", "doctor", "completion", "test"):
        assert re.search(rf"\n    {command}\s", done.stdout)
        helped = palpate(command, "--help")
        assert helped.returncode == 0
        assert f"examples:\n  {EXAMPLES[command][0]}\n" in helped.stdout
        assert all(len(line) <= 120 for line in helped.stdout.splitlines())


def test_every_bench_has_a_help_of_its_own() -> None:
    options = {"frontier": set(), "links": set(), "faults": {"--only", "--board", "--medium"}, "stability": {"--zwidth"}, "mutants": {"--file", "--sample", "--jobs"}}
    for what, own in options.items():
        helped = palpate("bench", what, "--help")
        assert helped.returncode == 0
        assert f"examples:\n  {EXAMPLES[f'bench {what}'][0]}\n" in helped.stdout and f"out/{what})" in helped.stdout
        assert set(re.findall(r"^  (--\w+)", helped.stdout, re.MULTILINE)) == own | {"--json", "--out"} | (set() if what == "mutants" else {"--quick"})


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["run"],
        ["run", "a.toml", "b.toml"],
        ["demo", "--fast"],
        ["run", "a.toml", "--board", "x"],
        ["replay"],
        ["plot"],
        ["replay", "a.h5", "--tolerance-N", "small"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_refused_on_one_line(arguments: list[str]) -> None:
    done = palpate(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1


def test_run_prints_a_table_and_writes_to_the_folder(
    fake: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", str(SCENE), "--out", "here"]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("Press with a sphere\n")
    assert "here/summary.json" in printed.out
    assert json.loads(Path("here/summary.json").read_text())["command"] == "run"


def test_json_is_all_there_is_on_standard_output(
    fake: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["simulate", str(SCENE), "--out", "here", "--json"]) == 0
    printed = capsys.readouterr()
    numbers = json.loads(printed.out)
    files = numbers.pop("files")
    assert numbers == json.loads(Path(files["summary.json"]).read_text())
    assert "Press with a sphere" in printed.err


def test_board_overrides_the_scene(fake: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", str(SCENE), "--out", "here", "--board", "native", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["board"] == "fake"


def test_demo_fails_where_a_check_does(
    fake: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["demo", "--out", "here"]) == 0
    original = fake_core.run_closed_loop

    def late(*arguments: Any) -> dict[str, Any]:
        results = original(*arguments)
        # a new array: the counters of the made-up run are one
        results["ticks/missed_deadlines"] = np.full_like(results["ticks/missed_deadlines"], 2)
        return results

    monkeypatch.setattr(fake_core, "run_closed_loop", late)
    assert cli.main(["demo", "--out", "here"]) == 1
    assert "palpate demo: missed_deadlines = 2: must be 0\n" in capsys.readouterr().err
    assert cli.main(["run", str(SCENE), "--out", "here"]) == 0
    assert "palpate run: warning: missed_deadlines = 2: must be 0\n" in capsys.readouterr().err


def test_a_board_that_dies_is_a_failure_on_one_line(
    fake: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(hil.BOARDS, "mps2_an386", fake_core.board("sys.exit(5)"))
    assert cli.main(["run", str(SCENE), "--json"]) == 1
    printed = capsys.readouterr()
    message = (
        "palpate run: board fake ended with code 5 (processor fault); last sign of life at tick 0; "
        "it said: hello from the board"
    )
    assert json.loads(printed.out) == {"error": message}
    assert printed.err.endswith(message + "\n")


def test_the_output_folder_must_be_one(fake: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    Path("file").write_text("")
    assert cli.main(["run", str(SCENE), "--out", "file"]) == 2
    assert capsys.readouterr().err == "--out = file: must be a folder\n"


def test_interruption(
    fake: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*arguments: Any) -> dict[str, Any]:
        raise KeyboardInterrupt

    monkeypatch.setattr(fake_core, "simulate", interrupt)
    assert cli.main(["simulate", str(SCENE)]) == 130
    assert capsys.readouterr().err.endswith("palpate simulate: interrupted\n")


def test_table_shows_what_is_not_known_as_a_dash() -> None:
    table = cli.format_table(
        "", Outcome({"rms_force_N": None, "ticks": 5000, "link_bytes_per_s": {"up": 1.5}}, {})
    )
    lines = [line.split() for line in table.splitlines()]
    assert lines[0] == ["Result"]
    assert lines[1][-1] == "5,000"
    assert lines[2][-3:] == ["up", "1.5", "bytes/s"]
    assert lines[3][-1] == "-"
