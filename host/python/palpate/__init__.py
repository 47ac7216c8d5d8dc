"""palpate on the PC: scenes, the closed loop with a board, records and pictures. The command line is `palpate.cli`."""

from pathlib import Path

# Of host and firmware alike: CMake and the wheel read the same file.
__version__ = (Path(__file__).parent / "VERSION").read_text("utf-8").strip()
