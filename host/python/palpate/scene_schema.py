"""The declarative layer under the scene format: kinds of values, key declarations, and the reader that applies them.

A section of a scene is a frozen dataclass whose fields are declared with `key()` or `section()`. The same declarations
drive the validation (`read_section`) and the tables in docs/scenes.md (`palpate.docs`), so they cannot drift apart.
"""

import dataclasses
import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

_SPEC = "palpate"
_MAX_VALUE_TEXT = 60

Section = TypeVar("Section")


class SceneError(ValueError):
    """A scene (or a file that it names) is not usable: one line that names file, key, value and range."""


class _Missing:
    """Marks a key that has no default."""


REQUIRED = _Missing()
# In place of a value, of keys that say so.
AUTO = "auto"


def format_value(value: object) -> str:
    """The value as one would write it in TOML, on one line, shortened when long."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, float):
        text = f"{value:.12g}"
    elif isinstance(value, str):
        text = '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    elif isinstance(value, Mapping):
        text = "{" + ", ".join(f"{name} = {format_value(item)}" for name, item in value.items()) + "}"
    elif isinstance(value, Sequence):
        text = "[" + ", ".join(format_value(item) for item in value) + "]"
    elif isinstance(value, int) and value.bit_length() > 200:
        text = hex(value)
    else:
        text = str(value)
    text = "".join(character if character.isprintable() else f"\\u{ord(character):04x}" for character in text)
    return text if len(text) <= _MAX_VALUE_TEXT else text[: _MAX_VALUE_TEXT - 3] + "..."


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """ "did you mean X?" for the nearest known word, or the list of all known words."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else "must be one of " + ", ".join(known)


class Reader:
    """Turns parsed TOML into checked values; knows the file, so that an error can name it."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def error(self, where: str, value: object, requirement: str) -> SceneError:
        """The error of one value: `file: key = value: must be requirement`."""
        return SceneError(f"{self.file}: {where} = {format_value(value)}: must be {requirement}")

    def problem(self, where: str, text: str) -> SceneError:
        """An error that is not about the range of one value: `file: key: text`."""
        return SceneError(f"{self.file}: {where}: {text}")


class Kind(Protocol):
    """What a key's value may be."""

    def type_text(self) -> str:
        """The type for the documentation."""

    def requirement(self, unit: str) -> str:
        """What the value must be, after the words "must be"."""

    def read(self, reader: Reader, where: str, value: object, unit: str) -> object:
        """The checked value; raises SceneError."""


def _is_number(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return _is_integer(value)


def _is_integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


@dataclass(frozen=True)
class Number:
    """A finite number between two bounds; `open_low` excludes the lower one."""

    low: float
    high: float
    open_low: bool = False

    def interval(self) -> str:
        low, high = (f"{bound:g}".replace("e+0", "e").replace("e-0", "e-") for bound in (self.low, self.high))
        return f"{'(' if self.open_low else '['}{low}, {high}]"

    def contains(self, value: float) -> bool:
        return (self.low < value if self.open_low else self.low <= value) and value <= self.high

    def type_text(self) -> str:
        return "number"

    def requirement(self, unit: str) -> str:
        return _with_unit(f"in {self.interval()}", unit)

    def read(self, reader: Reader, where: str, value: object, unit: str) -> float:
        if not _is_number(value) or not self.contains(value):  # type: ignore[arg-type]
            raise reader.error(where, value, self.requirement(unit))
        return float(value)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Integer:
    """A whole number between two bounds, both included."""

    low: int
    high: int

    def type_text(self) -> str:
        return "integer"

    def requirement(self, unit: str) -> str:
        return _with_unit(f"a whole number in [{self.low}, {self.high}]", unit)

    def read(self, reader: Reader, where: str, value: object, unit: str) -> int:
        if not _is_integer(value) or not self.low <= value <= self.high:  # type: ignore[operator]
            raise reader.error(where, value, self.requirement(unit))
        return value  # type: ignore[return-value]


@dataclass(frozen=True)
class Flag:
    """true or false."""

    def type_text(self) -> str:
        return "boolean"

    def requirement(self, unit: str) -> str:
        return "true or false"

    def read(self, reader: Reader, where: str, value: object, unit: str) -> bool:
        if not isinstance(value, bool):
            raise reader.error(where, value, self.requirement(unit))
        return value


@dataclass(frozen=True)
class Text:
    """Any text."""

    def type_text(self) -> str:
        return "string"

    def requirement(self, unit: str) -> str:
        return "a string"

    def read(self, reader: Reader, where: str, value: object, unit: str) -> str:
        if not isinstance(value, str):
            raise reader.error(where, value, self.requirement(unit))
        return value


@dataclass(frozen=True)
class Choice:
    """One of a few words."""

    choices: tuple[str, ...]

    def type_text(self) -> str:
        return "string"

    def requirement(self, unit: str) -> str:
        quoted = [f'"{choice}"' for choice in self.choices]
        return quoted[0] if len(quoted) == 1 else "one of " + ", ".join(quoted)

    def read(self, reader: Reader, where: str, value: object, unit: str) -> str:
        if value not in self.choices:
            raise reader.error(where, value, self.requirement(unit))
        return str(value)


@dataclass(frozen=True)
class Vector:
    """A list of numbers of one kind, as long as one of `lengths`."""

    lengths: tuple[int, ...]
    of: Number | Integer

    def type_text(self) -> str:
        return f"list of {' or '.join(map(str, self.lengths))} {self.of.type_text()}s"

    def requirement(self, unit: str) -> str:
        count = " or ".join(map(str, self.lengths))
        if isinstance(self.of, Integer):
            return _with_unit(f"{count} whole numbers in [{self.of.low}, {self.of.high}]", unit)
        return _with_unit(f"{count} numbers in {self.of.interval()}", unit)

    def read(
        self, reader: Reader, where: str, value: object, unit: str
    ) -> tuple[float, ...] | tuple[int, ...]:
        if not isinstance(value, list) or len(value) not in self.lengths:
            raise reader.error(where, value, self.requirement(unit))
        try:
            return tuple(self.of.read(reader, where, item, unit) for item in value)
        except SceneError:
            raise reader.error(where, value, self.requirement(unit)) from None


@dataclass(frozen=True)
class ListOf:
    """A list of values of one kind; an error names the item."""

    of: Kind
    max_length: int

    def type_text(self) -> str:
        text = self.of.type_text()
        return "list of " + (text.replace("list", "lists", 1) if isinstance(self.of, Vector) else f"{text}s")

    def requirement(self, unit: str) -> str:
        return f"a list (at most {self.max_length:,} items), each {self.of.requirement(unit)}"

    def read(self, reader: Reader, where: str, value: object, unit: str) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) > self.max_length:
            raise reader.error(where, value, self.requirement(unit))
        return tuple(self.of.read(reader, f"{where}[{i}]", item, unit) for i, item in enumerate(value))


@dataclass(frozen=True)
class TablesOf:
    """A list of tables, each read as a section."""

    section: type
    max_length: int

    def type_text(self) -> str:
        return "list of tables"

    def requirement(self, unit: str) -> str:
        names = ", ".join(name for name, _ in key_specs(self.section))
        return f"a list (at most {self.max_length:,} items) of tables {{{names}}}"

    def read(self, reader: Reader, where: str, value: object, unit: str) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) > self.max_length:
            raise reader.error(where, value, self.requirement(unit))
        return tuple(
            read_section(reader, f"{where}[{i}]", self.section, item) for i, item in enumerate(value)
        )


@dataclass(frozen=True)
class OrAuto:
    """A value of a kind, or "auto": chosen by `palpate.model_choice` before anything else sees it."""

    of: Kind

    def type_text(self) -> str:
        return f'{self.of.type_text()} or "{AUTO}"'

    def requirement(self, unit: str) -> str:
        return f'{self.of.requirement(unit)}, or "{AUTO}"'

    def read(self, reader: Reader, where: str, value: object, unit: str) -> object:
        if value == AUTO:
            return AUTO
        if isinstance(value, str):
            raise reader.error(where, value, self.requirement(unit))
        return self.of.read(reader, where, value, unit)


@dataclass(frozen=True)
class KeySpec:
    """Declaration of one key."""

    kind: Kind
    unit: str
    default: object
    default_text: str
    description: str


@dataclass(frozen=True)
class SectionSpec:
    """Declaration of one table inside another."""

    section: type
    required: bool
    optional: bool
    description: str


def key(
    kind: Kind, description: str, *, unit: str = "", default: object = REQUIRED, default_text: str = ""
) -> Any:
    """Declares a key. `default` is the value as validated (tuples, not lists); None means "not given", and then
    `default_text` says what happens."""
    text = default_text or ("required" if default is REQUIRED else format_value(default))
    spec = KeySpec(kind, unit, default, text, description)
    if default is REQUIRED:
        return dataclasses.field(metadata={_SPEC: spec})
    return dataclasses.field(default=default, metadata={_SPEC: spec})


def section(cls: type, description: str, *, required: bool = False, optional: bool = False) -> Any:
    """Declares a table. Without `required`, a missing table means all its defaults; with `optional`, it means None."""
    spec = SectionSpec(cls, required, optional, description)
    if required:
        return dataclasses.field(metadata={_SPEC: spec})
    default: Callable[[], object] = (lambda: None) if optional else cls
    return dataclasses.field(default_factory=default, metadata={_SPEC: spec})


def key_specs(cls: type) -> list[tuple[str, KeySpec]]:
    """Keys of a section, in order of declaration."""
    pairs = [(field.name, field.metadata.get(_SPEC)) for field in dataclasses.fields(cls)]
    return [(name, spec) for name, spec in pairs if isinstance(spec, KeySpec)]


def section_specs(cls: type) -> list[tuple[str, SectionSpec]]:
    """Tables inside a section, in order of declaration."""
    pairs = [(field.name, field.metadata.get(_SPEC)) for field in dataclasses.fields(cls)]
    return [(name, spec) for name, spec in pairs if isinstance(spec, SectionSpec)]


def read_section(reader: Reader, where: str, cls: type[Section], table: object) -> Section:
    """Checks a parsed table against the declarations of `cls` and builds it. `where` is "" for the whole scene."""
    if not isinstance(table, dict):
        raise reader.error(where, table, f"a table with the keys {', '.join(n for n, _ in key_specs(cls))}")
    prefix = f"{where}." if where else ""
    keys, sections = dict(key_specs(cls)), dict(section_specs(cls))
    values: dict[str, object] = {}
    for name, value in table.items():
        if name in keys:
            spec = keys[name]
            values[name] = spec.kind.read(reader, prefix + name, value, spec.unit)
        elif name in sections:
            values[name] = read_section(reader, prefix + name, sections[name].section, value)
        else:
            known = [prefix + known_name for known_name in (*keys, *sections)]
            raise SceneError(
                f"{reader.file}: {prefix}{format_key(name)} = {format_value(value)}: unknown key; "
                f"{did_you_mean(prefix + name, known)}"
            )
    for name, spec in keys.items():
        if name not in values and spec.default is REQUIRED:
            raise reader.problem(prefix + name, f"missing; must be {spec.kind.requirement(spec.unit)}")
    for name, section_spec in sections.items():
        if name not in values and section_spec.required:
            needed = [n for n, s in key_specs(section_spec.section) if s.default is REQUIRED]
            text = f"a table [{prefix}{name}]" + (f" with at least {', '.join(needed)}" if needed else "")
            raise reader.problem(prefix + name, f"missing; must be {text}")
    return cls(**values)


def format_key(name: str) -> str:
    """A key as it would stand in TOML: bare where that is possible."""
    bare = name != "" and all(c.isascii() and (c.isalnum() or c in "_-") for c in name)
    return name if bare else format_value(name)
