"""What is set for one arm and its amplifiers: found step by step, written to the board's registers, and read back."""
