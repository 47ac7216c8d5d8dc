"""`python -m palpate`."""

import sys

from palpate.cli import entry

sys.exit(entry())
