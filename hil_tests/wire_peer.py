"""`wire_sample` (host/link), which writes and parses transfers with the code that firmware and host use, and the messages
that pycyphal, an independent implementation, makes of the same definitions.
"""

import importlib
import json
import os
import pathlib
import subprocess
import sys
import warnings

import numpy as np
import pycyphal
import pycyphal.dsdl
import pytest
from pycyphal.transport import MessageDataSpecifier, ServiceDataSpecifier

ROOT = pathlib.Path(__file__).resolve().parent.parent
DSDL = ROOT / "shared" / "wire" / "dsdl" / "palpate"
BUILD = ROOT / os.environ.get("PALPATE_BUILD_HOST", "build/host")
BOARD, HOST = 42, 10
REQUEST = ServiceDataSpecifier.Role.REQUEST
RESPONSE = ServiceDataSpecifier.Role.RESPONSE
RECEIVE_TIMEOUT_S = 20.0  # generous: only a failure waits for it


def wire_sample(*command: str, stdin: bytes = b"") -> bytes:
    program = BUILD / "host" / "link" / "wire_sample"
    if not program.exists():
        pytest.fail(f"{program} is missing: build the host preset, or set PALPATE_BUILD_HOST")
    return subprocess.run([program, *command], input=stdin, stdout=subprocess.PIPE, check=True).stdout


def parse(stream: bytes, framing: str) -> tuple[list[dict], dict]:
    """Returns the transfers that our receiver finds in `stream`, and its counters."""
    *transfers, counters = [json.loads(line) for line in wire_sample("parse", framing, stdin=stream).splitlines()]
    return transfers, counters


def generated_messages(folder: pathlib.Path):
    """The message classes that pycyphal generates, into `folder`. Their package is also called palpate, so ours steps
    aside meanwhile.
    """
    pycyphal.dsdl.remove_import_hooks()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of pydsdl, caused by nunavut's templates
        pycyphal.dsdl.compile_all([DSDL], output_directory=folder)
    own = {name: sys.modules.pop(name) for name in list(sys.modules) if name.split(".")[0] == "palpate"}
    sys.path.insert(0, str(folder))
    try:
        importlib.invalidate_caches()
        generated = importlib.import_module("palpate")
    finally:
        sys.path.remove(str(folder))
        for name in [name for name in sys.modules if name.split(".")[0] == "palpate"]:
            del sys.modules[name]
        sys.modules.update(own)
    return generated


def serialized(message) -> bytes:
    return b"".join(pycyphal.dsdl.serialize(message))


def random_messages(messages, rng: np.random.Generator):
    """One message of each kind to the board and from it, with random contents and random array lengths."""

    def steps(most):
        return rng.integers(-(2**15), 2**15, size=rng.integers(0, most + 1)).astype(np.int16)

    def octets(most):
        return rng.integers(0, 2**8, size=rng.integers(0, most + 1)).astype(np.uint8)

    def sample():
        return messages.ServoSample_1_0(tip_m=rng.normal(size=3), force_N=rng.normal(size=3), triangle=rng.integers(0, 2**16))

    yield MessageDataSpecifier(1600), messages.ServoTrace_1_0(
        sequence=rng.integers(0, 2**32), samples=[sample() for _ in range(rng.integers(0, 33))]
    )
    def offset():
        return messages.TipOffset_1_0(steps=rng.integers(-(2**15), 2**15, size=3).astype(np.int16))

    yield MessageDataSpecifier(1604), messages.TipTrace_1_0(
        first_tick=rng.integers(0, 2**32), tip_m=rng.normal(size=3), step_exponent=int(rng.integers(-36, -11)),
        offsets=[offset() for _ in range(rng.integers(0, 32))],
    )
    yield MessageDataSpecifier(1601), messages.BoardStatus_1_0(tick=rng.integers(0, 2**32), faults=0x8001)
    yield MessageDataSpecifier(1602), messages.ModelReport_1_0(
        sequence=rng.integers(0, 2**32), status=0, correction_energy_J=rng.normal()
    )
    yield MessageDataSpecifier(1603), messages.BasisReport_1_0(
        basis_id=rng.integers(0, 2**32), missing=octets(16), held=rng.integers(0, 2**32, size=3, dtype=np.uint32)
    )
    yield MessageDataSpecifier(1610), messages.ModelState_1_0(
        schema_hash=rng.integers(0, 2**63), q_step_m=rng.normal(), displacement=steps(96), load=steps(192), q=steps(192), p=steps(192)
    )
    yield MessageDataSpecifier(1612), messages.ModelPart_1_0(basis_id=rng.integers(0, 2**32), data=octets(1024))
    yield MessageDataSpecifier(1611), messages.TraceRequest_1_0(first_tick=rng.integers(0, 2**32), count=12, form=1, ticks=8)
    yield MessageDataSpecifier(1613), messages.DirectForce_1_0(force_N=rng.normal(size=3))
    yield MessageDataSpecifier(1605), messages.DeviceState_1_0(tick=rng.integers(0, 2**32), velocity_m_s=rng.normal(size=3))
    yield ServiceDataSpecifier(300, REQUEST), messages.Command_1_0.Request(action=2, token=rng.integers(0, 2**32))
    yield ServiceDataSpecifier(300, RESPONSE), messages.Command_1_0.Response(status=49, mode=1)
    yield ServiceDataSpecifier(301, REQUEST), messages.GetInfo_1_0.Request()
    yield ServiceDataSpecifier(301, RESPONSE), messages.GetInfo_1_0.Response(
        board=np.frombuffer(b"x" * rng.integers(0, 33), dtype=np.uint8), max_basis=9216
    )


def wire_specifier(specifier) -> int:
    if isinstance(specifier, MessageDataSpecifier):
        return specifier.subject_id
    return (0xC000 if specifier.role == REQUEST else 0x8000) | specifier.service_id
