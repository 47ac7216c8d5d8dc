"""The board's registers in the eyes of pycyphal: listed, read, written and refused by the standard's services, whose public definitions are
those of test_cyphal_node.py; on a serial line and on classic CAN."""

import asyncio
import itertools

import can
import pytest
from board_peer import OK, lockstep, serial_terminal
from pycyphal.transport.can import CANTransport
from pycyphal.transport.can.media.pythoncan import PythonCANMedia
from test_cyphal_can_node import run_board
from test_cyphal_node import DEADLINE_S, PUBLIC_TYPES, application, messages, on_the_line, text  # noqa: F401  (fixtures)
from wire_peer import BOARD, HOST

pytestmark = pytest.mark.skipif(not PUBLIC_TYPES.exists(), reason="Cyphal's public definitions are not unpacked: ./run does it where there is cargo")
_channels = itertools.count()

FIELDS = ("encoder.sign", "setpoint.offset_a", "setpoint.gain", "monitor.offset_a", "monitor.gain", "friction.coulomb_n_m",
          "friction.viscous_n_m_s", "friction.compensated_share", "gravity.torque_n_m")
READ_ONLY = ("encoder.count", "arm.sample")


async def ask_everything(node, messages) -> None:
    from uavcan.primitive import Empty_1_0, String_1_0
    from uavcan.primitive.array import Real32_1_0
    from uavcan.register import Access_1_0, List_1_0, Name_1_0, Value_1_0

    listing, access = node.make_client(List_1_0, BOARD), node.make_client(Access_1_0, BOARD)

    async def read_or_write(name, value=None):
        value = value or Value_1_0(empty=Empty_1_0())
        response, _ = await access.call(Access_1_0.Request(name=Name_1_0(name.encode()), value=value))
        return response

    def reals(*values):
        return Value_1_0(real32=Real32_1_0(values))

    names = []
    while True:
        response, _ = await listing.call(List_1_0.Request(index=len(names)))
        if not (name := text(response.name.name)):
            break
        names.append(name)
    assert names == [field + suffix for field in FIELDS for suffix in ("", "<", ">", "=")] + list(READ_ONLY)

    signs = await read_or_write("encoder.sign")
    assert signs.mutable and not signs.persistent  # an emulated board has nowhere to keep them
    assert signs.value.real32.value.tolist() == [1, 1, 1] and signs.timestamp.microsecond > 0
    written = await read_or_write("encoder.sign", reals(1, -1, 1))
    assert written.value.real32.value.tolist() == [1, -1, 1]
    assert (await read_or_write("encoder.sign", reals(1, 0, 1))).value.real32.value.tolist() == [1, -1, 1]  # out of range
    assert (await read_or_write("encoder.sign", Value_1_0(string=String_1_0(b"hello")))).value.real32.value.tolist() == [1, -1, 1]
    most = await read_or_write("setpoint.gain<")
    assert most.value.real32.value.tolist() == [1.25] * 3 and not most.mutable and most.persistent
    counts = await read_or_write("encoder.count")
    assert len(counts.value.integer32.value) == 3 and not counts.mutable
    sample = await read_or_write("arm.sample")
    assert len(sample.value.real32.value) == 12 and sample.timestamp.microsecond > counts.timestamp.microsecond
    assert (await read_or_write("no.such")).value.empty is not None

    # While it is armed: read, but not written.
    command = node.make_client(messages.Command_1_0, BOARD, 300)
    request = messages.Command_1_0.Request
    while True:  # in real time on a busy computer it has just missed a tick, and refuses; the deadline is the test's
        challenge, _ = await command.call(request(action=request.ARM_REQUEST))
        armed, _ = await command.call(request(action=request.ARM_CONFIRM, token=challenge.token))
        if armed.status == OK:
            break
    assert (await read_or_write("encoder.sign", reals(1, 1, 1))).value.real32.value.tolist() == [1, -1, 1]
    await command.call(request(action=request.DISARM))
    assert (await read_or_write("encoder.sign", reals(1, 1, 1))).value.real32.value.tolist() == [1, 1, 1]


def test_on_a_serial_line(application, messages, tmp_path):  # noqa: F811
    with serial_terminal("native", tmp_path) as terminal:
        on_the_line(application, terminal, lambda node: ask_everything(node, messages))


def test_on_classic_can(application, messages, tmp_path):  # noqa: F811
    """Requests and responses of several frames."""
    channel = f"palpate_registers{next(_channels)}"

    async def run(board):
        bus = can.Bus(interface="virtual", channel=channel)
        transport = CANTransport(PythonCANMedia(f"virtual:{channel}", 1_000_000, 8), HOST)
        node = application.make_node(application.NodeInfo(name="org.palpate.test"), application.make_registry(None, {}), transport=transport)
        node.start()
        ticking = asyncio.create_task(run_board(board, bus))
        try:
            await asyncio.wait_for(ask_everything(node, messages), DEADLINE_S)
        finally:
            ticking.cancel()
            node.close()
            bus.shutdown()

    with lockstep("mps2_can_classic", tmp_path / "board") as board:
        asyncio.run(run(board))
