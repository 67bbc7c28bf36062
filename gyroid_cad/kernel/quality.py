"""Quality of a shape as those who receive it will judge it: its solids, its volume, its edges and its faces."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.gp import gp_Pnt2d, gp_Vec2d
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.common.verdicts import Worst, counted
from gyroid_cad.errors import ExportError, KernelError
from gyroid_cad.kernel.apart import read_shape
from gyroid_cad.kernel.borders import FaceBorders
from gyroid_cad.kernel.check import is_valid, measure_about, parts_of, topology
from gyroid_cad.kernel.edge_quality import edge_quality
from gyroid_cad.kernel.face_quality import face_quality
from gyroid_cad.kernel.sampled import SampledShape
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.nurbs.quadrature import SquareQuadrature
from gyroid_cad.nurbs.surface import face_integrals
from gyroid_cad.trim.surfaces import Quadric

__all__ = ["ShapeQuality", "file_quality", "shape_quality"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Along a use of an edge: pieces, and Gauss points of each.
_PIECES, _PER_PIECE = 32, 3
# Trimmed faces that are sampled together.
_AT_ONCE = 32


@dataclass(frozen=True, slots=True)
class ShapeQuality:
    """Counts of a shape, its volume, and the worst of everything that was measured.

    Attributes
    ----------
    solids, faces : int
    closed : bool
        Whether there are solids, and every edge bounds two faces, once each way.
    valid : bool
        By the kernel's own check.
    volume : float
        In mm3; below 0 of what is inside out, and of no meaning where the shape is not closed.
    worst : dict of str to Worst
        By name, as of :func:`gyroid_cad.kernel.edge_quality.edge_quality` and
        :func:`gyroid_cad.kernel.face_quality.face_quality`; "open edges", "open borders" of faces and "invalid faces",
        which are counted, besides.
    """

    solids: int
    faces: int
    closed: bool
    valid: bool
    volume: float
    worst: dict[str, Worst]


def file_quality(path: str | os.PathLike[str], progress: Progress | None = None) -> ShapeQuality:
    """Measure the shape of a STEP or BREP file, as :func:`shape_quality` does.

    Raises
    ------
    ExportError
        If it cannot be read or holds no face.
    KernelError
        If the kernel fails at it.
    """
    report_progress(progress, "read", 0, 1)
    shape = read_shape(path)
    if next(parts_of(shape, TopAbs_FACE), None) is None:
        raise ExportError(f"{path} holds no face: there is nothing to check")
    try:
        return shape_quality(shape, progress)
    except Standard_Failure as failed:
        raise KernelError(f"{path} could not be checked: the kernel failed: {failed}") from failed


def shape_quality(shape: TopoDS_Shape, progress: Progress | None = None) -> ShapeQuality:
    """Measure a shape, whoever made it.

    Parameters
    ----------
    shape : TopoDS_Shape
    progress : callable, optional
        Called with (stage, done, total).
    """
    report_progress(progress, "kernel's check", 0, 1)
    counts, valid = topology(shape), is_valid(shape)
    report_progress(progress, "edges", 0, 1)
    sampled = SampledShape(shape)
    edges = edge_quality(sampled)
    report_progress(progress, "volume", 0, 1)
    flux, areas = _measures(sampled)
    report_progress(progress, "faces", 0, 1)
    uses = np.bincount(sampled.borders.edge[sampled.uses], minlength=len(sampled.edges))
    middles = sampled.points[:, sampled.points.shape[1] // 2]
    faces = face_quality(sampled, areas)
    degree = max(edges["degree"], faces["degree"], key=lambda found: float(found.value or 0))
    unmatched = Worst(counts.open_edges, counted(middles[sampled.real & (uses != 2)]).place)
    return ShapeQuality(
        solids=counts.solids,
        faces=counts.faces,
        closed=counts.closed,
        valid=valid,
        volume=float(flux.sum()),
        worst={
            "open edges": unmatched,
            "open borders": Worst(len(sampled.open_borders)),
            "invalid faces": Worst(0) if valid else _invalid(sampled),
            **edges,
            **faces,
            "degree": degree,
        },
    )


def _invalid(sampled: SampledShape) -> Worst:
    """Count the faces that the kernel's check does not pass, and a place on the first."""
    check, borders = BRepCheck_Analyzer(sampled.shape, True), sampled.borders
    faces = np.array([number for number, face in enumerate(sampled.faces) if not check.IsValid(face)], dtype=np.int64)
    first = borders.edge[borders.loops[np.searchsorted(borders.face, faces)]]
    return counted(sampled.points[first, 0])


def _measures(sampled: SampledShape) -> tuple[Floats, Floats]:
    """Flux of (p - middle) / 3 through each face in mm3, which add up to the volume, and its area in mm2.

    By quadrature in arrays of B-spline faces, whole and trimmed; of others as the kernel integrates them.
    """
    surfaces, borders, count = sampled.surfaces, sampled.borders, len(sampled.faces)
    middle = np.nanmean(sampled.points, axis=(0, 1)) if sampled.real.any() else np.zeros(3)
    sums, known = np.zeros((count, 2)), np.zeros(count, dtype=bool)
    signs = np.array([-1.0 if face.Orientation() == TopAbs_REVERSED else 1.0 for face in sampled.faces])
    whole = borders.owner[borders.whole_patches(surfaces.domains)[:, 0]]
    known[whole] = True
    for splines, members in surfaces.in_groups():
        one, nets = splines.first, splines.nets - middle
        entire = np.flatnonzero(known[members])
        found = face_integrals(nets[entire], one.weights, (one.knots_u, one.knots_v), *one.quadrature())
        sums[members[entire]] = found[:, [0, 4]]
        trimmed = np.flatnonzero(~known[members])
        if len(trimmed) and np.array_equal(one.knots_u, one.knots_v) and not one.rational:
            quadrature = SquareQuadrature(one.knots_u)
            for some in np.array_split(trimmed, -(-len(trimmed) // _AT_ONCE)):
                for face, density in zip(
                    members[some].tolist(), quadrature.densities(nets[some], one.weights), strict=True
                ):
                    sums[face] = _trimmed(borders, face, quadrature, density)
            known[members[trimmed]] = True
    for number in np.flatnonzero(~known).tolist():
        plane = surfaces.others.get(number)
        if isinstance(plane, Quadric) and plane.kind == "plane":
            sums[number] = _flat(sampled, number, plane, middle)
            known[number] = True
    sums[:, 0] *= signs
    for number in np.flatnonzero(~known).tolist():
        sums[number] = measure_about(sampled.faces[number], middle)
    return sums[:, 0], sums[:, 1]


def _trimmed(borders: FaceBorders, face: int, quadrature: SquareQuadrature, density: Floats) -> Floats:
    """Flux and area of a face on part of a surface, by Green's theorem along its border."""
    parts, weights = gauss_points(np.linspace(0, 1, _PIECES + 1), _PER_PIECE)
    places, rates = [], []
    first, end = borders.loops[np.searchsorted(borders.face, [face, face + 1])].tolist()
    for use in range(first, end):
        place, rate = _along(borders, use, parts)
        places.append(place)
        rates.append(rate[:, 1] * weights * (1.0 if borders.along[use] else -1.0))
    return quadrature.over(np.concatenate(places), np.concatenate(rates), density)[[0, 4]]


def _flat(sampled: SampledShape, face: int, plane: Quadric, middle: Floats) -> Floats:
    """Flux and area of a plane face, by its area vector, the integral of r x dr / 2 round its border."""
    borders, total = sampled.borders, np.zeros(3)
    parts, weights = gauss_points(np.linspace(0, 1, _PIECES + 1), _PER_PIECE)
    first, end = borders.loops[np.searchsorted(borders.face, [face, face + 1])].tolist()
    for use in range(first, end):
        if sampled.real[borders.edge[use]]:
            points, rates = sampled.along(int(borders.edge[use]), parts)
            total += weights @ np.cross(points - middle, rates) / (2.0 if borders.along[use] else -2.0)
    # As the plane's own normal goes, with which the face's border runs.
    area = float(total @ plane.axes[2]) * plane.handed
    return np.array([area * plane.handed * float((plane.origin - middle) @ plane.axes[2]) / 3, abs(area)])


def _along(borders: FaceBorders, use: int, parts: Floats) -> tuple[Floats, Floats]:
    """Parameters along a use of an edge, (n, 2), and their derivatives by the part of its range."""
    curve = borders.curves.get(use)
    if curve is None:
        start, end = borders.ends[use]
        return start + parts[:, np.newaxis] * (end - start), np.broadcast_to(end - start, (len(parts), 2))
    low, high = curve.FirstParameter(), curve.LastParameter()
    point, rate, found = gp_Pnt2d(), gp_Vec2d(), np.empty((2, len(parts), 2))
    for index, t in enumerate((low + parts * (high - low)).tolist()):
        curve.D1(t, point, rate)
        found[:, index] = point.Coord(), rate.Coord()
    return found[0], found[1] * (high - low)
