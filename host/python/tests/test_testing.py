"""`palpate test`: nothing is lost when tests are counted."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import IO

import pytest

from palpate import testing
from palpate.paths import ROOT
from palpate.scene import SceneError
from palpate.testing import Count, Stage, count_ctest, count_junit

PYTEST = """<testsuites><testsuite>
<testcase classname="a" name="good"/>
<testcase classname="a" name="bad"><failure message="no"/></testcase>
<testcase classname="a" name="broken"><error message="no"/></testcase>
<testcase classname="a" name="left_out"><skipped message="needs a
 thing"/></testcase>
</testsuite></testsuites>"""
GOOGLETEST = """<testsuites><testsuite name="Body">
<testcase name="Good" status="run" result="completed" classname="Body"/>
<testcase name="Off" status="notrun" result="suppressed" classname="Body"/>
<testcase name="Skips" status="run" result="skipped" classname="Body"><skipped message="later"/></testcase>
{more}</testsuite></testsuites>"""
FAILURE = '<testcase name="Bad" status="run" classname="Body"><failure message="x"/></testcase>'


@pytest.fixture(autouse=True)
def logs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(testing, "LOGS", tmp_path)
    monkeypatch.setattr(testing, "ROOT", tmp_path.parent)
    return tmp_path


def ctest(folder: Path, **status: str) -> Count:
    cases = "".join(f'<testcase name="{name}" status="{value}"/>' for name, value in status.items())
    (folder / "ctest.xml").write_text(f"<testsuite>{cases}</testsuite>")
    return count_ctest(folder / "ctest.xml", folder)


def test_pytest_and_googletest_files(tmp_path: Path) -> None:
    (tmp_path / "pytest.xml").write_text(PYTEST)
    count = count_junit(tmp_path / "pytest.xml")
    assert count.text() == "1 passed, 2 failed, 1 skipped"
    assert count.failures == ["a.bad", "a.broken"]
    assert count.skips == ["a.left_out: needs a thing"]
    (tmp_path / "body_test.xml").write_text(GOOGLETEST.format(more=FAILURE))
    count = count_junit(tmp_path / "body_test.xml")
    assert count.text() == "1 passed, 1 failed, 2 skipped"
    assert count.skips == ["Body.Off: no reason given", "Body.Skips: later"]


def test_ctest_counts_cases_where_it_can(tmp_path: Path) -> None:
    (tmp_path / "body_test.xml").write_text(GOOGLETEST.format(more=""))
    assert ctest(tmp_path, body_test="run", script="run").text() == "2 passed, 0 failed, 2 skipped"


def test_a_program_that_crashes_or_leaks_is_a_failure(tmp_path: Path) -> None:
    assert ctest(tmp_path, crash="fail").failures == ["crash"]
    (tmp_path / "leak.xml").write_text(GOOGLETEST.format(more=""))
    assert ctest(tmp_path, leak="fail").failures == ["leak"]
    (tmp_path / "cut.xml").write_text("<testsuites><testsu")
    assert ctest(tmp_path, cut="fail").failures == ["cut"]
    (tmp_path / "body_test.xml").write_text(GOOGLETEST.format(more=FAILURE))
    assert ctest(tmp_path, body_test="fail").failures == ["Body.Bad"]


def test_what_ctest_does_not_run_is_told(tmp_path: Path) -> None:
    (tmp_path / "ctest.xml").write_text(
        '<testsuite><testcase name="off" status="disabled"/>'
        '<testcase name="later" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/></testcase>'
        '<testcase name="gone" status="notrun"><skipped message="Unable to find executable"/></testcase></testsuite>'
    )
    count = count_ctest(tmp_path / "ctest.xml", tmp_path)
    assert count.skips == ["off: disabled in CMake", "later: SKIP_RETURN_CODE=77"]
    assert count.failures == ["gone: Unable to find executable"]


def passing(log: IO[str]) -> Count:
    return Count(passed=3, skips=["a: because"])


def failing(log: IO[str]) -> Count:
    log.write("what went wrong\n")
    return Count(passed=1, failures=["b"])


def empty(log: IO[str]) -> Count:
    return Count()


def raising(log: IO[str]) -> Count:
    raise OSError("disk full")


def run(monkeypatch: pytest.MonkeyPatch, *work: Callable[[IO[str]], Count]) -> bool:
    listed = [Stage(function.__name__, function) for function in work]
    monkeypatch.setattr(testing, "stages", lambda quick, only=None: listed)
    return testing.run_tests(quick=False, as_json=False)


def test_report(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, passing)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "3 passed, 0 failed, 1 skipped"
    assert "skipped: a: because" in lines


def test_a_failure_does_not_stop_the_stages_after_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert not run(monkeypatch, failing, raising, empty, passing)
    printed = capsys.readouterr()
    lines = printed.out.splitlines()
    assert lines[-1] == "4 passed, 3 failed, 1 skipped"
    assert {"FAILED: b", "FAILED: raising: disk full", "FAILED: empty: ran no test"} <= set(lines)
    assert "  | what went wrong" in printed.err.splitlines()


def test_quick_is_a_part_of_all() -> None:
    quick = [stage.name for stage in testing.stages(quick=True)]
    full = [stage.name for stage in testing.stages(quick=False)]
    assert full[: len(quick)] == quick
    assert {"ctest host-asan", "ctest host-tsan", "fuzz", "clang-tidy"} <= set(full)


def names(words: list[str], quick: bool) -> list[str]:
    return [stage.name for stage in testing.stages(quick, testing.select(words, quick))]


def test_only_takes_stages_files_and_programs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(testing, "ROOT", ROOT)
    assert "link_test" in testing.cpp_programs() and "test_testing" in testing.python_tests()
    assert names(["docs"], False) == ["docs"]
    assert names(["test_testing", "test_gui"], False) == ["pytest"]
    assert testing.select(["test_gui"], True).files == ("hil_tests/test_gui.py",)
    assert names(["link_test"], False) == ["ctest host", "ctest host-asan", "ctest host-tsan"]
    assert names(["link_test", "test_testing"], True) == ["ctest host", "pytest"]  # --quick counts
    with pytest.raises(SceneError, match=r"--only sunshine: must be a stage \(format, .*test_gui, .*link_test"):
        testing.select(["sunshine"], False)
    with pytest.raises(SceneError, match="--only clang-tidy: is not among the stages of --quick"):
        testing.select(["clang-tidy"], True)


def test_only_runs_what_it_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(testing, "ROOT", ROOT)
    run: list[list[str]] = []
    monkeypatch.setattr(testing, "_run", lambda command, *_: run.append(list(command)) or True)
    with (tmp_path / "log").open("w") as log:
        for stage in testing.stages(True, testing.select(["link_test", "test_gui"], True)):
            stage.work(log)
    assert ["cmake", "--build", "--preset", "host"] == run[1][:4] and run[1][-2:] == ["--target", "link_test"]
    assert run[2][run[2].index("-R") + 1] == "^(link_test)$"
    assert all("hil_tests/test_gui.py" in command and "host/python/tests" not in command for command in run[3:]) and len(run) == 5
    assert all("not slow" in command[-1] for command in run[3:])


def test_threads_are_started_where_the_tests_notice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(testing, "ROOT", ROOT)
    # boards/cmake/no_threads.cpp sees what C++'s own library starts: there must be nothing else that does.
    others = re.compile(r"pthread_create|thrd_create|#\s*pragma\s+omp|std::execution")
    sources = testing._sources((".hpp", ".cpp", ".h", ".c"))
    assert len(sources) > 300
    assert [file for file in sources if others.search((ROOT / file).read_text())] == []


def test_commands_that_fail_or_do_not_exist(tmp_path: Path) -> None:
    with (tmp_path / "log").open("w") as log:
        assert testing._run(["sh", "-c", "echo out; echo err >&2"], log)
        assert not testing._run(["sh", "-c", "exit 3"], log)
        assert not testing._run(["/nowhere/tool"], log)
    text = (tmp_path / "log").read_text()
    assert "out\n" in text and "err\n" in text
    assert "cannot start /nowhere/tool: No such file or directory" in text


def test_clang_tidys_findings_are_named_once_by_their_path_in_the_repository() -> None:
    finding = f"{testing.ROOT}/host/link/a.cpp:3:5: error: looks wrong [bugprone-x,-warnings-as-errors]"
    output = "\n".join(["[1/2][0.1s] clang-tidy a.cpp", finding, "    3 |   a;", "/b.hpp:1:2: note: here", finding])
    assert testing.clang_tidy_findings(output) == [
        "host/link/a.cpp:3:5: error: looks wrong [bugprone-x,-warnings-as-errors]"
    ]
