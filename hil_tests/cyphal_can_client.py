"""A node of pycyphal's on a SocketCAN interface, for a kernel that has one (linux_guest.py): it lists its neighbours, asks the
board who it is, commands it, listens, and writes what it was told to a file, as JSON. It knows nothing of this project but its messages.

    cyphal_can_client.py FILE FOLDERS [NAME MTU INTERFACE COMMAND]...

FOLDERS are those of generated messages, with colons between. For each bus, COMMAND (of a shell) brings the interface up; it is
taken down at the end. One process serves them all: on an emulated processor the imports take longer than all the rest.
"""

import asyncio
import json
import pathlib
import subprocess
import sys

file, folders, *buses = sys.argv[1:]
sys.path[:0] = folders.split(":")

import palpate  # noqa: E402  (of the generated messages)
from pycyphal.application import NodeInfo, make_node, make_registry  # noqa: E402
from pycyphal.application.node_tracker import NodeTracker  # noqa: E402
from pycyphal.transport.can import CANTransport  # noqa: E402
from pycyphal.transport.can.media.socketcan import SocketCANMedia  # noqa: E402

OWN_NODE, BOARD, COMMAND_SERVICE, TRACE_SUBJECT, STATUS_SUBJECT = 10, 42, 300, 1600, 1601
TRACES = 3
# A guest's clock says nothing about its progress: only what has hung waits for it.
DEADLINE_S = 200.0


async def exchange(node) -> dict[str, object]:
    tracker = NodeTracker(node)
    known = asyncio.Event()
    tracker.add_update_handler(lambda number, _, entry: known.set() if number == BOARD and entry and entry.info else None)
    await known.wait()
    nodes = {
        number: {"name": bytes(entry.info.name).decode("ascii"), "uptime_s": int(entry.heartbeat.uptime)}
        for number, entry in tracker.registry.items() if entry.info
    }
    command = node.make_client(palpate.Command_1_0, BOARD, COMMAND_SERVICE)
    command.response_timeout = DEADLINE_S
    response, _ = await command.call(palpate.Command_1_0.Request(action=palpate.Command_1_0.Request.STOP))

    traces = node.make_subscriber(palpate.ServoTrace_1_0, TRACE_SUBJECT)
    heard = [(await anext(traces))[0] for _ in range(TRACES)]
    traces.close()  # what nobody wants, the kernel does not pass on
    statuses = node.make_subscriber(palpate.BoardStatus_1_0, STATUS_SUBJECT)
    status, _ = await anext(statuses)
    return {
        "nodes": nodes,
        "command": {"status": int(response.status), "mode": int(response.mode)},
        "traces": [
            {"first_tick": int(trace.first_tick), "tip_m": [sample.tip_m.tolist() for sample in trace.samples]} for trace in heard
        ],
        "status": {name: int(getattr(status, name)) for name in ("frames_received", "frames_refused", "frames_lost", "faults", "last_status")},
    }


async def on_the_bus(interface: str, mtu: int) -> dict[str, object]:
    transport = CANTransport(SocketCANMedia(interface, mtu), OWN_NODE)
    node = make_node(NodeInfo(name="org.palpate.test"), make_registry(None, {}), transport=transport)
    node.start()
    try:
        return await asyncio.wait_for(exchange(node), DEADLINE_S)
    finally:
        node.close()


results = {}
for name, mtu, interface, command in zip(*[iter(buses)] * 4):
    subprocess.run(["bash", "-euc", command], check=True)
    results[name] = asyncio.run(on_the_bus(interface, int(mtu)))
    subprocess.run(["ip", "link", "set", interface, "down"], check=True)
pathlib.Path(file).write_text(json.dumps(results), "ascii")
