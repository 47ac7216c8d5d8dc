#!/usr/bin/env python3
"""Mutation test of the safety supervisor: small wrong changes of its sources, one at a time, each of which a unit test must notice.

Each mutant is one change of one line (a comparison, an operator, a constant, a condition held true or false, a statement left out). It is compiled,
linked with the tests that the build has made, and run; it is killed when that fails. Mutants that do not change what the code does are listed with a
reason each in supervisor_mutants.toml. Exit code 0 when no other one survives, 1 otherwise, 2 where nothing can be compiled.

    python host/bench/supervisor_mutants.py                   # all of supervisor.cpp, some 5 min on two idle cores
    python host/bench/supervisor_mutants.py --sample 8 --json  # that many, the same each time
"""

import argparse
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

from tqdm import tqdm

sys.path.insert(0, str(Path(__file__).resolve().parent))

from firmware_build import ROOT, FirmwareTest, NoBuild

CORE = ROOT / "firmware/core"
EQUIVALENT = Path(__file__).with_suffix(".toml")
_DECISIONS = (
    "Arming.*:Calibration.*:Currents.*:Damping.*:DirectForce.*:Faults.*:Force.*:LinkLoss.*:PassivityControl.*:Supervisor.*:SupervisorEdges.*",
    "AllStates.*",  # the long walk, for those that nothing else has killed
)
# Mutated file -> what is compiled with it, and the tests that are to notice.
SOURCES = {
    "supervisor.cpp": (("supervisor.cpp",), _DECISIONS),
    "passivity.hpp": (("supervisor.cpp", "passivity_test.cpp"), ("Passivity.*:PassivityControl.*",)),
    "motor_heat.hpp": (("motor_heat_test.cpp",), ("MotorHeat.*",)),
    "limit_ranges.hpp": (("limit_ranges_test.cpp",), ("LimitRanges.*",)),
    "deadline_monitor.hpp": (("deadline_monitor_test.cpp",), ("DeadlineMonitor.*",)),
    "outputs.hpp": (("outputs_test.cpp",), ("Outputs.*",)),
}
# Of which none survives. The others can be asked for; nobody has gone through their survivors.
GUARDED = ("supervisor.cpp",)
FLAGS = ("-O0", "-g0")
# A mutant that runs longer than this does not end: the tests take 2 s.
LONGEST_S = 60.0
SEED = 1

_COMPARISON = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)}
_OPERATOR = {
    "&&": ("||",), "||": ("&&",), "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "|": ("&",), "&": ("|",), "^": ("|",), ">>": ("<<",),
    "+=": ("-=", "="), "-=": ("+=", "="), "*=": ("/=",), "|=": ("=",),
}  # fmt: skip
_SPACED = re.compile(r"(?<= )(<=|>=|==|!=|<|>|&&|\|\||\+=|-=|\*=|\|=|\+|-|\*|/|\||&|\^|>>)(?= |$)")
_NOT = re.compile(r"!(?=[\w(])")
_NUMBER = re.compile(r"(?<![\w.'])(0x[0-9a-f]+|\d[\d']*(?:\.\d+)?(?:e-?\d+)?)(u|f)?(?![\w.'])")
_WORD = {"true": "false", "false": "true", "std::min": "std::max", "std::max": "std::min", "always": "rendering", "rendering": "always",
         "Mode::render": "Mode::direct", "Mode::direct": "Mode::render", "Mode::idle": "Mode::calibrate"}  # fmt: skip
_WORDS = re.compile(r"\b(" + "|".join(sorted(_WORD, key=len, reverse=True)) + r")\b(?!\()|\bstd::(?:min|max)\b")
_IF = re.compile(r"\bif \((.*)\)( \{| return\b.*;| [\w.]+ [|+-]?= .*;| \w+\(.*\);|)$")
_STATEMENT = re.compile(r"(?:[\w.\[\]>-]+ [|+*-]?= .*|\w+\(.*\)|[+-]{2}\w+);$")
_CHOICE = re.compile(r"\? ([^?:]+(?:::[^?:]+)*) : ([^;,)]+)")
# Declarations. Of the table of ranges, too, which is data: its test reads it.
_NO_CODE = re.compile(r"^(?:LimitRange<|#|//|namespace|using|static_assert|\[\[nodiscard\]\]|template|inline constexpr std::array\b|struct|class|\}$)")


@dataclass(frozen=True)
class Mutant:
    """One changed line: its number from 1, and its code before and after, without the spaces around it."""

    file: str
    line: int
    before: str
    after: str

    def apply(self, source: str) -> str:
        lines = source.splitlines(keepends=True)
        assert lines[self.line - 1].count(self.before) == 1
        lines[self.line - 1] = lines[self.line - 1].replace(self.before, self.after)
        return "".join(lines)

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is when lines move."""
        return self.file, self.before, self.after


def _changes(code: str) -> Iterator[str]:
    """Of one line."""

    def put(match: re.Match[str], group: int, text: str) -> str:
        return code[: match.start(group)] + text + code[match.end(group) :]

    for match in _SPACED.finditer(code):
        for other in (*_COMPARISON.get(match[1], ()), *_OPERATOR.get(match[1], ())):
            yield put(match, 1, other)
    for match in _NOT.finditer(code):
        yield put(match, 0, "")
    for match in _NUMBER.finditer(code):
        if code[: match.start()].endswith("float, "):
            continue
        suffix = match[2] or ""
        is_float = suffix == "f"
        digits = match[1].replace("'", "")
        value = float(digits) if is_float or "." in digits else int(digits, 0)
        for other in {value + 1, value * 2} - {value}:
            yield put(match, 0, f"{float(other)!r}f" if is_float else f"{other}{suffix}")
    for match in _WORDS.finditer(code):
        yield put(match, 0, _WORD[match[0]])
    if found := _IF.search(code):
        yield put(found, 1, "true")
        yield put(found, 1, "false")
    if _STATEMENT.fullmatch(code):
        yield ";"
    if found := _CHOICE.search(code):
        yield code[: found.start()] + f"? {found[2]} : {found[1]}" + code[found.end() :]


def mutants(file: str, source: str) -> list[Mutant]:
    """Of a source, in its order."""
    found: dict[Mutant, None] = {}
    for number, line in enumerate(source.splitlines(), 1):
        code = line.split("//")[0].strip()
        # A comment behind the code is not code.
        if not code or _NO_CODE.match(code):
            continue
        for after in _changes(code):
            if after != code:
                found[Mutant(file, number, code, after)] = None
    return list(found)


def equivalents() -> dict[tuple[str, str, str], str]:
    """Mutants that change nothing, with the reason of each."""
    listed = tomllib.loads(EQUIVALENT.read_text())["equivalent"]
    return {(entry["file"], entry["before"], entry["after"]): entry["reason"] for entry in listed}


class Laboratory:
    """Compiles a mutant and runs the tests on it, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._build = FirmwareTest()
        self._source = {name: (CORE / name).read_text() for name in SOURCES}

    def is_killed(self, mutant: Mutant | None, file: str = "supervisor.cpp") -> bool:
        """By the compiler, which refuses it, or by a test; None: the source as it is."""
        with tempfile.TemporaryDirectory(dir=self._folder) as name:
            folder = Path(name)
            overlay = folder / "firmware/core"
            overlay.mkdir(parents=True)
            if mutant is not None:
                file = mutant.file
                (overlay / file).write_text(mutant.apply(self._source[file]))
            objects = []
            compiled, suites = SOURCES[file]
            for source in compiled:
                changed = overlay / source
                target = folder / f"{source}.o"
                trouble = self._build.compile(changed if changed.exists() else CORE / source, target, (f"-I{folder}", *FLAGS), CORE / source)
                if trouble:
                    return True
                objects.append(target)
            program = folder / "mutant"
            if trouble := self._build.link(objects, program):
                raise RuntimeError(trouble)
            return any(self._fails(program, suite) for suite in suites)

    @staticmethod
    def _fails(program: Path, suite: str) -> bool:
        try:
            done = subprocess.run([program, f"--gtest_filter={suite}", "--gtest_fail_fast", "--gtest_brief=1"], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL, timeout=LONGEST_S)  # fmt: skip
        except subprocess.TimeoutExpired:
            return True
        return done.returncode != 0


def run(files: list[str], sample: int | None, jobs: int) -> dict[str, object]:
    """What became of the mutants. Raises NoBuild, and RuntimeError where the sources as they are do not pass."""
    harmless = equivalents()
    every = [mutant for file in files for mutant in mutants(file, (CORE / file).read_text())]
    known = {mutant.key for mutant in every}
    stale = [entry for entry in harmless if entry[0] in files and entry not in known]
    if stale:
        raise RuntimeError(f"{EQUIVALENT.name} lists what is no mutant any more: {stale}")
    tried = [mutant for mutant in every if mutant.key not in harmless]
    if sample is not None:
        tried = random.Random(SEED).sample(tried, min(sample, len(tried)))
    survivors = []
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(jobs) as pool:
        laboratory = Laboratory(Path(name))
        for file in files:
            if laboratory.is_killed(None, file):
                raise RuntimeError(f"the tests fail without a mutant in {file}")
        futures = {pool.submit(laboratory.is_killed, mutant): mutant for mutant in tried}
        for future in tqdm(as_completed(futures), total=len(futures), unit="mutant", disable=None):
            if not future.result():
                survivors.append(mutant := futures[future])
                tqdm.write(f"survives: {mutant.file}:{mutant.line}: {mutant.before}  ->  {mutant.after}", file=sys.stderr)
    survivors.sort(key=lambda mutant: (mutant.file, mutant.line, mutant.after))
    return {
        "mutants": len(every),
        "equivalent": len(every) - len([m for m in every if m.key not in harmless]),
        "tried": len(tried),
        "killed": len(tried) - len(survivors),
        "survivors": [asdict(mutant) for mutant in survivors],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--file", choices=SOURCES, action="append", help="mutate this source (default: supervisor.cpp)")
    parser.add_argument("--sample", type=int, metavar="N", help="try so many of them")
    parser.add_argument("--jobs", type=int, default=2, help="at a time (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    args = parser.parse_args()
    if shutil.which("ninja") is None:
        parser.error("ninja is missing: ./run installs it")
    try:
        done = run(args.file or list(GUARDED), args.sample, args.jobs)
    except (NoBuild, RuntimeError) as error:
        print(f"supervisor_mutants: {error}", file=sys.stderr)
        return 2
    survivors = done["survivors"]
    assert isinstance(survivors, list)
    if args.json:
        print(json.dumps(done, indent=2))
    else:
        for mutant in survivors:
            print(f"survives: {mutant['file']}:{mutant['line']}: {mutant['before']}  ->  {mutant['after']}")
        print(f"{done['killed']} of {done['tried']} mutants killed; {done['equivalent']} of {done['mutants']} listed as equivalent")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
