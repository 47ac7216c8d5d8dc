"""Our messages on CAN against pycyphal, an independent implementation of Cyphal/CAN, over python-can's virtual bus.

The C++ side is `wire_sample` (host/link), which speaks CAN records; docs/protocol.md has their layout, and this test
reads and writes them by that alone.
"""

import asyncio
import itertools

import can
import numpy as np
import pycyphal.transport
import pytest
from pycyphal.transport import (
    InputSessionSpecifier,
    MessageDataSpecifier,
    OutputSessionSpecifier,
    PayloadMetadata,
    Priority,
    ServiceDataSpecifier,
    Timestamp,
)
from pycyphal.transport.can import CANTransport
from pycyphal.transport.can.media.pythoncan import PythonCANMedia
from pycyphal.transport.commons.crc import CRC16CCITT
from wire_peer import (
    BOARD,
    HOST,
    RECEIVE_TIMEOUT_S,
    REQUEST,
    RESPONSE,
    generated_messages,
    parse,
    random_messages,
    serialized,
    wire_sample,
    wire_specifier,
)

LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
EXTENT = PayloadMetadata(8192)
FORMATS = {"can_classic": 8, "can_fd": 64}  # framing of wire_sample: data bytes of a frame
TRANSFER_IDS = 32

_channels = itertools.count()


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    return generated_messages(tmp_path_factory.mktemp("dsdl"))


def frames_of(records: bytes) -> list[can.Message]:
    frames = []
    while records:
        word, length = int.from_bytes(records[:4], "little"), LENGTHS[records[4] & 15]
        assert word >> 31 == 1 and word >> 29 & 1 == 0 and records[4] >> 4 == 15 - (records[4] & 15)
        end = 5 + length
        assert CRC16CCITT.new(records[:end]).value_as_bytes == records[end : end + 2]
        fd = bool(word >> 30 & 1)
        frames.append(
            can.Message(
                arbitration_id=word & 0x1FFFFFFF, is_extended_id=True, is_fd=fd, bitrate_switch=fd, data=records[5:end]
            )
        )
        records = records[end + 2 :]
    return frames


def record_of(frame: can.Message) -> bytes:
    assert frame.is_extended_id
    code = LENGTHS.index(len(frame.data))
    word = frame.arbitration_id | 1 << 31 | frame.is_fd << 30
    content = word.to_bytes(4, "little") + bytes([code | (15 - code) << 4]) + bytes(frame.data)
    return content + CRC16CCITT.new(content).value_as_bytes


class Bus:
    """A virtual CAN bus with a listener that is no Cyphal node, and pycyphal's nodes."""

    def __init__(self, mtu: int):
        self._channel, self._mtu = f"palpate{next(_channels)}", mtu
        self.raw = can.Bus(interface="virtual", channel=self._channel)
        self._nodes = []

    def node(self, number: int) -> CANTransport:
        bit_s = 1_000_000 if self._mtu == 8 else (1_000_000, 5_000_000)
        self._nodes.append(CANTransport(PythonCANMedia(f"virtual:{self._channel}", bit_s, self._mtu), number))
        return self._nodes[-1]

    def received(self) -> list[can.Message]:
        """What has come to the listener: all that was sent before, for a virtual bus delivers at once."""
        return list(iter(lambda: self.raw.recv(0), None))

    def close(self):
        for node in self._nodes:
            node.close()
        self.raw.shutdown()


def on_bus(mtu: int, scenario):
    """Runs `scenario(bus)` to its end."""

    async def run():
        bus = Bus(mtu)
        try:
            return await scenario(bus)
        finally:
            bus.close()

    return asyncio.run(run())


def python_specifier(specifier: int):
    if specifier < 0x8000:
        return MessageDataSpecifier(specifier)
    return ServiceDataSpecifier(specifier & 0x3FFF, REQUEST if specifier & 0x4000 else RESPONSE)


def is_padded(payload: bytes, plain: bytes, mtu: int) -> bool:
    """Equal, but for up to 15 zeros behind it on CAN FD."""
    zeros = payload[len(plain) :]
    return payload[: len(plain)] == plain and not any(zeros) and len(zeros) <= (15 if mtu > 8 else 0)


@pytest.mark.parametrize("framing", FORMATS)
def test_pycyphal_reads_our_transfers(framing):
    """One transfer of each message, as the serial samples have them (whose values test_wire_interop.py checks)."""
    mtu = FORMATS[framing]
    expected, _ = parse(wire_sample("write", "serial"), "serial")
    assert len(expected) == 14
    frames = frames_of(wire_sample("write", framing))
    assert all(frame.is_fd == (mtu > 8) and len(frame.data) <= mtu for frame in frames)
    assert len(frames) > len(expected)

    async def scenario(bus):
        nodes = {HOST: bus.node(HOST), BOARD: bus.node(BOARD)}
        sessions = []
        for one in expected:
            specifier = python_specifier(one["specifier"])
            # Whoever does not send it listens; services know whose.
            listener = nodes[HOST if one["source"] == BOARD else BOARD]
            remote = one["source"] if isinstance(specifier, ServiceDataSpecifier) else None
            sessions.append(listener.get_input_session(InputSessionSpecifier(specifier, remote), EXTENT))
        for frame in frames:
            bus.raw.send(frame)
        deadline = asyncio.get_running_loop().time() + RECEIVE_TIMEOUT_S
        return [await session.receive(deadline) for session in sessions]

    for one, transfer in zip(expected, on_bus(mtu, scenario), strict=True):
        assert transfer is not None, f"specifier {one['specifier']} did not come"
        assert transfer.source_node_id == one["source"]
        assert transfer.transfer_id == one["transfer_id"] % TRANSFER_IDS
        assert transfer.priority.value == one["priority"]
        assert is_padded(b"".join(transfer.fragmented_payload), bytes.fromhex(one["payload"]), mtu)


def transfer_of(payload: bytes, transfer_id: int, priority: int) -> pycyphal.transport.Transfer:
    return pycyphal.transport.Transfer(Timestamp.now(), Priority(priority), transfer_id, [memoryview(payload)])


async def send(node: CANTransport, specifier, remote, transfer) -> None:
    session = node.get_output_session(OutputSessionSpecifier(specifier, remote), EXTENT)
    assert await session.send(transfer, asyncio.get_running_loop().time() + RECEIVE_TIMEOUT_S)


@pytest.mark.parametrize("framing", FORMATS)
def test_we_read_pycyphals_transfers(framing, messages):
    """Random messages of each kind; a transfer identifier that wraps; then what we read is written again, equal."""
    mtu = FORMATS[framing]
    sent = []

    async def scenario(bus):
        rng = np.random.default_rng(1)
        nodes = {HOST: bus.node(HOST), BOARD: bus.node(BOARD)}
        for turn in range(40):
            for specifier, message in random_messages(messages, rng):
                number = wire_specifier(specifier)
                service = isinstance(specifier, ServiceDataSpecifier)
                to_board = number in (1610, 1611, 1612) or (service and specifier.role == REQUEST)
                source, destination = (HOST, BOARD) if to_board else (BOARD, HOST)
                payload, priority = serialized(message), int(rng.integers(0, 8))
                await send(nodes[source], specifier, destination if service else None, transfer_of(payload, turn, priority))
                sent.append(
                    {
                        "priority": priority,
                        "source": source,
                        "destination": destination if service else 0xFFFF,
                        "specifier": number,
                        "transfer_id": turn % TRANSFER_IDS,
                        "payload": payload.hex(),
                        "decoded": payload.hex(),
                    }
                )
        return bus.received()

    frames = on_bus(mtu, scenario)
    transfers, counters = parse(b"".join(map(record_of, frames)), framing)
    assert counters == {"frames": len(sent), "refused": 0}
    for got, expected in zip(transfers, sent, strict=True):
        assert is_padded(bytes.fromhex(got.pop("payload")), bytes.fromhex(expected.pop("payload")), mtu)
        assert got == expected


@pytest.mark.parametrize("framing", FORMATS)
def test_lost_frames_of_pycyphal_cost_their_transfer(framing):
    """Of every tenth transfer one frame is lost: those are missing, all others arrive."""
    mtu = FORMATS[framing]

    async def scenario(bus):
        rng = np.random.default_rng(2)
        node, transfers = bus.node(BOARD), []
        for index in range(200):
            payload = rng.integers(0, 256, size=rng.integers(200, 400)).astype(np.uint8).tobytes()
            await send(node, MessageDataSpecifier(1600), None, transfer_of(payload, index, 4))
            frames = bus.received()
            if index % 10 == 5:
                del frames[rng.integers(len(frames))]
            transfers.append((index, payload, frames))
        return transfers

    transfers = on_bus(mtu, scenario)
    records = b"".join(record_of(frame) for _, _, frames in transfers for frame in frames)
    got, counters = parse(records, framing)
    good = [(index, payload) for index, payload, _ in transfers if index % 10 != 5]
    assert [one["transfer_id"] for one in got] == [index % TRANSFER_IDS for index, _ in good]
    for one, (_, payload) in zip(got, good, strict=True):
        assert is_padded(bytes.fromhex(one["payload"]), payload, mtu)
    assert counters == {"frames": 180, "refused": 20}
