"""Shapes of the kernel as those of its hosts: CadQuery's and build123d's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from gyroid_cad.errors import host_import

if TYPE_CHECKING:
    import build123d as bd
    import cadquery as cq

    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["HostShapes"]


class HasSolids(Protocol):
    def solid(self) -> KernelShape: ...

    def named_solids(self) -> dict[str, KernelShape]: ...


class HostShapes:
    """Mixin for whatever has a ``solid`` and ``named_solids``: the kernel's shapes as the types that the hosts ask for.

    The hosts are optional, and take seconds to load: they are imported when they are asked for.
    """

    __slots__ = ()

    def to_cadquery(self: HasSolids) -> cq.Shape:
        """Return the solid as a CadQuery shape, for ``cq.Assembly``, ``cq.Workplane``, exporters and viewers.

        Returns
        -------
        cadquery.Shape
            A Solid, or a Compound of several; a shape of the caller's own, as of ``solid``.

        Raises
        ------
        MissingHostError
            Without CadQuery: ``pip install "gyroid_cad[cadquery]"``.

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import Lattice
        >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8)
        >>> assembly = cq.Assembly().add(lattice.to_cadquery(), name="lattice")
        >>> cq.Workplane(obj=lattice.to_cadquery()).faces().size()
        84
        """
        with host_import("cadquery"):
            from cadquery import Shape

        return Shape.cast(self.solid())

    def to_build123d(self: HasSolids) -> bd.Part:
        """Return the solid as a build123d part, for algebra, builders, exporters and viewers.

        Returns
        -------
        build123d.Part
            Labelled by its domain, or with a child labelled so for each of several: the names stay in STEP. A shape of
            the caller's own, as of ``solid``.

        Raises
        ------
        MissingHostError
            Without build123d: ``pip install "gyroid_cad[build123d]"``.

        Examples
        --------
        >>> import build123d as bd
        >>> from gyroid_cad import Lattice
        >>> part = Lattice((1, 1, 1), 10, thickness=0.8).to_build123d()
        >>> len((part + bd.Pos(0, 0, 40) * bd.Box(10, 10, 10)).solids())
        2
        """
        with host_import("build123d"):
            from build123d import Compound, Part, Shape

        def part(name: str, solid: KernelShape) -> bd.Part:
            shape = Shape.cast(solid)
            return Part(shape.wrapped if isinstance(shape, Compound) else [shape], label=name)

        parts = [part(name, solid) for name, solid in self.named_solids().items()]
        return parts[0] if len(parts) == 1 else Part(children=parts)
