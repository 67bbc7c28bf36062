"""``python -m gyroid_cad`` and ``gyroid-cad``."""

import os
import sys


def run() -> None:
    """Run the command line and leave with its status."""
    open_standard_streams()
    keep_standard_output()
    try:
        from gyroid_cad.cli.app import main
    except KeyboardInterrupt:  # while what the commands need is loaded
        print("gyroid-cad: error: interrupted", file=sys.stderr)
        sys.exit(130)
    sys.exit(main())


def open_standard_streams() -> None:
    """Open those standard streams that were closed (``>&-``), to nowhere: else the next file takes a stream's place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            # The lowest number that is free: the others below it are open by now.
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", encoding="utf-8", closefd=False))


def keep_standard_output() -> None:
    """Keep standard output for what commands print; what libraries written in C or C++ print there goes nowhere."""
    sys.stdout.flush()
    ours, theirs = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(theirs, 1)
    os.close(theirs)
    line = 1 if os.isatty(ours) else -1
    sys.stdout = os.fdopen(ours, "w", buffering=line, encoding=sys.stdout.encoding, errors=sys.stdout.errors)


if __name__ == "__main__":
    run()
