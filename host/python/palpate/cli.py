"""The command line: `palpate demo | run | simulate | reproduce | reduce | bench | choose | mesh | gui | device | calibrate | fuzz | flash | doctor | completion | test`.

Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted.
"""

import argparse
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import Any, NoReturn, TextIO

from palpate.cli_examples import epilog
from palpate.colour import Colour, paint
from palpate.experiment import Outcome, ProgressBar, run, simulate
from palpate.hil import BOARDS, BoardError
from palpate.injected import rows as fault_rows
from palpate.model_choice import measured_in
from palpate.paths import ROOT, SCENES, SOURCE
from palpate.record import BadRecord, RecordError, read_record
from palpate.record_layout import RUN
from palpate.scene import Scene, SceneError, load_scene
from palpate.scene_body import Body
from palpate.scene_mesh import BodyMesh
from palpate.scene_overrides import parse_override
from palpate.scene_schema import Reader, key_specs
from palpate.summary import board_failures, suspicions

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

_HELP_WIDTH = 100
_EPILOG = (
    "exit codes: 0 done; 1 a check or a test failed, or the board did (it latched a fault, say); 2 bad input, with one line that names "
    "file, key, value and allowed range. Scenes: docs/scenes.md. Results: docs/records.md."
)

_BUILD = "./run build --board NAME builds a board's firmware and measures its longest tick, and nothing else."


class _Parser(argparse.ArgumentParser):
    """Complains on one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _board_or_address(text: str) -> str:
    if text not in BOARDS and ":" not in text:
        raise argparse.ArgumentTypeError(f"{text!r}: must be {', '.join(BOARDS)}, or an address as serial:/dev/ttyACM0")
    return text


class _ShowVersions(argparse.Action):
    """Versions of host, message schema and firmware, asked for only when they are wanted."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        from palpate import versions

        print(versions.text())
        parser.exit(OK)


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = _Parser(
        prog="palpate",
        description="Haptic rendering of deformable bodies: firmware, plant and body in one repeatable loop.",
        epilog=_EPILOG if SOURCE is None else f"{_BUILD} {_EPILOG}",
    )
    parser.add_argument(
        "--version", action=_ShowVersions, nargs=0, help="versions of host, message schema and firmware"
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def describe(among: Any, name: str, text: str, examples: str) -> argparse.ArgumentParser:
        command: argparse.ArgumentParser = among.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + ".",
            epilog=epilog(examples, fill(_EPILOG, _HELP_WIDTH)),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        return command

    def add(name: str, text: str, among: Any = commands, prefix: str = "") -> argparse.ArgumentParser:
        command = describe(among, name, text, prefix + name)
        command.add_argument(
            "--json",
            action="store_true",
            help="one JSON object on standard output, all else on standard error",
        )
        return command

    def add_out(command: argparse.ArgumentParser, default: str) -> None:
        command.add_argument(
            "--out", type=Path, metavar="DIR", help=f"folder for the results (default: {default})"
        )

    def add_board(command: argparse.ArgumentParser) -> None:
        command.add_argument(
            "--board", choices=sorted(BOARDS), help="where the firmware runs (default: the scene's)"
        )

    def add_medium(command: argparse.ArgumentParser) -> None:
        command.add_argument(
            "--medium", choices=("uart", "can", "canfd", "usb"), help="what carries the link (default: the scene's link.medium)"
        )

    def add_set(command: argparse.ArgumentParser) -> None:
        command.add_argument(
            "--set",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help="set a key of the scene, as in contact.friction=0.5; may be repeated",
        )

    def add_scene(command: argparse.ArgumentParser) -> None:
        command.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
        add_set(command)

    def add_mesh_options(command: argparse.ArgumentParser) -> None:
        for name, metavar, text in (
            ("--scale", "M", "a unit of the file in metres, 0.001 for millimetres (default: 1)"),
            ("--cell", "M", "of a surface: length of edges of its fill (default: the surface's own triangles)"),
            ("--young", "PA", "Young's modulus (default: 10000)"),
            ("--density", "KG_M3", "density (default: 1000)"),
            ("--damping-ratio", "RATIO", "of the springs (default: 1)"),
            ("--min-angle", "DEG", "smallest angle between two faces that is no sliver's (default: 5)"),
        ):
            command.add_argument(name, type=float, metavar=metavar, help=f"{text}; not with a scene")

    def add_reduce_options(command: argparse.ArgumentParser) -> None:
        body = command.add_mutually_exclusive_group()
        body.add_argument("--scene", type=Path, metavar="SCENE", help="scene file with the body (default: the paper's)")
        body.add_argument(
            "--check-locality",
            type=Path,
            metavar="SCENE",
            help="judge whether a patch around the contact will do for this body; exit code 1 if not the smallest",
        )
        body.add_argument("--dim", type=int, choices=(2, 3), help="the paper's square or cube (default: 2)")
        command.add_argument("--n", type=int, metavar="N", help="nodes on each axis of the paper's body (default: 12)")
        command.add_argument("--damping", type=float, metavar="RATIO", help="damping ratio b / sqrt(2 m k) of the body")
        command.add_argument("--order", type=int, metavar="R", help="states to keep (default: as few as give 1 %%)")
        command.add_argument(
            "--node", type=int, nargs="+", metavar="I", help="contact node I J K, I K in 2D (default: middle of the top)"
        )
        command.add_argument(
            "--tolerance", type=float, default=1e-6, metavar="E", help="of the projection, certified (default: 1e-6)"
        )
        command.add_argument(
            "--press",
            type=float,
            default=0.0,
            metavar="M",
            help="with --check-locality: compare the builders with the node pressed in by so many metres (default: 0)",
        )
        command.add_argument("--dense", action="store_true", help="balance the whole system, without a projection")
        add_set(command)

    def add_fuzz_options(command: argparse.ArgumentParser) -> None:
        from palpate.fuzzing.targets import TARGETS

        command.add_argument("target", choices=(*TARGETS, "all"), metavar="TARGET", help=f"{', '.join(TARGETS)}, or all")
        amount = command.add_mutually_exclusive_group()
        amount.add_argument("--runs", type=int, metavar="N", help="executions of each target (default: as in palpate test)")
        amount.add_argument("--time-s", type=int, metavar="T", help="as many as there are in T s for each target")
        command.add_argument("--seed", type=int, metavar="S", help="of the mutations, at least 1 (default: another each time)")
        command.add_argument(
            "--keep", action="store_true", help="take the smallest inputs that reach something new into host/fuzz/corpus"
        )
        command.add_argument("--ledger", action="store_true", help="add what was executed to host/fuzz/ledger.csv")

    demo = add("demo", "run scenes/demo.toml, firmware in QEMU, and check the result")
    add_out(demo, "out/demo")
    add_board(demo)
    add_medium(demo)
    run_command = add("run", "run a scene with the firmware in the loop")
    add_scene(run_command)
    add_out(run_command, "out/<name of the scene>")
    add_board(run_command)
    add_medium(run_command)
    replay = add("replay", "run the firmware again on a recorded tip path, with what --set changes, and compare")
    replay.add_argument("file", type=Path, metavar="FILE", help="record.h5 of run, demo, replay or gui; may be interrupted")
    add_set(replay)
    add_board(replay)
    add_medium(replay)
    add_out(replay, "out/replay")
    replay.add_argument(
        "--tolerance-N",
        type=float,
        metavar="X",
        help="exit code 1 where the force differs by more than X newtons in any tick (default: it may)",
    )
    plot = add("plot", "draw a record: forces, path, link, timing")
    plot.add_argument("file", type=Path, metavar="FILE", help="record.h5 of any command; may be interrupted")
    add_out(plot, "out/plot")
    plot.add_argument("--from", dest="from_s", type=float, metavar="T", help="begin at this time in s (default: the record's)")
    plot.add_argument("--to", dest="to_s", type=float, metavar="T", help="end at this time in s (default: the record's)")
    plot.add_argument(
        "--what", metavar="LIST", help="some of forces,path,link,timing (default: all that the record has)"
    )
    simulate_command = add("simulate", "simulate a scene's body, without device and firmware")
    add_scene(simulate_command)
    add_out(simulate_command, "out/<name of the scene>")
    gui = add("gui", "touch a body in a window, with the mouse as the hand")
    gui.add_argument(
        "scene", type=Path, nargs="?", default=SCENES / "demo.toml", metavar="SCENE", help="scene in TOML (default: the demo's)"
    )
    gui.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="set a key of the scene otherwise")
    gui.add_argument(
        "--board",
        type=_board_or_address,
        metavar="BOARD",
        help=f"{', '.join(BOARDS)}, or an address as serial:/dev/ttyACM0 (default: an attached board that answers, else native)",
    )
    gui.add_argument("--script", type=Path, metavar="FILE", help="a Python file with step(app, time_s): docs/gui.md")
    gui.add_argument("--duration", type=float, metavar="S", help="close the window after so many seconds")
    gui.add_argument("--screenshot", type=Path, metavar="PNG", help="write the window's last picture")
    gui.add_argument("--size", default="1280x800", metavar="WxH", help="of the window in pixels (default: 1280x800)")
    add_out(gui, "out/gui")
    device = add("device", "offer a board with arm and hand, without hardware, at a link that any program can open")
    device.add_argument(
        "scene", type=Path, nargs="?", default=SCENES / "demo.toml", metavar="SCENE", help="scene in TOML (default: the demo's)"
    )
    add_set(device)
    device.add_argument("--board", choices=tuple(BOARDS), default="native", help="where the firmware runs (default: native)")
    device.add_argument(
        "--link", default="pty:", metavar="ADDRESS", help="pty: (default), udp-listen:[HOST:]PORT, serial:PATH[,BAUD], can:INTERFACE or canfd:INTERFACE; the address to open is the first line (with --json of standard error)"
    )
    device.add_argument("--play", action="store_true", help="the hand follows the scene's path, again and again: back at its beginning it waits 1 s")
    device.add_argument("--duration", type=float, metavar="S", help="end after so many seconds (default: when it is interrupted)")
    choose = add("choose", "show what the rule makes of a scene's \"auto\", and why, line by line")
    add_scene(choose)
    add_board(choose)
    add_medium(choose)
    choose.add_argument(
        "--record", type=Path, metavar="FILE", help="record.h5 of a run: for the bandwidth and the latency that it measured"
    )
    mesh = add("mesh", "check a mesh, or that of a scene, element by element, and show what body it makes")
    mesh.add_argument("file", type=Path, metavar="FILE", help="mesh (.msh, .vtk, .vtu, .obj, .stl), or a scene with [body.mesh] (.toml)")
    add_mesh_options(mesh)
    add_set(mesh)
    mesh.add_argument("--out", type=Path, metavar="DIR", help="folder for mesh.json and mesh.png (default: none)")
    figures = add("reproduce", "repeat the paper's experiments, check its statements and write a report")
    figures.add_argument(
        "figures",
        nargs="*",
        metavar="FIGURE",
        help="fig4, table1, table2, fig5, fig8, frontier, locality, fig12 ... fig17, late, or all (default: all)",
    )
    add_out(figures, "out/reproduce")
    figures.add_argument(
        "--hil", action="store_true", help="the firmware in QEMU (mps2_an386) instead of as a Linux process"
    )
    reduction = add("reduce", "reduce a body as its contact node sees it, or judge whether a local model will do")
    add_reduce_options(reduction)
    add_out(reduction, "out/reduce")
    text = "measure what local models cost, what links hold, what faults do to the force, what is stable, or what the tests notice"
    benches = describe(commands, "bench", text, "bench").add_subparsers(dest="what", required=True, metavar="WHAT")
    frontier = add("frontier", "cost against error of every builder in every experiment, and sweeps", benches, "bench ")
    frontier.add_argument("--quick", action="store_true", help="two experiments, three builders, no sweeps")
    add_out(frontier, "out/frontier")
    links = add("links", "rates, latencies and costs of every medium", benches, "bench ")
    links.add_argument("--quick", action="store_true", help="two media, a small body")
    add_out(links, "out/links")
    faults = add("faults", "the fault matrix of link, host and board: what the force does, held against rules", benches, "bench ")
    faults.add_argument("--quick", action="store_true", help="some cases that stand for the rest; with --only those of them")
    faults.add_argument("--only", nargs="+", metavar="CASE", help="these cases, by name or group; a name that is none lists the groups")
    faults.add_argument("--board", choices=("native", "mps2_an386"), default="native", help="the board that runs the firmware (default: native)")
    faults.add_argument("--medium", choices=("uart", "can", "canfd", "usb"), default="uart", help="the link, with its cases (default: uart)")
    add_out(faults, "out/faults")
    stability = add("stability", "what a servo of this kind can render without creating energy", benches, "bench ")
    stability.add_argument(
        "--zwidth", action="store_true", required=True, help="the stiffest virtual wall by damping, servo rate, delay and encoder"
    )
    stability.add_argument("--quick", action="store_true", help="three rates, two dampings, shorter trials")
    add_out(stability, "out/stability")
    from palpate.mutants.laboratory import SOURCES

    mutants = add("mutants", "small wrong changes of the safety supervisor, each of which a unit test must notice", benches, "bench ")
    mutants.add_argument("--file", choices=tuple(SOURCES), action="append", help="mutate this source of firmware/core; may be repeated (default: all)")
    mutants.add_argument("--sample", type=int, metavar="N", help="try so many of them, the same each time")
    mutants.add_argument("--jobs", type=int, default=2, metavar="N", help="at a time (default: 2)")
    add_out(mutants, "out/mutants")
    calibrate = add("calibrate", "find what is the arm's and its amplifiers' own, step by step, and keep it on the board")
    calibrate.add_argument("link", metavar="LINK", help="the board: a serial port, or an address as in docs/device_api.md (udp:, can:, usb:)")
    calibrate.add_argument("--steps", nargs="+", metavar="STEP", help="only these: direction, zero, monitors, sweep, friction, gravity")
    calibrate.add_argument(
        "--set", action="append", default=[], metavar="NAME=A,B,C", help="write this register first, one number a joint; alone, without steps"
    )
    calibrate.add_argument("--show", action="store_true", help="read the registers and do nothing")
    calibrate.add_argument("--yes", action="store_true", help="do not wait for the Enter key; only with --steps direction monitors, which watch and move nothing")
    calibrate.add_argument("--patience", type=float, default=30.0, metavar="S", help="how long a motion is waited for (default: 30 s)")
    add_out(calibrate, "out/calibrate")
    if SOURCE is not None:
        add_fuzz_options(add("fuzz", "fuzz what decodes bytes and files from elsewhere"))
    flash = add("flash", "put the image of a board into its part, by OpenOCD, st-flash or DFU; untried on silicon")
    flash.add_argument("--board", choices=("nucleo_g474re",), required=True, help="whose image")
    flash.add_argument("--medium", choices=("uart", "usb", "can", "canfd"), default="uart", help="the image for this link (default: uart, the ST-LINK's port)")
    flash.add_argument("--by", choices=("openocd", "st-flash", "dfu-util"), help="the program for it (default: the first of these that is there)")
    add("doctor", "say whether all that palpate needs is there, and what to do where it is not")
    completion = add("completion", "print a script that completes commands, options and files in a shell")
    completion.add_argument("shell", choices=("bash", "zsh"), help="for which shell")
    test = add("test", "pass every test; the last line counts passed, failed and skipped")
    test.add_argument(
        "--quick", action="store_true", help="only the fast tests: no sanitizers, no fuzzing, no clang-tidy"
    )
    test.add_argument(
        "--only", nargs="+", metavar="NAME", help="only these: stages, files of Python tests, C++ test programs; a name that is none lists them"
    )
    return parser


@contextmanager
def _progress(label: str, unit: str) -> Iterator[ProgressBar]:
    """A bar on a terminal's standard error; elsewhere one line when the phase begins."""
    from tqdm import tqdm

    if not sys.stderr.isatty():
        print(f"{label} ...", file=sys.stderr, flush=True)
    with tqdm(desc=label, unit=unit, file=sys.stderr, disable=None, dynamic_ncols=True, leave=False) as bar:

        def update(done: int, total: int) -> bool:
            bar.total = total
            bar.update(done - bar.n)
            return True

        yield update


def _format(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_format, value)) or "nothing"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_format(item)}" for name, item in value.items())
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.4g}" if abs(value) < 1000 else f"{value:,.0f}"


_ROWS = {
    "source": ("record", ""),
    "changes": ("changed", ""),
    "board": ("board", ""),
    "ticks": ("servo ticks (1 kHz virtual time)", ""),
    "missed_deadlines": ("missed deadlines", ""),
    "worst_tick_instructions": ("longest servo tick", "instructions of 125,000"),
    "worst_busy_instructions": ("longest time without idling", "instructions"),
    "background_overruns": ("ticks with background work left over", ""),
    "model_updates": ("local models taken over", ""),
    "models_refused": ("local models refused", ""),
    "model_age_ticks": ("age of the local model", "ms"),
    "medium": ("link medium", ""),
    "link_bytes_per_s": ("link", "bytes/s"),
    "link_busy_percent": ("link busy", "% of the time"),
    "frames_lost": ("frames lost", ""),
    "interpolated_ticks": ("ticks interpolated by the host", ""),
    "nodes": ("nodes", ""),
    "exported_times": ("times exported", ""),
    "contact_ticks": ("ticks in contact", ""),
    "stick_to_slip": ("stick to slip", ""),
    "slip_to_stick": ("slip to stick", ""),
    "peak_force_N": ("peak force", "N"),
    "rms_force_N": ("rms force in contact", "N"),
    "rms_force_error_percent": ("rms force error against the full body", "%"),
    "contact_mode_divergence_ticks": ("ticks with another contact mode than it", ""),
    "largest_force_jump_N": ("largest force jump at a model change", "N"),
    "correction_energy_J": ("energy of corrections", "J"),
    "identical": ("equal to the record, to the bit", ""),
    "rms_force_difference_N": ("rms force difference to the record", "N"),
    "rms_force_difference_percent": ("the same, of the recorded force", "%"),
    "peak_force_difference_N": ("peak force difference to the record", "N"),
    "source_peak_force_N": ("peak force in the record", "N"),
    "equal_contact_modes_percent": ("ticks with the record's contact mode", "% of those in contact"),
    "largest_swap_step_N": ("largest force step at a model change", "N"),
    "source_rms_force_error_percent": ("rms force error of the record", "%"),
    "record_hash": ("record hash", ""),
    "wall_clock": ("wall clock of this machine", "s"),
}


def format_table(title: str, outcome: Outcome) -> str:
    """The summary for a person."""
    lines = [title or "Result"]
    for key, (label, unit) in _ROWS.items():
        if key in outcome.summary:
            text = _format(outcome.summary[key])
            lines.append(f"  {label:<42}{text}{f' {unit}' if unit and text != '-' else ''}")
        if key == "frames_lost":
            lines.extend(f"  {label:<42}{text}" for label, text in fault_rows(outcome.summary))
    lines.extend(
        f"  {'wrote' if i == 0 else '':<42}{_short(file)}" for i, file in enumerate(outcome.files.values())
    )
    return "\n".join(lines)


def _short(file: Path) -> str:
    """The path as seen from the working directory, where it lies below."""
    absolute = file.resolve()
    return str(absolute.relative_to(Path.cwd())) if absolute.is_relative_to(Path.cwd()) else str(file)


def _print_files(files: Mapping[str, str], table: TextIO) -> None:
    for i, written in enumerate(files.values()):
        print(f"  {'wrote' if i == 0 else '':<46}{_short(Path(written))}", file=table)


def _report(arguments: argparse.Namespace, scene: Scene, outcome: Outcome) -> None:
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(format_table(scene.sections.title, outcome), file=table)
    if arguments.json:
        files = {name: str(file) for name, file in outcome.files.items()}
        print(json.dumps({**outcome.summary, "files": files}, allow_nan=False))


def _output_folder(arguments: argparse.Namespace, default: str) -> Path:
    folder: Path = arguments.out or ROOT / "out" / default
    if folder.exists() and not folder.is_dir():
        raise SceneError(f"--out = {folder}: must be a folder")
    return folder


def _overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """What --set and --medium say; demo has the latter alone."""
    overrides = dict(parse_override(text) for text in getattr(arguments, "set", ()))
    if getattr(arguments, "medium", None) is not None:
        overrides["link.medium"] = arguments.medium
    return overrides


def _experiment(arguments: argparse.Namespace) -> int:
    is_demo = arguments.command == "demo"
    file = SCENES / "demo.toml" if is_demo else arguments.scene
    scene = load_scene(file, _overrides(arguments), getattr(arguments, "board", None))
    folder = _output_folder(arguments, scene.file.stem)
    if arguments.command != "simulate":
        scene.require_path()
    from palpate import _core  # after the scene is known to be good: bad input is told without it

    if arguments.command == "simulate":
        _report(arguments, scene, simulate(_core, scene, folder, _progress))
        return OK
    for line in scene.choice.lines() if scene.choice else ():
        print(line, file=sys.stderr)
    outcome = run(_core, scene, arguments.command, folder, _progress)
    _report(arguments, scene, outcome)
    failures, warnings = board_failures(outcome.summary), suspicions(outcome.summary)
    if is_demo:  # there, nothing of the kind is meant
        failures, warnings = failures + warnings, []
    warnings = [*warnings, *outcome.warnings]
    for message in failures:
        _tell(f"palpate {arguments.command}: {message}", "red")
    for message in warnings:
        _tell(f"palpate {arguments.command}: warning: {message}", "yellow")
    return FAILED if failures else OK


def _replay(arguments: argparse.Namespace) -> int:
    from palpate import replay

    tolerance_N: float | None = arguments.tolerance_N
    if tolerance_N is not None and not 0.0 <= tolerance_N <= 100.0:
        raise SceneError(f"--tolerance-N = {tolerance_N:g}: must be in [0, 100] N")
    folder = _output_folder(arguments, "replay")
    source = replay.load_source(arguments.file, _overrides(arguments), arguments.board)
    replay.check_folder(source, folder)
    from palpate import _core

    outcome = replay.replay(_core, source, folder, _progress)
    _report(arguments, source.scene, outcome)
    failures = board_failures(outcome.summary)
    difference_N = outcome.summary["peak_force_difference_N"]
    if tolerance_N is not None and difference_N > tolerance_N:
        failures.append(f"peak_force_difference_N = {difference_N:.4g}: must be at most {tolerance_N:g}")
    warnings = [*suspicions(outcome.summary), *outcome.warnings]
    for message in failures + [f"warning: {warning}" for warning in warnings]:
        print(f"palpate replay: {message}", file=sys.stderr)
    return FAILED if failures else OK


def _plot(arguments: argparse.Namespace) -> int:
    from palpate import plot

    what = None if arguments.what is None else [name.strip() for name in arguments.what.split(",")]
    folder = _output_folder(arguments, "plot")
    values = plot.plot(arguments.file, what, arguments.from_s, arguments.to_s, folder)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    for label, text in plot.format_table(values):
        print(f"  {label:<46}{text}", file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    return OK


def _choose(arguments: argparse.Namespace) -> int:
    measured = None
    if arguments.record:
        try:
            measured = measured_in(read_record(arguments.record, RUN)[0])
        except (OSError, KeyError, ValueError) as error:
            raise SceneError(f"--record = {arguments.record}: {error}: must be the record.h5 of a run") from None
    scene = load_scene(arguments.scene, _overrides(arguments), arguments.board, measured)
    choice = scene.choice or scene.judge(measured)
    if arguments.json:
        print(json.dumps(choice.to_dict(), allow_nan=False))
    else:
        print("\n".join(choice.lines()))
    return OK


# Options of palpate mesh, and the keys that they stand for.
_MESH_OPTIONS = {
    "scale": "body.mesh.scale_m",
    "cell": "body.mesh.cell_m",
    "young": "body.mesh.young_modulus_Pa",
    "density": "body.mesh.density_kg_m3",
    "damping_ratio": "body.damping_ratio",
    "min_angle": "body.mesh.min_angle_deg",
}


def _mesh_report(arguments: argparse.Namespace) -> Any:
    from palpate.mesh import command

    given = {name: getattr(arguments, name) for name in _MESH_OPTIONS}
    if arguments.file.suffix == ".toml":
        for name, value in given.items():
            if value is not None:
                key = _MESH_OPTIONS[name]
                raise SceneError(f"--{name.replace('_', '-')} = {value:g}: not with a scene: set it there, or with --set {key}=...")
        return command.examine_scene(arguments.file, _overrides(arguments))
    if arguments.set:
        raise SceneError("--set: only with a scene (.toml); a mesh has options of its own (palpate mesh --help)")
    kinds = dict(key_specs(BodyMesh)) | {"damping_ratio": dict(key_specs(Body))["damping_ratio"]}
    keys = {}
    for name, value in given.items():
        if value is not None:
            key = _MESH_OPTIONS[name].rpartition(".")[2]
            keys[key] = kinds[key].kind.read(Reader(arguments.file), f"--{name.replace('_', '-')}", value, kinds[key].unit)
    return command.examine_file(arguments.file, keys)


def _mesh(arguments: argparse.Namespace) -> int:
    from palpate.mesh import command

    report = _mesh_report(arguments)
    values = command.to_dict(report)
    files = command.write(report, values, arguments.out) if arguments.out else []
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(arguments.file, file=table)
    for name, text in command.lines(values):
        print(f"  {name:<28}{text}", file=table)
    for finding in report.findings:
        print(paint(f"  {'problem' if finding.error else 'note':<28}{finding}", "red" if finding.error else "yellow", table), file=table)
    if report.problem:
        print(paint(f"  {'problem':<28}{report.problem}", "red", table), file=table)
    print(f"  {'a scene takes it':<28}{'yes' if report.ok else 'no'}", file=table)
    for file in files:
        print(f"  {'wrote':<28}{file}", file=table)
    if arguments.json:
        print(json.dumps(values | {"files": [str(file) for file in files]}, allow_nan=False))
    return OK if report.ok else FAILED


def _reproduce(arguments: argparse.Namespace) -> int:
    from palpate.reproduce import command

    figures = command.select(arguments.figures)
    folder = _output_folder(arguments, "reproduce")
    from palpate import _core

    results, report = command.reproduce(_core, figures, folder, arguments.hil, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(command.format_results(results), file=table)
    print(f"report: {_short(report)}", file=table)
    if arguments.json:
        print(json.dumps(command.to_dict(results, report), allow_nan=False))
    return OK if all(result.passed for result in results) else FAILED


def _reduce(arguments: argparse.Namespace) -> int:
    from palpate.reduce import command

    file: Path | None = arguments.scene or arguments.check_locality
    if file is not None and arguments.n is not None:
        raise SceneError("--n: only for the paper's bodies (--dim); a scene has its own nodes (--set body.nodes=[...])")
    if arguments.check_locality is not None:
        given = {
            "--order": arguments.order is not None,
            "--dense": arguments.dense,
            "--tolerance": arguments.tolerance != 1e-6,
        }
        for option in (name for name, is_given in given.items() if is_given):
            raise SceneError(f"{option}: not with --check-locality, which chooses its own")
    elif arguments.press != 0.0:
        raise SceneError("--press: only with --check-locality")
    if not 0.0 <= arguments.press <= 0.1:
        raise SceneError(f"--press = {arguments.press:g}: must be in [0, 0.1] m")
    tolerance: float = arguments.tolerance
    if not 1e-12 <= tolerance <= 0.1:
        raise SceneError(f"--tolerance = {tolerance:g}: must be in [1e-12, 0.1]")
    dimension = arguments.dim or 2
    overrides = command.paper_overrides(dimension, arguments.n, arguments.damping)
    scene = command.load(file, dimension, {**overrides, **dict(parse_override(text) for text in arguments.set)})
    request = command.Request(scene, arguments.node, arguments.order, arguments.dense, tolerance)
    folder = _output_folder(arguments, "reduce")
    from palpate import _core

    if arguments.check_locality is not None:
        values, text, good = command.judge_locality(_core, request, arguments.press, folder, _progress)
    else:
        values, text, good = command.reduce_body(_core, request, folder, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(text, file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    return OK if good else FAILED


def _attached_board() -> str:
    """The address of the first that answers, else the native board's name."""
    from palpate.board_search import VARIABLE, find_boards

    found = find_boards()
    named = os.environ.get(VARIABLE)
    if named and all(board.address != named for board in found):
        raise SceneError(f"{VARIABLE} = {named}: no board of this version answers there, or another program has it; doctor says which")
    if not found:
        return "native"
    print(f"board {found[0].info.board} at {found[0].address}", file=sys.stderr)
    return found[0].address


def _gui(arguments: argparse.Namespace) -> int:
    from palpate.gui.command import Options, parse_size, run_window
    from palpate.gui.settings import Settings

    settings = Settings(arguments.scene, arguments.board or _attached_board(), _overrides(arguments))
    numbers = run_window(
        Options(
            settings,
            _output_folder(arguments, "gui"),
            arguments.script,
            arguments.duration,
            arguments.screenshot,
            parse_size(arguments.size),
        )
    )
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(
        f"{numbers['frames']} frames, {numbers['frames_per_s_median']:.0f} a second; {numbers['ticks']} servo ticks, "
        f"{numbers['models_taken']} of {numbers['models_sent']} models taken",
        file=table,
    )
    if arguments.json:
        print(json.dumps(numbers, allow_nan=False))
    return OK


def _device(arguments: argparse.Namespace) -> int:
    from palpate.virtual_device import run_device

    overrides = _overrides(arguments)
    for name in overrides:
        if name.startswith("link.") and not name.startswith("link.faults"):
            raise SceneError(f"--set {name}: a device takes no [link] of its scene; its link is --link (palpate device --help)")
    scene = load_scene(arguments.scene, overrides)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    numbers = run_device(
        scene, arguments.board, arguments.link, arguments.play, arguments.duration, lambda address: print(address, file=table, flush=True)
    )
    print(
        f"{numbers['ticks']} servo ticks, mode {numbers['mode']}; {numbers['bytes_received']:,} bytes in, "
        f"{numbers['bytes_sent']:,} out",
        file=table,
    )
    if arguments.json:
        print(json.dumps(numbers, allow_nan=False))
    return OK


def _bench_links(arguments: argparse.Namespace) -> int:
    from palpate.link_bench import command

    folder = _output_folder(arguments, "links")
    command.check_folder(folder)
    from palpate import _core

    values = command.bench_links(_core, arguments.quick, folder, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(command.format_tables(values), file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    return OK


def _bench_stability(arguments: argparse.Namespace) -> int:
    from palpate.stability import command

    folder = _output_folder(arguments, "stability")
    command.check_folder(folder)
    from palpate import _core

    values = command.bench_zwidth(_core, arguments.quick, folder, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(command.format_tables(values), file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    return OK


def _bench_mutants(arguments: argparse.Namespace) -> int:
    if SOURCE is None:
        raise SceneError("palpate bench mutants: only in the source tree: ./run bench mutants")
    from palpate.mutants import command
    from palpate.mutants.laboratory import SOURCES

    folder = _output_folder(arguments, "mutants")
    values = command.bench_mutants(arguments.file or list(SOURCES), arguments.sample, arguments.jobs, folder, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(command.format_table(values), file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    return FAILED if values["survivors"] else OK


def _bench(arguments: argparse.Namespace) -> int:
    if arguments.what == "faults":
        return _bench_faults(arguments)
    if arguments.what == "links":
        return _bench_links(arguments)
    if arguments.what == "stability":
        return _bench_stability(arguments)
    if arguments.what == "mutants":
        return _bench_mutants(arguments)
    from palpate.frontier import command

    folder = _output_folder(arguments, "frontier")
    command.check_folder(folder)
    from palpate import _core

    values, points = command.bench_frontier(_core, arguments.quick, folder, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(command.format_tables(values, points), file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    faults = [point.point.name for point in points if point.metrics["faults"] != 0]
    for name in faults:
        _tell(f"palpate bench: {name}: the board latched a fault", "red")
    return FAILED if faults else OK


def _bench_faults(arguments: argparse.Namespace) -> int:
    from palpate.faults import command

    folder = _output_folder(arguments, "faults")
    command.check_folder(folder)
    medium, board = arguments.medium, arguments.board
    command.choose(arguments.only, arguments.quick, medium)
    from palpate import _core

    values, results = command.bench_faults(_core, arguments.only, arguments.quick, board, medium, folder, _progress)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(command.format_table(results, lambda text, good: paint(text, "green" if good else "red", table)), file=table)
    _print_files(values["files"], table)
    if arguments.json:
        print(json.dumps(values, allow_nan=False))
    failed = [result.case.name for result in results if result.broken]
    for name in failed:
        _tell(f"palpate bench: {name}: breaks a rule of the fault matrix", "red")
    return FAILED if failed else OK


def _test(arguments: argparse.Namespace) -> int:
    if SOURCE is None:
        raise SceneError("palpate test: only in the source tree: ./run test")
    from palpate.testing import run_tests

    return OK if run_tests(quick=arguments.quick, as_json=arguments.json, only=arguments.only) else FAILED


def _fuzz(arguments: argparse.Namespace) -> int:
    from secrets import randbelow

    from palpate.fuzzing import command, ledger, targets as known
    from palpate.fuzzing.outcome import Effort

    for name in ("runs", "time_s", "seed"):
        value = getattr(arguments, name)
        if value is not None and not 1 <= value < 2**31:
            raise SceneError(f"palpate fuzz: --{name.replace('_', '-')} is {value}: must be in [1, {2**31 - 1}]")
    targets = known.TARGETS if arguments.target == "all" else (arguments.target,)
    effort = Effort(arguments.runs, arguments.time_s, arguments.seed or 1 + randbelow(2**31 - 1))
    commit = ledger.commit() if arguments.ledger else None
    outcomes = command.run(targets, effort, arguments.keep, _progress)
    if commit is not None:
        ledger.add(outcomes, effort.seed, commit)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    for outcome in outcomes:
        found = "nothing found" if outcome.finding is None else f"FOUND, with {outcome.file}"
        print(f"{outcome.target}: {outcome.executions:,} executions from seed {effort.seed}, {found}", file=table)
        if outcome.finding is not None:
            _tell(outcome.finding, "red")
    if arguments.json:
        found_of = {one.target: {"executions": one.executions, "finding": one.finding, "file": one.file and str(one.file)} for one in outcomes}
        print(json.dumps({"seed": effort.seed, "targets": found_of}))
    return OK if all(outcome.finding is None for outcome in outcomes) else FAILED


def _flash(arguments: argparse.Namespace) -> int:
    if SOURCE is None:
        raise SceneError("palpate flash: only in the source tree, where the images are built: ./run flash")
    from palpate.flash import flash

    done = flash(arguments.medium, arguments.by)
    if arguments.json:
        numbers = {name: getattr(done, name) for name in ("board", "identity", "image_bytes", "tool", "succeeded")}
        print(json.dumps({**numbers, "image": str(done.image)}))
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    if not done.succeeded:
        _tell(f"palpate flash: {done.tool} has failed; it said:\n{done.said.rstrip()}", "red")
        return FAILED
    print(f"{done.identity}: {done.image_bytes:,} bytes, by {done.tool}", file=table)
    print("amplifiers stay without power until the checklist is done: docs/hardware.md", file=table)
    return OK


def _calibrate(arguments: argparse.Namespace) -> int:
    from palpate.board_link import BoardLink
    from palpate.calibration import command
    from palpate.calibration.terminal import Terminal

    settings = [command.parse_setting(text) for text in arguments.set]
    if not 0.0 < arguments.patience < 3600.0:
        raise SceneError(f"--patience = {arguments.patience:g}: must be in (0, 3600) s")
    steps = command.parse_steps([] if arguments.show or (settings and not arguments.steps) else arguments.steps, arguments.yes)
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    with BoardLink(arguments.link) as board:
        values: dict[str, Any]
        if arguments.show:
            board.info()
            values = {"command": "calibrate", "ok": True, "after": command.registers(board)}
        else:
            folder = _output_folder(arguments, "calibrate")
            values = command.calibrate(
                board, steps, settings, Terminal(table, not arguments.yes).ask, lambda line: print(line, file=table, flush=True), arguments.patience, folder
            )
    for name, register in values["after"].items():
        kept = "kept" if register["persistent"] else "until the next start"
        print(f"{name:<28} {', '.join(f'{value:10.5g}' for value in register['values'])}  {kept}", file=table)
    if arguments.json:
        print(json.dumps(values))
    return OK if values["ok"] else FAILED


def _doctor(arguments: argparse.Namespace) -> int:
    from palpate import doctor

    checks = doctor.examine()
    table: TextIO = sys.stderr if arguments.json else sys.stdout
    print(doctor.format_checks(checks, lambda text, colour: paint(text, colour, table)), file=table)
    if arguments.json:
        print(json.dumps(doctor.to_dict(checks)))
    return OK if doctor.healthy(checks) else FAILED


def _completion(arguments: argparse.Namespace) -> int:
    from palpate import completion

    text = completion.script(build_parser(), arguments.shell)
    print(json.dumps({"script": text}) if arguments.json else text, end="")
    return OK


def _tell(message: str, colour: Colour) -> None:
    print(paint(message, colour, sys.stderr), file=sys.stderr)


def _complain(arguments: argparse.Namespace, message: str) -> None:
    _tell(message, "red")
    if arguments.json:
        print(json.dumps({"error": message}))


def main(argv: Sequence[str]) -> int:
    """Runs one command; returns the exit code."""
    arguments = build_parser().parse_args(argv)
    try:
        commands = {
            "replay": _replay,
            "plot": _plot,
            "test": _test,
            "fuzz": _fuzz,
            "reproduce": _reproduce,
            "reduce": _reduce,
            "bench": _bench,
            "gui": _gui,
            "device": _device,
            "choose": _choose,
            "mesh": _mesh,
            "flash": _flash,
            "calibrate": _calibrate,
            "doctor": _doctor,
            "completion": _completion,
        }
        return commands.get(arguments.command, _experiment)(arguments)
    except (SceneError, BadRecord) as error:
        _complain(arguments, str(error))
        return BAD_INPUT
    except (BoardError, RecordError, RuntimeError, OSError, ImportError) as error:
        _complain(arguments, f"palpate {arguments.command}: {error}")
        return FAILED
    except KeyboardInterrupt:
        _complain(arguments, f"palpate {arguments.command}: interrupted")
        return INTERRUPTED


def entry() -> int:
    """The command `palpate` of an installed wheel."""
    return main(sys.argv[1:])
