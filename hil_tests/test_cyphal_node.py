"""The board as a node among Cyphal nodes: pycyphal's application layer, which knows nothing of this project but the messages in
shared/wire/dsdl, finds it by its heartbeat, asks who it is, listens to it and commands it, on a serial line.

pycyphal wants the public definitions (uavcan) for that. They are no part of the project: `./run` unpacks a crate that has
them among its own tests (dependencies.txt, "crate").
"""

import asyncio
import importlib
import sys
import warnings

import pycyphal.dsdl
import pytest
from board_peer import FAULT_STOP_COMMAND, MODE_FAULT, OK, REPOSITORY, serial_terminal
from pycyphal.transport.serial import SerialTransport
from wire_peer import BOARD, HOST, generated_messages

import palpate

(CRATE,) = [
    line.split()[1] for line in (REPOSITORY / "dependencies.txt").read_text().splitlines() if line.startswith("crate canadensis")
]
PUBLIC_TYPES = REPOSITORY / ".venv/crates" / CRATE / "tests/public_regulated_data_types/uavcan"
NAMES = {"native": "native", "mps2": "mps2_an386"}
DEADLINE_S = 60.0  # generous: only a failure waits for it

pytestmark = pytest.mark.skipif(
    not PUBLIC_TYPES.exists(), reason=f"the crate {CRATE}, with Cyphal's public definitions, is not unpacked: ./run does it where there is cargo"
)


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    return generated_messages(tmp_path_factory.mktemp("dsdl"))


@pytest.fixture(scope="module")
def application(tmp_path_factory):
    """pycyphal.application, which imports what is generated from the public definitions."""
    folder = tmp_path_factory.mktemp("uavcan")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of pydsdl, caused by nunavut's templates
        pycyphal.dsdl.compile_all([PUBLIC_TYPES], output_directory=folder)
    sys.path.append(str(folder))
    try:
        importlib.invalidate_caches()
        importlib.import_module("pycyphal.application.node_tracker")
        yield pycyphal.application
    finally:
        sys.path.remove(str(folder))


@pytest.fixture(params=list(NAMES))
def board(request, tmp_path):
    """Name and terminal."""
    with serial_terminal(request.param, tmp_path) as terminal:
        yield NAMES[request.param], terminal


def on_the_line(application, terminal: str, exchange):
    """Runs `exchange(node)` with a node of pycyphal's, which has a heartbeat of its own, on that line."""

    async def run():
        registry = application.make_registry(None, {})
        node = application.make_node(
            application.NodeInfo(name="org.palpate.test"), registry, transport=SerialTransport(terminal, local_node_id=HOST)
        )
        node.start()
        try:
            return await asyncio.wait_for(exchange(node), DEADLINE_S)
        finally:
            node.close()

    return asyncio.run(run())


def text(octets) -> str:
    return bytes(octets).decode("ascii")


def test_is_found_by_its_heartbeat_and_says_who_it_is(application, board):
    name, terminal = board

    async def exchange(node):
        tracker = application.node_tracker.NodeTracker(node)
        known = asyncio.get_running_loop().create_future()

        def note(number, _, entry):
            if entry is not None and entry.info is not None and not known.done():
                known.set_result((number, entry.heartbeat, entry.info))

        tracker.add_update_handler(note)
        number, _, info = await known
        return number, info

    number, info = on_the_line(application, terminal, exchange)
    assert number == BOARD
    assert text(info.name) == f"org.palpate.{name}"
    major, minor, _ = palpate.__version__.split(".")
    assert (info.protocol_version.major, info.protocol_version.minor) == (1, 0)
    assert (info.software_version.major, info.software_version.minor) == (int(major), int(minor))
    assert (info.hardware_version.major, info.hardware_version.minor, info.software_vcs_revision_id) == (0, 0, 0)
    assert text(info.unique_id).rstrip("\0") == name
    assert len(info.software_image_crc) == 0 and len(info.certificate_of_authenticity) == 0


def test_a_heartbeat_a_second_tells_its_health(application, board, messages):
    from uavcan.node import Heartbeat_1_0, Health_1_0, Mode_1_0

    async def exchange(node):
        heartbeats = node.make_subscriber(Heartbeat_1_0)
        command = node.make_client(messages.Command_1_0, BOARD, 300)

        async def ask(action):
            response, _ = await command.call(messages.Command_1_0.Request(action=action))
            return response.status, response.mode

        async def heard(accept):
            async for heartbeat, transfer in heartbeats:
                if transfer.source_node_id == BOARD and accept(heartbeat):
                    return heartbeat

        first = await heard(lambda one: one.mode.value == Mode_1_0.OPERATIONAL)
        second = await heard(lambda one: True)
        assert (first.health.value, first.vendor_specific_status_code) == (Health_1_0.NOMINAL, 0)
        assert second.uptime == first.uptime + 1
        assert await ask(messages.Command_1_0.Request.STOP) == (OK, MODE_FAULT)
        stopped = await heard(lambda one: one.health.value != Health_1_0.NOMINAL)
        assert stopped.health.value == Health_1_0.CAUTION
        assert 1 << (stopped.vendor_specific_status_code - 1) == FAULT_STOP_COMMAND
        assert (await ask(messages.Command_1_0.Request.CLEAR_FAULT))[0] == OK
        assert await heard(lambda one: one.health.value == Health_1_0.NOMINAL)

    on_the_line(application, board[1], exchange)


def test_our_own_messages_come_and_a_node_among_nodes_is_no_fault(application, board, messages):
    """pycyphal's heartbeats reach the board, too: nothing of ours, and refused would be a fault."""

    async def exchange(node):
        traces = node.make_subscriber(messages.ServoTrace_1_0, 1600)
        statuses = node.make_subscriber(messages.BoardStatus_1_0, 1601)
        trace, transfer = await anext(traces)
        assert transfer.source_node_id == BOARD
        assert len(trace.samples) == 4 and not any(sample.tip_m.any() for sample in trace.samples)  # encoders at zero
        following, _ = await anext(traces)
        assert following.first_tick > trace.first_tick
        async for status, _ in statuses:
            if status.frames_received >= 3:
                return status

    status = on_the_line(application, board[1], exchange)
    assert (status.frames_refused, status.frames_lost, status.last_status) == (0, 0, OK)


def test_is_a_master_of_time_for_those_who_have_a_heartbeat(application, board):
    """Each message says when the one before went out, by the board's ticks; the first, that there was none."""
    from uavcan.time import Synchronization_1_0

    async def exchange(node):
        times = node.make_subscriber(Synchronization_1_0)  # its subject is the standard's, 7168
        heard = []
        async for message, transfer in times:
            assert transfer.source_node_id == BOARD
            heard.append((transfer.transfer_id, message.previous_transmission_timestamp_microsecond))
            if len(heard) == 4:
                return heard

    heard = on_the_line(application, board[1], exchange)
    first = heard[0][0]
    assert [number - first for number, _ in heard] == [0, 1, 2, 3]
    spoken_us = [previous_us for number, previous_us in heard if number > 0]
    assert first > 0 or heard[0][1] == 0
    assert all(us > 0 and us % 1000 == 0 for us in spoken_us)
    # Every 500 ticks; a board on a busy computer may miss some.
    assert all(500_000 <= later - earlier <= 1_000_000 for earlier, later in zip(spoken_us, spoken_us[1:]))
