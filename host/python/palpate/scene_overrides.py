"""Keys of a scene that are set from outside: `palpate run SCENE --set contact.friction=0.5`."""

import tomllib
from collections.abc import Mapping
from typing import Any

from palpate.scene_schema import SceneError, format_value

Overrides = Mapping[str, Any]


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


def format_override(name: str, value: Any) -> str:
    """As it stands after --set."""
    return f"{name}={value if isinstance(value, str) and value.isidentifier() else format_value(value)}"
