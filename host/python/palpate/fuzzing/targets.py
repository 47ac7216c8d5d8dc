"""Which targets there are, and how many executions each has in `palpate test`."""

SHORT_RUNS = {
    "cobs": 20_000,
    "frames": 20_000,
    "can": 20_000,
    "messages": 20_000,
    "tip_trace": 20_000,
    "model": 20_000,
    "host_endpoint": 20_000,
    "basis_file": 20_000,
    "renderer": 2_000,
    "board": 2_000,
    "board_can": 2_000,
    "usb": 5_000,
    "usb_host": 2_000,
    "scene": 1_000,
    "record": 200,
}
TARGETS = tuple(SHORT_RUNS)
# The others are C++.
IN_PYTHON = ("scene", "record")
