"""Pieces that are left where a wall and a part cross, described by numbers of vertices, edges and faces."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.trim.boundary import Boundary
from gyroid_cad.trim.lattice_faces import LatticeFaces, Pairs
from gyroid_cad.trim.section_fit import SectionCurve

__all__ = ["Crossing", "CutEdge", "CutLoops", "Uses"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Uses = list[tuple[int, bool]]


@dataclass(frozen=True, slots=True)
class CutEdge:
    """An edge of what is left.

    Attributes
    ----------
    start, end : int
        Vertices.
    first, last : float
        Parameters of its curve there.
    kind : {"rim", "part", "section"}
    number : int
        Of the rim, of the part's edge, or of the section curve.
    """

    start: int
    end: int
    first: float
    last: float
    kind: str
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class CutLoops:
    """A piece of a face, by its loops of edges, each with whether it is used the way it runs.

    Attributes
    ----------
    face : int
        Of the wall's faces, or of the part's.
    loops : list
        The outer one first; the piece lies on their left where the normal of the parameters points towards one.
    whole : bool
        Whether it is all of the face.
    """

    face: int
    loops: list[Uses]
    whole: bool


@dataclass(eq=False)
class Crossing:
    """Pieces of a wall's faces in a part, and of the part's boundary in and beside the region they bound.

    Attributes
    ----------
    faces : LatticeFaces
    boundary : Boundary
    pairs : Pairs
    backwards : ndarray of bool, shape (faces,)
        Of the wall's faces, whether the region lies on the side that the normal points to.
    points : list of ndarray, shape (3,)
        Vertices; the first are the part's own.
    fans : dict
        Vertices at corners of the wall's faces, by the numbers of their fans.
    twins : dict
        Vertices that are one with another: where posts of two fans, which are one line, come to the part's boundary.
    edges : list of CutEdge
    sections : list of SectionCurve
    lattice : list of CutLoops
    inner, outer : list of CutLoops
        Of the part's faces in the region, and beside it.
    """

    faces: LatticeFaces
    boundary: Boundary
    pairs: Pairs
    backwards: Booleans
    points: list[Floats] = field(default_factory=list)
    fans: dict[int, int] = field(default_factory=dict)
    twins: dict[int, int] = field(default_factory=dict)
    edges: list[CutEdge] = field(default_factory=list)
    sections: list[SectionCurve] = field(default_factory=list)
    lattice: list[CutLoops] = field(default_factory=list)
    inner: list[CutLoops] = field(default_factory=list)
    outer: list[CutLoops] = field(default_factory=list)
