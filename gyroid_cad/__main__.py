"""``python -m gyroid_cad`` and ``gyroid-cad``."""

import sys

from gyroid_cad.cli import main


def run() -> None:
    """Run the command line and leave with its status."""
    sys.exit(main())


if __name__ == "__main__":
    run()
