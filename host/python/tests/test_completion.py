"""Completion in a real shell, and colours only where they are wanted."""

import io
import os
import pty
import re
import select
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from command import ROOT, palpate

from palpate import colour
from palpate.cli_examples import EXAMPLES

_PATIENCE_S = 30.0


class Bash:
    """bash on a terminal, with the script sourced."""

    def __init__(self, folder: Path) -> None:
        script = palpate("completion", "bash")
        assert script.returncode == 0, script.stderr
        (folder / "completion.sh").write_text(script.stdout)
        self._fd, other = pty.openpty()
        environment = {**os.environ, "PS1": "", "TERM": "dumb", "INPUTRC": "/dev/null"}
        self._process = subprocess.Popen(
            ["bash", "--norc", "--noprofile", "-i"],
            cwd=folder, env=environment, stdin=other, stdout=other, stderr=other, start_new_session=True,
        )
        os.close(other)
        self._say("bind 'set enable-bracketed-paste off'; . ./completion.sh; cd " + str(ROOT) + "; echo re''ady\n")
        self._until(r"ready\r\n")

    def _say(self, text: str) -> None:
        os.write(self._fd, text.encode())

    def _until(self, pattern: str) -> re.Match[str]:
        seen, deadline_s = "", time.monotonic() + _PATIENCE_S
        while (found := re.search(pattern, seen)) is None:
            left_s = max(0.0, deadline_s - time.monotonic())
            assert select.select([self._fd], [], [], left_s)[0], f"{pattern} not in {seen!r}"
            seen += os.read(self._fd, 4096).decode(errors="replace")
        return found

    def complete(self, line: str) -> list[str]:
        """The words that the line has become when the tabulator key was pressed at its end."""
        # Control-A goes to the line's beginning: what stands there is printed instead of run.
        self._say(f"{line}\t\x01printf '<%s>' \n")
        return self._until(r"<[^%>]+>(<[^>]+>)*")[0][1:-1].split("><")

    def close(self) -> None:
        """Ends the shell."""
        self._process.kill()
        self._process.wait()
        os.close(self._fd)


@pytest.fixture(scope="module")
def bash(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bash]:
    shell = Bash(tmp_path_factory.mktemp("bash"))
    yield shell
    shell.close()


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("palpate simu", ["palpate", "simulate"]),
        ("palpate --ver", ["palpate", "--version"]),
        ("palpate run scenes/pre", ["palpate", "run", "scenes/press.toml"]),
        ("palpate run scenes/press.toml --boa", ["palpate", "run", "scenes/press.toml", "--board"]),
        ("palpate run --board nat", ["palpate", "run", "--board", "native"]),
        ("palpate demo --out hos", ["palpate", "demo", "--out", "host/"]),
        ("palpate reproduce fig17 table1 late fig1", ["palpate", "reproduce", "fig17", "table1", "late", "fig1"]),
        ("palpate reproduce fig17 front", ["palpate", "reproduce", "fig17", "frontier"]),
        ("./run doc", ["./run", "doctor"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_bash_completes(bash: Bash, typed: str, completed: list[str]) -> None:
    assert bash.complete(typed) == completed


def test_zsh_gets_a_script_with_every_command() -> None:
    done = palpate("completion", "zsh")
    assert done.returncode == 0
    assert done.stdout.startswith("#compdef palpate")
    assert all(re.search(rf"""\n *['"]?{command}['"]?:""", done.stdout) for command in EXAMPLES if " " not in command)
    assert palpate("completion", "fish").returncode == 2


class Terminal(io.StringIO):
    """A stream that calls itself a terminal."""

    def isatty(self) -> bool:
        return True


def test_colours_only_on_a_terminal_that_wants_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert colour.paint("no", "red", Terminal()) == "\033[31mno\033[0m"
    assert colour.paint("no", "red", io.StringIO()) == "no"
    monkeypatch.setenv("TERM", "dumb")
    assert colour.paint("no", "red", Terminal()) == "no"
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    assert colour.paint("no", "red", Terminal()) == "no"
