"""Rebuild every picture of the README from nothing: ``python images/rebuild.py``.

Examples that a picture shows run first, in a folder of their own. CalculiX (``ccx``) must be installed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parent
# Scripts, and the example that leaves what they draw, if any.
_SCRIPTS = (
    ("render.py", None),
    ("render_bonnet.py", None),
    ("render_quality.py", None),
    ("render_stress.py", None),
    ("render_parts.py", "light_bracket.py"),
    ("render_exchanger.py", "counter_flow_in_cadquery.py"),
    ("render_solutions.py", "isogeometric_heat.py"),
)


def main() -> None:
    """Run every script, the examples first."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    for script, example in _SCRIPTS:
        with TemporaryDirectory() as folder:
            if example is not None:
                _run([str(ROOT / "examples" / example)], folder, environment)
            _run([str(FOLDER / script), *([folder] if example else [])], str(ROOT), environment)


def _run(arguments: list[str], folder: str, environment: dict[str, str]) -> None:
    subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, check=True)


if __name__ == "__main__":
    main()
