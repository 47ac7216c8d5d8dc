"""What a scene's link carries, from its keys alone."""

from palpate.scene_sections import Link

TICKS_PER_SECOND = 1000
_BITS_PER_BYTE_OF_A_UART = 10.0
_BULK_BYTES_PER_FRAME = 19 * 64.0  # host/link/usb_time.hpp


def is_shared(link: Link) -> bool:
    """Do both directions share the medium?"""
    return link.medium != "uart"


def bytes_per_tick(link: Link) -> float:
    """Of messages, at most, in a servo tick: on a serial line and USB those of frames; on CAN those that full frames carry
    beside their tail byte, each in its longest time."""
    if link.medium == "uart":
        return link.baud / _BITS_PER_BYTE_OF_A_UART / TICKS_PER_SECOND
    if link.medium == "usb":
        return _BULK_BYTES_PER_FRAME
    if link.medium == "can":
        return 7 / (_classic_frame_s(8, link.bit_rate_Hz) * TICKS_PER_SECOND)
    return 63 / (_fd_frame_s(link.bit_rate_Hz, link.data_bit_rate_Hz) * TICKS_PER_SECOND)


def _stuffed(bits: int) -> int:
    """With all the stuff bits that there may be: one after the first five, then after every four."""
    return bits + (bits - 1) // 4


def _classic_frame_s(data_bytes: int, bit_rate_Hz: float) -> float:
    """Extended identifier; host/link/can_cost.cpp has the same, with the names of the fields (ISO 11898-1)."""
    return (_stuffed(1 + 29 + 3 + 2 + 4 + 8 * data_bytes + 15) + 13) / bit_rate_Hz


def _fd_frame_s(bit_rate_Hz: float, data_bit_rate_Hz: float) -> float:
    """The same of 64 bytes on CAN FD."""
    return (_stuffed(1 + 29 + 6) + 13) / bit_rate_Hz + (_stuffed(5 + 8 * 64) + 1 + 4 + 21 + 7) / data_bit_rate_Hz
