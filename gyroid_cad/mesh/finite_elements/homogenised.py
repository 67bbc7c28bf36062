"""Effective elasticity and conductivity of an endless lattice, from one periodic cell of quadratic hexahedra.

The cell is strained, or put in a gradient, along each of six or three ways; what it does besides is periodic, and takes
the least energy (first-order periodic homogenisation; for instance Hassani and Hinton, Computers & Structures 69, 1998,
707-717). scikit-fem assembles, SciPy's SuperLU solves: both are kept by others, and the cell is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import meshio
import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree
from skfem.helpers import ddot, sym_grad, trace
from skfem.io.meshio import from_meshio

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.mesh.finite_elements.data import MeshData
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs

__all__ = ["EffectiveTensors", "homogenised"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of Gauss points: exact for the product of two gradients on an element whose sides are straight.
_RULE = 5
# Along which pairs of axes Voigt's six strains are: xx, yy, zz, yz, xz, xy, the last three as twice the tensor's.
_VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


@dataclass(frozen=True, slots=True, eq=False)
class EffectiveTensors:
    """Stiffness and conductivity of the lattice as a whole, for a solid of Young's modulus 1 and conductivity 1.

    Attributes
    ----------
    stiffness : ndarray, shape (6, 6)
        In Voigt's order xx, yy, zz, yz, xz, xy, with engineering shear strains.
    conductivity : ndarray, shape (3, 3)
    """

    stiffness: Floats
    conductivity: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)


def homogenised(mesh: MeshData, pairs: PeriodicPairs, volume: float, poisson_ratio: float) -> EffectiveTensors:
    """Solve the cell problems of elasticity and of conduction.

    Parameters
    ----------
    mesh : Mesh
        Of one cell, quadratic hexahedra of 27 nodes.
    pairs : PeriodicPairs
        Its own.
    volume : float
        Of the cell, solid and empty, in mm3.
    poisson_ratio : float
        Of the solid.

    Returns
    -------
    EffectiveTensors
    """
    grid = from_meshio(meshio.Mesh(mesh.points, [("hexahedron27", mesh.cells)]))
    scalar = skfem.Basis(grid, skfem.ElementHex2(), intorder=_RULE)
    vector = scalar.with_element(skfem.ElementVector(skfem.ElementHex2()))
    own = _masters(mesh, pairs)
    stiffness = _stiffness(vector, _periodic(vector, mesh, own, 3), poisson_ratio) / volume
    conductivity = _conductivity(scalar, _periodic(scalar, mesh, own, 1)) / volume
    return EffectiveTensors((stiffness + stiffness.T) / 2, (conductivity + conductivity.T) / 2)


def _masters(mesh: MeshData, pairs: PeriodicPairs) -> Integers:
    """Of each node that which it is in the endless lattice."""
    own = np.arange(len(mesh.points))
    own[pairs.second] = pairs.first
    return own


def _periodic(basis: Any, mesh: MeshData, own: Integers, components: int) -> csr_array:
    """Degrees of freedom from those that are their own in the endless lattice, without those of one node.

    That node stays where it is: what is periodic is known but for a shift.
    """
    # The library numbers nodes its own way.
    node = cKDTree(mesh.points).query(basis.doflocs.T)[1]
    component = np.zeros(basis.N, dtype=np.int64)
    for dofs in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs):
        component[dofs] = np.arange(components)[:, np.newaxis]
    number = components * own[node] + component
    free, column = np.unique(number, return_inverse=True)
    held = free // components == free[0] // components
    kept = np.cumsum(~held) - 1
    rows = np.flatnonzero(~held[column])
    shape = (basis.N, int((~held).sum()))
    return csr_array((np.ones(len(rows)), (rows, kept[column[rows]])), shape=shape)


def _stiffness(basis: Any, periodic: csr_array, poisson_ratio: float) -> Floats:
    first = poisson_ratio / (1 + poisson_ratio) / (1 - 2 * poisson_ratio)
    shear = 1 / 2 / (1 + poisson_ratio)
    strains = np.zeros((6, 3, 3))
    for row, (i, j) in enumerate(_VOIGT):
        strains[row, i, j] += 0.5
        strains[row, j, i] += 0.5
    stresses = 2 * shear * strains + first * np.einsum("aii,jk->ajk", strains, np.eye(3))

    def energy(u: Any, v: Any, _: Any) -> Any:
        strain = sym_grad(u)
        return 2 * shear * ddot(strain, sym_grad(v)) + first * trace(strain) * trace(sym_grad(v))

    def load(stress: Floats) -> Any:
        return skfem.LinearForm(lambda v, _: -ddot(stress[:, :, None, None], sym_grad(v))).assemble(basis)

    uniform = np.einsum("aij,bij->ab", stresses, strains) * float(basis.dx.sum())
    loads = np.array([load(stress) for stress in stresses]).T
    return _effective(skfem.BilinearForm(energy).assemble(basis), loads, periodic, uniform)


def _conductivity(basis: Any, periodic: csr_array) -> Floats:
    def energy(u: Any, v: Any, _: Any) -> Any:
        return np.sum(u.grad * v.grad, axis=0)

    def load(axis: int) -> Any:
        return skfem.LinearForm(lambda v, _: -v.grad[axis]).assemble(basis)

    loads = np.array([load(axis) for axis in range(3)]).T
    uniform = np.eye(3) * float(basis.dx.sum())
    return _effective(skfem.BilinearForm(energy).assemble(basis), loads, periodic, uniform)


def _effective(energy: Any, loads: Floats, periodic: csr_array, uniform: Floats) -> Floats:
    """Energies of pairs of ways, less what is gained where the cell gives way."""
    matrix = (periodic.T @ energy @ periodic).tocsc()
    reduced = periodic.T @ loads
    # Symmetric and positive: no pivots are needed, and the ordering may take it for what it is.
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    found = factors.solve(reduced)
    return np.asarray(uniform - reduced.T @ found)
