"""The page of `palpate bench faults`: rules with what is left of them, every case, and pictures; it needs no other file."""

import base64
import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from palpate.reproduce.report import STYLE, format_number, verdict

_RULES = (
    "Limits. In every tick force, set-points and the tip\u2019s speed are within the device\u2019s (but for rounding, 0.0001), and no set-point "
    "is given while outputs are off.",
    "Ramps. While outputs are on, the force changes in a tick by at most 0.5 N more than it ever does without faults; faults of the "
    "board cut instead.",
    "A fault does not raise the force by more than 0.5 N over that of the same tick without it, or over what the full body says "
    "along the tip\u2019s own way.",
    "Time. When the host is silent, or none of its models is taken, their force fades and outputs go off, both in time.",
    "Recovery. The run ends in the mode that is documented, by itself where it may.",
    "Counted. Every frame that was removed, every model that was refused and every restart shows.",
)
_COLUMNS = ("case", "", "change in a tick [N]", "rise over the same tick [N]", "left of rule 3 [N]", "force gone [ms]", "outputs off [ms]",
            "first model again [ms]", "lost of removed", "ends in")  # fmt: skip


def write_report(file: Path, values: dict[str, Any], pictures: Sequence[Path]) -> None:
    """Writes the page. values: of faults.json; pictures: faults.png and forces.png, which go into it."""
    cases = values["cases"]
    failed = [case for case in cases if case["broken"]]
    free = values["fault_free"]
    titles = (
        "Left: how long after the beginning of the fault the model\u2019s force is gone and outputs are off. Middle: the largest change of "
        "force in a tick. Right: force above that of the run without the fault.",
        "Force over time, of each case and without faults (dashed); below, how long each fault lasts.",
    )
    text = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>The fault matrix</title><style>{STYLE}</style></head><body>
<h1>The fault matrix {verdict(not failed)}</h1>
<p>{len(cases) - len(failed)} of {len(cases)} cases hold every rule: palpate {html.escape(values["palpate"])}, board
{html.escape(values["board"])}, link {html.escape(values["medium"])}. Without faults the force is {format_number(free["force_N"])} N at most
and changes by {format_number(free["step_N"])} N in a tick at most. All of it is virtual time and repeats to the bit; the rules in full
are in docs/faults.md.</p>
<h2>What is left of each rule</h2>
<div class="wide"><table><thead><tr><th>Rule</th><th>Closest of all cases</th><th>Limit</th><th>Left</th></tr></thead><tbody>
{"".join(_rule(i + 1, words, values) for i, words in enumerate(_RULES))}
</tbody></table></div>
<h2>Pictures</h2>
{"".join(map(_figure, pictures, titles))}
<h2>Every case</h2>
<div class="wide"><table><thead><tr>{"".join(f"<th>{html.escape(column)}</th>" for column in _COLUMNS)}</tr></thead><tbody>
{"".join(map(_case, cases))}
</tbody></table></div>
</body></html>
"""
    file.write_text(text, encoding="utf-8")


def _figure(file: Path, caption: str) -> str:
    image = base64.b64encode(file.read_bytes()).decode("ascii")
    shown = html.escape(caption)
    return f'<figure><img alt="{shown}" src="data:image/png;base64,{image}"><figcaption>{shown}</figcaption></figure>\n'


def _rule(number: int, words: str, values: dict[str, Any]) -> str:
    rows = [f'<tr><td colspan="4"><strong>{number}.</strong> {html.escape(words)}</td></tr>']
    for margin in values["margins"]:
        if margin["rule"] != number:
            continue
        unit = margin["unit"]
        what = f"{margin['what']}: {margin['case']}"
        cells = "".join(f'<td class="number">{format_number(float(margin[name]))} {unit}</td>' for name in ("value", "limit", "left"))
        rows.append(f'<tr><td class="why">{html.escape(what)}</td>{cells}</tr>')
    return "".join(rows) + "\n"


def _case(case: dict[str, Any]) -> str:
    def shown(value: float | None) -> str:
        return "" if value is None else format_number(value)

    lost = ", ".join(f"{case[f'lost_{way}']:,} of {case[f'removed_{way}']:,} {way}" for way in ("down", "up"))
    numbers = (f"{case['step_N']:.3f}", f"{case['rise_N']:.2f}", f"{-case['excess_N']:.2f}", shown(case["force_gone_ticks"]),
               shown(case["outputs_off_ticks"]), shown(case["recovery_ticks"]), lost, case["ends_in"])  # fmt: skip
    broken = "".join(f'<br><span class="fail">{html.escape(text)}</span>' for text in case["broken"])
    cells = "".join(f'<td class="number">{html.escape(text)}</td>' for text in numbers)
    return f"<tr><td>{html.escape(case['name'])}{broken}</td><td>{verdict(not case['broken'])}</td>{cells}</tr>\n"
