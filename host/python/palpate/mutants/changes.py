"""Small wrong changes of a source, each of one line: a comparison, an operator, a constant, a condition held true or false, a statement left out."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_COMPARISON = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)}
_OPERATOR = {
    "&&": ("||",), "||": ("&&",), "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "|": ("&",), "&": ("|",), "^": ("|",), ">>": ("<<",),
    "+=": ("-=", "="), "-=": ("+=", "="), "*=": ("/=",), "|=": ("=",),
}  # fmt: skip
_SPACED = re.compile(r"(?<= )(<=|>=|==|!=|<|>|&&|\|\||\+=|-=|\*=|\|=|\+|-|\*|/|\||&|\^|>>)(?= |$)")
_NOT = re.compile(r"!(?=[\w(])")
_NUMBER = re.compile(r"(?<![\w.'])(0x[0-9a-f]+|\d[\d']*(?:\.\d+)?(?:e-?\d+)?)(u|f)?(?![\w.'])")
_WORD = {"true": "false", "false": "true", "std::min": "std::max", "std::max": "std::min", "always": "rendering", "rendering": "always",
         "Mode::render": "Mode::direct", "Mode::direct": "Mode::render", "Mode::idle": "Mode::calibrate"}  # fmt: skip
_WORDS = re.compile(r"\b(" + "|".join(sorted(_WORD, key=len, reverse=True)) + r")\b(?!\()|\bstd::(?:min|max)\b")
_IF = re.compile(r"\bif \((.*)\)( \{| return\b.*;| [\w.]+ [|+-]?= .*;| \w+\(.*\);|)$")
_STATEMENT = re.compile(r"(?:[\w.\[\]>-]+ [|+*-]?= .*|\w+\(.*\)|[+-]{2}\w+);$")
_CHOICE = re.compile(r"\? ([^?:]+(?:::[^?:]+)*) : ([^;,)]+)")
# Declarations. Of the table of ranges, too, which is data: its test reads it.
_NO_CODE = re.compile(r"^(?:LimitRange<|#|//|namespace|using|static_assert|\[\[nodiscard\]\]|template|inline constexpr std::array\b|struct|class|\}$)")


Key = tuple[str, str, str]


@dataclass(frozen=True)
class Mutant:
    """One changed line: its number from 1, and its code before and after, without the spaces around it."""

    file: str
    line: int
    before: str
    after: str

    def apply(self, source: str) -> str:
        lines = source.splitlines(keepends=True)
        assert lines[self.line - 1].count(self.before) == 1
        lines[self.line - 1] = lines[self.line - 1].replace(self.before, self.after)
        return "".join(lines)

    @property
    def key(self) -> Key:
        """What it is when lines move."""
        return self.file, self.before, self.after


def _changes(code: str) -> Iterator[str]:
    """Of one line."""

    def put(match: re.Match[str], group: int, text: str) -> str:
        return code[: match.start(group)] + text + code[match.end(group) :]

    for match in _SPACED.finditer(code):
        for other in (*_COMPARISON.get(match[1], ()), *_OPERATOR.get(match[1], ())):
            yield put(match, 1, other)
    for match in _NOT.finditer(code):
        yield put(match, 0, "")
    for match in _NUMBER.finditer(code):
        if code[: match.start()].endswith("float, "):
            continue
        suffix = match[2] or ""
        is_float = suffix == "f"
        digits = match[1].replace("'", "")
        value = float(digits) if is_float or "." in digits else int(digits, 0)
        for number in {value + 1, value * 2} - {value}:
            yield put(match, 0, f"{float(number)!r}f" if is_float else f"{number}{suffix}")
    for match in _WORDS.finditer(code):
        yield put(match, 0, _WORD[match[0]])
    if found := _IF.search(code):
        yield put(found, 1, "true")
        yield put(found, 1, "false")
    if _STATEMENT.fullmatch(code):
        yield ";"
    if found := _CHOICE.search(code):
        yield code[: found.start()] + f"? {found[2]} : {found[1]}" + code[found.end() :]


def mutants(file: str, source: str) -> list[Mutant]:
    """Of a source, in its order."""
    found: dict[Mutant, None] = {}
    for number, line in enumerate(source.splitlines(), 1):
        code = line.split("//")[0].strip()
        # A comment behind the code is not code.
        if not code or _NO_CODE.match(code):
            continue
        for after in _changes(code):
            if after != code:
                found[Mutant(file, number, code, after)] = None
    return list(found)
