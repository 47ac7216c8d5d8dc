"""Drivers of the host on a real Linux kernel (linux_guest.py): nothing of the kernel's is imitated, only what is plugged in."""

import os
import re
from pathlib import Path

import linux_guest
import pytest
from board_peer import BUILD_HOST
from linux_guest import CAN_MODULES, GuestError, run_in_guest

# Far above what the slowest machine needs: a guest that needs it has hung.
DEADLINE_S = 300.0
pytestmark = pytest.mark.slow


def run_tests(program, folder, *, before="true", environment="", **options):
    """A GoogleTest program in a guest, after a shell command: all of its tests ran, and none was skipped."""
    command = f"{before} && {environment} exec {BUILD_HOST / 'host/link' / program}"
    guest = run_in_guest(["sh", "-c", command], folder, deadline_s=DEADLINE_S, **options)
    print(guest.output)
    assert guest.exit_code == 0, guest.output
    assert "SKIPPED" not in guest.output and re.search(r"\[  PASSED  \] [1-9]", guest.output), guest.output
    return guest


def children():
    """Processes that this one has started and not waited for."""
    return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()


def test_a_command_sees_this_machine_and_cannot_change_it(tmp_path):
    mark = linux_guest.REPOSITORY / "written_by_a_guest"
    guest = run_in_guest(
        ["sh", "-c", f"uname -r; id -u; pwd; echo out; echo error >&2; echo kept > /run/share/file; touch {mark}; exit 7"],
        tmp_path, deadline_s=DEADLINE_S)
    release, user, folder, *rest = guest.output.splitlines()
    assert guest.exit_code == 7
    assert release == next(linux_guest.KERNEL.glob("lib/modules/*")).name
    assert user == "0" and folder == str(linux_guest.REPOSITORY)
    assert rest[:2] == ["out", "error"] and "Read-only file system" in rest[2]
    assert not mark.exists()
    assert (tmp_path / "share/file").read_text() == "kept\n"
    assert guest.boot_s > 0


def test_a_command_that_hangs_is_ended_with_its_guest(tmp_path):
    before = children()
    with pytest.raises(GuestError, match="not done after 5 s"):
        run_in_guest(["sleep", "infinity"], tmp_path, deadline_s=5)
    assert children() == before


def test_a_guest_that_ends_early_says_so(tmp_path):
    with pytest.raises(GuestError, match=r"ended early[^$]*last words"):
        run_in_guest(["sh", "-c", "echo last words; echo o > /proc/sysrq-trigger; sleep infinity"], tmp_path,
                     deadline_s=DEADLINE_S)


def test_what_is_missing_is_named(tmp_path, monkeypatch):
    with pytest.raises(GuestError, match="has no module flux_capacitor"):
        run_in_guest(["true"], tmp_path, deadline_s=DEADLINE_S, modules=["flux-capacitor"])
    monkeypatch.setattr(linux_guest, "KERNEL", tmp_path)
    with pytest.raises(GuestError, match="holds 0 kernels, 1 is needed"):
        run_in_guest(["true"], tmp_path, deadline_s=DEADLINE_S)
    monkeypatch.setattr(linux_guest.os, "defpath", str(tmp_path))
    with pytest.raises(GuestError, match="qemu-system-x86_64 is not installed: ./run installs"):
        linux_guest._program("qemu-system-x86_64")


def test_a_virtual_can_bus(tmp_path):
    run_tests("socketcan_test", tmp_path, modules=CAN_MODULES,
              before="ip link add dev vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up",
              environment="PALPATE_TEST_CAN=vcan0")
