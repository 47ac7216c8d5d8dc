"""USB devices in Python for a guest of linux_guest.py: the far end of QEMU's usb-redir (usbredir protocol 0.7).

A device is a class with descriptors and what it does with control and bulk transfers. Where a guest opens its port, the
device is plugged in; UsbDevice.unplug() pulls it out and plugs it in again.
"""

import collections
import contextlib
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

# Packet types (usb-redir-protocol.txt of usbredir)
HELLO, DEVICE_CONNECT, RESET, INTERFACE_INFO, ENDPOINT_INFO = 0, 1, 3, 4, 5
SET_CONFIGURATION, GET_CONFIGURATION, CONFIGURATION_STATUS = 6, 7, 8
SET_ALTERNATE, GET_ALTERNATE, ALTERNATE_STATUS = 9, 10, 11
START_INTERRUPT, STOP_INTERRUPT, INTERRUPT_STATUS = 15, 16, 17
CANCEL_DATA, DISCONNECT_ACK = 21, 24
CONTROL_DATA, BULK_DATA, INTERRUPT_DATA = 100, 101, 103
# Capabilities: version in device_connect, packet sizes in ep_info, 64-bit identifiers, 32-bit bulk lengths
_CAPABILITIES = 1 << 1 | 1 << 4 | 1 << 5 | 1 << 6
_VERSION = b"palpate test device"
SUCCESS, CANCELLED, INPUT_OUTPUT_ERROR, STALL = 0, 1, 3, 4
FULL_SPEED, HIGH_SPEED = 1, 2
TYPE_CONTROL, TYPE_BULK, TYPE_INTERRUPT, TYPE_NONE = 0, 2, 3, 255
_CONTROL_PACKET_BYTES = 64
BULK_PACKET_BYTES = 512
_GET_STATUS, _GET_DESCRIPTOR = 0, 6
_DIRECTION_IN = 0x80


@dataclass(frozen=True)
class Identity:
    """What the device says of itself."""

    vendor: int
    product: int
    manufacturer_name: str
    product_name: str
    serial: str


class UsbDevice:
    """A high-speed device with one interface of its vendor's own class and one bulk endpoint each way.

    All methods run in the thread that serves the device.
    """

    identity: Identity
    interface_class = (0xFF, 0, 0)
    bulk_in, bulk_out = 0x81, 0x01

    def __init__(self) -> None:
        self._requests: collections.deque[tuple[int, int, int]] = collections.deque()  # identifier, stream, length
        self._messages: collections.deque[bytes] = collections.deque()
        self._channel: Channel | None = None
        self._pulled_out = False
        self.configurations_set = 0

    # What a device does

    def on_plugged_in(self) -> None:
        """The port is open anew."""

    def on_bulk_out(self, data: bytes) -> None:
        """A transfer of the host's, as long as it made it: without bytes where it sent a zero-length packet."""

    def on_vendor_out(self, request: int, value: int, data: bytes) -> bool:
        """A control transfer to the device; False: it stalls."""
        return False

    def on_vendor_in(self, request: int, value: int) -> bytes | None:
        """A control transfer from the device; None: it stalls."""
        return None

    def send(self, message: bytes) -> None:
        """Queues bytes for the host; a transfer of the host's never holds two messages."""
        self._messages.append(message)

    def unplug(self) -> None:
        """Pulls the device out once the current transfer is done, and plugs it in again."""
        self._pulled_out = True

    # Descriptors

    def _device_descriptor(self) -> bytes:
        who = self.identity
        return struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0200, 0, 0, 0, _CONTROL_PACKET_BYTES, who.vendor, who.product,
                           0x0100, 1, 2, 3, 1)

    def _configuration_descriptor(self) -> bytes:
        endpoints = b"".join(struct.pack("<BBBBHB", 7, 5, endpoint, 2, BULK_PACKET_BYTES, 0)
                             for endpoint in (self.bulk_in, self.bulk_out))
        interface = struct.pack("<9B", 9, 4, 0, 0, 2, *self.interface_class, 0)
        body = interface + endpoints
        return struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), 1, 1, 0, 0x80, 50) + body

    def _string_descriptor(self, index: int) -> bytes | None:
        if index == 0:
            return struct.pack("<BBH", 4, 3, 0x0409)  # US English
        who = self.identity
        texts = (who.manufacturer_name, who.product_name, who.serial)
        if index > len(texts):
            return None
        text = texts[index - 1].encode("utf-16-le")
        return bytes((2 + len(text), 3)) + text

    def _descriptor(self, kind: int, index: int) -> bytes | None:
        if kind == 3:
            return self._string_descriptor(index)
        qualifier = struct.pack("<BBHBBBBBB", 10, 6, 0x0200, 0, 0, 0, _CONTROL_PACKET_BYTES, 1, 0)
        return {1: self._device_descriptor(), 2: self._configuration_descriptor(), 6: qualifier}.get(kind)

    # usbredir

    def serve(self, channel: "Channel") -> bool:
        """Until the host hangs up (False) or the device is pulled out (True)."""
        self._channel, self._pulled_out = channel, False
        self._requests.clear()
        self._messages.clear()
        channel.send_hello()
        while not self._pulled_out:
            packet = channel.receive()
            if packet is None:
                return False
            self._handle(*packet)
            self._answer_requests()
        return True

    def _handle(self, kind: int, identifier: int, body: bytes) -> None:
        if kind == HELLO:
            self._connect()
        elif kind == RESET:
            self._requests.clear()
            self._messages.clear()
        elif kind == SET_CONFIGURATION:
            self.configurations_set += 1
            self._channel.send(CONFIGURATION_STATUS, identifier, bytes((SUCCESS, body[0])))
        elif kind == GET_CONFIGURATION:
            self._channel.send(CONFIGURATION_STATUS, identifier, bytes((SUCCESS, 1)))
        elif kind == SET_ALTERNATE:
            self._channel.send(ALTERNATE_STATUS, identifier, bytes((SUCCESS, body[0], body[1])))
        elif kind == GET_ALTERNATE:
            self._channel.send(ALTERNATE_STATUS, identifier, bytes((SUCCESS, body[0], 0)))
        elif kind == CONTROL_DATA:
            self._control(identifier, body)
        elif kind == BULK_DATA:
            self._bulk(identifier, body)
        elif kind == CANCEL_DATA:
            for request in list(self._requests):
                if request[0] == identifier:
                    self._requests.remove(request)
                    self._answer_bulk(self.bulk_in, CANCELLED, request, b"")
        elif kind != DISCONNECT_ACK:
            raise ValueError(f"usbredir packet of type {kind} with {len(body)} bytes: not one that QEMU needs here")

    def _connect(self) -> None:
        # Endpoints are indexed by number, those of direction IN from 16 on.
        types, sizes = [TYPE_NONE] * 32, [0] * 32
        for index in (0, 16):
            types[index], sizes[index] = TYPE_CONTROL, _CONTROL_PACKET_BYTES
        for endpoint in (self.bulk_in, self.bulk_out):
            index = (endpoint & 0xF) + (16 if endpoint & _DIRECTION_IN else 0)
            types[index], sizes[index] = TYPE_BULK, BULK_PACKET_BYTES
        self._channel.send(ENDPOINT_INFO, 0, bytes(types) + bytes(32) + bytes(32) + struct.pack("<32H", *sizes))
        columns = [bytes([value] + [0] * 31) for value in self.interface_class]
        self._channel.send(INTERFACE_INFO, 0, struct.pack("<I", 1) + bytes(32) + b"".join(columns))
        who = self.identity
        self._channel.send(DEVICE_CONNECT, 0,
                           struct.pack("<BBBBHHH", HIGH_SPEED, 0, 0, 0, who.vendor, who.product, 0x0100))
        self.on_plugged_in()

    def _control(self, identifier: int, body: bytes) -> None:
        endpoint, request, kind, _, value, index, length = struct.unpack_from("<BBBBHHH", body)
        answer: bytes | None = None
        vendor, to_host = kind & 0x60 == 0x40, bool(kind & _DIRECTION_IN)
        if vendor and to_host:
            answer = self.on_vendor_in(request, value)
        elif vendor:
            answer = b"" if self.on_vendor_out(request, value, body[10:]) else None
        elif to_host and request == _GET_DESCRIPTOR:
            answer = self._descriptor(value >> 8, value & 0xFF)
        elif to_host and request == _GET_STATUS:
            answer = b"\0\0"
        elif not to_host:  # features, among them CLEAR_FEATURE(ENDPOINT_HALT)
            answer = b""
        status = STALL if answer is None else SUCCESS
        answer = (answer or b"")[:length]
        self._channel.send(CONTROL_DATA, identifier, struct.pack(
            "<BBBBHHH", endpoint, request, kind, status, value, index, len(answer) if to_host else length) + answer)

    def _bulk(self, identifier: int, body: bytes) -> None:
        endpoint, _, length_low, stream, length_high = struct.unpack_from("<BBHIH", body)
        request = identifier, stream, length_low | length_high << 16
        if endpoint == self.bulk_in:
            self._requests.append(request)
        else:
            self.on_bulk_out(body[10:])
            self._answer_bulk(endpoint, SUCCESS, request, b"")

    def _answer_requests(self) -> None:
        while self._requests and self._messages:
            request, message = self._requests.popleft(), self._messages.popleft()
            length = request[2]
            if len(message) > length:
                self._messages.appendleft(message[length:])
            self._answer_bulk(self.bulk_in, SUCCESS, request, message[:length])

    def _answer_bulk(self, endpoint: int, status: int, request: tuple[int, int, int], data: bytes) -> None:
        identifier, stream, length = request
        if endpoint == self.bulk_in:
            length = len(data)
        self._channel.send(BULK_DATA, identifier,
                           struct.pack("<BBHIH", endpoint, status, length & 0xFFFF, stream, length >> 16) + data)


class Channel:
    """Packets over a stream socket."""

    def __init__(self, stream: socket.socket) -> None:
        self._stream = stream
        self._received = b""
        self._head = struct.Struct("<III")  # until both have said hello

    def send_hello(self) -> None:
        self.send(HELLO, 0, _VERSION.ljust(64, b"\0") + struct.pack("<I", _CAPABILITIES))

    def send(self, kind: int, identifier: int, body: bytes) -> None:
        self._stream.sendall(self._head.pack(kind, len(body), identifier) + body)

    def has_something(self, longest_s: float) -> bool:
        """Waits for it. Part of a packet, too: the rest is on its way."""
        return bool(self._received) or bool(select.select([self._stream], [], [], longest_s)[0])

    def receive(self) -> tuple[int, int, bytes] | None:
        """Type, identifier and body of the next packet; None: the host has hung up."""
        head = self._take(self._head.size)
        if head is None:
            return None
        kind, length, identifier = self._head.unpack(head)
        body = self._take(length)
        if body is None:
            return None
        if kind == HELLO:
            (capabilities,) = struct.unpack_from("<I", body, 64)
            if capabilities & _CAPABILITIES != _CAPABILITIES:
                raise ValueError(f"QEMU's usb-redir lacks capabilities: {capabilities:#x}, needed {_CAPABILITIES:#x}")
            self._head = struct.Struct("<IIQ")
        return kind, identifier, body

    def handle_until(self, due_s: float, handle: Callable[[int, int, bytes], None]) -> bool:
        """Packets up to a time of time.monotonic(). False: the host has hung up."""
        while self.has_something(max(0.0, due_s - time.monotonic())):
            packet = self.receive()
            if packet is None:
                return False
            handle(*packet)
        return True

    def _take(self, length: int) -> bytes | None:
        while len(self._received) < length:
            try:
                some = self._stream.recv(65536)
            except ConnectionResetError:
                some = b""
            if not some:
                return None
            self._received += some
        taken, self._received = self._received[:length], self._received[length:]
        return taken


@contextlib.contextmanager
def plugged_in(device: UsbDevice, port: socket.socket) -> Iterator[None]:
    """Serves `device` on a port of linux_guest.usb_port() until the guest has ended; what its thread raised is raised."""
    path, problems = port.getsockname(), []

    def serve() -> None:
        try:
            while True:
                with socket.socket(socket.AF_UNIX) as stream:
                    stream.connect(path)
                    if not device.serve(Channel(stream)):
                        return
        except ConnectionError:  # the guest has ended between two plugs
            return
        except Exception as problem:
            problems.append(problem)

    thread = threading.Thread(target=serve, name="usb device")
    thread.start()
    try:
        yield
    finally:
        port.close()
        thread.join()
        if problems:
            raise problems[0]
