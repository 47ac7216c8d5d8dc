"""Our frames and messages against pycyphal, an independent implementation of Cyphal/serial and DSDL.

The C++ side is `wire_sample` (host/link).
"""

import asyncio
import importlib.util
import os
import pty
import random
import threading
import tty

import numpy as np
import pycyphal
import pycyphal.dsdl
import pytest
from pycyphal.presentation import Presentation
from pycyphal.transport import MessageDataSpecifier, Priority, ServiceDataSpecifier, Timestamp
from pycyphal.transport.commons.high_overhead_transport import TransferCRC, serialize_transfer
from pycyphal.transport.serial import SerialFrame, SerialTransport
from pycyphal.transport.serial._stream_parser import StreamParser
from wire_peer import (
    BOARD,
    DSDL,
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


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    return generated_messages(tmp_path_factory.mktemp("dsdl"))


def pycyphal_frame(specifier, payload: bytes, source: int, destination, transfer_id: int, priority=Priority.NOMINAL) -> bytes:
    """One transfer as pycyphal's serial transport puts it on the wire."""

    def make(index, end_of_transfer, fragment):
        return SerialFrame(
            priority=priority,
            transfer_id=transfer_id,
            index=index,
            end_of_transfer=end_of_transfer,
            payload=fragment,
            source_node_id=source,
            destination_node_id=destination,
            data_specifier=specifier,
            user_data=0,
        )

    (frame,) = serialize_transfer([memoryview(payload)], 2**30, make)
    return bytes(frame.compile_into(bytearray(2 * len(payload) + 100)))


def pycyphal_parse(stream: bytes, run: int) -> list[SerialFrame]:
    """The frames that pycyphal's stream parser finds, fed in runs of `run` bytes."""
    frames = []

    def take(_timestamp, raw, frame):
        assert frame is not None, f"pycyphal refused {len(raw)} bytes"
        frames.append(frame)

    parser = StreamParser(take, 2**20)
    for at in range(0, len(stream), run):
        parser.process_next_chunk(stream[at : at + run], Timestamp.now())
    return frames


@pytest.fixture(scope="module")
def schema_hash():
    """The function that the build hashes the definitions with."""
    spec = importlib.util.spec_from_file_location("schema_hash", DSDL.parent.parent / "schema_hash.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.schema_hash


def test_schema_hash_is_the_same_in_python(schema_hash):
    assert int(wire_sample("hash"), 16) == schema_hash(DSDL)


def test_schema_hash_ignores_comments_and_white_space_only(schema_hash, tmp_path):
    folder = tmp_path / "palpate"
    folder.mkdir()

    def value(text: str, name: str = "A.1.0.dsdl") -> int:
        (folder / name).write_text(text)
        try:
            return schema_hash(folder)
        finally:
            (folder / name).unlink()

    plain = value("uint8 X = 1\nuint8[<=4] y\n@sealed\n")
    assert value("# comment\nuint8  X=1   # another's\n\n  uint8[ <=4 ] y\n@sealed") == plain
    assert value("uint8 X = 2\nuint8[<=4] y\n@sealed\n") != plain
    assert value("uint8 X = 1\nuint8[<=4] y\n@sealed\n", "A.1.1.dsdl") != plain
    assert value("uint8 X = '#'\n@sealed\n") != value("uint8 X = '!'\n@sealed\n")


@pytest.mark.parametrize("run", [1, 97, 1 << 20])
def test_pycyphal_reads_our_frames(messages, run):
    stream = wire_sample("write", "serial")
    frames = pycyphal_parse(stream, run)
    payloads = {}
    for frame in frames:
        assert frame.single_frame_transfer
        assert TransferCRC.new(frame.payload).check_residue()
        payloads[frame.data_specifier] = bytes(frame.payload[:-4])

    def sent(specifier, kind):
        message = pycyphal.dsdl.deserialize(kind, [memoryview(payloads.pop(specifier))])
        assert message is not None
        return message

    # The values are those of wire_sample.cpp.
    schema_hash = int(wire_sample("hash"), 16)
    trace = sent(MessageDataSpecifier(1600), messages.ServoTrace_1_0)
    assert (trace.sequence, trace.first_tick, len(trace.samples)) == (3, 1000, 10)
    for i, sample in enumerate(trace.samples):
        assert list(sample.tip_m) == [0.25 * i, -0.5, 0.0]
        assert list(sample.force_N) == [0.0, 1.0, -0.125 * i]
        assert (sample.mode, sample.flags, sample.triangle) == (messages.Contact_1_0.MODE_STICK, 1, 300 + i)
    tips = sent(MessageDataSpecifier(1604), messages.TipTrace_1_0)
    assert (tips.first_tick, tips.step_exponent, len(tips.offsets)) == (1010, -15, 7)
    assert list(tips.tip_m) == [0.0, -0.5, 0.0]
    for i, offset in enumerate(tips.offsets):
        assert list(2.0**tips.step_exponent * offset.steps) == [0.125 * (i + 1), 0.0, 0.0]
    status = sent(MessageDataSpecifier(1601), messages.BoardStatus_1_0)
    assert (status.schema_hash, status.tick, status.mode) == (schema_hash, 1100, status.MODE_RENDER)
    assert (status.token, status.worst_tick_count, status.clock_Hz) == (0xDEADBEEF, 5000, 25_000_000)
    assert (status.trace_form, status.trace_ticks) == (messages.TraceRequest_1_0.FORM_TIP, 8)
    report = sent(MessageDataSpecifier(1602), messages.ModelReport_1_0)
    assert (report.sequence, report.status, report.model_tick, report.swap_tick) == (5, 0, 990, 1010)
    assert report.correction_energy_J == -0.125
    response = sent(ServiceDataSpecifier(300, RESPONSE), messages.Command_1_0.Response)
    assert (response.status, response.mode, response.token) == (0, 1, 77)
    info = sent(ServiceDataSpecifier(301, RESPONSE), messages.GetInfo_1_0.Response)
    assert (info.schema_hash, bytes(info.board), info.max_modes) == (schema_hash, b"sample", 192)
    basis = sent(MessageDataSpecifier(1603), messages.BasisReport_1_0)
    assert (basis.basis_id, basis.status, basis.basis_bytes) == (0xCAFEBABE, 38, 13_000)
    assert list(basis.missing) == [0, 0, 0, 0, 0, 0, 5] and list(basis.held) == [11, 12]
    state = sent(MessageDataSpecifier(1610), messages.ModelState_1_0)
    assert (state.sequence, state.schema_hash, state.tick, state.basis_id) == (5, schema_hash, 990, 0xCAFEBABE)
    assert state.q_step_m == 0.5
    assert np.array_equal(state.displacement, 100 * np.arange(96) - 4608)
    for array in (state.load, state.q, state.p):
        assert np.array_equal(array, 100 * np.arange(192) - 4608)
    part = sent(MessageDataSpecifier(1612), messages.ModelPart_1_0)
    assert (part.basis_id, part.basis_bytes, part.first_block) == (0xCAFEBABE, 13_000, 8)
    assert np.array_equal(part.data, np.arange(1024, dtype=np.uint8))
    trace_request = sent(MessageDataSpecifier(1611), messages.TraceRequest_1_0)
    assert (trace_request.first_tick, trace_request.count) == (950, 40)
    assert (trace_request.form, trace_request.ticks) == (trace_request.FORM_TIP, 8)
    command = sent(ServiceDataSpecifier(300, REQUEST), messages.Command_1_0.Request)
    assert (command.action, command.token) == (command.ARM_CONFIRM, 77)
    sent(ServiceDataSpecifier(301, REQUEST), messages.GetInfo_1_0.Request)
    force = sent(MessageDataSpecifier(1613), messages.DirectForce_1_0)
    assert list(force.force_N) == [0.5, -0.25, 1.0]
    device = sent(MessageDataSpecifier(1605), messages.DeviceState_1_0)
    assert (device.tick, device.mode, device.flags, device.faults) == (1200, status.MODE_DIRECT, 16, 0x0102)
    assert list(device.tip_m) == [0.125, -0.5, 0.0]
    assert list(device.velocity_m_s) == [0.0, 0.25, -1.0]
    assert list(device.force_N) == [0.0, 0.0, 2.5]
    assert not payloads

    # pycyphal, given the same transfers, writes the same bytes.
    again = b"".join(
        pycyphal_frame(
            frame.data_specifier,
            bytes(frame.payload[:-4]),
            frame.source_node_id,
            frame.destination_node_id,
            frame.transfer_id,
            frame.priority,
        )
        for frame in frames
    )
    assert again == stream


def test_we_read_pycyphals_frames(messages):
    rng = np.random.default_rng(1)
    sent, stream = [], b""
    for _ in range(20):
        for specifier, message in random_messages(messages, rng):
            service = isinstance(specifier, ServiceDataSpecifier)
            header = {
                "priority": int(rng.integers(0, 8)),
                "source": int(rng.integers(0, 0xFFFF)),
                "destination": int(rng.integers(0, 0xFFFF)) if service else 0xFFFF,
                "specifier": wire_specifier(specifier),
                "transfer_id": int(rng.integers(0, 2**63)),
            }
            payload = serialized(message)
            sent.append({**header, "payload": payload.hex(), "decoded": payload.hex()})
            destination = header["destination"] if service else None
            stream += pycyphal_frame(
                specifier, payload, header["source"], destination, header["transfer_id"], Priority(header["priority"])
            )
    frames, counters = parse(stream, "serial")
    assert frames == sent
    assert counters == {"frames": len(sent), "refused": 0}


def test_damaged_frames_of_pycyphal_are_refused(messages):
    """In every tenth frame one bit is flipped: those are missing, all others arrive."""
    rng, picker = np.random.default_rng(2), random.Random(2)
    good, stream = [], b""
    for index in range(200):
        payload = rng.integers(0, 256, size=rng.integers(0, 300)).astype(np.uint8).tobytes()
        frame = bytearray(pycyphal_frame(MessageDataSpecifier(1600), payload, BOARD, None, index))
        if index % 10 == 5:
            bit = picker.randrange(8 * len(frame))
            frame[bit // 8] ^= 1 << (bit % 8)
        else:
            good.append(index)
        stream += bytes(frame)
    frames, counters = parse(stream, "serial")
    assert [frame["transfer_id"] for frame in frames] == good
    assert counters["refused"] >= 20


class SerialLine:
    """A pseudo-terminal: pycyphal has one end, the test the other."""

    def __init__(self):
        self._end, peer = pty.openpty()
        tty.setraw(self._end)
        tty.setraw(peer)
        self.port = os.ttyname(peer)
        self._peer = peer
        self._received = bytearray()
        self._changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while True:
            try:
                data = os.read(self._end, 4096)
            except OSError:
                return
            with self._changed:
                self._received += data
                self._changed.notify_all()

    def wait_for_frames(self, count: int) -> bytes:
        """Waits until `count` frames have come (each ends with a delimiter); returns all bytes so far."""

        def complete():
            return sum(1 for part in bytes(self._received).split(b"\0") if part) >= count and self._received[-1:] == b"\0"

        with self._changed:
            assert self._changed.wait_for(complete, timeout=RECEIVE_TIMEOUT_S), f"got {len(self._received)} bytes"
            return bytes(self._received)

    def write(self, data: bytes):
        while data:
            data = data[os.write(self._end, data) :]

    def close(self):
        os.close(self._peer)


def test_pycyphals_transport_over_a_serial_line(messages):
    """pycyphal as the host on a serial port: it receives what the board sends, and the board reads what it sends."""
    line = SerialLine()

    async def run():
        node = Presentation(SerialTransport(line.port, local_node_id=HOST, service_transfer_multiplier=2))
        traces = node.make_subscriber(messages.ServoTrace_1_0, 1600)
        statuses = node.make_subscriber(messages.BoardStatus_1_0, 1601)
        models = node.make_publisher(messages.ModelState_1_0, 1610)
        models.send_timeout = RECEIVE_TIMEOUT_S
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, line.write, wire_sample("write", "serial"))
        trace, transfer = await traces.receive(loop.time() + RECEIVE_TIMEOUT_S)
        assert (trace.first_tick, transfer.source_node_id, transfer.transfer_id) == (1000, BOARD, 3)
        status, _ = await statuses.receive(loop.time() + RECEIVE_TIMEOUT_S)
        assert status.tick == 1100

        model = messages.ModelState_1_0(tick=7, p=np.arange(192, dtype=np.int16))
        assert await models.publish(model)
        client = node.make_client(messages.Command_1_0, 300, BOARD)
        client.response_timeout = 0.01  # nobody answers
        request = messages.Command_1_0.Request(action=messages.Command_1_0.Request.DISARM)
        assert await client.call(request) is None
        stream = await loop.run_in_executor(None, line.wait_for_frames, 3)
        node.close()
        return stream, model, request

    try:
        stream, model, request = asyncio.run(run())
    finally:
        line.close()
    frames, counters = parse(stream, "serial")
    assert counters["refused"] == 0
    assert [frame["specifier"] for frame in frames] == [1610, 0xC000 | 300, 0xC000 | 300]
    assert frames[0]["payload"] == serialized(model).hex() == frames[0]["decoded"]
    assert frames[1]["payload"] == serialized(request).hex()
    assert frames[1] == frames[2]  # sent twice: the board ignores the repeat by its transfer-ID
    assert (frames[1]["source"], frames[1]["destination"]) == (HOST, BOARD)
