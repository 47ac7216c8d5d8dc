"""Listen to a board in a dozen lines of pycyphal: a client of the wire protocol (docs/protocol.md) without a line of palpate's code.

`python listen_with_pycyphal.py /dev/ttyACM0` (or `serial:/dev/pts/3`, as `./run device` says it); the message definitions are those of the source tree that this file lies in.
"""

import asyncio
import importlib
import sys
import tempfile
from pathlib import Path

import pycyphal.dsdl
from pycyphal.presentation import Presentation
from pycyphal.transport.serial import SerialTransport


async def listen(port: str) -> None:
    """Prints the tip's height in the first tick of ten traces."""
    transport = SerialTransport(port, local_node_id=None, baudrate=921_600)  # to send, too, it would be a node of its own: 50
    traces = Presentation(transport).make_subscriber(messages.ServoTrace_1_0, 1600)
    for _ in range(10):
        trace, transfer = await anext(traces)
        print(f"node {transfer.source_node_id}, tick {trace.first_tick}: tip at z = {1e3 * trace.samples[0].tip_m[2]:.2f} mm")
    transport.close()


with tempfile.TemporaryDirectory() as folder:
    pycyphal.dsdl.compile_all([Path(__file__).parents[2] / "shared/wire/dsdl/palpate"], output_directory=folder)
    sys.path.insert(0, folder)  # what is generated is called palpate: not beside palpate's own package
    messages = importlib.import_module("palpate")
    if len(sys.argv) != 2:
        sys.exit("usage: listen_with_pycyphal.py PORT")
    asyncio.run(listen(sys.argv[1].removeprefix("serial:")))
