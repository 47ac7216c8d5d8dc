"""The byte layouts of docs/protocol.md against the message definitions."""

from collections.abc import Iterator

import pydsdl
import pytest

from palpate.paths import ROOT

MESSAGES = ("GetInfo.Response", "Command.Request", "Command.Response", "BoardStatus", "ServoTrace", "ServoSample")


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
