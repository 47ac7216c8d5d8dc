"""A CAN FD adapter with candleLight's protocol, which the kernel's driver gs_usb makes an interface (can0) of, and a node
on its bus that answers.

The node answers every frame with the next identifier and the data in reverse, unless the identifier is one of COMMANDS.
"""

import struct

from usb_redir import Identity, UsbDevice

# linux/drivers/net/can/usb/gs_usb.c
_HOST_FORMAT, _BIT_TIMING, _MODE, _BIT_TIMING_LIMITS, _DEVICE_CONFIGURATION = 0, 1, 2, 4, 5
_DATA_BIT_TIMING, _LIMITS_EXTENDED = 10, 11
_FEATURE_LISTEN_ONLY, _FEATURE_LOOP_BACK, _FEATURE_FD, _FEATURE_LIMITS_EXTENDED = 1 << 0, 1 << 1, 1 << 8, 1 << 10
_FLAG_FD, _FLAG_BIT_RATE_SWITCH = 1 << 1, 1 << 2
_NO_ECHO = 0xFFFFFFFF
_FRAME = struct.Struct("<IIBBBB")
_DATA_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_CLOCK_Hz = 80_000_000

# linux/can.h, linux/can/error.h
_EXTENDED, _ERROR = 1 << 31, 1 << 29
ERROR_LOST_ARBITRATION, ERROR_CONTROLLER, ERROR_ACKNOWLEDGE, ERROR_BUS_OFF, ERROR_RESTARTED = (
    1 << 1, 1 << 2, 1 << 5, 1 << 6, 1 << 8)
_CONTROLLER_RECEIVE_OVERFLOW = 1 << 0

# Frames that make the controller tell of an error: identifier to error class and data. The same as in
# host/link/socketcan_adapter_test.cpp.
COMMANDS = {
    0x1FFFFF00: (ERROR_BUS_OFF, bytes(8)),
    0x1FFFFF01: (ERROR_RESTARTED, bytes(8)),
    0x1FFFFF02: (ERROR_ACKNOWLEDGE | ERROR_CONTROLLER, bytes((0, _CONTROLLER_RECEIVE_OVERFLOW, 0, 0, 0, 0, 0, 0))),
    0x1FFFFF03: (ERROR_LOST_ARBITRATION, bytes(8)),
}


class GsUsbAdapter(UsbDevice):
    """One channel; frames need no time on its bus."""

    identity = Identity(0x1D50, 0x606F, "palpate", "gs_usb test adapter", "CAN0001")
    bulk_in, bulk_out = 0x81, 0x02

    def __init__(self) -> None:
        super().__init__()
        self.bit_timings: dict[str, tuple[int, ...]] = {}

    def on_vendor_in(self, request: int, value: int) -> bytes | None:
        features = _FEATURE_LISTEN_ONLY | _FEATURE_LOOP_BACK | _FEATURE_FD | _FEATURE_LIMITS_EXTENDED
        # Time segments 1 and 2, jump width, prescaler: least, most (and its step).
        limits = struct.pack("<10I", features, _CLOCK_Hz, 1, 256, 1, 128, 128, 1, 512, 1)
        data_limits = struct.pack("<8I", 1, 32, 1, 16, 16, 1, 32, 1)
        return {
            _DEVICE_CONFIGURATION: struct.pack("<4B2I", 0, 0, 0, 0, 2, 1),
            _BIT_TIMING_LIMITS: limits,
            _LIMITS_EXTENDED: limits + data_limits,
        }.get(request)

    def on_vendor_out(self, request: int, value: int, data: bytes) -> bool:
        if request in (_BIT_TIMING, _DATA_BIT_TIMING):
            self.bit_timings["data" if request == _DATA_BIT_TIMING else "nominal"] = struct.unpack("<5I", data)
        return request in (_HOST_FORMAT, _MODE, _BIT_TIMING, _DATA_BIT_TIMING)

    def bit_rate(self, phase: str) -> float:
        """As the driver has set it, of the phase "nominal" or "data"."""
        propagation, segment_1, segment_2, _, prescaler = self.bit_timings[phase]
        return _CLOCK_Hz / prescaler / (1 + propagation + segment_1 + segment_2)

    def on_bulk_out(self, data: bytes) -> None:
        if not data:
            return
        echo, identifier, code, channel, flags, _ = _FRAME.unpack_from(data)
        self.send(data)  # to the driver: sent
        command = COMMANDS.get(identifier & ~_EXTENDED)
        if command is not None:
            kind, error = command
            self.send(_FRAME.pack(_NO_ECHO, _ERROR | kind, 8, channel, 0, 0) + error)
            return
        payload = data[_FRAME.size:_FRAME.size + _DATA_LENGTHS[code]][::-1]
        length = 64 if flags & _FLAG_FD else 8
        self.send(_FRAME.pack(_NO_ECHO, identifier + 1, code, channel, flags, 0) + payload.ljust(length, b"\0"))
