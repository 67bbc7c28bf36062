"""The paper's mesh, 4 x 3 x 2 cells at 20 x 20 a patch: what it takes beside its bare nodes, and how good it is.

The bare nodes are those of every patch by one matrix product: tensor products of basis functions, one row a node, times
the control points of both faces of all patches, shared nodes over and over. Ours makes each node once, and the
elements. Both in a process with one thread, for ours needs no more, by processor time; writing beside it.

Run: ``python -m benchmarks.meshes [--small]``; ``--small`` has 4 x 4 elements a patch.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.subject import CELL_SIZE
from benchmarks.timing import Row, arguments_for, best_in_turn, best_of, fresh_python, plain_table, print_verdicts
from gyroid_cad.builds.meshes import mesh_quality
from gyroid_cad.common.formats import MESH_FORMATS
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh, hexahedra, quadrilaterals
from gyroid_cad.nurbs.basis import basis

__all__ = ["main"]

_CELLS, _SUBDIVISIONS, _FEW_SUBDIVISIONS = (4, 3, 2), 20, 4
_PATCHES = 576
_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    small = arguments_for("Mesh the paper's lattice.").parse_args(arguments).small
    subdivisions = _FEW_SUBDIVISIONS if small else _SUBDIVISIONS
    expected = _PATCHES * subdivisions**2
    seconds = json.loads(fresh_python("-m", "benchmarks.meshes", "--alone", str(subdivisions), **_THREAD))
    lattice = Lattice(_CELLS, CELL_SIZE, 0.1 * CELL_SIZE)
    quality = mesh_quality(lattice.hexahedra(subdivisions, 3))
    scaled = quality.measures["scaled_jacobian"]
    counts = len(lattice.quadrilaterals(subdivisions).cells), len(lattice.hexahedra(subdivisions).cells)
    rows = [
        Row("quadrilaterals off the paper's number", abs(counts[0] - expected), 0),
        Row("hexahedra off the paper's number", abs(counts[1] - expected), 0),
        Row("hexahedra / nodes by one product", seconds["hexahedra"] / seconds["product"], 5, 2, "x"),
        Row("  and looked at for being inside out", seconds["checked"] / seconds["product"], unit="x"),
        Row("quadrilaterals / nodes of both faces by one product", seconds["quads"] / seconds["product"], unit="x"),
        Row("3 layers at 0.1 L: smallest scaled Jacobian", scaled.smallest, 0.5, at_least=True),
        Row("  mean", scaled.mean, 0.9, at_least=True),
        Row("  turned inside out", quality.inverted, 0),
    ]
    passed = print_verdicts("The paper's mesh", rows)
    _print_writing(lattice.hexahedra(subdivisions))
    return passed


def _print_writing(mesh: Mesh) -> None:
    lines = []
    with TemporaryDirectory() as folder:
        for ending in [ending for form in MESH_FORMATS for ending in form.endings]:
            path = Path(folder) / f"mesh{ending}"
            seconds, _ = best_of(lambda path=path: mesh.write(path), 1)  # type: ignore[misc]
            lines.append((ending, f"{seconds:.2f} s", f"{path.stat().st_size / 1e6:.1f} MB"))
    plain_table(f"{len(mesh.cells):,} hexahedra to files", ("", "processor time", "size"), lines)


def _run_alone(subdivisions: int) -> None:
    lattice = Lattice(_CELLS, CELL_SIZE, 0.1 * CELL_SIZE)
    wall = lattice.fitted().wall
    along = basis(wall.knots, 3, np.linspace(-1, 1, subdivisions + 1))
    functions = np.kron(along, along)
    nets = wall.nets[wall.patch_net] + wall.shifts[wall.patch_shift][:, np.newaxis, np.newaxis, np.newaxis]
    control_points = np.ascontiguousarray(nets.reshape(-1, functions.shape[1], 3).swapaxes(0, 1))
    control_points = control_points.reshape(functions.shape[1], -1)
    product, ours, quads, checked = best_in_turn(
        20,
        lambda: functions @ control_points,
        lambda: hexahedra(wall, subdivisions),
        lambda: quadrilaterals(wall, subdivisions),
        lambda: lattice.hexahedra(subdivisions),
    )
    names = ("product", "hexahedra", "quads", "checked")
    print(json.dumps({name: some[0] for name, some in zip(names, (product, ours, quads, checked), strict=True)}))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        _run_alone(int(sys.argv[2]))
    else:
        sys.exit(not main(sys.argv[1:]))
