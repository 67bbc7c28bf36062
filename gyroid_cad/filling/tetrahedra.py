"""Tetrahedra of a filled part: even triangles on the faces that its bodies share, then the volume between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.kernel.outlines import shared_triangles
from gyroid_cad.kernel.solid import KernelShape
from gyroid_cad.mesh.finite_elements.data import Surface
from gyroid_cad.mesh.finite_elements.elements import require_order
from gyroid_cad.mesh.tetrahedra.data import TetrahedralMesh
from gyroid_cad.mesh.tetrahedra.exact import ExactPanels, PlacedTriangles
from gyroid_cad.mesh.tetrahedra.measures import cell_volumes, mean_ratios, smallest_determinants
from gyroid_cad.mesh.tetrahedra.remesh import Remeshing, narrow_places
from gyroid_cad.mesh.tetrahedra.surface import SurfaceMesh, panels_of
from gyroid_cad.mesh.tetrahedra.volume import Volume, filled_volume, require_netgen, with_middles

__all__ = ["USUAL_THROUGH", "Meshed", "element_length", "require_elements", "tetrahedra_of"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Elements through the wall, if nothing is said.
USUAL_THROUGH = 2.0
_MOST_THROUGH = 0.5, 20.0
_THROUGH = "a number from 0.5 to 20, of elements through the wall"
_SIZES = "a length above 0 mm, and at most the cell size"
# Where there is no wall, in parts of the cell.
_NO_WALL = 1 / 8
# Of the first triangles: largest distance from the faces in parts of the size, and angle between neighbours in degrees.
_DEVIATION, _ANGLE = 0.05, 15.0
# Of the sides by which places on the faces are looked up, in parts of the size.
_LOOKED_UP = 0.5
# Triangles are made finer where they come too near each other, and where elements are poor, so many times.
_TRIES, _TRIES_FOR_QUALITY, _MOST_GIVEN_UP = 6, 1, 2
_FINER = 0.5
# The smallest mean ratio that needs no second try.
_FAIR = 0.15
# Of the volume of each region with sides that follow the faces as quadratic ones do; or, of coarse elements, in parts
# of what moves as straight sides are bent.
_AGREEMENT, _OF_MOVED = 1e-3, 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Meshed:
    """Shapes that are to be meshed together.

    Attributes
    ----------
    shapes : dict of TopoDS_Shape
        By the name of the region.
    face_names : mapping of str to sequence of str
        Names of the faces of each, in the order in which the kernel counts them; if there are none all are "boundary".
    volumes : dict of float
        In mm3.
    """

    shapes: dict[str, KernelShape]
    face_names: Mapping[str, Sequence[str]]
    volumes: dict[str, float]


def require_elements(
    element_size: float | None, elements_through: float | None, order: int, wanted: bool = True
) -> None:
    """Check what is asked of elements, before anything is filled; and that the mesher is there, if any are wanted.

    Raises
    ------
    ParameterError
    """
    require_order(order)
    if element_size is not None and elements_through is not None:
        raise ParameterError("elements_through", elements_through, "none beside element_size, which says the same")
    if element_size is not None and finite_number("element_size", element_size, _SIZES) <= 0:
        raise ParameterError("element_size", element_size, _SIZES)
    if elements_through is not None:
        low, high = _MOST_THROUGH
        if not low <= finite_number("elements_through", elements_through, _THROUGH) <= high:
            raise ParameterError("elements_through", elements_through, _THROUGH)
    if wanted:
        require_netgen()


def element_length(
    element_size: float | None, elements_through: float | None, wall: float | None, cell_size: float
) -> float:
    """Length of the elements' edges, in mm.

    Parameters
    ----------
    element_size : float, optional
        In mm.
    elements_through : float, optional
        Instead, how many elements there are through the wall, about.
    wall : float, optional
        Its smallest thickness, in mm.
    cell_size : float

    Raises
    ------
    ParameterError
        If elements would be larger than a cell.

    Examples
    --------
    >>> element_length(None, None, 0.8, 10.0), element_length(None, 4, 0.8, 10.0), element_length(0.3, None, 0.8, 10.0)
    (0.4, 0.2, 0.3)
    """
    if element_size is None:
        return (wall or cell_size * _NO_WALL) / (elements_through or USUAL_THROUGH)
    if element_size > cell_size:
        raise ParameterError("element_size", element_size, f"at most the cell size, {cell_size:g} mm")
    return float(element_size)


def tetrahedra_of(meshed: Meshed, size: float, order: int, progress: Progress | None = None) -> TetrahedralMesh:
    """Tetrahedra of all shapes, in one mesh.

    Parameters
    ----------
    meshed : Meshed
    size : float
        Length of the edges, in mm.
    order : {1, 2}
        Of 4 nodes, or of 10 that lie on the exact faces in the middles of edges too.
    progress : callable, optional

    Raises
    ------
    KernelError
        If no mesh is found whose elements are sound and whose volumes agree with the bodies'.
    """
    seconds: dict[str, float] = {}
    with timed(seconds, "triangles", progress):
        surface = _Surface(meshed, size)
    surface.work.run(progress)
    with timed(seconds, "tetrahedra", progress):
        mesh, volume = _best(surface, size, order)
    names = [surface.names[panel] for panel in range(len(surface.sides))]
    boundaries = {}
    for name in sorted(set(names)):
        own = np.isin(mesh.panels, [panel for panel, called in enumerate(names) if called == name])
        boundaries[name] = Surface(volume.elements[own, 0], volume.faces[own, 0])
    regions = tuple(meshed.shapes)
    return TetrahedralMesh(volume.points, volume.cells, regions, volume.regions, boundaries, meshed.volumes)


class _Surface:
    """Triangles of all faces, made even, with the panels' regions and names."""

    def __init__(self, meshed: Meshed, size: float) -> None:
        shapes, regions = list(meshed.shapes.values()), list(meshed.shapes)
        shared = shared_triangles(shapes, _DEVIATION * size, np.radians(_ANGLE))
        made = shared.triangles
        called = [
            meshed.face_names[regions[shape]][face] if meshed.face_names.get(regions[shape]) else "boundary"
            for shape, face in shared.first.tolist()
        ]
        # Panels are of one name, and between the same two regions.
        number = np.unique(called, return_inverse=True)[1]
        _, kinds = np.unique(np.column_stack([shared.users, number]), axis=0, return_inverse=True)
        panels = panels_of(made.vertices, made.triangles, kinds.ravel()[made.faces])
        first = np.unique(panels, return_index=True)[1]
        self.sides = shared.users[made.faces[first]]
        self.names = [called[face] for face in made.faces[first].tolist()]
        mesh = SurfaceMesh(made.vertices, made.triangles, panels)
        fine = PlacedTriangles(mesh, made.faces, made.places).finer(shared.surfaces, _LOOKED_UP * size)
        self.exact = ExactPanels(shared.surfaces, shared.surfaces.domains, fine)
        self.work = Remeshing(self.exact, mesh, size)
        self.volumes = np.array([meshed.volumes[name] for name in regions])


@dataclass(frozen=True, slots=True, eq=False)
class _Try:
    """Triangles with the tetrahedra between them, if there are any, and what is amiss with them.

    Where triangles or elements are to be finer there are places, in mm, with the lengths of the edges there.
    """

    mesh: SurfaceMesh
    volume: Volume | None
    smallest_ratio: float
    problem: str
    places: Floats
    lengths: Floats


def _best(surface: _Surface, size: float, order: int) -> tuple[SurfaceMesh, Volume]:
    """Triangles and tetrahedra, the best of some tries.

    Raises
    ------
    KernelError
        If none is sound.
    """
    sound, given_up = list[_Try](), 0
    for _ in range(_TRIES):
        one = _tried(surface, size, order)
        given_up += one.volume is None and not len(one.places)
        if given_up > _MOST_GIVEN_UP or (one.problem and one.volume is not None and not len(one.places)):
            break
        if not one.problem:
            sound.append(one)
            if not len(one.places) or len(sound) > _TRIES_FOR_QUALITY:
                break
        # Where Netgen gives up, other triangles of the same sizes may do.
        surface.work.refine(one.places, _FINER * one.lengths)
    if not sound:
        where = f" near ({', '.join(f'{x:.4g}' for x in one.places[0])}) mm" if len(one.places) else ""
        raise KernelError(f"no mesh of elements of {size:.4g} mm: {one.problem}{where}; another element size may do")
    best = max(sound, key=lambda one: one.smallest_ratio)
    assert best.volume is not None
    return best.mesh, best.volume


def _tried(surface: _Surface, size: float, order: int) -> _Try:
    """Tetrahedra between the triangles as they are now."""
    mesh, nowhere = surface.work.placed(), (np.empty((0, 3)), np.empty(0))
    places, lengths = narrow_places(mesh)
    if len(places):
        return _Try(mesh, None, 0.0, "faces come too near each other", places, lengths)
    try:
        volume = filled_volume(mesh, surface.sides, size)
    except KernelError as failed:
        return _Try(mesh, None, 0.0, str(failed), *nowhere)
    quadratic = with_middles(volume, mesh, surface.exact)
    ratios = mean_ratios(volume.points, volume.cells)
    turned = (smallest_determinants(quadratic.points, quadratic.cells) <= 0) & (order == 2)
    problem = _disagreement(volume, quadratic, surface.volumes)
    if turned.any():
        problem = f"{int(turned.sum())} elements with middles on the faces are turned inside out"
    corners = volume.points[volume.cells[turned | (ratios < _FAIR)]]
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).mean(axis=1)
    chosen = quadratic if order == 2 else volume
    return _Try(mesh, chosen, float(ratios.min()), problem, corners.mean(axis=1), lengths)


def _disagreement(straight: Volume, curved: Volume, exact: Floats) -> str:
    """Message of what is amiss with the regions' volumes, or nothing."""
    before, after = (cell_volumes(one.points, one.cells) for one in (straight, curved))
    found, moved = (
        np.bincount(curved.regions, some, len(exact) + 1)[1:] / exact for some in (after, np.abs(after - before))
    )
    off = np.abs(found - 1)
    agree = off <= np.maximum(_AGREEMENT, _OF_MOVED * moved)
    return "" if agree.all() else f"a region's volume is off by {off[~agree].max():.1e}"
