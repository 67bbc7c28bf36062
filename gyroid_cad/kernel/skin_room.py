"""Room that faces leave for a skin: by distances from triangles, before any offset is made.

A face has an inner side of its own below a skin of thickness s where a ball of radius s touches it from inside and
touches nothing else before: where none does, its offset vanishes, and the offsets of its neighbours meet in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Face, TopoDS_Solid

from gyroid_cad.common.arrays import unit
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.extent import box_round, corners_of, free_form_faces
from gyroid_cad.kernel.part import triangles_by_face
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.files import numbered_corners

__all__ = ["FaceRoom", "SkinRoom", "shown_place"]

Floats = NDArray[np.float64]

# Places on a face where balls are tried, and how often their radii are halved.
_PLACES, _HALVINGS = 96, 12
# A ball may be so much larger than the room for it, in parts of it: triangles have chords.
_AS_LARGE = 0.98
# Of triangles, in parts of a skin and of the solid's extent, as distances are measured by.
_DEFLECTION, _COARSE, _FINE = 1e-2, 1e-3, 2e-4
# Normals of a face that differ by no more are those of a plane.
_FLAT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class FaceRoom:
    """Room below a face.

    Attributes
    ----------
    number : int
        Of the face, from 1, as ``TopExp_Explorer`` counts those of its solid.
    radius : float
        Of the largest ball that touches the face from inside, in mm.
    place : ndarray, shape (3,)
        Where that touches it, in mm.
    """

    number: int
    radius: float
    place: Floats

    def __str__(self) -> str:
        where = f"face {self.number} has room for at {shown_place(self.place)}"
        return f"each face keeps an inner side below about {self.radius:.2g} mm, the least, which {where}"


class SkinRoom:
    """Room that the faces of a solid leave for a skin.

    Parameters
    ----------
    solid : TopoDS_Solid
    openings : sequence of TopoDS_Face
        Of its faces, which get no skin.
    skin : float
        In mm.
    """

    def __init__(self, solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float) -> None:
        numbered = enumerate((as_face(face) for face in parts_of(solid, TopAbs_FACE)), 1)
        self._faces = [(n, face) for n, face in numbered if not any(face.IsSame(opening) for opening in openings)]
        self._skin = skin
        self._shape = compound_of(face for _, face in self._faces)
        extent = float(np.ptp(corners_of(box_round([self._shape])), axis=0).max())
        self._deflection = max(min(_DEFLECTION * skin, _COARSE * extent), _FINE * extent)

    @cached_property
    def _corners(self) -> list[Floats]:
        """Triangles of each face: of a part without free-form faces they are asked for where a skin fails alone."""
        return triangles_by_face(self._shape, self._deflection)

    def rooms(self, most: float) -> list[FaceRoom]:
        """Room below every face that gets a skin, as far as that is less than the most, in mm.

        Balls are followed for all faces at once: a radius that is too large is halved, one that fits is enlarged.
        """
        vertices, triangles, _ = numbered_corners(np.concatenate(self._corners))
        away, random = SignedDistances(vertices, triangles).away, np.random.default_rng(0)
        meshed = [(n, some) for (n, _), some in zip(self._faces, self._corners, strict=True) if len(some)]
        points, inwards = (
            np.concatenate(some) for some in zip(*(_spread(corners, random) for _, corners in meshed), strict=True)
        )

        def fits(radius: Floats) -> NDArray[np.bool_]:
            found = away(points + radius[:, np.newaxis] * inwards)
            return np.asarray(found >= _AS_LARGE * radius - 2 * self._deflection)

        low, high = np.zeros(len(points)), np.full(len(points), most)
        low = np.where(fits(high), high, low)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            fitting = fits(middle)
            low, high = np.where(fitting, middle, low), np.where(fitting, high, middle)
        found = []
        for index, (number, _) in enumerate(meshed):
            own = index * _PLACES + int(np.argmax(low[index * _PLACES : (index + 1) * _PLACES]))
            found.append(FaceRoom(number, float(low[own]), points[own]))
        return found

    def tightest(self) -> FaceRoom:
        """The face that leaves least room, looked for up to twice the skin."""
        return min(self.rooms(2 * self._skin), key=lambda room: room.radius)

    def crossing_pairs(self) -> int:
        """Count pairs of free-form faces, flat ones left out, that are so near that their offsets may meet."""
        free = [index for index, (_, face) in enumerate(self._faces) if free_form_faces(face)]
        bent = [self._corners[index] for index in free if _is_bent(self._corners[index])]
        boxes = [(some.min(axis=(0, 1)) - self._skin, some.max(axis=(0, 1)) + self._skin) for some in bent]
        return sum(
            bool(np.all(low <= other_high) and np.all(other_low <= high))
            for (low, high), (other_low, other_high) in combinations(boxes, 2)
        )


def _spread(corners: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Points spread evenly over triangles, and normals into the solid; shape (n, 3) each."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    chosen = random.choice(len(corners), _PLACES, p=area / area.sum())
    weights = random.dirichlet((1.0, 1.0, 1.0), _PLACES)
    return np.einsum("ij,ijk->ik", weights, corners[chosen]), -unit(across[chosen])


def _is_bent(corners: Floats) -> bool:
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    normals = unit(across[lengths > 0])
    return bool(len(normals) and np.ptp(normals, axis=0).max() > _FLAT)


def shown_place(place: Floats) -> str:
    """A place as messages have it.

    >>> shown_place(np.array([1.0, -0.00001, 2.34567]))
    '(1, 0, 2.346)'
    """
    return "(" + ", ".join(f"{round(x, 3) + 0.0:g}" for x in place.tolist()) + ")"
