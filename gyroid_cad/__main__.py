"""``python -m gyroid_cad`` and ``gyroid-cad``."""

import sys


def run() -> None:
    """Run the command line and leave with its status."""
    try:
        from gyroid_cad.cli.app import main
    except KeyboardInterrupt:  # while what the commands need is loaded
        print("gyroid-cad: error: interrupted", file=sys.stderr)
        sys.exit(130)
    sys.exit(main())


if __name__ == "__main__":
    run()
