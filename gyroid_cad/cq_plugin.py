"""CadQuery: importing this module adds ``Workplane.gyroid`` and ``Workplane.gyroid_fill``, and nothing else.

Type checkers know neither: for them there are :class:`GyroidWorkplane`, and the two as functions of a workplane.

>>> import cadquery as cq
>>> import gyroid_cad.cq_plugin
>>> result = cq.Workplane().gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8)
>>> light = cq.Workplane().box(12, 9, 8).gyroid_fill(cell_size=8, density=0.3)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.choices import Kind, SurfaceName, Trim
from gyroid_cad.errors import GyroidError, ParameterError, host_import
from gyroid_cad.fields.field import FieldLike
from gyroid_cad.filling.fill import fill
from gyroid_cad.lattice import Lattice, MapLike
from gyroid_cad.surface.fit import FitSettings

with host_import("cadquery"):
    import cadquery as cq

__all__ = ["GyroidWorkplane", "gyroid", "gyroid_fill"]

Plane = TypeVar("Plane", bound=cq.Workplane)


def gyroid(
    self: Plane,
    cells: tuple[int, int, int],
    cell_size: float | None = None,
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
    trim: Trim | None = None,
    surface: SurfaceName = "gyroid",
    keep_islands: bool = False,
    compact: float | None = None,
    kind: Kind = "sheet",
    porosity: FieldLike | None = None,
    pore_size: float | None = None,
    throat: float | None = None,
    hydraulic_diameter: float | None = None,
    area_per_volume: float | None = None,
    curvature_radius: float | None = None,
) -> Plane:
    """A lattice of the gyroid, or of another surface, at each point of the stack.

    Parameters
    ----------
    cells, cell_size, thickness, density, fit, scale_field, map, tolerance, trim, surface, keep_islands, compact, \
    kind, porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius
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
        Of several bodies each is tagged by its name: ``result.solids(tag="fluid-a")``.

    Raises
    ------
    ParameterError, FitError, KernelError

    Examples
    --------
    >>> import cadquery as cq
    >>> import gyroid_cad.cq_plugin
    >>> cq.Workplane().gyroid((1, 1, 1), 10, thickness=0.8).solids().size()
    1
    """
    lattice = Lattice(
        cells,
        cell_size,  # type: ignore[arg-type]
        thickness,
        density,
        fit or FitSettings(),
        scale_field,
        map,
        tolerance,
        trim,
        surface,
        keep_islands=keep_islands,
        compact=compact,
        kind=kind,
        porosity=porosity,
        pore_size=pore_size,
        throat=throat,
        hydraulic_diameter=hydraulic_diameter,
        area_per_volume=area_per_volume,
        curvature_radius=curvature_radius,
    )
    low, high = lattice.bounding_box()
    per_axis = (centered,) * 3 if isinstance(centered, bool) else tuple(centered)
    if len(per_axis) != 3:
        raise ParameterError("centered", centered, "True, False or three of them")
    offset = [-(a + b) / 2 if middle else -a for a, b, middle in zip(low, high, per_axis, strict=True)]
    place = cq.Location(cq.Vector(*offset))
    if len(named := lattice.named_solids()) > 1:
        for name, solid in named.items():
            self.eachpoint(cq.Shape.cast(solid).moved(place).moved, True, False).tag(name)
    shape = lattice.to_cadquery().moved(place)
    made: Plane = self.eachpoint(shape.moved, True, combine, clean)
    return made


def gyroid_fill(
    self: Plane,
    cell_size: float | None = None,
    thickness: FieldLike | None = None,
    density: FieldLike | None = None,
    kind: Kind = "sheet",
    *,
    skin: float | None = None,
    openings: Sequence[Any] = (),
    plug: float | None = None,
    core: Any = None,
    origin: Point | None = None,
    rotation: Point = (0.0, 0.0, 0.0),
    fit: FitSettings | None = None,
    drop_islands: bool = False,
    keep_islands: bool = False,
    tolerance: float | None = None,
    lattice: Lattice | None = None,
    surface: SurfaceName = "gyroid",
    solids: Sequence[str | int] = (),
    partial: bool = False,
    compact: float | None = None,
    porosity: FieldLike | None = None,
    pore_size: float | None = None,
    throat: float | None = None,
    hydraulic_diameter: float | None = None,
    area_per_volume: float | None = None,
    curvature_radius: float | None = None,
) -> Plane:
    """Fill the solid in the chain; what is left takes its place.

    As with ``Workplane.shell``, faces that are selected are where the skin is left open:
    ``part.faces(">Z").gyroid_fill(7, density=0.3, skin=1)``.

    Parameters
    ----------
    cell_size, thickness, density, kind, skin, openings, plug, core, origin, rotation, fit, drop_islands, \
    keep_islands, tolerance, lattice, surface, solids, partial, compact, \
    porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius
        As of :func:`gyroid_cad.fill`; lengths in mm, places in global coordinates. Openings join those selected.

    Returns
    -------
    Workplane
        With one object: the solid, or a compound where there are several; the bare surface is a compound of shells.
        Its domains are tagged by their names: ``filled.solids(tag="channel-a")``.

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError, KernelError

    Examples
    --------
    >>> import cadquery as cq
    >>> import gyroid_cad.cq_plugin
    >>> light = cq.Workplane().box(4, 4, 4, centered=False).gyroid_fill(8, density=0.3)
    >>> light.val().isValid()
    True
    """
    selected = [shape for shape in self.objects if isinstance(shape, cq.Face)]
    try:
        part = self.findSolid()
    except ValueError:
        raise ParameterError("part", self, "a chain with a solid in it") from None
    made = fill(
        part,
        cell_size,
        thickness,
        density,
        kind,
        origin,
        rotation,
        fit,
        drop_islands,
        skin=skin,
        openings=[*openings, *selected],
        plug=plug,
        core=core,
        tolerance=tolerance,
        lattice=lattice,
        surface=surface,
        keep_islands=keep_islands,
        solids=solids,
        partial=partial,
        compact=compact,
        porosity=porosity,
        pore_size=pore_size,
        throat=throat,
        hydraulic_diameter=hydraulic_diameter,
        area_per_volume=area_per_volume,
        curvature_radius=curvature_radius,
    )
    for name, domain in made.domains.items():
        self.newObject([cq.Shape.cast(domain)]).tag(name)
    filled: Plane = self.newObject([made.to_cadquery()])
    return filled


class GyroidWorkplane(cq.Workplane):  # type: ignore[misc]
    """``cadquery.Workplane`` with both methods where type checkers see them; at run time the two are alike.

    >>> GyroidWorkplane().box(12, 9, 8).gyroid_fill(cell_size=8, density=0.3).solids().size()
    1
    """

    gyroid = gyroid
    gyroid_fill = gyroid_fill


def _install() -> None:
    additions = {"gyroid": gyroid, "gyroid_fill": gyroid_fill}
    for name in additions:
        present = getattr(cq.Workplane, name, None)
        if present is not None and getattr(present, "__module__", None) != __name__:
            raise GyroidError(
                f"cadquery.Workplane.{name} is taken by {getattr(present, '__module__', present)}; "
                "gyroid_cad.cq_plugin does not replace it"
            )
    for name, addition in additions.items():
        setattr(cq.Workplane, name, addition)


_install()
