"""A board in lock-step, whose link is a USB bus, in the USB port of a guest (linux_guest.py): between its host controller
(usb_host.py) and QEMU's usb-redir (usb_redir.py).

The board's time is that of this machine while something is plugged in, a tick a millisecond at most, or slower where that is asked
for, for the guest has no other: such a run does not repeat.
"""

import struct
import time
from collections.abc import Callable

import numpy as np
import usb_redir as redir
from usb_host import Status, Transfer, UsbHost

import palpate

_STATUS = {Status.DONE: redir.SUCCESS, Status.STALLED: redir.STALL, Status.SILENT: redir.INPUT_OUTPUT_ERROR,
           Status.CANCELLED: redir.CANCELLED}
_TICK_s = 1e-3
# It stays pulled out for as long as this, which a guest notices.
_OUT_TICKS = 300
_DEVICE, _CONFIGURATION, _INTERFACE, _ENDPOINT = 1, 2, 4, 5
_TO_HOST, _CLEAR_FEATURE, _SET_ADDRESS, _SET_INTERFACE = 0x80, 1, 5, 11
_TO_ENDPOINT = 0x02


class UsbBoard:
    """Takes the place of usb_redir.UsbDevice. `is_pulled_out()` is asked now and then: true, once, pulls it out."""

    def __init__(self, host: UsbHost, is_pulled_out: Callable[[], bool] = lambda: False):
        self._host = host
        self._is_pulled_out = is_pulled_out
        self._tick_s = _TICK_s
        self.plant: palpate.Plant | None = None  # once it is moved
        self.largest_force_N = 0.0  # since it was moved
        self._pending: dict[int, Transfer] = {}
        self._descriptors = b"", b""
        self._channel: redir.Channel | None = None
        self.times_plugged_in = 0
        self.ticks = 0

    def move(self, plant: palpate.Plant, tick_s: float) -> None:
        """From here on `plant`, whose sensors are among the host's inputs, goes its way and takes the board's currents; a tick takes no
        less than tick_s."""
        self.plant, self._tick_s, self.largest_force_N = plant, tick_s, 0.0

    def serve(self, channel: redir.Channel) -> bool:
        """Until the guest hangs up (False) or the board is pulled out (True)."""
        self._channel = channel
        if self.times_plugged_in:
            self._host.run(_OUT_TICKS)
        self._host.reset()
        self._descriptors = self._host.descriptor(_DEVICE), self._host.descriptor(_CONFIGURATION, length=4096)
        self.times_plugged_in += 1
        channel.send_hello()
        due_s = time.monotonic()
        while True:
            if not channel.handle_until(due_s, self._handle):
                return False
            # Late: what is missed is not made up for.
            due_s = max(due_s + self._tick_s, time.monotonic())
            self._tick()
            if self.ticks % 16 == 0 and self._is_pulled_out():
                self._pending.clear()
                self._host.unplug()
                self._host.run(2)
                return True

    def _tick(self) -> None:
        actuators = self._host.tick()
        self.ticks += 1
        self.largest_force_N = max(self.largest_force_N, float(np.linalg.norm(actuators["force_N"])))
        if self.plant is not None:
            self.plant.advance(np.asarray(actuators["setpoint_A"], dtype=np.float64), bool(actuators["enabled"]))

    def _handle(self, kind: int, identifier: int, body: bytes) -> None:
        if kind == redir.HELLO:
            self._connect()
        elif kind == redir.RESET:
            self._pending.clear()
            self._host.reset()
            # QEMU keeps the kernel's own for itself.
            self._host.submit(Transfer(0, setup=struct.pack("<BBHHH", 0, _SET_ADDRESS, 1, 0, 0)))
        elif kind == redir.SET_CONFIGURATION:
            self._request(0x00, 9, body[0], 0, 0, redir.CONFIGURATION_STATUS, identifier, lambda one: body[:1])
        elif kind == redir.GET_CONFIGURATION:
            self._request(0x80, 8, 0, 0, 1, redir.CONFIGURATION_STATUS, identifier, lambda one: one or b"\0")
        elif kind == redir.SET_ALTERNATE:
            self._request(0x01, _SET_INTERFACE, body[1], body[0], 0, redir.ALTERNATE_STATUS, identifier, lambda one: body[:2])
        elif kind == redir.GET_ALTERNATE:
            self._request(0x81, 10, 0, body[0], 1, redir.ALTERNATE_STATUS, identifier, lambda one: body[:1] + (one or b"\0"))
        elif kind == redir.CONTROL_DATA:
            self._control(identifier, body)
        elif kind == redir.BULK_DATA:
            self._bulk(identifier, body)
        elif kind == redir.START_INTERRUPT:
            self._poll_interrupt(body[0])
            self._channel.send(redir.INTERRUPT_STATUS, identifier, bytes((redir.SUCCESS, body[0])))
        elif kind == redir.STOP_INTERRUPT:
            self._cancel(-body[0])
            self._channel.send(redir.INTERRUPT_STATUS, identifier, bytes((redir.SUCCESS, body[0])))
        elif kind == redir.CANCEL_DATA:
            self._cancel(identifier)
        elif kind != redir.DISCONNECT_ACK:
            raise ValueError(f"usbredir packet of type {kind} with {len(body)} bytes: not one that QEMU needs here")

    def _connect(self) -> None:
        device, configuration = self._descriptors
        kinds, sizes, intervals, owners = [redir.TYPE_NONE] * 32, [0] * 32, [0] * 32, [0] * 32
        interfaces: list[bytes] = []
        for index in (0, 16):
            kinds[index], sizes[index] = redir.TYPE_CONTROL, device[7]
        at = 0
        while at < len(configuration):
            one = configuration[at:at + configuration[at]]
            if one[1] == _INTERFACE:
                interfaces.append(bytes((one[2], one[5], one[6], one[7])))
            elif one[1] == _ENDPOINT:
                index = (one[2] & 0xF) + (16 if one[2] & _TO_HOST else 0)
                kinds[index], sizes[index], intervals[index] = one[3] & 3, one[4] | one[5] << 8, one[6]
                owners[index] = interfaces[-1][0]
            at += len(one)
        self._channel.send(redir.ENDPOINT_INFO, 0,
                           bytes(kinds) + bytes(intervals) + bytes(owners) + struct.pack("<32H", *sizes))
        columns = b"".join(bytes(column).ljust(32, b"\0") for column in zip(*interfaces, strict=True))
        self._channel.send(redir.INTERFACE_INFO, 0, struct.pack("<I", len(interfaces)) + columns)
        vendor, product, version = struct.unpack_from("<HHH", device, 8)
        self._channel.send(redir.DEVICE_CONNECT, 0, struct.pack(
            "<BBBBHHH", redir.FULL_SPEED, device[4], device[5], device[6], vendor, product, version))

    def _submit(self, identifier: int, transfer: Transfer, answer: Callable[[Transfer], None]) -> None:
        def on_done(done: Transfer) -> None:
            # Those that a reset has ended are not known any more, and not answered.
            if self._pending.pop(identifier, None) is not None:
                answer(done)

        transfer.on_done = on_done
        self._pending[identifier] = transfer
        self._host.submit(transfer)

    def _cancel(self, identifier: int) -> None:
        if identifier in self._pending:
            self._host.cancel(self._pending[identifier])

    def _request(self, kind: int, request: int, value: int, index: int, length: int, answer: int, identifier: int,
                 rest: Callable[[bytes], bytes]) -> None:
        """A standard request that usbredir has a packet of its own for."""
        self._submit(identifier, Transfer(0, setup=struct.pack("<BBHHH", kind, request, value, index, length)),
                     lambda done: self._channel.send(answer, identifier, bytes((_STATUS[done.status],)) + rest(done.received)))

    def _control(self, identifier: int, body: bytes) -> None:
        endpoint, request, kind, _, value, index, length = struct.unpack_from("<BBBBHHH", body)

        def answer(done: Transfer) -> None:
            if done.status is Status.DONE and (kind, request, value) == (_TO_ENDPOINT, _CLEAR_FEATURE, 0):
                self._host.restart_toggle(index & 0xFF)
            moved = len(done.received) if kind & _TO_HOST else length if done.status is Status.DONE else 0
            self._channel.send(redir.CONTROL_DATA, identifier, struct.pack(
                "<BBBBHHH", endpoint, request, kind, _STATUS[done.status], value, index, moved) + done.received)

        setup = struct.pack("<BBHHH", kind, request, value, index, length)
        self._submit(identifier, Transfer(0, setup=setup, data=body[10:]), answer)

    def _bulk(self, identifier: int, body: bytes) -> None:
        endpoint, _, length_low, stream, length_high = struct.unpack_from("<BBHIH", body)
        length = length_low | length_high << 16

        def answer(done: Transfer) -> None:
            moved = len(done.received) if endpoint & _TO_HOST else done.sent
            self._channel.send(redir.BULK_DATA, identifier, struct.pack(
                "<BBHIH", endpoint, _STATUS[done.status], moved & 0xFFFF, stream, moved >> 16) + done.received)

        transfer = Transfer(endpoint, length=length) if endpoint & _TO_HOST else Transfer(endpoint, data=body[10:])
        self._submit(identifier, transfer, answer)

    def _poll_interrupt(self, endpoint: int) -> None:
        def answer(done: Transfer) -> None:
            if done.status is Status.DONE:
                self._channel.send(redir.INTERRUPT_DATA, 0, struct.pack(
                    "<BBH", endpoint, redir.SUCCESS, len(done.received)) + done.received)
                self._poll_interrupt(endpoint)

        self._submit(-endpoint, Transfer(endpoint, length=64, interval_ticks=16), answer)
