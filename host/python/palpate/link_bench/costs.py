"""What a message costs: the host's processor time, and the firmware's instructions in QEMU."""

from typing import Any

from palpate import hil
from palpate.scene import make_scene

MEDIA = {"serial": "uart", "can_classic": "can", "can_fd": "canfd"}  # one that speaks it
BOARD = "mps2_an386"
_HOST_ROUNDS, _BOARD_ROUNDS = 101, 21
_BODY = {"nodes": [2, 2, 2], "fixed_faces": ["z-"]}  # only [link] counts here


def _scene(medium: str) -> dict[str, Any]:
    return make_scene({"body": _BODY, "link": {"medium": medium}}).to_dict()


def host_costs(core: Any) -> list[dict[str, Any]]:
    """A row for each framing and message: {framing, message, message_bytes, link_bytes, to_board, us, of_a_copy}; of_a_copy: that
    time over that of a memcpy of as many bytes."""
    rows = []
    for framing, medium in MEDIA.items():
        for cost in core.host_link_cost(_scene(medium), _HOST_ROUNDS):
            seconds, copy_s = cost.pop("seconds"), cost.pop("copy_seconds")
            rows.append({"framing": framing, **cost, "us": 1e6 * seconds, "of_a_copy": seconds / copy_s})
    return rows


def board_costs(core: Any) -> list[dict[str, Any]]:
    """A row for each framing and message: {framing, message, message_bytes, link_bytes, to_board, instructions,
    per_link_byte}. Raises hil.BoardError."""
    rows = []
    for framing, medium in MEDIA.items():
        board = hil.BOARDS[BOARD].on(medium)
        assert board.instructions_per_count is not None
        with hil.Board(board) as running:
            costs = core.board_link_cost(_scene(medium), running.actuator_fd, running.sensor_fd, _BOARD_ROUNDS)
        for cost in costs:
            instructions = cost.pop("clock_counts") * board.instructions_per_count
            rows.append({"framing": framing, **cost, "instructions": instructions, "per_link_byte": instructions / cost["link_bytes"]})
    return rows
