"""Sizes of solids: volume, area and centre, of one and of several together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gyroid_cad.common.arrays import Point

__all__ = ["ShapeSize", "joint_size"]


@dataclass(frozen=True, slots=True)
class ShapeSize:
    """Size of a shape, by quadrature.

    Attributes
    ----------
    volume, area : float
        In mm3 and mm2, of all its bodies; shells have no volume.
    centroid : tuple of float, optional
        Of the volume, in mm; none where it is not known as exactly.
    """

    volume: float
    area: float
    centroid: Point | None = None


def joint_size(sizes: Sequence[ShapeSize]) -> ShapeSize:
    """Size of several shapes together; its centroid is known if all of theirs are.

    Examples
    --------
    >>> joint_size([ShapeSize(1.0, 6.0, (0.5, 0.5, 0.5)), ShapeSize(3.0, 9.0, (2.5, 0.5, 0.5))])
    ShapeSize(volume=4.0, area=15.0, centroid=(2.0, 0.5, 0.5))
    """
    volume, area = sum(size.volume for size in sizes), sum(size.area for size in sizes)
    known = [(size.volume, size.centroid) for size in sizes if size.centroid is not None]
    if not volume or len(known) < len(sizes):
        return ShapeSize(volume, area)
    x, y, z = (sum(share * centroid[axis] for share, centroid in known) / volume for axis in range(3))
    return ShapeSize(volume, area, (x, y, z))
