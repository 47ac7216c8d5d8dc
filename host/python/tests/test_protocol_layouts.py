"""The byte layouts of docs/protocol.md against the message definitions."""

import re
from collections.abc import Iterator

import pydsdl
import pytest

from palpate.paths import ROOT

MESSAGES = ("GetInfo.Response", "Command.Request", "Command.Response", "BoardStatus", "ServoTrace", "ServoSample", "DeviceState", "TraceRequest", "DirectForce")
# Fields that are numbers with names, and where the names stand.
NAMED = (
    ("`action` of Command", "Command.Request", ""),
    ("`mode` of Command, BoardStatus and DeviceState", "BoardStatus", "MODE_"),
    ("`mode` of ServoSample", "Contact", "MODE_"),
    ("`flags`", "ServoSample", "FLAG_"),
    ("`form`", "TraceRequest", "FORM_"),
)


@pytest.fixture(scope="module")
def types() -> dict[str, pydsdl.CompositeType]:
    every: dict[str, pydsdl.CompositeType] = {}
    for one in pydsdl.read_namespace(ROOT / "shared/wire/dsdl/palpate", []):
        name = one.full_name.removeprefix("palpate.")
        if isinstance(one, pydsdl.ServiceType):
            every |= {f"{name}.Request": one.request_type, f"{name}.Response": one.response_type}
        else:
            every[name] = one
    return every


def rows(message: pydsdl.CompositeType) -> Iterator[str]:
    """A row a field: where it begins, its type, its name. Behind an array of variable length offsets count from its end."""
    offset, after = 0, ""
    for one in message.fields:
        kind, name = one.data_type, one.name
        if isinstance(kind, pydsdl.VariableLengthArrayType):
            item = str(kind.element_type).removeprefix("saturated ")
            yield f"| {after}{offset} | `uint8` length, then so many `{item}`, {kind.capacity} at most | `{name}` |"
            offset, after = 0, f"end of `{name}` + "
            continue
        bits = kind.bit_length_set.max
        if name:
            yield f"| {after}{offset} | `{str(kind).removeprefix('saturated ')}` | `{name}` |"
        offset += bits // 8


@pytest.mark.parametrize("name", MESSAGES)
def test_the_layout_stands_in_the_document(types: dict[str, pydsdl.CompositeType], name: str) -> None:
    text = (ROOT / "docs/protocol.md").read_text("utf-8")
    table = "\n".join(("| byte | type | field |", "|---|---|---|", *rows(types[name])))
    assert f"**`palpate.{name}`**" in text and table in text, f"docs/protocol.md lacks:\n**`palpate.{name}`**\n\n{table}"


@pytest.mark.parametrize(("field", "name", "prefix"), NAMED)
def test_the_numbers_stand_in_the_document(types: dict[str, pydsdl.CompositeType], field: str, name: str, prefix: str) -> None:
    constants = [one for one in types[name].constants if one.name.startswith(prefix)]
    row = f"| {field} | {', '.join(f'{one.value.native_value} {one.name.removeprefix(prefix)}' for one in constants)} |"
    assert constants and row in (ROOT / "docs/protocol.md").read_text("utf-8"), f"docs/protocol.md lacks:\n{row}"


def test_the_statuses_stand_in_the_document() -> None:
    text = (ROOT / "docs/protocol.md").read_text("utf-8").partition("| status | name | meaning |")[2].partition("\n\n")[0]
    enumeration = (ROOT / "shared/status.hpp").read_text("utf-8").partition("enum class")[2].partition("};")[0]
    statuses = re.findall(r"(\w+) = (\d+),", enumeration)
    told = re.findall(r"^\| (\d+) \| `(\w+)` \|", text, re.MULTILINE)
    assert len(statuses) > 20 and told == [(number, name) for name, number in statuses]


def test_the_device_library_names_the_boards_faults() -> None:
    enumeration = (ROOT / "firmware/core/supervisor.hpp").read_text("utf-8").partition("enum class Fault")[2].partition("};")[0]
    names = re.findall(r"(\w+) = 1u << \d+,", enumeration)
    array = (ROOT / "host/device_api/device.cpp").read_text("utf-8").partition("kFaults[]")[2].partition(";")[0]
    assert names and re.findall(r'"(\w+)"', array) == names
