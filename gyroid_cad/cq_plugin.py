"""CadQuery: importing this module adds ``Workplane.gyroid``, and nothing else.

>>> import cadquery as cq
>>> import gyroid_cad.cq_plugin
>>> result = cq.Workplane().gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8)
"""

from __future__ import annotations

from typing import Any

import cadquery as cq

from gyroid_cad.errors import GyroidError, ParameterError
from gyroid_cad.fit import FitSettings
from gyroid_cad.lattice import FieldLike, Lattice, MapLike

__all__ = ["gyroid"]

_NAME = "gyroid"


def gyroid(
    self: cq.Workplane,
    cells: tuple[int, int, int],
    cell_size: float,
    thickness: FieldLike | None = None,
    density: FieldLike | None = None,
    fit: FitSettings | None = None,
    centered: bool | tuple[bool, bool, bool] = True,
    combine: Any = True,
    clean: bool = False,
    *,
    scale_field: FieldLike | None = None,
    map: MapLike | None = None,
    tolerance: float | None = None,
) -> cq.Workplane:
    """A gyroid lattice at each point of the stack.

    Parameters
    ----------
    cells, cell_size, thickness, density, fit, scale_field, map, tolerance
        As of :class:`gyroid_cad.Lattice`; lengths in mm.
    centered : bool or tuple of bool
        As of ``Workplane.box``: whether the middle of the lattice's bounding box, or its lowest corner,
        is on the point, along each axis.
    combine : bool or str
        As of ``Workplane.eachpoint``: True or "a" to fuse with the solid in the chain, "cut" or "s" to cut
        from it, False to keep the lattices separate.
    clean : bool
        Merge faces afterwards. Off unless asked for, for no two faces of a lattice lie on one surface.

    Returns
    -------
    Workplane

    Raises
    ------
    ParameterError, FitError, KernelError
    """
    lattice = Lattice(cells, cell_size, thickness, density, fit or FitSettings(), scale_field, map, tolerance)
    low, high = lattice.bounding_box()
    per_axis = (centered,) * 3 if isinstance(centered, bool) else tuple(centered)
    if len(per_axis) != 3:
        raise ParameterError("centered", centered, "True, False or three of them")
    offset = [-(a + b) / 2 if middle else -a for a, b, middle in zip(low, high, per_axis, strict=True)]
    shape = cq.Shape.cast(lattice.solid()).moved(cq.Location(cq.Vector(*offset)))
    return self.eachpoint(shape.moved, True, combine, clean)


def _install() -> None:
    present = getattr(cq.Workplane, _NAME, None)
    if present is not None and getattr(present, "__module__", None) != __name__:
        raise GyroidError(
            f"cadquery.Workplane.{_NAME} is taken by {getattr(present, '__module__', present)}; "
            "gyroid_cad.cq_plugin does not replace it"
        )
    cq.Workplane.gyroid = gyroid


_install()
