"""palpate on the PC: bodies, local models, sessions, the simulated device, experiments with the firmware in the loop.

Everything here is imported when it is first used: the command line (`palpate.cli`) starts without the C++ core.
"""

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from palpate.board_link import BoardInfo, BoardLink, BoardLinkError, BoardState
    from palpate.body import Body, Drive, State, Touch
    from palpate.experiments import Result, run, simulate, sweep
    from palpate.hil import BoardError
    from palpate.link import Uart
    from palpate.live import Live
    from palpate.local_model import LocalModel, build_model
    from palpate.plant import Plant
    from palpate.scene import Scene, SceneError, load_scene, make_scene
    from palpate.session import Session, Update
    from palpate.virtual_device import VirtualDevice, VirtualDeviceState

# Of host and firmware alike: CMake and the wheel read the same file.
__version__ = (Path(__file__).parent / "VERSION").read_text("utf-8").strip()

_HOMES = {
    "board_link": ("BoardInfo", "BoardLink", "BoardLinkError", "BoardState"),
    "body": ("Body", "Drive", "State", "Touch"),
    "experiments": ("Result", "run", "simulate", "sweep"),
    "hil": ("BoardError",),
    "link": ("Uart",),
    "live": ("Live",),
    "local_model": ("LocalModel", "build_model"),
    "plant": ("Plant",),
    "scene": ("Scene", "SceneError", "load_scene", "make_scene"),
    "session": ("Session", "Update"),
    "virtual_device": ("VirtualDevice", "VirtualDeviceState"),
}
_MODULE_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "BoardError",
    "BoardInfo",
    "BoardLink",
    "BoardLinkError",
    "BoardState",
    "Body",
    "Drive",
    "Live",
    "LocalModel",
    "Plant",
    "Result",
    "Scene",
    "SceneError",
    "Session",
    "State",
    "Touch",
    "Uart",
    "Update",
    "VirtualDevice",
    "VirtualDeviceState",
    "__version__",
    "build_model",
    "load_scene",
    "make_scene",
    "run",
    "simulate",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'palpate' has no attribute {name!r}")
    return getattr(importlib.import_module(f"palpate.{_MODULE_OF[name]}"), name)


def __dir__() -> list[str]:
    return __all__
