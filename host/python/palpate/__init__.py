"""palpate on the PC: scenes, the closed loop with a board, records and pictures. The command line is `palpate.cli`."""

__version__ = "0.1.0"
