"""The experiment of section 5.1 (Figures 12 and 13): a node that is pulled and released. Numbers of its scenes."""

GLOBAL_RATE_HZ = 30.0
RELEASE_S = 1.0
# After the release, the time from which a model on the board knows of it: a frame, and its way to the board.
KNOWN_AFTER_S = 0.1
