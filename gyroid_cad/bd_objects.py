"""build123d: ``Gyroid``, a part object like ``Box`` or ``Sphere``.

>>> from build123d import BuildPart
>>> from gyroid_cad.bd_objects import Gyroid
>>> with BuildPart() as part:
...     gyroid = Gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8)
"""

from __future__ import annotations

from build123d import Align, BasePartObject, BuildPart, Location, Mode, Part, RotationLike
from build123d.geometry import to_align_offset

from gyroid_cad.fit import FitSettings
from gyroid_cad.lattice import FieldLike, Lattice, MapLike

__all__ = ["Gyroid"]


class Gyroid(BasePartObject):  # type: ignore[misc]
    """Part Object: Gyroid

    A gyroid lattice, aligned by its bounding box.

    Parameters
    ----------
    cells, cell_size, thickness, density, fit, scale_field, map, tolerance
        As of :class:`gyroid_cad.Lattice`; lengths in mm.
    rotation : RotationLike
        Angles about the axes, in degrees.
    align : Align, tuple of Align or None
        None leaves the block of cells with its corner at the origin, as ``Lattice`` has it.
    mode : Mode

    Raises
    ------
    ParameterError, FitError, KernelError
    """

    _applies_to = [BuildPart._tag]  # noqa: RUF012 (the host's own declaration)

    def __init__(
        self,
        cells: tuple[int, int, int],
        cell_size: float,
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
    ) -> None:
        self.lattice = Lattice(cells, cell_size, thickness, density, fit or FitSettings(), scale_field, map, tolerance)
        part = Part.cast(self.lattice.solid())
        if align is not None:
            # The host would measure the box on the kernel's faces; the control nets give it at once.
            part = part.moved(Location(to_align_offset(*self.lattice.bounding_box(), align)))
        super().__init__(part=part, rotation=rotation, align=None, mode=mode)
