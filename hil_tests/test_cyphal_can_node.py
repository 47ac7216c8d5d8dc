"""The board as a node on a CAN bus, in the eyes of pycyphal's application layer: found by its heartbeat, asked who it is, listened
to and commanded. The firmware is a board in lock-step, its frames on python-can's virtual bus, or on the bus of an adapter that
a real kernel (linux_guest.py) makes can0 of, for SocketCAN; on a serial line: test_cyphal_node.py.
"""

import asyncio
import itertools
import json
import pathlib
import sys

import can
import pytest
from board_peer import FAULT_STOP_COMMAND, MODE_FAULT, OK, lockstep
from can_board import LENGTHS, CanBoard, CanFrame, RecordReader
from linux_guest import CAN_MODULES, run_in_guest, usb_port
from pycyphal.transport.can import CANTransport
from pycyphal.transport.can.media.pythoncan import PythonCANMedia
from test_can_session import CAN0_UP
from test_cyphal_node import DEADLINE_S, PUBLIC_TYPES, application, messages, text  # noqa: F401  (fixtures)
from usb_redir import plugged_in
from wire_peer import BOARD, HOST

pytestmark = pytest.mark.skipif(not PUBLIC_TYPES.exists(), reason="Cyphal's public definitions are not unpacked: ./run does it where there is cargo")
_channels = itertools.count()


async def run_board(board, bus) -> None:
    """Tick by tick, as fast as it goes, with what is on the bus."""
    board.reader = RecordReader()
    while True:
        link = b""
        while (frame := bus.recv(0)) is not None:
            code = LENGTHS.index(len(frame.data))
            link += CanFrame(frame.arbitration_id, code, frame.is_fd, bytes(frame.data)).record()
        board.tick(link=link)
        for one in board.frames:
            bus.send(can.Message(
                arbitration_id=one.identifier, is_extended_id=True, is_fd=one.is_fd, bitrate_switch=one.is_fd, data=one.data))
        board.frames.clear()
        await asyncio.sleep(0)


@pytest.mark.parametrize("framing", ["can_classic", "can_fd"])
def test_is_a_node_among_nodes_on_can(application, messages, tmp_path, framing):  # noqa: F811
    from uavcan.time import Synchronization_1_0

    mtu, bit_s = (8, 1_000_000) if framing == "can_classic" else (64, (1_000_000, 5_000_000))
    channel = f"palpate_node{next(_channels)}"

    async def exchange(node):
        tracker = application.node_tracker.NodeTracker(node)
        known = asyncio.get_running_loop().create_future()

        def note(number, _, entry):
            if number == BOARD and entry is not None and entry.info is not None and not known.done():
                known.set_result(entry.info)

        tracker.add_update_handler(note)
        traces = node.make_subscriber(messages.ServoTrace_1_0, 1600)
        statuses = node.make_subscriber(messages.BoardStatus_1_0, 1601)
        times = node.make_subscriber(Synchronization_1_0)
        command = node.make_client(messages.Command_1_0, BOARD, 300)
        info = await known
        assert text(info.name) == "org.palpate.mps2_an386"
        trace, transfer = await anext(traces)
        assert transfer.source_node_id == BOARD and len(trace.samples) == 4
        response, _ = await command.call(messages.Command_1_0.Request(action=messages.Command_1_0.Request.STOP))
        assert response.status == OK
        heard = [(await anext(times))[0].previous_transmission_timestamp_microsecond for _ in range(3)]
        assert heard[2] - heard[1] == 500_000  # its ticks are virtual time: every one is there
        async for status, _ in statuses:
            if status.frames_received >= 3:
                return status

    async def run(board):
        bus = can.Bus(interface="virtual", channel=channel)
        registry = application.make_registry(None, {})
        transport = CANTransport(PythonCANMedia(f"virtual:{channel}", bit_s, mtu), HOST)
        node = application.make_node(application.NodeInfo(name="org.palpate.test"), registry, transport=transport)
        node.start()
        ticking = asyncio.create_task(run_board(board, bus))
        try:
            return await asyncio.wait_for(exchange(node), DEADLINE_S)
        finally:
            ticking.cancel()
            node.close()
            bus.shutdown()

    with lockstep(f"mps2_{framing}", tmp_path / "board") as board:
        status = asyncio.run(run(board))
    assert (status.frames_refused, status.frames_lost, status.last_status) == (0, 0, OK)


CLIENT = pathlib.Path(__file__).with_name("cyphal_can_client.py")
# Far above what the slowest machine needs: a guest that needs it has hung.
GUEST_DEADLINE_S = 500.0
# A heartbeat comes every 1,000 ticks, and a guest takes what pycyphal has not subscribed to without pycyphal.
GUEST_TICK_s = 4e-3


@pytest.mark.slow
def test_is_a_node_among_nodes_on_can_of_a_real_kernel(application, messages, tmp_path):  # noqa: F811
    """can0 on classic CAN, then on CAN FD, in one guest: its start and pycyphal's imports take most of the time."""
    import uavcan

    folders = ":".join(str(pathlib.Path(package.__path__[0]).parent) for package in (messages, uavcan))
    command = [sys.executable, str(CLIENT), "/run/share/answers", folders]
    for framing, mtu in ("can_classic", 8), ("can_fd", 64):
        command += [framing, str(mtu), "can0", CAN0_UP[framing]]
    (tmp_path / "guest").mkdir()
    with lockstep("mps2_can_classic", tmp_path / "classic") as classic, lockstep("mps2_can_fd", tmp_path / "fd") as fd, usb_port() as port:
        bus = CanBoard(classic, fd, GUEST_TICK_s)
        with plugged_in(bus, port):
            guest = run_in_guest(command, tmp_path / "guest", deadline_s=GUEST_DEADLINE_S, modules=CAN_MODULES, usb=port)
    assert guest.exit_code == 0, guest.output
    answers = json.loads((tmp_path / "guest/share/answers").read_text("ascii"))
    assert list(answers) == ["can_classic", "can_fd"]
    for framing, heard in answers.items():
        assert {number: node["name"] for number, node in heard["nodes"].items()} == {str(BOARD): "org.palpate.mps2_an386"}
        assert heard["command"] == {"status": OK, "mode": MODE_FAULT}
        for trace in heard["traces"]:
            ticks = range(trace["first_tick"], trace["first_tick"] + len(trace["tip_m"]))
            assert len(ticks) == 4 and trace["tip_m"] == [bus.tip_m[framing][tick] for tick in ticks]
            assert any(any(tip_m) for tip_m in trace["tip_m"])  # the arm has left the origin
        status = heard["status"]
        assert (status["frames_refused"], status["frames_lost"], status["last_status"], status["faults"]) == (0, 0, OK, FAULT_STOP_COMMAND)
