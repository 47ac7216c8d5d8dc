"""A real Linux kernel for tests of drivers: Debian's, in QEMU, with this machine's file system, for the time of one command.

The guest sees `/` of this machine over 9p, read-only, so that programs and libraries are those of the build. /run is its own
(empty, writable; HOME and TMPDIR are in it), and so are /dev, /proc and /sys. The command runs as root, with one shell
around it. The processor is emulated (TCG) even where there is a KVM: the same everywhere, and a KVM inside another virtual
machine can fail (QEMU 7.2 stops when such a one refuses a register). It is one, so that two threads that
wake each other do not wait for this machine's scheduler: 3,900 round trips a second over vcan in place of 110 when others
compute beside.

    .venv/bin/python hil_tests/linux_guest.py --module vcan --module can-raw -- ip link show

runs a command there: prints what it has written when it has ended, and ends with its exit code; 2 without a guest (docs/links.md).
"""

import argparse
import contextlib
import gzip
import os
import pathlib
import re
import shlex
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent
KERNEL = REPOSITORY / ".venv/unpacked/linux-image-amd64"
# What a guest needs to have the file system, and what it may need besides.
_ROOT_MODULES = ("virtio_pci", "virtio_rng", "9p", "9pnet_virtio")
CAN_MODULES = ("vcan", "can-raw", "gs_usb")
USB_MODULES = ("xhci-pci",)
_MEMORY_MiB = 1024

# Runs as the first process of the initial RAM file system. /share is a folder of the host, writable.
_INIT = """#!/bin/busybox sh
B=/bin/busybox
$B mount -t proc none /proc; $B mount -t sysfs none /sys; $B mount -t devtmpfs none /dev
fail() { echo "guest: $1"; $B poweroff -f; }
for module in /modules/*; do $B insmod $module || fail "insmod $module"; done
options=trans=virtio,version=9p2000.L,msize=262144
$B mount -t 9p -o $options,ro,cache=loose root /root || fail "9p of /"
for folder in proc sys dev; do $B mount --move /$folder /root/$folder; done
$B mount -t tmpfs none /root/run
$B mkdir -p /root/run/share /root/run/tmp /root/dev/shm /root/dev/pts
$B mount -t tmpfs none /root/dev/shm; $B mount -t devpts none /root/dev/pts
$B mount -t 9p -o $options,rw,cache=none share /root/run/share || fail "9p of the shared folder"
$B ip link set lo up
echo "guest: ready after $($B cut -d' ' -f1 /root/proc/uptime) s"
$B chroot /root /bin/bash /run/share/command > /root/run/share/output 2>&1
echo $? > /root/run/share/exit_code
$B poweroff -f
"""


class GuestError(RuntimeError):
    """There is no guest, or none any more: what it lacks, or what its console said last."""


@dataclass(frozen=True)
class GuestRun:
    """What a command in a guest came to: its exit code, what it wrote to its standard output and error, and what the
    kernel's console said meanwhile."""

    exit_code: int
    output: str
    console: str

    @property
    def boot_s(self) -> float:
        """The guest's own time from its kernel's start to the command's."""
        return float(re.search(r"guest: ready after ([\d.]+) s", self.console)[1])


def _program(name: str) -> str:
    found = shutil.which(name, path=os.defpath + ":/usr/sbin:/sbin")
    if found is None:
        raise GuestError(f"{name} is not installed: ./run installs what dependencies.txt lists")
    return found


def _kernel_image() -> pathlib.Path:
    images = sorted(KERNEL.glob("boot/vmlinuz-*"))
    if len(images) != 1:
        raise GuestError(f"{KERNEL} holds {len(images)} kernels, 1 is needed: delete it, then ./run unpacks one")
    return images[0]


def _with_needed(modules: Sequence[str]) -> list[pathlib.Path]:
    """The files of these modules and of all that they need, in the order of loading; what is built in has none."""
    folder = next(KERNEL.glob("lib/modules/*"))
    files = {file.stem.replace("-", "_"): file for file in folder.rglob("*.ko")}
    built_in = {
        pathlib.Path(line).stem.replace("-", "_")
        for line in (folder / "modules.builtin").read_text("ascii").split()
    }
    order: list[pathlib.Path] = []

    def add(name: str) -> None:
        name = name.replace("-", "_")
        if name in built_in:
            return
        if name not in files:
            raise GuestError(f"{folder.name} has no module {name}")
        if files[name] not in order:
            needed = re.search(rb"\0depends=([^\0]*)\0", files[name].read_bytes())
            for other in filter(None, needed[1].decode("ascii").split(",")):
                add(other)
            order.append(files[name])

    for module in modules:
        add(module)
    return order


def _write_initial_file_system(file: pathlib.Path, modules: Sequence[str]) -> None:
    tree = file.with_suffix(".tree")
    for folder in ("bin", "proc", "sys", "dev", "modules", "root"):
        (tree / folder).mkdir(parents=True)
    shutil.copy(_program("busybox"), tree / "bin/busybox")
    for index, module in enumerate(_with_needed(modules)):
        shutil.copy(module, tree / f"modules/{index:02d}_{module.name}")
    (tree / "init").write_text(_INIT, "ascii")
    (tree / "init").chmod(0o755)
    names = "\n".join(str(path.relative_to(tree)) for path in sorted(tree.rglob("*")))
    archive = subprocess.run(
        [_program("cpio"), "--create", "--format=newc", "--quiet"],
        input=names.encode(), cwd=tree, capture_output=True, check=True)
    file.write_bytes(gzip.compress(archive.stdout, 1))
    shutil.rmtree(tree)


@contextlib.contextmanager
def usb_port() -> Iterator[socket.socket]:
    """A socket on which a guest's USB port will listen: a device that connects to it is plugged in, one that
    disconnects is pulled out (usb_redir.py)."""
    with socket.socket(socket.AF_UNIX) as port:
        port.bind("")  # the kernel gives it a name that is no file's
        port.listen(1)
        yield port


def run_in_guest(
    command: Sequence[str],
    folder: pathlib.Path,
    *,
    deadline_s: float,
    modules: Sequence[str] = (),
    usb: socket.socket | None = None,
) -> GuestRun:
    """Boots, runs `command` and returns what came of it.

    `folder` is empty, writable, and shared: the guest sees it as /run/share. `modules` are loaded before the command, `usb`
    is a port of usb_port(). Raises GuestError where something is missing, where the guest ends without having run the
    command, and after `deadline_s`; no process is left behind, not even if this one is killed.
    """
    kernel = _kernel_image()
    share, initial, console = folder / "share", folder / "initial.gz", folder / "console.txt"
    share.mkdir()
    _write_initial_file_system(initial, (*_ROOT_MODULES, *modules, *(USB_MODULES if usb else ())))
    (share / "command").write_text(
        "export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/run/tmp TMPDIR=/run/tmp PYTHONDONTWRITEBYTECODE=1\n"
        f"cd {shlex.quote(str(REPOSITORY))}\nexec {shlex.join(command)}\n")
    qemu = [
        _program("setpriv"), "--pdeathsig", "KILL", _program("qemu-system-x86_64"),
        "-machine", "q35", "-accel", "tcg", "-cpu", "max", "-m", str(_MEMORY_MiB),
        "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot",
        "-kernel", str(kernel), "-initrd", str(initial),
        "-append", "console=ttyS0 quiet panic=-1 mitigations=off random.trust_cpu=on",
        "-serial", f"file:{console}", "-device", "virtio-rng-pci",
        "-fsdev", "local,id=root,path=/,security_model=none,readonly=on,multidevs=remap",
        "-device", "virtio-9p-pci,fsdev=root,mount_tag=root",
        "-fsdev", f"local,id=share,path={share},security_model=none",
        "-device", "virtio-9p-pci,fsdev=share,mount_tag=share",
    ]
    if usb is not None:
        qemu += ["-device", "qemu-xhci", "-chardev", f"socket,id=usb,fd={usb.fileno()},server=on,wait=off",
                 "-device", "usb-redir,chardev=usb"]
    ended = _run_until(qemu, deadline_s, [usb.fileno()] if usb else [])
    said = console.read_text("utf-8", "replace") if console.exists() else ""
    written = (share / "output").read_text("utf-8", "replace") if (share / "output").exists() else ""
    if ended is None or not (share / "exit_code").exists():
        why = f"the guest was not done after {deadline_s} s" if ended is None else f"the guest ended early: {ended}"
        raise GuestError(f"{why}\n--- its console\n{said[-4000:]}\n--- its command's output\n{written[-4000:]}")
    return GuestRun(int((share / "exit_code").read_text()), written, said)


def _run_until(command: Sequence[str], deadline_s: float, descriptors: Sequence[int]) -> str | None:
    """Runs QEMU and returns what it wrote itself; None: not done within the deadline, and killed."""
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, pass_fds=descriptors,
        text=True) as process:
        try:
            return process.communicate(timeout=deadline_s)[0]
        except subprocess.TimeoutExpired:
            return None
        finally:
            process.kill()


def parse_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str], float]:
    """Of the command line: the command, the modules, the deadline in s. Ends the program with 2 where they are wrong."""
    parser = argparse.ArgumentParser(
        prog="linux_guest.py", description="Runs a command as root in a Linux guest, with this machine's files, read-only.")
    parser.add_argument(
        "--module", action="append", metavar="NAME",
        help=f"kernel module to load; may be repeated (default: {', '.join(CAN_MODULES)})")
    parser.add_argument("--deadline", type=float, default=300.0, metavar="S", help="seconds until the guest is ended (default: 300)")
    parser.add_argument("command", nargs="+", metavar="COMMAND", help="behind --: the program and its arguments")
    given = parser.parse_args(arguments)
    if not 0.0 < given.deadline <= 86_400.0:
        parser.error(f"--deadline is {given.deadline:g}: must be in (0, 86400] s")
    return given.command, given.module or list(CAN_MODULES), given.deadline


def main(arguments: Sequence[str]) -> int:
    """The command line; returns the exit code."""
    command, modules, deadline_s = parse_arguments(arguments)
    with tempfile.TemporaryDirectory(prefix="palpate-guest-") as folder:
        try:
            guest = run_in_guest(command, pathlib.Path(folder), deadline_s=deadline_s, modules=modules)
        except GuestError as error:
            print(f"linux_guest.py: {error}", file=sys.stderr)
            return 2
    print(guest.output, end="")
    return guest.exit_code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
