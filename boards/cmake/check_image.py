"""Compares a linked firmware image with the memory of the part it is for, and its deepest stack with the reservation.

Called after linking (bare_metal.cmake). Prints a table; exits 1 with one line for each budget that is exceeded, each
symbol that needs a heap or a C++ run-time, and each call whose stack cannot be bounded.

The deepest stack is the sum over the contexts, each of which may interrupt those before it at their deepest, of the
deepest path through GCC's call graph (-fcallgraph-info=su) plus the exception frame that the processor pushes. A call
through a pointer may go to any of --indirect; without them it is an error. Weak symbols that nobody defines are asked for and
not called.
"""

import argparse
import pathlib
import re
import subprocess
import sys

# ARMv7-M with FPU: 8 words, 17 of the FPU, one reserved, one that aligns.
EXCEPTION_FRAME_BYTES = 27 * 4
# Functions of newlib and libgcc that have no call graph, and a bound on their stack: they save at most eight registers.
LIBRARY_FUNCTIONS = {"memcmp", "memcpy", "memmove", "memset", "strlen", "__aeabi_uldivmod", "__udivmoddi4"}
LIBRARY_STACK_BYTES = 64
# The function that runs constructors of static objects through pointers, and how GCC names those.
RUNS_CONSTRUCTORS = "start_up"
CONSTRUCTOR_PREFIX = "_GLOBAL__sub_I_"
FLASH_SECTIONS = (".text", ".ARM.exidx", ".data")
RAM_SECTIONS = (".stack", ".data", ".bss", ".noinit")
NO_MEMORY_OF_THE_PART = (".exchange",)
NO_MEMORY = (".debug", ".comment", ".ARM.attributes")
# Heap, operator new and delete, exceptions and guards.
FORBIDDEN_SYMBOLS = re.compile(r"^(_?(malloc|free|calloc|realloc|sbrk)(_r)?|_Zn[wa].*|_Zd[la].*|__cxa_.*)$")

NODE = re.compile(r'^node: \{ title: "(?P<title>[^"]+)" label: "(?P<label>(?:[^"\\]|\\.)*)"')
EDGE = re.compile(r'^edge: \{ sourcename: "(?P<source>[^"]+)" targetname: "(?P<target>[^"]+)"')
STACK = re.compile(r"\\n(?P<bytes>\d+) bytes \((?P<kind>[^)]+)\)$")


def symbol_of(title: str) -> str:
    """A local function's title starts with its file; the symbol follows the last colon."""
    return title.rsplit(":", 1)[-1]


class CallGraph:
    """Stack of each function and whom it calls, by symbol. A symbol that two files define keeps its larger stack."""

    def __init__(self, files: list[pathlib.Path], names_of_address: dict[int, list[str]], indirect: set[str]):
        self.indirect = indirect
        self.stack_bytes: dict[str, int] = {}
        self.calls: dict[str, set[str]] = {}
        self.unbounded: list[str] = []
        for file in files:
            self._read(file)
        # Names that the compiler gave to one function, such as the variants of a constructor.
        for names in names_of_address.values():
            known = [name for name in names if name in self.stack_bytes]
            for name in names if known else ():
                if name not in self.stack_bytes:
                    self.stack_bytes[name] = self.stack_bytes[known[0]]
                    self.calls[name] = self.calls.get(known[0], set())

    def leave_out(self, symbols: set[str]) -> None:
        """Symbols that are not in the image."""
        self.stack_bytes |= dict.fromkeys(symbols, 0)
        self.calls |= {symbol: set() for symbol in symbols}

    def _read(self, file: pathlib.Path) -> None:
        for line in file.read_text(encoding="utf-8").splitlines():
            if node := NODE.match(line):
                symbol = symbol_of(node["title"])
                if stack := STACK.search(node["label"]):
                    self.stack_bytes[symbol] = max(self.stack_bytes.get(symbol, 0), int(stack["bytes"]))
                    if "dynamic" in stack["kind"] and "bounded" not in stack["kind"]:
                        self.unbounded.append(f"{symbol}: stack frame of unknown size")
            elif edge := EDGE.match(line):
                self.calls.setdefault(symbol_of(edge["source"]), set()).add(symbol_of(edge["target"]))

    def _targets(self, symbol: str) -> set[str]:
        targets = set(self.calls.get(symbol, ()))
        if "__indirect_call" in targets and symbol == RUNS_CONSTRUCTORS:
            targets.discard("__indirect_call")
            targets |= {name for name in self.stack_bytes if name.startswith(CONSTRUCTOR_PREFIX)}
        elif "__indirect_call" in targets and self.indirect:
            targets.discard("__indirect_call")
            targets |= self.indirect
        return targets

    def deepest(self, symbol: str, path: tuple[str, ...] = (), known: dict[str, int] | None = None) -> int:
        """Bytes of stack below `symbol`, its own frame included. Problems go to self.unbounded."""
        known = {} if known is None else known
        if symbol in known:
            return known[symbol]
        if symbol in path:
            self.unbounded.append(f"recursion: {' -> '.join((*path, symbol))}")
            return 0
        if symbol not in self.stack_bytes:
            if symbol in LIBRARY_FUNCTIONS:
                return LIBRARY_STACK_BYTES
            caller = path[-1] if path else "the command line"
            self.unbounded.append(f"{symbol}, called by {caller}: its stack is not known")
            return 0
        below = max((self.deepest(target, (*path, symbol), known) for target in self._targets(symbol)), default=0)
        known[symbol] = self.stack_bytes[symbol] + below
        return known[symbol]


def output_of(tool: str, *arguments: str) -> list[str]:
    return subprocess.run([tool, *arguments], check=True, capture_output=True, text=True).stdout.splitlines()


def weak_references(tool_prefix: str, objects: list[pathlib.Path]) -> set[str]:
    """Symbols that the objects want and do without."""
    lines = [line.split() for line in output_of(tool_prefix + "nm", "--undefined-only", *map(str, objects))]
    return {line[1] for line in lines if len(line) == 2 and line[0] in "wv"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--image", type=pathlib.Path, required=True)
    parser.add_argument("--compiler", required=True, help="its size and nm are beside it")
    parser.add_argument("--flash", type=int, required=True, help="bytes of the part")
    parser.add_argument("--ram", type=int, required=True, help="bytes of the part")
    parser.add_argument("--contexts", nargs="+", required=True, help="entry functions, lowest priority first; those of one priority joined by |")
    parser.add_argument("--indirect", nargs="*", default=[], help="functions that are called through pointers")
    parser.add_argument("--table", type=pathlib.Path, help="a file for the table, too")
    parser.add_argument("--objects", type=pathlib.Path, nargs="+", required=True)
    arguments = parser.parse_args()
    tool_prefix = arguments.compiler.removesuffix("g++")

    sizes = {}
    for line in output_of(tool_prefix + "size", "-A", "-d", str(arguments.image)):
        words = line.split()
        # Sections without an address take no memory.
        if len(words) == 3 and words[0].startswith(".") and not words[0].startswith(NO_MEMORY):
            sizes[words[0]] = int(words[1])
    problems = [f"section {name} ({size} bytes) is in no budget" for name, size in sizes.items()
                if name not in FLASH_SECTIONS + RAM_SECTIONS + NO_MEMORY_OF_THE_PART]
    names_of_address: dict[int, list[str]] = {}
    defined = set()
    for line in output_of(tool_prefix + "nm", "--defined-only", str(arguments.image)):
        address, kind, name = line.split()
        defined.add(name)
        if kind in "tTwW":
            names_of_address.setdefault(int(address, 16), []).append(name)
    problems += [f"symbol {name}: the firmware has no heap and no C++ run-time"
                 for names in names_of_address.values() for name in names if FORBIDDEN_SYMBOLS.match(name)]

    graph = CallGraph([file.with_suffix(".ci") for file in arguments.objects], names_of_address,
                      set(arguments.indirect))
    graph.leave_out(weak_references(tool_prefix, arguments.objects) - defined)
    depths = {names: max(graph.deepest(name) for name in names.split("|")) for names in arguments.contexts}
    problems += sorted(set(graph.unbounded))

    rows = [("flash", sum(sizes.get(name, 0) for name in FLASH_SECTIONS), arguments.flash),
            ("RAM, stack included", sum(sizes.get(name, 0) for name in RAM_SECTIONS), arguments.ram),
            ("deepest stack", sum(depths.values()) + EXCEPTION_FRAME_BYTES * (len(depths) - 1), sizes[".stack"])]
    table = [f"{arguments.image.name:<38}{'bytes':>10}{'budget':>10}"]
    for name, used, budget in rows:
        table.append(f"  {name:<36}{used:>10,}{budget:>10,}{used / budget:>8.0%}")
        if used > budget:
            problems.append(f"{name}: {used} bytes, the budget is {budget}")
    for names, depth in depths.items():
        for i, name in enumerate(names.split("|")):
            table.append(f"    {name:<34}{depth:>10,}" if i == 0 else f"    or {name}")
    print("\n".join(table))
    if arguments.table:
        arguments.table.write_text("\n".join(table) + "\n", encoding="utf-8")
    for problem in problems:
        print(f"{arguments.image.name}: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
