"""Scene files with changed values, keys and bytes: each is a scene, or is refused with a SceneError."""

import datetime
import json
import random
import tomllib
from pathlib import Path
from typing import Any

from palpate.fuzzing.values import mutate_tree, odd_value
from palpate.paths import SCENES
from palpate.scene import SceneError, load_scene
from palpate.scene_overrides import parse_override


class SceneFuzz:
    """One execution after another, from a seed; `folder` is for the file."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._draw = random.Random(seed)
        self._sources = [file.read_bytes() for file in sorted(SCENES.glob("*.toml"))]
        self.file = folder / "scene.toml"

    def next(self) -> None:
        """Writes the next input."""
        source = self._draw.choice(self._sources)
        if self._draw.random() < 0.3:
            self.file.write_bytes(_mutate_bytes(source, self._draw))
        else:
            self.file.write_bytes(_toml(mutate_tree(tomllib.loads(source.decode()), self._draw)).encode())

    def execute(self) -> None:
        """Reads it. Whatever is not a SceneError is a finding."""
        overrides = {}
        try:
            if self._draw.random() < 0.2:
                key = self._draw.choice(("contact.friction", "body.nodes", "path.csv", "model", "a.b.c", "", "."))
                overrides = dict([parse_override(f"{key}={_toml_value(odd_value(self._draw))}")])
            scene = load_scene(self.file, overrides)
            assert scene.text
            if scene.path is not None:
                scene.judge()
            scene.to_dict()
        except SceneError as error:
            assert str(error) and "\n" not in str(error), "a refusal is one line"


def _mutate_bytes(source: bytes, draw: random.Random) -> bytes:
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
