"""build123d: ``Gyroid``, a part object like ``Box`` or ``Sphere``, and ``GyroidFill``, which fills a part.

>>> from build123d import BuildPart
>>> from gyroid_cad.bd_objects import Gyroid
>>> with BuildPart() as part:
...     gyroid = Gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.choices import Kind, SurfaceName, Trim
from gyroid_cad.errors import ParameterError, host_import
from gyroid_cad.fields.field import FieldLike
from gyroid_cad.filling.fill import fill
from gyroid_cad.lattice import Lattice, MapLike
from gyroid_cad.surface.fit import FitSettings

with host_import("build123d"):
    from build123d import Align, BasePartObject, BuildPart, Location, Mode, Part, RotationLike
    from build123d.geometry import to_align_offset

__all__ = ["Gyroid", "GyroidFill"]


class Gyroid(BasePartObject):  # type: ignore[misc]
    """Part Object: a lattice of the gyroid, or of another surface, aligned by its bounding box.

    Parameters
    ----------
    cells, cell_size, thickness, density, fit, scale_field, map, tolerance, trim, surface, keep_islands, compact, \
    kind, porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius
        As of :class:`gyroid_cad.Lattice`; lengths in mm.
    rotation : RotationLike
        Angles about the axes, in degrees.
    align : Align, tuple of Align or None
        None leaves the block of cells with its corner at the origin, as ``Lattice`` has it.
    mode : Mode

    Attributes
    ----------
    children : tuple of Part
        Of several bodies, labelled by their names.

    Raises
    ------
    ParameterError, FitError, KernelError

    Examples
    --------
    >>> from gyroid_cad.bd_objects import Gyroid
    >>> lattice = Gyroid((1, 1, 1), 10, thickness=0.8)
    >>> len(lattice.solids()), lattice.bounding_box().center().length < 1e-6
    (1, True)
    """

    _applies_to = [BuildPart._tag]  # noqa: RUF012 (the host's own declaration)

    def __init__(
        self,
        cells: tuple[int, int, int],
        cell_size: float | None = None,
        thickness: FieldLike | None = None,
        density: FieldLike | None = None,
        fit: FitSettings | None = None,
        rotation: RotationLike = (0, 0, 0),
        align: Align | tuple[Align, Align, Align] | None = (Align.CENTER, Align.CENTER, Align.CENTER),
        mode: Mode = Mode.ADD,
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
    ) -> None:
        self.lattice = Lattice(
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
        # A solid where it is one, as the host's own objects begin: the place of a part would be lost in its ``locate``.
        part = Part.cast(self.lattice.solid())
        if align is not None:
            # The host would measure the box on the kernel's faces; the control nets give it at once.
            part = part.moved(Location(to_align_offset(*self.lattice.bounding_box(), align)))
        super().__init__(part=part, rotation=rotation, align=None, mode=mode)
        if len(named := self.lattice.named_solids()) > 1:
            solids = zip(named, self.solids(), strict=True)
            self.children = [Part([solid], label=name) for name, solid in solids]


class GyroidFill(Part):  # type: ignore[misc]
    """Part Operation: a part filled with gyroid, or with another surface's lattice.

    Parameters
    ----------
    part : Part, Solid or Compound, optional
        In a builder, the part made so far if left out.
    cell_size, thickness, density, kind, skin, openings, plug, core
        As of :func:`gyroid_cad.fill`; lengths in mm, places in global coordinates. Openings may be faces of the part,
        such as ``part.faces().sort_by(Axis.Z)[-1:]``.
    mode : Mode
        In a builder, the filled part takes the place of what is there.
    origin, rotation, fit, drop_islands, keep_islands, material_density, tolerance, lattice, surface, solids, partial, \
    compact, porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius
        As of :func:`gyroid_cad.fill`.

    Attributes
    ----------
    report : FillReport
    label : str
        The domain: "sheet", "network-a", "network-b" or "surface".
    children : tuple of Part
        Where there are two domains: labelled "channel-a" and "channel-b".

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError, KernelError

    Examples
    --------
    >>> from build123d import Box
    >>> from gyroid_cad.bd_objects import GyroidFill
    >>> light = GyroidFill(Box(5, 4, 3), 10, thickness=0.8)
    >>> light.label, light.is_valid
    ('sheet', True)
    """

    def __init__(
        self,
        part: Any = None,
        cell_size: float | None = None,
        thickness: FieldLike | None = None,
        density: FieldLike | None = None,
        kind: Kind = "sheet",
        *,
        skin: float | None = None,
        openings: Sequence[Any] = (),
        plug: float | None = None,
        core: Any = None,
        mode: Mode = Mode.REPLACE,
        origin: Point | None = None,
        rotation: Point = (0.0, 0.0, 0.0),
        fit: FitSettings | None = None,
        drop_islands: bool = False,
        keep_islands: bool = False,
        material_density: float | None = None,
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
    ) -> None:
        # As the host's operations do, not as its objects: those are placed at the builder's locations.
        context: BuildPart | None = BuildPart._get_context("GyroidFill")
        subject = part if part is not None or context is None else context.part
        if subject is None:
            raise ParameterError("part", part, "a part, or a builder with one in it")
        filled = fill(
            subject,
            cell_size,
            thickness,
            density,
            kind,
            origin,
            rotation,
            fit,
            drop_islands,
            material_density,
            skin=skin,
            openings=openings,
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
        self.report = filled.report
        self.mode = mode
        part = filled.to_build123d()
        super().__init__(obj=part.wrapped, label=part.label, children=part.children)
        if context is not None:
            context._add_to_context(self, clean=False, mode=mode)
