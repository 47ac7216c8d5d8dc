"""`palpate test`: runs every kind of test in stages, fast ones first, and counts the outcomes."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO
from xml.etree import ElementTree

from palpate.paths import BUILD, ROOT
from palpate.scene_schema import SceneError

LOGS = ROOT / "out/test"
_SOURCE_FOLDERS = ("shared", "firmware", "boards", "host", "hil_tests")
_FAILURE_LINES = 60
_SANITIZERS = {
    "ASAN_OPTIONS": "detect_leaks=1:strict_string_checks=1",
    "UBSAN_OPTIONS": "print_stacktrace=1",
    "TSAN_OPTIONS": "halt_on_error=1",
}


@dataclass
class Count:
    """What became of some tests; skips and failures with their names."""

    passed: int = 0
    failures: list[str] = field(default_factory=list)
    skips: list[str] = field(default_factory=list)

    def __iadd__(self, other: "Count") -> "Count":
        self.passed += other.passed
        self.failures += other.failures
        self.skips += other.skips
        return self

    def text(self) -> str:
        """As in the last line of `palpate test`."""
        return f"{self.passed} passed, {len(self.failures)} failed, {len(self.skips)} skipped"


@dataclass(frozen=True)
class Stage:
    """A name and what to do; `work` writes its output to the log and returns the count."""

    name: str
    work: Callable[[IO[str]], Count]


@dataclass(frozen=True)
class Result:
    """A stage that has run."""

    name: str
    count: Count
    duration_s: float


def count_junit(file: Path) -> Count:
    """Counts the test cases of a JUnit XML file as pytest and GoogleTest write it."""
    count = Count()
    for case in ElementTree.parse(file).iter("testcase"):
        name = ".".join(filter(None, (case.get("classname"), case.get("name"))))
        skipped = case.find("skipped")
        if case.find("failure") is not None or case.find("error") is not None:
            count.failures.append(name)
        elif skipped is not None or case.get("status") == "notrun":
            reason = (
                "" if skipped is None else " ".join((skipped.get("message") or skipped.text or "").split())
            )
            count.skips.append(f"{name}: {reason or 'no reason given'}")
        else:
            count.passed += 1
    return count


def count_ctest(file: Path, cases: Path) -> Count:
    """Counts the tests of a ctest run from its JUnit file and from the XML files that GoogleTest programs wrote to
    `cases`: a program that wrote one counts by its cases, any other test as one. A program that fails although all of
    its cases passed (a leak found at its end, say) is a failure of its own."""
    count = Count()
    for test in ElementTree.parse(file).iter("testcase"):
        name, status = test.get("name", ""), test.get("status")
        own = cases / f"{name}.xml"
        inner = Count()
        if own.exists():
            try:
                inner = count_junit(own)
            except ElementTree.ParseError:
                inner = Count()
        count += inner
        if status == "fail" and not inner.failures:
            count.failures.append(name)
        elif status == "notrun":  # a test that skips itself, or one that cannot be started
            skipped = test.find("skipped")
            reason = "" if skipped is None else skipped.get("message", "")
            if reason.startswith("SKIP_"):
                count.skips.append(f"{name}: {reason}")
            else:
                count.failures.append(f"{name}: {reason or 'did not run'}")
        elif status == "disabled":
            count.skips.append(f"{name}: disabled in CMake")
        elif status == "run" and not own.exists():
            count.passed += 1
    return count


def _run(command: Sequence[str], log: IO[str], environment: Mapping[str, str] | None = None) -> bool:
    """Runs a command in the repository; its output goes to the log, and its newest line to a terminal."""
    log.write(f"$ {' '.join(command)}\n")
    live = sys.stderr.isatty()
    try:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env={**os.environ, **(environment or {})},
        )
    except OSError as error:
        log.write(f"cannot start {command[0]}: {error.strerror}\n")
        return False
    with process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                log.write(line)
                if live:
                    width = shutil.get_terminal_size().columns - 1
                    print(f"\r\033[K  {line.strip()}"[: width + 5], end="", file=sys.stderr, flush=True)
        except BaseException:
            process.kill()
            raise
    if live:
        print("\r\033[K", end="", file=sys.stderr, flush=True)
    return process.returncode == 0


def _one(name: str, passed: bool) -> Count:
    return Count(passed=1) if passed else Count(failures=[name])


def _sources(suffixes: Sequence[str]) -> list[str]:
    files = [
        file for folder in _SOURCE_FOLDERS for file in (ROOT / folder).rglob("*") if file.suffix in suffixes
    ]
    return sorted(str(file.relative_to(ROOT)) for file in files)


def check_format(log: IO[str]) -> Count:
    """clang-format changes nothing; one test."""
    sources = _sources((".hpp", ".cpp", ".h", ".c"))
    return _one("clang-format", _run(["clang-format", "--dry-run", "-Werror", *sources], log))


def build_site(log: IO[str]) -> Count:
    """The documentation's site builds without a warning; one test."""
    site = ["-m", "mkdocs", "build", "--strict", "--site-dir", str(ROOT / "out/site")]
    return _one("mkdocs --strict", _run([sys.executable, *site], log, {"NO_MKDOCS_2_WARNING": "1"}))


def python_tests() -> dict[str, str]:
    """Files of Python tests by their names, as pytest takes them."""
    files = [file for folder in ("host/python/tests", "hil_tests") for file in sorted((ROOT / folder).glob("test_*.py"))]
    return {file.stem: str(file.relative_to(ROOT)) for file in files}


def cpp_programs() -> list[str]:
    """Names of the C++ test programs, which are their targets'."""
    lists = [file for folder in _SOURCE_FOLDERS for file in (ROOT / folder).rglob("CMakeLists.txt")]
    return sorted({name for file in lists for name in re.findall(r"^\s*palpate_test\((\w+)", file.read_text("utf-8"), re.MULTILINE)})


@dataclass(frozen=True)
class Selection:
    """What `--only` asks for: stages as a whole, files of Python tests, C++ test programs."""

    stages: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()


def select(names: Sequence[str], quick: bool) -> Selection:
    """Raises SceneError for a name that is none, with those that are; and for a stage that `quick` leaves out."""
    known, files, programs = [stage.name for stage in stages(False)], python_tests(), cpp_programs()
    for name in names:
        if name not in known and name not in files and name not in programs:
            raise SceneError(
                f"--only {name}: must be a stage ({', '.join(known)}), a file of Python tests ({', '.join(files)}) or a C++ test program "
                f"({', '.join(programs)})"
            )
        if name in known and quick and name not in [stage.name for stage in stages(True)]:
            raise SceneError(f"--only {name}: is not among the stages of --quick")
    return Selection(
        tuple(name for name in names if name in known),
        tuple(files[name] for name in names if name in files),
        tuple(name for name in names if name in programs),
    )


def run_ctest(preset: str, log: IO[str], launcher: Sequence[str] = (), programs: Sequence[str] = ()) -> Count:
    """Configures, builds and runs the C++ tests of a preset, or only some programs of them, and builds nothing else of it."""
    folder = BUILD / preset
    jobs = str(os.cpu_count() or 1)
    # Also where it has been configured: with what the preset says now.
    if not _run(["cmake", "--preset", preset], log):
        return Count(failures=[f"{preset}: configure"])
    if not _run(["cmake", "--build", "--preset", preset, "-j", jobs, "--target", *(programs or ["palpate_tests"])], log):
        return Count(failures=[f"{preset}: build"])
    cases, summary = LOGS / f"{preset}-cases", LOGS / f"{preset}-ctest.xml"
    shutil.rmtree(cases, ignore_errors=True)
    summary.unlink(missing_ok=True)
    cases.mkdir(parents=True)
    command = ["ctest", "--test-dir", str(folder), "-j", jobs, "--output-on-failure", "--timeout", "900"]
    command += ["-R", f"^({'|'.join(programs)})$"] if programs else []
    succeeded = _run(
        [*launcher, *command, "--output-junit", str(summary)],
        log,
        # CHOLMOD's own threads come from a library that ThreadSanitizer does not know: none.
        {**_SANITIZERS, "GTEST_OUTPUT": f"xml:{cases}/", "OMP_THREAD_LIMIT": "1"},
    )
    if not summary.exists():
        return Count(failures=[f"{preset}: ctest"])
    count = count_ctest(summary, cases)
    if not succeeded and not count.failures:
        count.failures.append(f"{preset}: ctest")
    return count


def run_pytest(quick: bool, log: IO[str], files: Sequence[str] = ()) -> Count:
    """The Python tests: command line, scenes, records, and the firmware in the loop. Files side by side, one a
    processor; then, with the machine for themselves, the tests of loops that run in real time."""
    folders = list(files) or [folder for folder in ("host/python/tests", "hil_tests") if (ROOT / folder).is_dir()]
    rest = " and not slow" if quick else ""
    # A worker that crashes ends the run: with another in its place, pytest-xdist waits forever for the rest of its file.
    side_by_side = ["-n", str(os.cpu_count() or 1), "--dist=loadfile", "--max-worker-restart=0"]
    count = Count()
    for name, chosen, options in (
        ("pytest", "not real_time", side_by_side),
        ("pytest in real time", "real_time", []),
    ):
        report = LOGS / f"{name.replace(' ', '-')}.xml"
        report.unlink(missing_ok=True)
        command = [sys.executable, "-m", "pytest", "-q", "--durations=10", "--timeout=600", f"--junit-xml={report}"]
        succeeded = _run(
            [*command, *options, *folders, "-m", chosen + rest],
            log,
            {"PYTHONPATH": str(ROOT / "host/python"), "MPLBACKEND": "Agg"},
        )
        if not report.exists():
            count.failures.append(name)
            continue
        part = count_junit(report)
        if files and part.passed + len(part.failures) + len(part.skips) == 0:
            continue  # the files have tests of the other kind
        if not succeeded and not part.failures:
            part.failures.append(name)
        count += part
    return count


def run_clang_tidy(log: IO[str]) -> Count:
    """clang-tidy finds nothing in the sources of the host preset; one test, which fails by its findings. The C++ tests
    are left out: GoogleTest's macros triple the time. Clang's own warnings are left out (`-w`): the flags that ask for
    them are GCC's, which has compiled these sources with warnings as errors."""
    sources = {str(ROOT / source) for source in _sources((".cpp",)) if not source.endswith("_test.cpp")}
    database = BUILD / "host/compile_commands.json"
    compiled = {entry["file"] for entry in json.loads(database.read_text())} if database.exists() else set()
    files = sorted(sources & compiled)
    if not files:
        return Count(failures=["clang-tidy: build/host/compile_commands.json has no source of the project"])
    # run-clang-tidy takes regular expressions: its list is the database's, narrowed to ours.
    narrowed = LOGS / "clang-tidy"
    narrowed.mkdir(parents=True, exist_ok=True)
    entries = [entry for entry in json.loads(database.read_text()) if entry["file"] in sources]
    (narrowed / "compile_commands.json").write_text(json.dumps(entries))
    programs = Path(sys.executable).parent
    command = [str(programs / "run-clang-tidy.py"), "-clang-tidy-binary", str(programs / "clang-tidy"), "-quiet"]
    command += ["-extra-arg=-w", "-p", str(narrowed), "-j", str(os.cpu_count() or 1)]
    output = LOGS / "clang-tidy/output.log"
    with output.open("w") as file:
        succeeded = _run(command, file)
    text = output.read_text()
    log.write(text)
    return Count(passed=1) if succeeded else Count(failures=clang_tidy_findings(text) or ["clang-tidy"])


def clang_tidy_findings(output: str) -> list[str]:
    """The findings of clang-tidy's output, each once, by their paths in the repository."""
    lines = (line for line in output.splitlines() if re.match(r"\S+:\d+:\d+: (warning|error): ", line))
    return list(dict.fromkeys(line.replace(f"{ROOT}/", "", 1) for line in lines))


def run_fuzz(log: IO[str]) -> Count:
    """A fixed number of executions of every fuzz target, from the same seed in each run; one test a target."""
    from palpate.fuzzing import command
    from palpate.fuzzing.libfuzzer import NotBuilt
    from palpate.fuzzing.outcome import Effort
    from palpate.fuzzing.targets import TARGETS

    count = Count()
    executions = 0
    for target in TARGETS:
        try:
            outcome = command.run((target,), Effort(None, None, 1), False, lambda *_: nullcontext(lambda *_: None))[0]
        except NotBuilt as reason:
            count.skips.append(str(reason))
            continue
        except RuntimeError as error:
            log.write(f"{error}\n")
            return Count(failures=["fuzz: build"])
        executions += outcome.executions
        log.write(f"{target}: {outcome.executions:,} executions, seed 1\n{outcome.finding or ''}")
        count += _one(f"fuzz {target}", outcome.finding is None)
    print(f"fuzz: {executions:,} executions", file=sys.stderr, flush=True)
    return count


def _without_address_randomization() -> list[str]:
    """GCC's ThreadSanitizer does not start where the kernel spreads addresses over more than 28 bits."""
    command = ["setarch", os.uname().machine, "--addr-no-randomize"]
    if shutil.which("setarch") and subprocess.run([*command, "true"], capture_output=True).returncode == 0:
        return command
    return []


def stages(quick: bool, only: Selection | None = None) -> list[Stage]:
    """All stages, fast ones first, or those of a selection: a C++ program in every preset that has tests, a file in one stage."""
    of = only or Selection()

    def ctest(preset: str, launcher: Callable[[], Sequence[str]] = lambda: ()) -> Stage:
        programs = () if f"ctest {preset}" in of.stages else of.programs
        return Stage(f"ctest {preset}", lambda log: run_ctest(preset, log, launcher(), programs))

    files = () if "pytest" in of.stages else of.files
    result = [
        Stage("format", check_format),
        Stage("docs", build_site),
        ctest("host"),
        Stage("pytest", lambda log: run_pytest(quick, log, files)),
    ]
    if not quick:
        result += [
            ctest("host-asan"),
            ctest("host-tsan", _without_address_randomization),
            Stage("fuzz", run_fuzz),
            Stage("clang-tidy", run_clang_tidy),
        ]
    if only is None:
        return result
    wanted = {*only.stages, *(["pytest"] if only.files else [])}
    return [stage for stage in result if stage.name in wanted or (only.programs and stage.name.startswith("ctest "))]


def run_stage(stage: Stage) -> Result:
    """Runs one stage; an error inside counts as a failure."""
    file = LOGS / f"{stage.name.replace(' ', '-')}.log"
    started_s = time.monotonic()
    with file.open("w", encoding="utf-8") as log:
        try:
            count = stage.work(log)
        except (OSError, ValueError, ElementTree.ParseError) as error:
            log.write(f"{error}\n")
            count = Count(failures=[f"{stage.name}: {error}"])
    if count.passed + len(count.failures) + len(count.skips) == 0:
        count.failures.append(f"{stage.name}: ran no test")
    if count.failures:
        lines = file.read_text("utf-8", errors="replace").splitlines()[-_FAILURE_LINES:]
        print("\n".join(f"  | {line}" for line in lines), file=sys.stderr)
    return Result(stage.name, count, time.monotonic() - started_s)


def run_tests(quick: bool, as_json: bool, only: Sequence[str] | None = None) -> bool:
    """Runs all stages, or what `only` names, goes on after a failure, and reports. The last line counts all tests. True: none failed.

    Raises SceneError for names that are none."""
    selection = select(only, quick) if only else None
    report = sys.stderr if as_json else sys.stdout
    LOGS.mkdir(parents=True, exist_ok=True)
    results: list[Result] = []
    todo = stages(quick, selection)
    for i, stage in enumerate(todo, start=1):
        print(f"[{i}/{len(todo)}] {stage.name} ...", file=report, flush=True)
        results.append(run_stage(stage))
        print(
            f"[{i}/{len(todo)}] {stage.name}: {results[-1].count.text()} in {results[-1].duration_s:.1f} s",
            file=report,
            flush=True,
        )
    total = Count()
    for result in results:
        total += result.count
    for name in total.skips:
        print(f"skipped: {name}", file=report)
    for name in total.failures:
        print(f"FAILED: {name}", file=report)
    if total.failures:
        print(f"logs: {LOGS.relative_to(ROOT)}/", file=report)
    print(total.text(), file=report, flush=True)
    if as_json:
        print(json.dumps(_as_json(total, results)))
    return not total.failures


def _as_json(total: Count, results: Sequence[Result]) -> dict[str, object]:
    def numbers(count: Count) -> dict[str, int]:
        return {"passed": count.passed, "failed": len(count.failures), "skipped": len(count.skips)}

    stages_json = [
        {"name": r.name, **numbers(r.count), "duration_s": round(r.duration_s, 3)} for r in results
    ]
    return {**numbers(total), "stages": stages_json}
