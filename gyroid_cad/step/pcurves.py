"""Edges' curves in the parameters of their faces (ISO 10303-42, PCURVE), written beside their curves in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.step.geometry import ParameterCurve, ParameterLine, Spline
from gyroid_cad.step.text import StepText, real

__all__ = ["edge_curves"]

Integers = NDArray[np.int64]

_PLANE_OF_PARAMETERS = (
    "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))"
)


def edge_curves(text: StepText, curves: Integers, surfaces: Integers, pcurves: Sequence[ParameterCurve]) -> Integers:
    """Write what edges lie on: their curves in space, with those in the parameters of surfaces that are known.

    The curve in space stays the one that counts: of the two it is the closer to both faces.

    Parameters
    ----------
    text : StepText
    curves : ndarray of int, shape (edges,)
        Numbers of their curves in space.
    surfaces : ndarray of int
        Numbers of surfaces.
    pcurves : sequence of ParameterCurve

    Returns
    -------
    ndarray of int, shape (edges,)
        Number of a SURFACE_CURVE or SEAM_CURVE, or of the curve in space alone.
    """
    if not pcurves:
        return curves
    context = text.once(_PLANE_OF_PARAMETERS)
    lines = _parameter_curves(text, [one.curve for one in pcurves])
    held = text.table("DEFINITIONAL_REPRESENTATION('',", lines[:, np.newaxis], f",#{context})")
    edge, on = np.array([one.edge for one in pcurves]), surfaces[[one.surface for one in pcurves]]
    numbers = text.table("PCURVE('',", on, ",", held, ")")
    # The second of an edge stands beside its first.
    order = np.argsort(edge, kind="stable")
    edges, first, count = np.unique(edge[order], return_index=True, return_counts=True)
    made = curves.copy()
    seams = np.zeros(len(edges), dtype=bool)
    twice = count == 2
    seams[twice] = on[order[first[twice]]] == on[order[first[twice] + 1]]
    for kind, some in (("SURFACE", ~seams), ("SEAM", seams)):
        for size in (1, 2):
            which = np.flatnonzero(some & (count == size))
            own = numbers[order[first[which, np.newaxis] + np.arange(size)]]
            if len(which):
                made[edges[which]] = text.table(f"{kind}_CURVE('',", curves[edges[which]], ",", own, ",.CURVE_3D.)")
    return made


def _parameter_curves(text: StepText, found: Sequence[Spline | ParameterLine]) -> Integers:
    made = np.zeros(len(found), dtype=np.int64)
    alike: dict[tuple[Any, ...], list[int]] = {}
    for index, one in enumerate(found):
        if isinstance(one, ParameterLine):
            made[index] = _line(text, one)
        else:
            weights = None if one.weights is None else one.weights.tobytes()
            alike.setdefault((one.degrees, one.poles.shape, one.knots, weights), []).append(index)
    for indices in alike.values():
        splines = [found[index] for index in indices]
        one = splines[0]
        assert isinstance(one, Spline)
        poles = np.stack([spline.poles for spline in splines if isinstance(spline, Spline)])
        u, v = poles.reshape(-1, 2).T
        nets = text.table("CARTESIAN_POINT('',(", u, ",", v, "))").reshape(poles.shape[:2])
        made[indices] = text.spline_table(one.degrees, nets, one.knots, one.closed, one.weights, counted=False)
    return made


def _line(text: StepText, line: ParameterLine) -> int:
    start = text.once(f"CARTESIAN_POINT('',{_pair(line.origin)})")
    way = text.once(f"DIRECTION('',{_pair(line.direction)})")
    vector = text.once(f"VECTOR('',#{way},{real(line.rate)})")
    return text.once(f"LINE('',#{start},#{vector})")


def _pair(parts: tuple[float, float]) -> str:
    return f"({','.join(real(float(part) + 0.0) for part in parts)})"
