"""Meshes of a lattice's wall, checked: whole patches only, and no element turned inside out."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gyroid_cad.builds.triangles import TriangleReport, Triangles, triangle_report, triangles
from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.choices import Trim
from gyroid_cad.common.formats import require_meshing
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh, hexahedra, quadrilaterals
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs, periodic_pairs
from gyroid_cad.mesh.finite_elements.quality import Quality, inverted, quality_report
from gyroid_cad.mesh.iga.patches import VolumePatches, wall_volumes
from gyroid_cad.wall.fitted import FittedWall, LatticeSpec

__all__ = ["LatticeMeshes", "hexahedral_mesh", "mesh_quality"]

_QUADRILATERAL_CORNERS = 4


def hexahedral_mesh(fitted: FittedWall, subdivisions: int, layers: int, order: int, full: bool) -> Mesh:
    """Hexahedra of a lattice's wall; see :func:`gyroid_cad.mesh.finite_elements.hexahedra.hexahedra`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed, or an element would be turned inside out: then it says where.
    """
    _require_whole_patches(fitted)
    mesh = hexahedra(fitted.wall, subdivisions, layers, order, full)
    # Of patches that are alike one is looked at.
    patches = np.unique(fitted.wall.patch_net, return_index=True)[1]
    nodes = mesh.cells.shape[1]
    elements = mesh.cells.reshape(fitted.complex.patch_count, -1, nodes)[patches].reshape(-1, nodes)
    bad = inverted(mesh.points, elements)
    if len(bad.elements):
        worst = int(np.argmin(bad.determinants))
        where = ", ".join(f"{x:.4g}" for x in bad.places[worst])
        raise ParameterError(
            "thickness",
            fitted.max_thickness,
            f"a thinner wall, or more than {subdivisions} subdivisions: near ({where}) mm an element of the mesh is "
            f"turned inside out, and {len(bad.elements) - 1} others of {len(elements)}",
        )
    return mesh


def _quadrilateral_mesh(fitted: FittedWall, subdivisions: int, order: int, full: bool) -> Mesh:
    """Quadrilaterals of a lattice's mid-surface; see :func:`gyroid_cad.mesh.finite_elements.hexahedra.quadrilaterals`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed.
    """
    _require_whole_patches(fitted)
    return quadrilaterals(fitted.wall, subdivisions, order, full)


def _lattice_volumes(fitted: FittedWall, degree: int) -> VolumePatches:
    """A lattice's wall as trivariate patches; see :func:`gyroid_cad.mesh.iga.patches.wall_volumes`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed.
    """
    _require_whole_patches(fitted)
    return wall_volumes(fitted.wall, degree)


class HasWall(Protocol):
    """Stands for :class:`gyroid_cad.Lattice`."""

    @property
    def cell_size(self) -> float: ...

    @property
    def trim(self) -> Trim | None: ...

    @property
    def wall_thickness(self) -> float: ...

    @property
    def volume_fraction(self) -> float: ...

    @property
    def exact_volume(self) -> float: ...

    def fitted(self, progress: Progress | None = None) -> FittedWall: ...

    def spec(self) -> LatticeSpec: ...

    def deviation(self, given: float | None = None) -> float: ...

    def triangles(self, deviation: float | None = None, progress: Progress | None = None) -> Triangles: ...


class LatticeMeshes:
    """Mixin of :class:`gyroid_cad.Lattice`: triangles and meshes of its wall, of which no kernel is asked."""

    __slots__ = ()

    def triangles(self: HasWall, deviation: float | None = None, progress: Progress | None = None) -> Triangles:
        """The triangles behind STL and 3MF files of whole patches; no kernel is asked.

        Parameters
        ----------
        deviation : float, optional
            As of :meth:`write`.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError
            If the lattice is trimmed, or a patch would take too many triangles.
        FitError
            If the fit's edges do not meet those of its neighbours.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).triangles(deviation=0.2).write("cell.3mf")
        """
        if self.trim:
            raise ParameterError(
                "trim", self.trim, "none: triangles of a trimmed lattice are the kernel's, of its solid"
            )
        if deviation is not None:
            deviation = finite_number("deviation", deviation, "a length in mm, a finite number")
            require_meshing(deviation)
        # The wall first, so that its progress is told.
        self.fitted(progress)
        return triangles(self.spec(), self.deviation(deviation), progress)

    def triangle_report(
        self: HasWall, deviation: float | None = None, progress: Progress | None = None
    ) -> TriangleReport:
        """Make the triangles if they aren't yet, and say what they are; nothing is written.

        Examples
        --------
        >>> report = Lattice((1, 1, 1), 10, thickness=0.8).triangle_report(deviation=0.2)
        >>> report.deviation <= 0.2, report.patches
        (True, 24)
        """
        made = self.triangles(deviation, progress)
        with timed(made.seconds, "report", progress):
            measures = (self.wall_thickness, self.volume_fraction, self.exact_volume)
        return triangle_report(made, *measures)

    def hexahedra(self: HasWall, subdivisions: int, layers: int = 1, order: int = 1, full: bool = False) -> Mesh:
        """The wall as structured hexahedra that share their nodes; no kernel is asked.

        Parameters
        ----------
        subdivisions : int
            Elements along each side of a patch; a gyroid's cell has 24 patches.
        layers : int
            Across the wall.
        order : {1, 2}
            Elements of 8 nodes, or of 20.
        full : bool
            Quadratic elements of 27 nodes.

        Returns
        -------
        Mesh
            Which :meth:`gyroid_cad.Mesh.write` puts into files and :func:`gyroid_cad.mesh_quality` measures.

        Raises
        ------
        ParameterError
            Also if memory would not do, or an element would be turned inside out.

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(4, layers=2)
        >>> mesh.cells.shape
        (768, 8)
        """
        return hexahedral_mesh(self.fitted(), subdivisions, layers, order, full)

    def quadrilaterals(self: HasWall, subdivisions: int, order: int = 1, full: bool = False) -> Mesh:
        """The mid-surface as structured quadrilaterals, as of :meth:`hexahedra`; quadratic ones of 8 nodes, or of 9.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).quadrilaterals(4).cells.shape
        (384, 4)
        """
        return _quadrilateral_mesh(self.fitted(), subdivisions, order, full)

    def volumes(self: HasWall, degree: int = 1) -> VolumePatches:
        """The wall as trivariate NURBS patches that share their control points, for isogeometric analysis.

        Parameters
        ----------
        degree : {1, 3}
            Across the wall; 3 along it.

        Returns
        -------
        VolumePatches
            Which :meth:`gyroid_cad.VolumePatches.write` puts into files.

        Raises
        ------
        ParameterError

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes(degree=3)
        >>> volumes.degrees, volumes.rational
        ((3, 3, 3), False)
        """
        return _lattice_volumes(self.fitted(), degree)

    def periodic_pairs(self: HasWall, mesh: Mesh) -> PeriodicPairs:
        """Nodes of the lattice's mesh that are one and the same where the next block of cells would join.

        Examples
        --------
        >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8)
        >>> pairs = lattice.periodic_pairs(lattice.hexahedra(2))
        >>> len(pairs.first) == len(pairs.second)
        True
        """
        return periodic_pairs(mesh, self.cell_size, self.spec().frame.rotation)


def mesh_quality(mesh: Mesh) -> Quality:
    """Measure the quality of a mesh's elements; of quadrilaterals the corners are measured.

    Parameters
    ----------
    mesh : Mesh

    Returns
    -------
    Quality

    Examples
    --------
    >>> from gyroid_cad import Lattice, mesh_quality
    >>> quality = mesh_quality(Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(4))
    >>> quality.inverted, bool(quality.measures["scaled_jacobian"].smallest > 0.5)
    (0, True)
    """
    return quality_report(mesh.points, mesh.cells if mesh.layers else mesh.cells[:, :_QUADRILATERAL_CORNERS])


def _require_whole_patches(fitted: FittedWall) -> None:
    if fitted.spec.trimmed:
        raise ParameterError("trim", "box", "none with meshes and volumes, which are made of whole patches")
