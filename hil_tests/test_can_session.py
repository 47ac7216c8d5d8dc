"""The project's session over CAN interfaces of a real kernel (linux_guest.py): vcan with the firmware inside the guest, and can0 of an
adapter whose bus has the firmware in QEMU outside (can_board.py), on classic CAN and CAN FD."""

import re

import pytest
from board_peer import lockstep
from can_board import CanBoard
from kernel_session import at_the_same_interface, with_a_board
from linux_guest import CAN_MODULES, run_in_guest, usb_port
from usb_redir import plugged_in
from wire_peer import BOARD, HOST

# Far above what the slowest machine needs: a guest that needs it has hung.
DEADLINE_S = 400.0
pytestmark = pytest.mark.slow

KINDS = {"can_classic": "can", "can_fd": "canfd"}
_THERE = "until ip link show can0 >/dev/null 2>&1; do sleep 0.1; done\nip link set can0 up txqueuelen 1000 type can bitrate 1000000"
CAN0_UP = {"can_classic": f"{_THERE} fd off", "can_fd": f"{_THERE} dbitrate 5000000 fd on"}
VCAN0_UP = "ip link add dev vcan0 type vcan && ip link set vcan0 mtu 72 txqueuelen 1000 && ip link set vcan0 up"
# By docs/protocol.md: what the board and the host say to each other in a session; and of that what takes many frames, for candump
# may miss some on a slow kernel. On can0 the host asks for tips alone, and gets them.
SUBJECTS = {BOARD: {1600, 1601, 1602, 1603, 1604, 7509}, HOST: {1610, 1611, 1612}}
FREQUENT = {"vcan0": {BOARD: {1600}, HOST: {1610, 1612}}, "can0": {BOARD: {1604}, HOST: {1610, 1612}}}
COMMAND = 300


def watched(interface, framing, script):
    """As in test_linux_guest.py: what candump sees goes to the shared folder."""
    return f"""candump -L {interface} >/run/share/candump_{interface}_{framing} & watcher=$!
until grep -q {interface} /proc/net/can/rcvlist_all; do sleep 0.1; done
{script}
kill $watcher; wait $watcher || true"""


def assert_documented(lines, is_fd, frequent):
    """Identifiers by docs/protocol.md, "On a CAN bus", from its text alone."""
    seen = {BOARD: set(), HOST: set()}
    services = set()
    for line in lines:
        frame = line.split()[2]
        identifier, data = re.fullmatch(r"([0-9A-F]{8})#(?:#[0-9A-F])?([0-9A-F]*)", frame).groups()
        assert ("##" in frame) == is_fd and 2 <= len(data) <= (128 if is_fd else 16)
        word = int(identifier, 16)
        source = word & 0x7F
        if word >> 25 & 1:
            assert word >> 23 & 1 == 0 and word >> 7 & 0x7F in (BOARD, HOST)
            services.add((word >> 14 & 0x1FF, bool(word >> 24 & 1), source))
        else:
            assert word >> 24 & 1 == 0 and word >> 21 & 7 == 3 and word >> 7 & 1 == 0
            seen[source].add(word >> 8 & 0x1FFF)
    for node, subjects in seen.items():
        assert frequent[node] <= subjects <= SUBJECTS[node]
    assert services <= {(COMMAND, True, HOST), (COMMAND, False, BOARD)}


def test_a_session_on_vcan_and_with_a_board_behind_an_adapter(tmp_path):
    """One guest, since its start takes long."""
    script = [VCAN0_UP]
    for framing, kind in KINDS.items():
        script.append(watched("vcan0", framing, at_the_same_interface(framing, f"{kind}:vcan0")))
        script.append(CAN0_UP[framing])
        script.append(watched("can0", framing, with_a_board(framing, f"{kind}:can0")))
        script.append("ip link set can0 down")
    (tmp_path / "guest").mkdir()
    with lockstep("mps2_can_classic", tmp_path / "classic") as classic, lockstep("mps2_can_fd", tmp_path / "fd") as fd, usb_port() as port:
        bus = CanBoard(classic, fd)
        with plugged_in(bus, port):
            guest = run_in_guest(
                ["bash", "-euc", "\n".join(script)], tmp_path / "guest", deadline_s=DEADLINE_S, modules=CAN_MODULES, usb=port
            )
    print(guest.output)
    assert guest.exit_code == 0, guest.output
    assert len(re.findall(r"session: \d+ of \d+ models taken over", guest.output)) == 4
    for framing in KINDS:
        assert bus.largest_force_N[framing] > 0.3  # 3 mm, where a node meets some 300 N/m
        for interface, frequent in FREQUENT.items():
            lines = (tmp_path / f"guest/share/candump_{interface}_{framing}").read_text("ascii").splitlines()
            assert_documented(lines[:-1], framing == "can_fd", frequent)
