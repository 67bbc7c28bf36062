"""Check of the files in ``dist/``: the sdist holds what git knows, the wheel the package of it, and nothing else."""

from __future__ import annotations

import subprocess
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
ADDED_TO_SDIST = {"PKG-INFO"}
# What is no Python is soon left out.
DATA = {"gyroid_cad/py.typed", "gyroid_cad/printing/printers.toml"}


def known_to_git() -> set[str]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(listed.stdout.split("\0")) - {""}


def in_wheel(path: Path) -> set[str]:
    with zipfile.ZipFile(path) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def in_sdist(path: Path) -> set[str]:
    with tarfile.open(path) as archive:
        return {str(PurePosixPath(*PurePosixPath(member.name).parts[1:])) for member in archive if not member.isdir()}


def main() -> None:
    (wheel,), (sdist,) = (ROOT / "dist").glob("*.whl"), (ROOT / "dist").glob("*.tar.gz")
    known = known_to_git()
    package = {name for name in known if name.startswith("gyroid_cad/")}
    assert package >= DATA, DATA - package
    for found, wanted in ((in_wheel(wheel), package), (in_sdist(sdist), known | ADDED_TO_SDIST)):
        assert found == wanted, f"too many: {sorted(found - wanted)}, missing: {sorted(wanted - found)}"


if __name__ == "__main__":
    main()
