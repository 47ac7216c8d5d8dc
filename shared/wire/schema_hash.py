"""One number for a set of message definitions: two programs understand each other if theirs is the same.

Hashed are the files' names and their DSDL tokens; comments and white space do not count. The build writes the number
into palpate/schema_hash.hpp; Python code imports this file and calls schema_hash().
"""

import argparse
import hashlib
import pathlib
import re

# A string or character literal, a comment, a word or number, the line that parts request from response, or a symbol.
_TOKEN = re.compile(r"""'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|\#.*|[\w.]+|^---+|[^\s\w]""")


def canonical_text(folder: pathlib.Path) -> str:
    """Returns the definitions below `folder` (a DSDL root namespace), each as its path and its tokens, one line each."""
    lines = []
    for path in sorted(folder.rglob("*.dsdl"), key=lambda p: p.relative_to(folder).as_posix()):
        lines.append(f"{folder.name}/{path.relative_to(folder).as_posix()}")
        for line in path.read_text(encoding="utf-8").splitlines():
            tokens = [token for token in _TOKEN.findall(line) if not token.startswith("#")]
            if tokens:
                lines.append(" ".join(tokens))
    if not lines:
        raise ValueError(f"{folder}: no .dsdl files below it")
    return "\n".join(lines) + "\n"


def schema_hash(folder: pathlib.Path) -> int:
    """Returns the first 64 bits (little-endian) of the SHA-256 of canonical_text(folder)."""
    digest = hashlib.sha256(canonical_text(pathlib.Path(folder)).encode()).digest()
    return int.from_bytes(digest[:8], "little")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path, help="DSDL root namespace")
    parser.add_argument("header", type=pathlib.Path, help="C++ header to write")
    arguments = parser.parse_args()
    arguments.header.parent.mkdir(parents=True, exist_ok=True)
    arguments.header.write_text(
        "// Written by shared/wire/schema_hash.py from the message definitions.\n"
        "#pragma once\n\n#include <cstdint>\n\nnamespace palpate::wire {\n\n"
        f"inline constexpr std::uint64_t kSchemaHash = 0x{schema_hash(arguments.folder):016x}u;\n\n"
        "}  // namespace palpate::wire\n"
    )


if __name__ == "__main__":
    main()
