"""No command in the documentation is untested without a reason that is written down (documented_commands.py)."""

import re
import shlex
from pathlib import Path

import pytest
from command import ROOT, palpate
from documented_commands import NOT_RUN, RUN, TESTED

from palpate.cli_examples import EXAMPLES

_COMMAND = re.compile(
    r"(?:xvfb-run -a )?\./run\b|palpate [a-z]|python |\.venv/bin/python |source <|pip install|ctest |build/host/|cmake |PYTHONPATH"
)
# In fences of these languages, and in indented blocks, each line is a command; elsewhere what stands in backticks.
_SHELLS = ("", "sh", "bash", "text", "console")


def commands_of(text: str) -> list[str]:
    """The commands of a page in Markdown, comments left out."""
    found: list[str] = []
    fence: str | None = None
    for line in text.splitlines():
        if opened := re.match(r"```(\w*)", line):
            fence = opened[1] if fence is None else None
        elif fence in _SHELLS or (fence is None and line.startswith("    ")):
            found.append(re.sub(r"\s+#.*", "", line).strip())
        elif fence is None:
            found += re.findall(r"`([^`\n]+)`", line)
    return [command for command in found if _COMMAND.match(command)]


def documented() -> set[str]:
    """All commands of README.md, docs/ and the command line's help."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    written = {command for page in pages for command in commands_of(page.read_text("utf-8"))}
    return written | {example for examples in EXAMPLES.values() for example in examples}


def test_commands_are_found_where_they_stand() -> None:
    page = "see `./run a` and `x`\n\n```sh\n./run b   # why\n```\n```python\npalpate = 1\n```\n| `./run c [D]` |\n\n    ./run d\n"
    assert commands_of(page) == ["./run a", "./run b", "./run c [D]", "./run d"]


def test_every_documented_command_is_accounted_for() -> None:
    known = [*RUN, *TESTED, *NOT_RUN]
    assert len(known) == len(set(known)), "in one list only"
    here = documented()
    print(f"{len(here)} commands: {len(RUN)} run here, {len(TESTED)} by other tests, {len(NOT_RUN)} not run")
    assert sorted(here - set(known)) == [], "to be added to documented_commands.py"
    assert sorted(set(known) - here) == [], "no longer documented"


def test_the_tests_that_are_named_exist() -> None:
    for name in TESTED.values():
        file, _, test = name.partition("::")
        assert re.search(rf"^def {test}\(", (ROOT / file).read_text("utf-8"), re.MULTILINE), name


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a brief run."""
    folder = tmp_path_factory.mktemp("press")
    given = RUN["./run run scenes/press.toml --board native"].format(out=folder)
    done = palpate(*shlex.split(given))
    assert done.returncode == 0, done.stderr
    return folder / "record.h5"


@pytest.mark.parametrize("command", RUN)
def test_it_runs(command: str, record: Path, tmp_path: Path) -> None:
    done = palpate(*shlex.split(RUN[command].format(out=tmp_path, record=record)))
    assert done.returncode == 0, done.stderr
    assert done.stdout
