"""Where things are: in the repository, or in an installed wheel, which has scenes and the native board but no more."""

import os
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
_HOST = PACKAGE.parents[1]
# The repository; None in an installed wheel.
SOURCE: Path | None = _HOST.parent if (_HOST.parent / "dependencies.txt").exists() else None
# Results go below it.
ROOT = SOURCE or Path.cwd()
BUILD = ROOT / "build"
SCENES = (SOURCE or PACKAGE) / "scenes"


def cache_folder() -> Path:
    """Where files are kept between runs: $PALPATE_CACHE, or `palpate` in the cache folder of the XDG Base Directory
    Specification 0.8, which has relative paths ignored."""
    if own := os.environ.get("PALPATE_CACHE"):
        return Path(own).absolute()
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else Path.home() / ".cache") / "palpate"
