"""The report of `palpate reproduce`: one HTML page that needs no other file."""

import base64
import html
import math
from collections.abc import Sequence
from pathlib import Path

from palpate import __version__
from palpate.reproduce.checks import Check
from palpate.reproduce.figure import Case, Study, Table
from palpate.reproduce.results import FigureResult
from palpate.scene_overrides import format_override

STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 52rem; padding: 1rem; color: #1b1f23; background: #fff;
       font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .5rem 0; }
h2 { font-size: 1.25rem; line-height: 1.3; margin: 2.5rem 0 .5rem; padding-top: 1rem; border-top: 1px solid #d0d7de; }
p { margin: .6rem 0; }
blockquote { margin: .8rem 0; padding: .1rem 1rem; border-left: 4px solid #9cc3ea; color: #444; }
figure { margin: 1rem 0; }
img { width: 100%; height: auto; }
figcaption { font-size: .9rem; color: #555; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .88rem; }
th, td { text-align: left; vertical-align: top; padding: .4rem .5rem; border-bottom: 1px solid #e4e8ec; }
th { border-bottom: 2px solid #c4ccd4; white-space: nowrap; }
td.number { white-space: nowrap; font-variant-numeric: tabular-nums; }
.why { color: #57606a; }
.pass, .fail, .only { font-weight: 600; white-space: nowrap; }
.pass { color: #1a7f37; } .fail { color: #b3261e; } .only { color: #6b6b6b; font-weight: 400; }
code, pre { font-family: ui-monospace, "DejaVu Sans Mono", Menlo, monospace; font-size: .82rem; }
pre { background: #f4f6f8; padding: .6rem .8rem; overflow-x: auto; border-radius: 4px; }
a { color: #17508f; }
@media (max-width: 40rem) {
  .checks thead { display: none; }
  .checks tr { display: block; padding: .5rem 0; border-bottom: 1px solid #d0d7de; }
  .checks td { display: block; border: 0; padding: .1rem 0; white-space: normal; }
  .checks td[data-label]::before { content: attr(data-label) ": "; color: #6b6b6b; }
}
"""

TITLE = "The paper’s figures, reproduced"
_PAPER = (
    "P. Jacobs, M. J. Fu and M. C. Çavuşoğlu, <cite>High Fidelity Haptic Rendering of Frictional Contact with "
    "Deformable Objects in Virtual Environments using Multi-rate Simulation</cite>, International Journal of Robotics "
    "Research 29(14), 2010"
)


def write_report(file: Path, results: Sequence[FigureResult], hil: bool) -> Path:
    """Writes the page; images are inside it. Returns `file`."""
    parts = [_head(results, hil), *(_section(result, hil) for result in results), "</body></html>\n"]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(parts), encoding="utf-8")
    return file


def format_number(value: float | int) -> str:
    """Four significant digits; whole numbers as they are."""
    if isinstance(value, int):
        return f"{value:,}"
    if math.isnan(value):
        return "none"
    return f"{value:,.4g}"


def format_tolerance(check: Check) -> str:
    """The bounds in words; empty without any."""
    if check.at_most is not None and check.at_least == -check.at_most:
        return f"within ±{format_number(float(check.at_most))}"
    bounds = [("at least", check.at_least), ("at most", check.at_most)]
    return ", ".join(f"{words} {bound:.7g}" for words, bound in bounds if bound is not None)


def format_command(case: Case, hil: bool) -> str:
    """The command that repeats one run or study."""
    file = case.shown_file
    overrides = "".join(f" --set '{format_override(*item)}'" for item in case.overrides.items())
    if isinstance(case, Study):
        if case.order is None:
            return f"./run reduce --check-locality {file}{overrides}"
        method = " --dense" if case.dense else f" --tolerance {case.tolerance:g}"
        return f"./run reduce --scene {file} --order {case.order}{method}{overrides}"
    return f"./run run {file} --board {'mps2_an386' if hil else 'native'}{overrides}"


def verdict(passed: bool | None) -> str:
    """In its colour; None: nothing to judge."""
    name, text = {True: ("pass", "pass"), False: ("fail", "FAIL"), None: ("only", "reported")}[passed]
    return f'<span class="{name}">{text}</span>'


def _head(results: Sequence[FigureResult], hil: bool) -> str:
    rows = "".join(
        f'<tr><td><a href="#{result.figure.name}">{result.figure.label}</a></td>'
        f"<td>{html.escape(result.figure.title)}</td><td>{_count(result)}</td><td>{verdict(result.passed)}</td></tr>"
        for result in results
    )
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{TITLE}</title><style>{STYLE}</style></head><body>
<h1>{TITLE}</h1>
<p>{_PAPER}: section 2 and the experiments of sections 5 and 6.1, done again with palpate {html.escape(__version__)}.</p>
{"".join(f"<p>{text}</p>" for text in _how(results, hil))}
<p>The paper prints its curves as pictures, without data, mesh constants or the motion of the hand. So its
<em>statements</em> and its tables are compared here, not its curves: each row below holds one number against a sentence
of the paper, with a tolerance and the reason for it. Where the paper gives no number, the row says so. The material is ours
where the paper states none: masses of 1 g, springs of 100 N/m, 1 cm apart, critically damped, unless a section says
otherwise.</p>
<div class="wide"><table><thead><tr><th></th><th>Experiment</th><th>Checks passed</th><th></th></tr></thead>
<tbody>{rows}</tbody></table></div>"""


def _how(results: Sequence[FigureResult], hil: bool) -> list[str]:
    """How the numbers came about, a paragraph for each way that these results took."""
    where = (
        "in QEMU, an emulated Cortex-M4F" if hil else "as a Linux process, whose arithmetic is that of the board"
    )
    ways = []
    if any(result.figure.studies for result in results):
        ways.append(
            "What belongs to section 2 reduces linear bodies, on one core, without device and firmware. Its times "
            "are those of this machine, and the only numbers here that do not repeat."
        )
    if any(result.figure.runs for result in results):
        ways.append(
            f"For those of sections 5 and 6.1 the firmware ran {where}, a thousand ticks a second of virtual time, against a "
            "simulated arm; the full body and the local models came from the host at 30 Hz. All of that repeats to the bit."
        )
    return ways


def _count(result: FigureResult) -> str:
    judged = [check.passed for check in result.checks if check.passed is not None]
    return f"{sum(judged)} of {len(judged)}"


def _section(result: FigureResult, hil: bool) -> str:
    figure = result.figure
    claims = "".join(
        f"<blockquote><p>“{html.escape(text)}” (section {section})</p></blockquote>"
        for text, section in figure.claims
    )
    setting = "".join(f"<p>{html.escape(text)}</p>" for text in figure.setting)
    image = base64.b64encode(result.plot.read_bytes()).decode("ascii")
    commands = "\n".join(html.escape(format_command(case, hil)) for case in figure.cases)
    whole = f"./run reproduce {figure.name}" + (" --hil" if hil and figure.runs else "")
    scenes = ", ".join(dict.fromkeys(f"<code>{case.shown_file}</code>" for case in figure.cases))
    return f"""<section id="{figure.name}">
<h2>{figure.label}. {html.escape(figure.title)} {verdict(result.passed)}</h2>
<p>What the paper states:</p>{claims}
<p>What was done here:</p>{setting}
<figure><img alt="Our {figure.label}: {html.escape(figure.caption)}" src="data:image/png;base64,{image}">
<figcaption>{html.escape(figure.caption)}</figcaption></figure>
<div class="wide checks"><table><thead><tr><th>Number, what the paper says of it, why this tolerance</th><th>Measured</th>
<th>Tolerance</th><th></th></tr></thead><tbody>
{"".join(map(_row, result.checks))}
</tbody></table></div>
{"".join(map(_table, result.tables))}
<p>Scene: {scenes}. All of it: <code>{whole}</code>. One by one:</p>
<pre>{commands}</pre>
</section>"""


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in (("",) if table.names else ()) + table.columns)
    names = [f"<td>{html.escape(name)}</td>" for name in table.names] or [""] * len(table.rows)
    body = "".join(
        f"<tr>{name}" + "".join(f'<td class="number">{format_number(value)}</td>' for value in row) + "</tr>"
        for name, row in zip(names, table.rows, strict=True)
    )
    return (
        f"<details{' open' if table.main else ''}><summary>{html.escape(table.title)} ({len(table.rows)})</summary>"
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div></details>'
    )


def _row(check: Check) -> str:
    unit = f" {html.escape(check.unit)}" if check.unit else ""
    tolerance = format_tolerance(check)
    why = f"Tolerance: {check.reason}" if tolerance else check.reason[0].upper() + check.reason[1:]
    shown = f'<td class="number" data-label="Tolerance">{tolerance}{unit}</td>' if tolerance else "<td></td>"
    return (
        f'<tr><td><strong>{html.escape(check.name)}</strong><br><span class="why">Paper: '
        f"{html.escape(check.paper_states)}. {html.escape(why)}.</span></td>"
        f'<td class="number" data-label="Measured">{format_number(check.measured)}{unit}</td>{shown}'
        f"<td>{verdict(check.passed)}</td></tr>\n"
    )
