"""What the kernel says of links to boards: CAN interfaces, the board's USB device, and the kernel that tests run in QEMU."""

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BOARD_USB = ("1209", "0001")  # firmware/usb/descriptors.hpp
RULE = "host/link/70-palpate.rules"
RULE_FOLDERS = ("/etc/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d", "/run/udev/rules.d")
FD_MTU = 72  # of an interface for CAN FD; 16 of a classic one (linux/can.h)
_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class CanInterface:
    """As the kernel has it. Rates and state are None where it says none: of a virtual one, or without the program `ip`."""

    name: str
    is_up: bool
    is_fd: bool
    is_virtual: bool
    state: str | None = None  # of the controller, as ERROR-ACTIVE or BUS-OFF
    bit_rate_Hz: int | None = None
    data_bit_rate_Hz: int | None = None
    restart_ms: int | None = None

    def text(self) -> str:
        """For a person."""
        rate = "" if self.bit_rate_Hz is None else f", {self.bit_rate_Hz:,} bit/s"
        data = "" if self.data_bit_rate_Hz is None else f" and {self.data_bit_rate_Hz:,} bit/s"
        state = "" if self.state is None else f", {self.state.lower()}"
        return f"{'up' if self.is_up else 'down'}{state}{', virtual' if self.is_virtual else ''}, {'CAN FD' if self.is_fd else 'classic CAN'}{rate}{data}"

    def remedy(self) -> str:
        """What to do; empty where it can be used."""
        if self.state == "BUS-OFF":
            return f"wiring and bit rates of all nodes; then sudo ip link set {self.name} type can restart, or restart-ms 100 when it is set up"
        if self.is_up:
            return ""
        if self.is_virtual:
            return f"sudo ip link set {self.name} mtu {FD_MTU} && sudo ip link set {self.name} up"
        return f"sudo ip link set {self.name} up type can bitrate 1000000 restart-ms 100 (docs/links.md has that for CAN FD)"


def can_interfaces(details: Sequence[Mapping[str, Any]]) -> list[CanInterface]:
    """Those among what `ip -details -json link show` says."""
    found = []
    for link in details:
        if link.get("link_type") != "can":
            continue
        info = link.get("linkinfo", {})
        data: Mapping[str, Any] = info.get("info_data", {})
        found.append(CanInterface(
            link["ifname"], "UP" in link.get("flags", ()), link.get("mtu") == FD_MTU, info.get("info_kind") in ("vcan", "vxcan"),
            data.get("state"), data.get("bittiming", {}).get("bitrate"), data.get("data_bittiming", {}).get("bitrate"), data.get("restart_ms"),
        ))  # fmt: skip
    return found


def ask_ip() -> list[CanInterface] | None:
    """None without the program `ip`, or where it does not speak JSON."""
    # Also where a user's path has no sbin.
    environment = {**os.environ, "PATH": f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"}
    try:
        done = subprocess.run(
            ["ip", "-details", "-json", "link", "show"], capture_output=True, text=True, timeout=_TIMEOUT_S, env=environment
        )
        return can_interfaces(json.loads(done.stdout or "[]"))
    except (OSError, subprocess.TimeoutExpired, ValueError, KeyError):
        return None


def usb_devices(folder: Path = Path("/sys/bus/usb/devices")) -> list[Path]:
    """The nodes of the board's USB devices that are plugged in, as /dev/bus/usb/001/004."""

    def read(device: Path, name: str) -> str:
        try:
            return (device / name).read_text("ascii").strip()
        except OSError:
            return ""

    boards = [one for one in sorted(folder.glob("*")) if (read(one, "idVendor"), read(one, "idProduct")) == BOARD_USB]
    return [Path(f"/dev/bus/usb/{int(read(one, 'busnum') or 0):03}/{int(read(one, 'devnum') or 0):03}") for one in boards]


def installed_rule(folders: Sequence[str] = RULE_FOLDERS) -> Path | None:
    """The file of udev rules by which a user may open the board, if it is installed."""
    name = Path(RULE).name
    return next((Path(folder) / name for folder in folders if (Path(folder) / name).is_file()), None)


def guest_kernel(root: Path) -> Path | None:
    """The image of the Linux kernel that `./run` unpacks for tests in QEMU (dependencies.txt), with its modules beside it."""
    unpacked = root / ".venv/unpacked/linux-image-amd64"
    images = sorted(unpacked.glob("boot/vmlinuz-*"))
    return images[-1] if images and any(unpacked.glob("lib/modules/*/modules.builtin")) else None
