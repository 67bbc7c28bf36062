"""Files of trivariate patches as MFEM and G+Smo read them, and what both assemble on them."""

from __future__ import annotations

from pathlib import Path

import mfem.ser as mfem
import numpy as np
import pygismo
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import spsolve

from gyroid_cad.mesh.iga.patches import VolumePatches

Floats = NDArray[np.float64]

# MFEM's attributes of the boundary.
SIDE_0, SIDE_1, FREE = range(1, 4)


class Problem:
    """A mesh file as MFEM reads it, with the space of its own patches."""

    def __init__(self, volumes: VolumePatches, folder: Path, refinements: int = 0) -> None:
        self.volumes, self.folder = volumes, folder
        volumes.write(folder / "wall.mesh")
        self.mesh = mfem.Mesh(str(folder / "wall.mesh"))
        for _ in range(refinements):
            self.mesh.UniformRefinement()
        self.space = mfem.FiniteElementSpace(self.mesh, self.mesh.GetNodes().OwnFEC())

    @property
    def nodes(self) -> Floats:
        """Control points as MFEM numbers them."""
        nodes = self.mesh.GetNodes()
        return np.stack(
            [
                nodes.GetDataArray()[[nodes.FESpace().DofToVDof(i, c) for i in range(self.space.GetNDofs())]]
                for c in range(3)
            ],
            axis=1,
        )

    def numbers(self) -> NDArray[np.int64]:
        """Our numbers of MFEM's control points."""
        self.volumes.write_field(np.arange(len(self.volumes.control_points)), self.folder / "numbers.gf")
        return mfem.GridFunction(self.mesh, str(self.folder / "numbers.gf")).GetDataArray().astype(np.int64)

    def integral(self, degree: int = 9) -> float:
        """Of 1, by a rule for polynomials of a degree along each parameter."""
        integrator = mfem.DomainLFIntegrator(mfem.ConstantCoefficient(1.0))
        integrator.SetIntRule(mfem.IntRules.Get(mfem.Geometry.CUBE, degree))
        form = mfem.LinearForm(self.space)
        form.AddDomainIntegrator(integrator)
        form.Assemble()
        return float(np.sum(form.GetDataArray()))

    def inflow(self, field: mfem.VectorCoefficient) -> Floats:
        """What flows in through the boundary, all of it, by control point."""
        form = mfem.LinearForm(self.space)
        # Rules for degree 2 * 3 + 3, for a cubic function on a normal of degree 5.
        form.AddBoundaryIntegrator(mfem.BoundaryNormalLFIntegrator(field, 2, 3))
        form.Assemble()
        return form.GetDataArray().copy()

    def matrix(self, *integrators: mfem.BilinearFormIntegrator) -> csr_array:
        form = mfem.BilinearForm(self.space)
        for integrator in integrators:
            form.AddDomainIntegrator(integrator)
        form.Assemble()
        form.Finalize()
        matrix = form.SpMat()
        arrays = (matrix.GetDataArray().copy(), matrix.GetJArray().copy(), matrix.GetIArray().copy())
        return csr_array(arrays, shape=(matrix.Height(), matrix.Width()))

    def stiffness(self) -> csr_array:
        return self.matrix(mfem.DiffusionIntegrator(mfem.ConstantCoefficient(1.0)))

    def on_boundary(self, *parts: int) -> NDArray[np.bool_]:
        """Which control points belong to parts of the boundary, by MFEM's attributes."""
        marker, found = mfem.intArray([int(part in parts) for part in (SIDE_0, SIDE_1, FREE)]), mfem.intArray()
        self.space.GetEssentialTrueDofs(marker, found)
        chosen = np.zeros(self.space.GetNDofs(), dtype=bool)
        chosen[found.ToList()] = True
        return chosen


class Multipatch:
    """A multipatch file as G+Smo reads it, with its own numbering of the degrees of freedom."""

    def __init__(self, volumes: VolumePatches, folder: Path) -> None:
        volumes.write(folder / "wall.xml")
        self.patches = pygismo.core.gsMultiPatch()
        pygismo.io.gsReadFile(str(folder / "wall.xml"), self.patches)
        self.bases = pygismo.core.gsMultiBasis(self.patches)
        self.mapper = pygismo.assembler.createMapper(self.bases, self.patches, 1, True, True)

    def numbers(self) -> NDArray[np.int64]:
        """G+Smo's number of every control point of every patch, u fastest."""
        return np.asarray(self.mapper.asVector(0), dtype=np.int64).reshape(self.patches.nPatches(), -1)

    def stiffness(self) -> csr_array:
        """Assembled by G+Smo patch by patch, with two points more than the degree, and joined by its own mapper."""
        options = pygismo.io.gsOptionList()
        options.addReal("quA", "points per degree", 1.0)
        options.addInt("quB", "points more", 2)
        terms = {"alpha": 0.0, "beta": 1.0, "gamma": 0.0}
        apart = pygismo.utils.gsH1Projection.matrix(self.bases, self.patches, targetDim=1, options=options, **terms)
        numbers = self.numbers().ravel()
        join = csr_array((np.ones(len(numbers)), (np.arange(len(numbers)), numbers)))
        return csr_array(join.T @ csr_array(apart) @ join)


def solved(matrix: csr_array, sources: Floats, values: Floats, known: NDArray[np.bool_]) -> Floats:
    """Values where they are known, and elsewhere such that the matrix makes the sources of them."""
    free = ~known
    result = np.where(known, values, 0.0)
    result[free] = spsolve(csc_array(matrix[free][:, free]), (sources - matrix @ result)[free])
    return result


def u_fastest(net: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.swapaxes(net, 1, 3).reshape(len(net), -1)
