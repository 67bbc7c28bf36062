"""Draw the paper's figures from this code: ``python docs/figures [name ...]``, all of them if no name is given.

They are written to docs/images. Needs matplotlib, and VTK, which CadQuery brings.
"""

from __future__ import annotations

import sys
import time
from types import ModuleType

import cells
import meshes
import patches
import plane
import tutorials

MODULES: tuple[ModuleType, ...] = (plane, patches, cells, meshes, tutorials)


def main(names: list[str]) -> None:
    """Draw the figures of these names, or all."""
    makers = {name: make for module in MODULES for name, make in vars(module).items() if name.startswith("fig_")}
    for name in names or sorted(makers):
        start = time.perf_counter()
        target = makers[name]()
        print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB in {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
