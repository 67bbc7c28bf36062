"""Netgen's volume mesher, run in a process of its own: it prints as it goes, and brings a kernel of its own.

``python -m gyroid_cad.mesh.tetrahedra.netgen_run GIVEN.npz MADE.npz`` reads points, triangles, their panels, the
regions on both sides of each panel, and a size; it writes points, tetrahedra and the region of each.
"""

from __future__ import annotations

import sys

import netgen.meshing as mesher
import numpy as np

__all__ = ["tetrahedra_in_file"]

# How much sizes grow away from the surface (Netgen's "moderate" is 0.3, its "coarse" 0.5).
_GRADING = 0.4


def tetrahedra_in_file(given: str, made: str) -> None:
    """Fill what triangles bound with tetrahedra.

    Parameters
    ----------
    given, made : str
        Names of the files.
    """
    data = np.load(given)
    mesh = mesher.Mesh(dim=3)
    numbers = [mesh.Add(mesher.MeshPoint(mesher.Pnt(*point))) for point in data["points"].tolist()]
    faces = [
        mesh.Add(mesher.FaceDescriptor(surfnr=panel, domin=inside, domout=outside, bc=panel))
        for panel, (inside, outside) in enumerate(data["sides"].tolist(), 1)
    ]
    for corners, panel in zip(data["triangles"].tolist(), data["panels"].tolist(), strict=True):
        mesh.Add(mesher.Element2D(faces[panel], [numbers[corner] for corner in corners]))
    mesh.GenerateVolumeMesh(maxh=float(data["size"]), grading=_GRADING)
    elements = mesh.Elements3D().NumPy()
    # Its own sense of turning is the opposite one.
    cells = elements["nodes"][:, [0, 2, 1, 3]].astype(np.int64) - 1 if len(elements) else np.empty((0, 4), np.int64)
    points = np.array([point.p for point in mesh.Points()])
    np.savez(made, points=points, cells=cells, regions=elements["index"].astype(np.int64))


if __name__ == "__main__":
    tetrahedra_in_file(*sys.argv[1:])
