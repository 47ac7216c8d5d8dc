"""`python -m palpate`."""

import sys

from palpate.cli import main

sys.exit(main(sys.argv[1:]))
