"""Keys of a scene that are set from outside: `palpate run SCENE --set contact.friction=0.5`."""

import json
import tomllib
from collections.abc import Mapping
from typing import Any

from palpate.scene_schema import SceneError, format_value

Overrides = Mapping[str, Any]

# Before each override at the end of a scene's text.
OVERRIDE_COMMENT = "\n# --set "


def parse_override(text: str) -> tuple[str, Any]:
    """Key and value of `section.key=value`, the value as in TOML; a bare word is a string. Raises SceneError."""
    name, equals, value = text.partition("=")
    name = name.strip()
    if not equals or not all(part.isidentifier() for part in name.split(".")):
        raise SceneError(f"--set {text}: must be section.key=value, as in contact.friction=0.5")
    value = value.strip()
    if value.isidentifier() and value not in ("true", "false", "inf", "nan"):
        return name, value
    try:
        return name, tomllib.loads(f"value = {value}")["value"]
    except (ValueError, RecursionError):
        raise SceneError(f"--set {text}: {value or 'nothing'} is not a value in TOML") from None


def apply_overrides(table: dict[str, Any], overrides: Overrides) -> None:
    """Sets dotted keys in a parsed scene; sections that are missing are made. Raises SceneError where a part of the
    path is not a section."""
    for name, value in overrides.items():
        *sections, key = name.split(".")
        inner = table
        for section in sections:
            inner = inner.setdefault(section, {})
            if not isinstance(inner, dict):
                raise SceneError(f"--set {format_override(name, value)}: {section} is not a section")
        inner[key] = value


def split_overrides(text: str) -> tuple[str, dict[str, Any]]:
    """A scene's text as `load_scene` leaves it, apart: the file's own, and the overrides at its end."""
    mark = OVERRIDE_COMMENT.strip("\n")
    lines = text.split("\n")
    own = len(lines)
    while own > 0 and lines[own - 1].startswith(mark):
        own -= 1
    overrides = dict(parse_override(line.removeprefix(mark)) for line in lines[own:])
    return "\n".join(lines[:own]), overrides


def exact_override(name: str, value: Any) -> str:
    """On one line, such that `parse_override` gives the same value, every digit of it."""
    return f"{name}={_exact(value)}"


def _exact(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # JSON's strings are TOML's, but for DEL
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(name)} = {_exact(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_exact, value)) + "]"
    return repr(value) if isinstance(value, int | float) else str(value)


def format_override(name: str, value: Any) -> str:
    """As a person reads it after --set: long values are shortened."""
    return f"{name}={value if isinstance(value, str) and value.isidentifier() else format_value(value)}"
