"""Quality of a shape's edges: their length, how near they come to faces and to each other, how smoothly faces meet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.GeomAbs import GeomAbs_BezierCurve, GeomAbs_BSplineCurve, GeomAbs_CN
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Pnt

from gyroid_cad.common.arrays import dot, unit
from gyroid_cad.common.verdicts import Worst, as_point, largest, smallest
from gyroid_cad.kernel.compat import RealArray, as_vertex
from gyroid_cad.kernel.sampled import SampledShape

__all__ = ["edge_quality"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Faces are meant to be smooth across an edge where, at most places along it, their normals are within so many degrees.
_MEANT_SMOOTH = 5.0
# Up to here the distance to the place of the same parameter is told, in mm; above, the nearest place is looked for.
_ANYWAY = 1e-4
# At so many places the nearest one is looked for, which takes a millisecond each.
_LOOKED_AT = 500
# Of a curve's range of parameters.
_SAME_KNOT = 1e-9


def edge_quality(sampled: SampledShape) -> dict[str, Worst]:
    """Measure the edges of a shape.

    Returns
    -------
    dict of str to Worst
        "smallest edge" and "smallest segment" (between neighbouring knots of an edge's curve), "gap of edge and face"
        and "gap of edges" (their ends at a vertex), all in mm; "tangency", the angle of normals in degrees across edges
        meant to be smooth; "sharpest corner", the angle between neighbouring edges of a face in degrees; "degree of
        curves"; "largest tolerance" of edges and vertices in mm.
    """
    middles = sampled.points[:, len(sampled.parts) // 2]
    segments = [_shortest_segment(curve) for curve in sampled.curves]
    lengths = np.array([length for length, _ in segments])
    degrees = np.array([_degree(curve) for curve in sampled.curves])
    return {
        "smallest edge": smallest(sampled.lengths, middles),
        "smallest segment": smallest(lengths, np.array([place for _, place in segments]).reshape(-1, 3)),
        "gap of edge and face": _off_faces(sampled),
        "gap of edges": _apart_at_vertices(sampled),
        "tangency": _tangency(sampled),
        "sharpest corner": _sharpest_corner(sampled),
        "degree": largest(np.where(degrees > 0, degrees, np.nan), middles),
        "largest tolerance": _largest_tolerance(sampled),
    }


def _shortest_segment(curve: Any) -> tuple[float, tuple[float, float, float]]:
    """Length of the shortest piece between neighbouring knots of an edge's curve, and where it is; NaN of no spline.

    Pieces of which the edge takes up a part only, where it ends between two knots, are left out.
    """
    none = np.nan, (np.nan,) * 3
    if curve is None or curve.GetType() != GeomAbs_BSplineCurve:
        return none
    count = curve.NbIntervals(GeomAbs_CN)
    knots = RealArray(1, count + 1)
    curve.Intervals(knots, GeomAbs_CN)
    values = np.array([knots.Value(k) for k in range(1, count + 2)])
    # The middle of each is looked at too: a closed curve may be one segment.
    t = np.interp(np.arange(2 * count + 1) / 2, np.arange(count + 1), values)
    points = np.array([curve.Value(one).Coord() for one in t.tolist()])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1).reshape(-1, 2).sum(axis=1)
    spline = curve.BSpline()
    own = np.array([spline.Knot(k) for k in range(1, spline.NbKnots() + 1)])
    cut = np.abs(own[:, np.newaxis] - values[[0, -1]]).min(axis=0) > _SAME_KNOT * np.ptp(own)
    lengths[[0, -1]] = np.where(cut, np.inf, lengths[[0, -1]])
    shortest = int(np.argmin(lengths))
    return (float(lengths[shortest]), as_point(points[2 * shortest + 1])) if np.isfinite(lengths[shortest]) else none


def _degree(curve: Any) -> int:
    splines = (GeomAbs_BSplineCurve, GeomAbs_BezierCurve)
    return int(curve.Degree()) if curve is not None and curve.GetType() in splines else 0


def _off_faces(sampled: SampledShape) -> Worst:
    """Largest distance of an edge from a face that it bounds."""
    _, on_face, _ = sampled.on_faces
    points = sampled.points[sampled.borders.edge[sampled.uses]]
    apart = np.linalg.norm(on_face - points, axis=-1)
    if not apart.size:
        return Worst()
    # The nearest place is at most as far off as that of the same parameter: the largest of those bounds are looked at.
    worst, found = -1.0, Worst()
    for rank, place in enumerate(np.argsort(-apart, axis=None).tolist()):
        use, index = divmod(place, apart.shape[1])
        bound = float(apart[use, index])
        if bound <= worst:
            break
        known = bound <= _ANYWAY or rank >= _LOOKED_AT
        away = bound if known else min(bound, _distance(sampled, use, points[use, index]))
        if away > worst:
            worst, found = away, Worst(away, as_point(points[use, index]))
    return found


def _distance(sampled: SampledShape, use: int, point: Floats) -> float:
    """Distance of a point from the surface of the face of a use, within its bounds, as the kernel finds it."""
    surface = BRep_Tool.Surface_s(sampled.faces[int(sampled.borders.owner[sampled.uses[use]])])
    nearest = GeomAPI_ProjectPointOnSurf(gp_Pnt(*point.tolist()), surface)
    return float(nearest.LowerDistance()) if nearest.NbPoints() else np.inf


def _apart_at_vertices(sampled: SampledShape) -> Worst:
    """Largest distance between ends of edges at one vertex."""
    real = np.flatnonzero(sampled.real)
    vertex = sampled.end_vertices[real].ravel()
    ends = sampled.points[real][:, [0, -1]].reshape(-1, 3)
    order = np.argsort(vertex, kind="stable")
    vertex, ends = vertex[order], ends[order]
    _, first, counts = np.unique(vertex, return_index=True, return_counts=True)
    apart, places = [np.zeros(0)], [np.zeros((0, 3))]
    for count in np.unique(counts[counts > 1]).tolist():
        some = ends[first[counts == count, np.newaxis] + np.arange(count)]
        pairs = np.linalg.norm(some[:, :, np.newaxis] - some[:, np.newaxis], axis=-1)
        apart.append(pairs.max(axis=(1, 2)))
        places.append(some[:, 0])
    return largest(np.concatenate(apart), np.concatenate(places))


def _tangency(sampled: SampledShape) -> Worst:
    """Largest angle between the normals of two faces along an edge that is meant to be smooth, in degrees.

    Where faces fold back on each other, or one does in itself, normals point away from each other: that is no smooth
    edge either.
    """
    edge = sampled.borders.edge[sampled.uses]
    order = np.argsort(edge, kind="stable")
    _, first, counts = np.unique(edge[order], return_index=True, return_counts=True)
    first = first[counts == 2]
    one, other = order[first], order[first + 1]
    normals = sampled.on_faces[2]
    chord = np.linalg.norm(normals[one] - normals[other], axis=-1)
    known = np.linalg.norm(normals[one], axis=-1) * np.linalg.norm(normals[other], axis=-1) > 0
    angles = np.where(known, np.degrees(2 * np.arcsin(np.clip(chord / 2, 0, 1))), np.nan)
    some = known.any(axis=1)
    meant = np.flatnonzero(some)[np.nanmedian(angles[some], axis=1) <= _MEANT_SMOOTH]
    return largest(angles[meant].ravel(), sampled.points[edge[one[meant]]].reshape(-1, 3))


def _sharpest_corner(sampled: SampledShape) -> Worst:
    """Smallest angle between an edge of a face's border and the next one, in degrees, inside the face or outside."""
    borders = sampled.borders
    loop = np.repeat(np.arange(len(borders.face)), np.diff(borders.loops))
    following = np.arange(len(loop)) + 1
    following[borders.loops[1:] - 1] = borders.loops[:-1]
    real = sampled.real[borders.edge]
    # Beside an edge shrunk to a point, as at the tip of a cone, there is no corner of two edges.
    use = np.flatnonzero(real & real[following] & (following != np.arange(len(loop))))
    after = following[use]
    back = -_tangents(sampled, use, np.where(borders.along[use], -1, 0))
    ahead = _tangents(sampled, after, np.where(borders.along[after], 0, -1))
    chord = np.linalg.norm(unit(back) - unit(ahead), axis=-1)
    known = dot(back, back) * dot(ahead, ahead) > 0
    angles = np.where(known, np.degrees(2 * np.arcsin(np.clip(chord / 2, 0, 1))), np.nan)
    # The seam of a face is run both ways, and turns back where it ends.
    angles[borders.edge[use] == borders.edge[after]] = np.nan
    places = sampled.points[borders.edge[use], np.where(borders.along[use], -1, 0)]
    return smallest(angles, places)


def _tangents(sampled: SampledShape, use: Integers, end: Integers) -> Floats:
    """Directions of uses of edges at an end, the way the border runs."""
    rates = sampled.rates[sampled.borders.edge[use], end]
    return np.asarray(np.where(sampled.borders.along[use, np.newaxis], rates, -rates))


def _largest_tolerance(sampled: SampledShape) -> Worst:
    """Largest tolerance that the kernel holds of an edge or of a vertex, in mm."""
    numbered = sampled.borders.vertices
    vertices = [as_vertex(numbered.FindKey(k)) for k in range(1, numbered.Extent() + 1)]
    values = [*map(BRep_Tool.Tolerance_s, sampled.edges), *map(BRep_Tool.Tolerance_s, vertices)]
    corners = np.array([BRep_Tool.Pnt_s(vertex).Coord() for vertex in vertices]).reshape(-1, 3)
    places = np.concatenate([sampled.points[:, len(sampled.parts) // 2], corners])
    shown = np.where(np.isnan(places[:, 0]), np.nan, np.array(values))
    return largest(shown, places)
