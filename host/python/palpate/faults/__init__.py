"""The fault matrix: what goes wrong with link, host and board, and what the force then does (docs/faults.md)."""
