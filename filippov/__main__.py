"""python -m filippov: the command."""

import sys

from filippov.cli import main

if __name__ == "__main__":
    sys.exit(main())
