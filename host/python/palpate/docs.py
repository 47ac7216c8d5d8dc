"""Writes the tables of docs/scenes.md, records.md and frontier.md from the declarations in the code, those of numbers.md and faults.md
from the measurements in docs/numbers, and the programs that stand in other pages.

`python -m palpate.docs` rewrites what stands between the markers `<!-- begin NAME -->` and `<!-- end NAME -->`;
with `--check` it only says whether that would change anything.
"""

import argparse
import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from palpate import record_layout, summary
from palpate.frontier import metrics, points
from palpate.paths import ROOT
from palpate.record_layout import Dataset
from palpate.scene_overrides import format_override
from palpate.scene_schema import Choice, Flag, ListOf, TablesOf, Text, key_specs, section_specs
from palpate.scene_sections import SceneFile

NUMBERS = ROOT / "docs/numbers/scenes.json"
FAULTS = ROOT / "docs/numbers/faults.json"
# Programs that stand in a page: a forge shows the page as it is, so the text is in it and not included when the site is built.
LISTINGS = {
    "listen_with_pycyphal": "docs/examples/listen_with_pycyphal.py",
    "touch_a_body": "docs/examples/touch_a_body.py",
    "example_wall": "host/device_api/example_wall.c",
}
_MARKED = re.compile(r"<!-- begin (\w+) -->\n.*?<!-- end \1 -->", re.DOTALL)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines)


def _range_text(kind: object, unit: str) -> str:
    """The range without the words that the type column has already."""
    if isinstance(kind, Flag | Text | TablesOf):
        return f"at most {kind.max_length:,}" if isinstance(kind, TablesOf) else ""
    if isinstance(kind, Choice):
        return ", ".join(f"`{choice}`" for choice in kind.choices)
    if isinstance(kind, ListOf):
        return f"at most {kind.max_length:,}; each {_range_text(kind.of, unit)}"
    text = kind.requirement(unit)  # type: ignore[attr-defined]
    match = re.search(r"[\[(][-\d.e]+, [-+\d.e]+\].*", text)
    return match[0] if match else text


def _keys_table(cls: type) -> str:
    rows = []
    for name, spec in key_specs(cls):
        default = spec.default_text
        plain = default == "required" or spec.default is None
        rows.append(
            [
                f"`{name}`",
                spec.kind.type_text(),
                spec.unit,
                default if plain else f"`{default}`",
                _range_text(spec.kind, spec.unit),
                spec.description,
            ]
        )
    return _table(["key", "type", "unit", "default", "range", "meaning"], rows)


def _nested_tables(where: str, cls: type) -> list[str]:
    named: dict[type, list[str]] = {}
    for name, spec in key_specs(cls):
        if isinstance(spec.kind, TablesOf):
            named.setdefault(spec.kind.section, []).append(f"`{where}.{name}`")
    return [
        part
        for table, names in named.items()
        for part in (f"Each table of {' and '.join(names)}:", _keys_table(table))
    ]


def _section_parts(where: str, cls: type) -> list[str]:
    parts = [_keys_table(cls), *_nested_tables(where, cls)] if key_specs(cls) else []
    for name, spec in section_specs(cls):
        full = f"{where}.{name}" if where else name
        parts += [
            f"## [{full}]" if not where else f"### [{full}]",
            spec.description,
            *_section_parts(full, spec.section),
        ]
    return parts


def scene_tables() -> str:
    """All keys of a scene, section by section."""
    return "\n\n".join(["## Top level", *_section_parts("", SceneFile)])


def dataset_table(layout: Sequence[Dataset]) -> str:
    """Datasets of a record."""
    types = {"f": "float", "u": "unsigned", "i": "integer"}
    rows = []
    for dataset in layout:
        type_text = f"{types[dataset.dtype[0]]} {8 * int(dataset.dtype[1:])}"
        meaning = dataset.description + (" (may be absent)" if dataset.optional else "")
        hashed = "yes" if dataset.hashed else ""
        rows.append([f"`/{dataset.path}`", dataset.shape_text(), type_text, dataset.unit, hashed, meaning])
    return _table(["dataset", "shape", "type", "unit", "in record_hash", "meaning"], rows)


def summary_table(keys: Sequence[summary.Key]) -> str:
    """Keys of summary.json, or of the metrics in frontier.json."""
    return _table(["key", "unit", "meaning"], [[f"`{key.name}`", key.unit, key.definition] for key in keys])


def _settings(overrides: Mapping[str, object]) -> str:
    return ", ".join(f"`{format_override(*item)}`" for item in overrides.items())


def numbers_table(measured: Mapping[str, Any]) -> str:
    """The runs of docs/numbers/scenes.json (host/bench/scene_numbers.py)."""
    rows = []
    for run in measured["runs"]:
        rows.append(
            [
                f"`{run['scene']}`",
                f"`{run['builder']}`",
                f"{run['rms_force_error_percent']:.2f} %",
                f"{run['peak_force_N']:.2f} N",
                f"{run['worst_tick_instructions']:,}",
                f"{run['missed_deadlines']}",
                f"{run['background_overruns']}",
                f"{run['model_updates']}",
                f"{run['link_bytes_per_s']['down'] / 1e3:.1f} kB/s",
            ]
        )
    header = ["scene", "builder", "error", "peak force", "tick", "missed", "left over", "models", "link down"]
    return f"Measured with version {measured['version']} on `{measured['board']}`.\n\n{_table(header, rows)}"


def faults_table(measured: Mapping[str, Any]) -> str:
    """The matrix of one medium (host/bench/fault_numbers.py)."""

    def ticks(value: float | None) -> str:
        return "" if value is None else f"{value:,}"

    rows = [
        [
            row["group"],
            f"{row['cases']}",
            f"{row['step_N']:.2f}",
            f"{row['rise_N']:.2f}",
            f"{row['left_N']:.2f}",
            *(ticks(row[name]) for name in ("force_gone_ticks", "outputs_off_ticks", "recovery_ticks")),
            f"{row['lost']:,} of {row['removed']:,}",
        ]
        for row in measured["groups"]
    ]
    header = ["group", "cases", "largest change, N a tick", "largest rise over the same tick, N", "left of rule 3, N", "force gone, ms",
              "outputs off, ms", "first model again, ms", "frames lost, of those removed"]  # fmt: skip
    free, closest = measured["fault_free"], measured["closest"]
    verdict = "no rule broken" if measured["passed"] else "a rule is broken"
    words = (
        f"{sum(row['cases'] for row in measured['groups'])} cases, {verdict}. Without faults {free['force_N']:.2f} N and "
        f"{free['step_N']:.3f} N in a tick at most. Closest to rule 3: `{closest['case']}`, {closest['left_N']:.2f} N left."
    )
    return f"{words}\n\n{_table(header, rows)}"


def blocks() -> dict[str, str]:
    """Generated text by the name in its markers."""
    return {
        "scene_keys": scene_tables(),
        "run_summary": summary_table(summary.RUN_KEYS),
        "replay_summary": summary_table(summary.REPLAY_KEYS),
        "plot_keys": summary_table(summary.PLOT_KEYS),
        "simulate_summary": summary_table(summary.SIMULATE_KEYS),
        "run_datasets": dataset_table(record_layout.RUN),
        "simulate_datasets": dataset_table(record_layout.SIMULATE),
        "frontier_metrics": summary_table(metrics.METRICS),
        "frontier_builders": _table(
            ["builder", "meaning", "keys of the scene"],
            [
                [f"`{b.name}`", b.title, _settings({**b.overrides, **({"board.name": b.board} if b.board else {})})]
                for b in points.BUILDERS.values()
            ],
        ),
        "frontier_experiments": _table(
            ["experiment", "meaning", "keys of the scene"],
            [[f"`{e.name}`", e.title, _settings(e.overrides)] for e in points.EXPERIMENTS.values()],
        ),
        "frontier_sweeps": _table(
            ["sweep", "values"], [[f"`{name}`", "; ".join(values)] for name, values in points.SWEEPS.items()]
        ),
        "scene_numbers": numbers_table(json.loads(NUMBERS.read_text("utf-8"))),
        **{f"faults_{medium}": faults_table(one) for medium, one in json.loads(FAULTS.read_text("utf-8"))["media"].items()},
        "counters": _table(
            ["attribute", "meaning"], [[f"`{k}`", v] for k, v in record_layout.RUN_COUNTERS.items()]
        ),
        **{name: _listing(file) for name, file in LISTINGS.items()},
    }


def _listing(file: str) -> str:
    language = {"py": "python"}.get(file.rpartition(".")[2], "c")
    return f"```{language}\n{(ROOT / file).read_text('utf-8').rstrip()}\n```"


def rewrite(text: str) -> str:
    """The text with every marked block brought up to date. KeyError for a marker that is not known."""
    generated = blocks()
    return _MARKED.sub(lambda m: f"<!-- begin {m[1]} -->\n{generated[m[1]]}\n<!-- end {m[1]} -->", text)


FILES = tuple(ROOT / f"docs/{name}.md" for name in ("scenes", "records", "frontier", "numbers", "faults", "protocol", "device_api", "first_evening"))


def outdated(files: Sequence[Path] = FILES) -> list[Path]:
    """Those files whose tables do not agree with the code."""
    return [file for file in files if rewrite(file.read_text("utf-8")) != file.read_text("utf-8")]


def main() -> int:
    """Returns 1 where `--check` finds an outdated file."""
    parser = argparse.ArgumentParser(prog="python -m palpate.docs", description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing")
    check = parser.parse_args().check
    old = outdated()
    for file in old:
        print(f"{file.relative_to(ROOT)}: {'is outdated' if check else 'brought up to date'}")
        if not check:
            file.write_text(rewrite(file.read_text("utf-8")), "utf-8")
    return 1 if check and old else 0


if __name__ == "__main__":
    sys.exit(main())
