"""`palpate completion`: a script that completes palpate's commands, options, choices and files in a shell."""

import argparse

import shtab

SHELLS = ("bash", "zsh")
_FILES = {"SCENE": shtab.FILE, "FILE": shtab.FILE, "DIR": shtab.DIRECTORY}
# The script that builds before it starts palpate takes the same arguments.
_ALSO = {"bash": "complete -o bashdefault -F {function} ./run\n", "zsh": ""}


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """For `source <(...)` in bash, `eval "$(...)"` in zsh. Metavariables SCENE and FILE are completed as files, DIR as folders."""
    _mark(parser)
    text: str = shtab.complete(parser, shell)
    return f"{text.rstrip()}\n{_ALSO[shell].format(function=f'_shtab_{parser.prog}')}"


def _mark(parser: argparse.ArgumentParser) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _mark(command)
        elif action.metavar in _FILES:
            action.complete = _FILES[str(action.metavar)]  # type: ignore[attr-defined]
        elif action.dest == "figures":
            from palpate.reproduce.catalogue import FIGURES

            action.choices = [*FIGURES, "all"]
