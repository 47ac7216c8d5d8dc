"""The window: a body that is touched with the mouse, or with what a board renders (docs/gui.md)."""
