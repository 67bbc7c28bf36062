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
from scipy.sparse import csr_array, kron
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree
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
    basis = skfem.Basis(grid, skfem.ElementHex2(), intorder=_RULE)
    # The library numbers nodes its own way.
    own = _masters(mesh, pairs)[cKDTree(mesh.points).query(basis.doflocs.T)[1]]
    rates = _Rates(basis)
    stiffness = _stiffness(rates, _periodic(own, 3), poisson_ratio) / volume
    conductivity = _conductivity(rates, _periodic(own, 1)) / volume
    return EffectiveTensors((stiffness + stiffness.T) / 2, (conductivity + conductivity.T) / 2)


def _masters(mesh: MeshData, pairs: PeriodicPairs) -> Integers:
    """Of each node that which it is in the endless lattice."""
    own = np.arange(len(mesh.points))
    own[pairs.second] = pairs.first
    return own


def _periodic(own: Integers, components: int) -> csr_array:
    """Degrees of freedom from those that are their own in the endless lattice, without those of one node.

    That node stays where it is: what is periodic is known but for a shift.
    """
    number = (components * own[:, np.newaxis] + np.arange(components)).ravel()
    free, column = np.unique(number, return_inverse=True)
    held = free // components == free[0] // components
    kept = np.cumsum(~held) - 1
    rows = np.flatnonzero(~held[column])
    return csr_array((np.ones(len(rows)), (rows, kept[column[rows]])), shape=(len(number), int((~held).sum())))


class _Rates:
    """Integrals of products of two functions' rates of change, by pairs of axes, and of one function's; and the volume.

    All energies are sums of these, which are assembled once.
    """

    def __init__(self, basis: Any) -> None:
        def product(a: int, b: int) -> Any:
            return skfem.BilinearForm(lambda u, v, _: v.grad[a] * u.grad[b]).assemble(basis)

        self.products = {(a, b): product(a, b) for a in range(3) for b in range(a, 3)}
        self.products |= {(b, a): matrix.T for (a, b), matrix in self.products.items() if a != b}
        single = (skfem.LinearForm(lambda v, _, a=a: v.grad[a]).assemble(basis) for a in range(3))
        self.single = np.array(list(single))
        self.square = sum(self.products[a, a] for a in range(3))
        self.volume = float(basis.dx.sum())


def _stiffness(rates: _Rates, periodic: csr_array, poisson_ratio: float) -> Floats:
    first = poisson_ratio / (1 + poisson_ratio) / (1 - 2 * poisson_ratio)
    shear = 1 / 2 / (1 + poisson_ratio)
    strains = np.zeros((6, 3, 3))
    for row, (i, j) in enumerate(_VOIGT):
        strains[row, i, j] += 0.5
        strains[row, j, i] += 0.5
    stresses = 2 * shear * strains + first * np.einsum("aii,jk->ajk", strains, np.eye(3))
    energy = kron(rates.square, shear * np.eye(3))
    for (a, b), product in rates.products.items():
        place = np.zeros((3, 3))
        place[a, b] += first
        place[b, a] += shear
        energy = energy + kron(product, place)
    loads = -np.einsum("kab,bn->nak", stresses, rates.single).reshape(-1, len(stresses))
    uniform = np.einsum("aij,bij->ab", stresses, strains) * rates.volume
    return _effective(energy, loads, periodic, uniform)


def _conductivity(rates: _Rates, periodic: csr_array) -> Floats:
    return _effective(rates.square, -rates.single.T, periodic, np.eye(3) * rates.volume)


def _effective(energy: Any, loads: Floats, periodic: csr_array, uniform: Floats) -> Floats:
    """Energies of pairs of ways, less what is gained where the cell gives way."""
    matrix = (periodic.T @ energy @ periodic).tocsc()
    reduced = periodic.T @ loads
    # Symmetric and positive: no pivots are needed, and the ordering may take it for what it is.
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    found = factors.solve(reduced)
    return np.asarray(uniform - reduced.T @ found)
