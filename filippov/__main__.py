"""python -m filippov: the command."""

import sys
from pathlib import Path

from filippov.app.cli.main import main


def _installed_first() -> None:
    """Have what is installed found before the current folder, which `python -m` puts first.

    So a scipy.py that lies there is not scipy. Behind the rest the folder stays: in a bare checkout workers
    find the package there.
    """
    if not sys.flags.safe_path and sys.path[:1] == [str(Path.cwd())]:
        sys.path.append(sys.path.pop(0))


if __name__ == "__main__":
    _installed_first()
    sys.exit(main())
