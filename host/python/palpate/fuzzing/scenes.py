"""Scene files with changed values, keys and bytes: each is a scene, or is refused with a SceneError."""

import datetime
import json
import tomllib
from pathlib import Path
from typing import Any

from palpate.fuzzing.draw import Draw
from palpate.fuzzing.values import mutate_tree, odd_value
from palpate.paths import SCENES
from palpate.scene import SceneError, load_scene
from palpate.scene_overrides import parse_override


class SceneFuzz:
    """One execution after another; `folder` is for the file."""

    def __init__(self, folder: Path) -> None:
        self._sources = [file.read_bytes() for file in sorted(SCENES.glob("*.toml"))]
        self.file = folder / "scene.toml"

    def execute(self, data: bytes) -> None:
        """Whatever is not a SceneError is a finding."""
        draw = Draw(data)
        self.file.write_bytes(self._changed(draw))
        try:
            overrides = {}
            if draw.chance(0.2):
                key = draw.choice(("contact.friction", "body.nodes", "path.csv", "model", "a.b.c", "", "."))
                overrides = dict([parse_override(f"{key}={_toml_value(odd_value(draw))}")])
            scene = load_scene(self.file, overrides)
            assert scene.text
            if scene.path is not None:
                scene.judge()
            scene.to_dict()
        except SceneError as error:
            assert str(error) and "\n" not in str(error), "a refusal is one line"

    def _changed(self, draw: Draw) -> bytes:
        source = draw.choice(self._sources)
        if draw.chance(0.3):
            return _mutate_bytes(source, draw)
        if draw.chance(0.1):
            return draw.rest()
        return _toml(mutate_tree(tomllib.loads(source.decode()), draw)).encode()


def _mutate_bytes(source: bytes, draw: Draw) -> bytes:
    data = bytearray(source)
    for _ in range(draw.randint(1, 4)):
        at = draw.randrange(len(data))
        match draw.randrange(4):
            case 0:
                data[at] = draw.randrange(256)
            case 1:
                del data[at : at + draw.randint(1, 20)]
            case 2:
                data[at:at] = draw.choice((b"[", b"]", b"=", b'"', b"\n", b"\xff", b"\x00", b"1e999", b"'''", b"[[a]]\n"))
            case _:
                del data[at:]
        if not data:
            return bytes(data)
    return bytes(data)


def _toml(tree: dict[str, Any]) -> str:
    """Simple values first, then tables, as the format wants it."""
    tables = {name: value for name, value in tree.items() if isinstance(value, dict)}
    lines = [f"{json.dumps(name)} = {_toml_value(value)}" for name, value in tree.items() if name not in tables]
    for name, table in tables.items():
        lines.append(f"[{json.dumps(name)}]")
        lines += [f"{json.dumps(key)} = {_toml_value(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float):
        return repr(value)  # nan and inf are TOML
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(name)} = {_toml_value(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    if isinstance(value, datetime.date):
        return value.isoformat()
    return str(value)
