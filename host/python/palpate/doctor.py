"""`palpate doctor`: is everything there that palpate needs, and what to do where it is not.

Checks are of two kinds: what is needed (its absence ends the command with 1), and what only one part of palpate wants.
"""

import os
import re
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from palpate import __version__, kernel_links, versions
from palpate.colour import Colour
from palpate.paths import SOURCE

_TIMEOUT_S = 20.0
Paint = Callable[[str, Colour], str]


def plain(text: str, colour: Colour) -> str:
    """No colours."""
    return text


_BOARD_PATIENCE_S = 1.0  # until a board that is there has answered
_BUILT_BY_RUN = ("native", "mps2_an386", "mps2_an500")  # by every command of ./run; other boards by `./run build`


@dataclass(frozen=True)
class Check:
    """One thing that was looked at. remedy: what to do; empty where it is ok. needed: nothing goes without it."""

    name: str
    ok: bool
    found: str
    remedy: str = ""
    needed: bool = True

    def line(self, paint: Paint = plain) -> str:
        """For a person."""
        state = paint(f"{'ok' if self.ok else 'problem':<8}", "green" if self.ok else "red" if self.needed else "yellow")
        remedy = f" -> {self.remedy}" if self.remedy else ""
        return f"{state}{self.name}: {self.found}{remedy}"


@dataclass(frozen=True)
class Tool:
    """A program, the Debian package that has it, and what wants it."""

    program: str
    package: str
    purpose: str
    needed: bool


TOOLS = (
    Tool("cmake", "cmake", "building", True),
    Tool("ninja", "ninja-build", "building", True),
    Tool("g++", "g++", "building the host", True),
    Tool("arm-none-eabi-g++", "gcc-arm-none-eabi", "building the firmware", True),
    Tool("qemu-system-arm", "qemu-system-arm", "the boards mps2_an386 and mps2_an500", True),
    Tool("openocd", "openocd", "only ./run flash", False),
    Tool("clang-format", "clang-format", "only ./run test", False),
    Tool("ccache", "ccache", "only faster building", False),
)


def _version_of(program: str) -> str:
    """The first number with a dot that the program says of itself."""
    try:
        done = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=_TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    # In parentheses stands what the packager has added.
    match = re.search(r"\d+(\.\d+)+", re.sub(r"\(.*?\)", "", done.stdout.partition("\n")[0]))
    return match[0] if match else ""


def check_tool(tool: Tool) -> Check:
    """Is the program there, and which version?"""
    path = shutil.which(tool.program)
    if path is None:
        return Check(
            tool.program,
            False,
            f"not found; for {tool.purpose}",
            f"apt-get install {tool.package}",
            tool.needed,
        )
    return Check(tool.program, True, _version_of(path) or "version unknown", needed=tool.needed)


def check_host() -> Check:
    """Is the extension built, and with which message definitions?"""
    schema = versions.host_schema()
    if schema is None:
        remedy = "./run --help builds it" if SOURCE else "install the wheel again"
        return Check("host", False, f"{__version__}, its extension module cannot be imported", remedy)
    return Check("host", True, f"{__version__}, message schema {versions.schema_text(schema)}")


def check_firmware(firmware: versions.Firmware, host_schema: int | None) -> Check:
    """Is a board's image there, of the host's version and schema?"""
    name = f"firmware {firmware.board}"
    always_built = firmware.board in _BUILT_BY_RUN
    needed = always_built if SOURCE else firmware.board == "native"
    build = "./run --help" if always_built else f"./run build --board {firmware.board}"
    if firmware.version is None:
        return Check(name, False, firmware.problem, f"{build} builds it" if SOURCE else "only in the source tree", needed)
    found = f"{firmware.version}, message schema {versions.schema_text(firmware.schema)}"
    if host_schema is not None and firmware.schema != host_schema:
        wrong = f"{found}: not the host's, {versions.schema_text(host_schema)}"
        return Check(name, False, wrong, f"build both again: {build}", needed)
    if firmware.version != __version__:
        return Check(name, False, f"{found}: not the host's {__version__}", f"build both again: {build}", needed)
    return Check(name, True, found, needed=needed)


def pinned_packages(text: str) -> list[tuple[str, str]]:
    """Names and versions of the lines `pip NAME==VERSION` of dependencies.txt; extras in brackets are left out."""
    found = re.findall(r"^pip ([\w.-]+)(?:\[[^\]]*\])?==(\S+)", text, re.MULTILINE)
    return [(name, version) for name, version in found]


def check_packages(pinned: Sequence[tuple[str, str]]) -> Iterator[Check]:
    """One line for all that agree with dependencies.txt, one for each that does not."""
    agreeing = 0
    for name, wanted in pinned:
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            found = ""
        if found == wanted:
            agreeing += 1
        else:
            told = f"{found}, pinned is {wanted}" if found else f"not installed, pinned is {wanted}"
            yield Check(f"Python package {name}", False, told, f"{sys.executable} -m pip install '{name}=={wanted}'")
    yield Check("Python packages", agreeing > 0, f"{agreeing} of {len(pinned)} as pinned in dependencies.txt")


def check_display(environment: dict[str, str]) -> Check:
    """Could a window be opened?"""
    name = "display"
    if wayland := environment.get("WAYLAND_DISPLAY"):
        return Check(name, True, f"Wayland {wayland}", needed=False)
    display = environment.get("DISPLAY", "")
    remedy = "only windows want one: log in graphically, or run under xvfb-run"
    if not display:
        return Check(name, False, "DISPLAY is not set", remedy, False)
    local = re.fullmatch(r"(?:unix)?:(\d+)(?:\.\d+)?", display)
    if local and not Path(f"/tmp/.X11-unix/X{local[1]}").exists():
        return Check(name, False, f"DISPLAY is {display}, but no X server listens there", remedy, False)
    return Check(name, True, display, needed=False)


def check_serial_ports() -> Iterator[Check]:
    """Ports on USB, which may be a board, and whether this user may open them."""
    try:
        from serial.tools import list_ports
    except ImportError:
        yield Check("serial ports", False, "pyserial is not installed", "pip install pyserial: only for a board", False)
        return
    ports = [port for port in list_ports.comports() if port.vid is not None]
    if not ports:
        may = "this user may open them" if may_open("dialout") else "this user may not open them: sudo adduser $USER dialout, then log in again"
        yield Check("serial ports", True, f"none on USB; boards in QEMU and native need none; {may}", needed=False)
    for port in ports:
        name = f"serial port {port.device}"
        found = f"{port.description} ({port.vid:04x}:{port.pid:04x})"
        if os.access(port.device, os.R_OK | os.W_OK):
            yield Check(name, True, found, needed=False)
        else:
            group = _group_of(port.device)
            yield Check(name, False, f"{found}: no permission", f"sudo adduser $USER {group}, then log in again", False)


def check_can() -> Iterator[Check]:
    """CAN interfaces of the kernel: up, off the bus, for which frames, at which rates."""
    interfaces = kernel_links.ask_ip()
    if interfaces is None:
        yield Check("CAN interfaces", False, "not known: the program ip does not answer", "apt-get install iproute2: only for a board on CAN", False)
        return
    if not interfaces:
        yield Check("CAN interfaces", True, "none; the CAN buses of scenes are in virtual time and need none", needed=False)
    for one in interfaces:
        yield Check(f"CAN interface {one.name}", not one.remedy(), one.text(), one.remedy(), False)


def check_usb() -> Iterator[Check]:
    """The board's own USB interface: who may open it."""
    rule = kernel_links.installed_rule()
    file = kernel_links.RULE if SOURCE is None else SOURCE / kernel_links.RULE
    install = f"sudo cp {file} /etc/udev/rules.d/ && sudo udevadm control --reload && sudo udevadm trigger"
    told = f"udev rule {rule}" if rule else "no udev rule"
    devices = kernel_links.usb_devices()
    if not devices:
        found = f"no {':'.join(kernel_links.BOARD_USB)} is plugged in; {told}"
        yield Check("USB devices", True, found if rule else f"{found} (for one: {install})", needed=False)
    for device in devices:
        good = os.access(device, os.R_OK | os.W_OK)
        found = f"{':'.join(kernel_links.BOARD_USB)}, {told}{'' if good else ': no permission'}"
        remedy = "" if good else f"{install}, then plug it in again" if rule is None else "plug it in again, and log in at this computer itself"
        yield Check(f"USB device {device}", good, found, remedy, False)


def check_guest_kernel(root: Path) -> Check:
    """The kernel of the tests of SocketCAN and libusb."""
    image = kernel_links.guest_kernel(root)
    if image is None:
        return Check("Linux kernel for tests", False, "not unpacked", "rm -f .venv/dependencies.sha256; ./run --help unpacks it", False)
    return Check("Linux kernel for tests", True, image.name.removeprefix("vmlinuz-"), needed=False)


def may_open(group: str) -> bool:
    """Is this user in it, or root?"""
    import grp

    try:
        return os.geteuid() == 0 or grp.getgrnam(group).gr_gid in os.getgroups()
    except KeyError:
        return False


def _group_of(device: str) -> str:
    import grp

    try:
        found = os.stat(device)
        return grp.getgrgid(found.st_gid).gr_name if stat.S_ISCHR(found.st_mode) else "dialout"
    except (OSError, KeyError):
        return "dialout"


def check_boards() -> Iterator[Check]:
    """Attached boards: which firmware answers, whether this host understands it, and why it started last."""
    if versions.host_schema() is None:
        return
    from palpate.board_link import BoardLink, BoardLinkError
    from palpate.board_search import addresses
    from palpate.reset_record import REGISTER, ResetRecord

    for address in addresses():
        name = f"board at {address}"
        try:
            with BoardLink(address, timeout_s=_BOARD_PATIENCE_S) as board:
                info = board.info()
                kept = board.find_register(REGISTER)
                record = None if kept is None else ResetRecord.of(info.board, kept.values)
        except (BoardLinkError, ValueError) as error:
            yield Check(name, False, str(error), "flash it, or close what has its port", False)
            continue
        found = f"{info.board}, firmware {info.firmware}"
        if record is not None:
            found += f"; last reset: {record.cause}" + (f", before it: {record.fault}" if record.fault else "")
        same = info.firmware == __version__
        yield Check(name, same, found if same else f"{found}: not the host's {__version__}", "" if same else "flash it again", False)


def examine() -> list[Check]:
    """All checks, in the order in which they are shown."""
    checks = [Check("python", True, sys.version.split()[0]), check_host()]
    checks += [check_firmware(firmware, versions.host_schema()) for firmware in versions.all_firmware()]
    if SOURCE is not None:
        checks += [check_tool(tool) for tool in TOOLS]
        checks += check_packages(pinned_packages((SOURCE / "dependencies.txt").read_text("utf-8")))
    checks.append(check_display(dict(os.environ)))
    if SOURCE is not None:
        checks.append(check_guest_kernel(SOURCE))
    checks += check_serial_ports()
    checks += check_usb()
    checks += check_can()
    checks += check_boards()
    return checks


def healthy(checks: Sequence[Check]) -> bool:
    """Nothing that is needed is missing."""
    return all(check.ok or not check.needed for check in checks)


def to_dict(checks: Sequence[Check]) -> dict[str, Any]:
    """For --json."""
    schema = versions.host_schema()
    return {
        "ok": healthy(checks),
        "version": __version__,
        "schema": None if schema is None else versions.schema_text(schema),
        "checks": [asdict(check) for check in checks],
    }


def format_checks(checks: Sequence[Check], paint: Paint = plain) -> str:
    """A line for each, and what it comes to."""
    missing = sum(not check.ok and check.needed for check in checks)
    wishes = sum(not check.ok and not check.needed for check in checks)
    verdict = "all that is needed is there" if missing == 0 else f"missing what is needed: {missing}"
    more = f"; {wishes} more that only some commands want" if wishes else ""
    return "\n".join([*(check.line(paint) for check in checks), f"palpate doctor: {verdict}{more}"])
