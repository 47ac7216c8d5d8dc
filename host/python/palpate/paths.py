"""Where things are in the repository."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BUILD = ROOT / "build"
SCENES = ROOT / "scenes"


def cache_folder() -> Path:
    """Where files are kept between runs: $PALPATE_CACHE, or `palpate` in the cache folder of the XDG Base Directory
    Specification 0.8, which has relative paths ignored."""
    if own := os.environ.get("PALPATE_CACHE"):
        return Path(own).absolute()
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else Path.home() / ".cache") / "palpate"
