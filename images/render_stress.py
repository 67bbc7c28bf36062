"""Render the stress that CalculiX finds in a stretched gyroid, with the package's own rasteriser.

Run from the repository's root: ``PYTHONPATH=. python images/render_stress.py``. It solves
``examples/stiffness_in_calculix.py`` anew.
"""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from render_solutions import CELLS, LITTLE_TO_MUCH, SHADES, repeated
from sheet import Sheet, mixed

from examples.stiffness_in_calculix import CELL_SIZE, DENSITY, STRAIN, stiffness
from gyroid_cad import Lattice, Mesh
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_grids
from gyroid_cad.render.picture import CAMERA

Floats = NDArray[np.float64]

SUBDIVISIONS = 4
_SIZE, _BAR_ROOM, _BAR_HEIGHT = (860, 720), 100, 420
# A stretch of a thousandth would not be seen.
_MAGNIFIED = 100
# Steps along each side of an element's face, which is curved.
_FINENESS = 4


def main() -> Path:
    """Draw the von Mises stress on the stretched lattice; lines are the edges of elements."""
    with TemporaryDirectory() as folder:
        job = Path(folder) / "cell"
        stiffness(SUBDIVISIONS, job)
        mesh = Lattice((1, 1, 1), CELL_SIZE, density=DENSITY).hexahedra(SUBDIVISIONS, order=2)
        moved, stress = (nodal(job.with_suffix(".frd"), name, len(mesh.points)) for name in ("DISP", "STRESS"))
    x, y, z, xy, yz, xz = stress.T
    mises = np.sqrt(((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) / 2 + 3 * (xy**2 + yz**2 + xz**2))
    most = float(mises.max())
    step = CELL_SIZE * np.array([1 + _MAGNIFIED * STRAIN, 1, 1])
    places = step * np.array(list(product(range(CELLS), repeat=3)))
    pieces = [repeated(one, places) for one in _surfaces(mesh, mesh.points + _MAGNIFIED * moved, mises / most)]
    sheet = Sheet(_SIZE)
    sheet.put(draw(pieces, (_SIZE[0] - _BAR_ROOM, _SIZE[1]), CAMERA))
    bar = (_SIZE[0] - _BAR_ROOM, (_SIZE[1] - _BAR_HEIGHT) // 2, _BAR_HEIGHT)
    sheet.put_bar(mixed(LITTLE_TO_MUCH, SHADES), most, "MPa", *bar)
    return sheet.save("stress_in_calculix", many_colours=True)


def nodal(path: Path, name: str, nodes: int) -> Floats:
    """A field at the nodes from CalculiX's result file; shape (nodes, components)."""
    block = re.search(rf"^ -4  {name}.*?^ -3", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    assert block is not None
    lines = [line for line in block[0].splitlines() if line.startswith(" -1")]
    values = {int(line[3:13]): [float(line[k : k + 12]) for k in range(13, len(line), 12)] for line in lines}
    return np.array([values[number] for number in range(1, nodes + 1)])


def _surfaces(mesh: Mesh, points: Floats, values: Floats) -> list[Facets]:
    """Every surface of the mesh, its elements' faces as they are curved, coloured by values from 0 to 1."""
    shapes, along_u, along_v = _shape_functions(np.linspace(-1, 1, _FINENESS + 1))
    made = []
    for number, surface in enumerate(mesh.surfaces().values()):
        nodes = mesh.surface_nodes(surface)
        corners = points[nodes]
        places, u, v = (np.einsum("abk,fkx->fabx", functions, corners) for functions in (shapes, along_u, along_v))
        colours = mixed(LITTLE_TO_MUCH, np.einsum("abk,fk->fab", shapes, values[nodes]))
        made.append(facets_of_grids(places, np.cross(u, v), colours, closed=True, surface=number))
    return made


def _shape_functions(along: Floats) -> tuple[Floats, Floats, Floats]:
    """Of a quadrilateral of eight nodes, corners first, and their derivatives, on a grid; shape (n, n, 8) each."""
    u, v = along[:, np.newaxis], along[np.newaxis]
    values, by_u, by_v = [], [], []
    for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        values.append((1 + a * u) * (1 + b * v) * (a * u + b * v - 1) / 4)
        by_u.append(a * (1 + b * v) * (2 * a * u + b * v) / 4)
        by_v.append(b * (1 + a * u) * (a * u + 2 * b * v) / 4)
    for a, b in ((0, -1), (1, 0), (0, 1), (-1, 0)):
        values.append((1 - u**2) * (1 + b * v) / 2 if a == 0 else (1 - v**2) * (1 + a * u) / 2)
        by_u.append(-u * (1 + b * v) if a == 0 else a * (1 - v**2) / 2)
        by_v.append(b * (1 - u**2) / 2 if a == 0 else -v * (1 + a * u))
    shape = (len(along), len(along))
    return tuple(np.stack([np.broadcast_to(one, shape) for one in some], axis=-1) for some in (values, by_u, by_v))


if __name__ == "__main__":
    print(main())
