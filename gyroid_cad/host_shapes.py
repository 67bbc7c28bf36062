"""Shapes of the kernel as those of its hosts, CadQuery's and build123d's, and theirs as the kernel's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from gyroid_cad.errors import ParameterError, host_import

if TYPE_CHECKING:
    import build123d as bd
    import cadquery as cq

    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["HostShapes", "named_shapes"]


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


def named_shapes(given: Any) -> tuple[Sequence[KernelShape], list[list[str]]]:
    """Shapes of the kernel in whatever a user of a host hands over, and what each is called there.

    Parameters
    ----------
    given : shape, Workplane or assembly
        Of the kernel, CadQuery or build123d.

    Raises
    ------
    ParameterError

    Examples
    --------
    >>> import cadquery as cq
    >>> lamp = cq.Assembly(name="lamp").add(cq.Workplane().box(4, 4, 1), name="foot")
    >>> named_shapes(lamp)[1]
    [['lamp/foot', 'foot']]
    """
    if hasattr(given, "toCompound"):
        # An assembly of CadQuery, whose names begin with those of the assemblies that it is in.
        leaves = [(shape.moved(place).wrapped, [name, name.rpartition("/")[2]]) for shape, name, place, _ in given]
        return [shape for shape, _ in leaves], [list(dict.fromkeys(names)) for _, names in leaves]
    if hasattr(given, "vals"):
        shapes = [shape.wrapped for shape in given.vals()]
        return shapes, [[] for _ in shapes]
    shape = getattr(given, "wrapped", given)
    if not hasattr(shape, "ShapeType"):
        accepted = "a shape of the kernel, CadQuery or build123d, a Workplane, an assembly, a STEP or BREP file"
        raise ParameterError("part", given, accepted)
    if shape.IsNull():
        raise ParameterError("part", given, "a shape that holds a solid, not an empty one")
    # The children of a shape of build123d have labels.
    labels = [label for label, count in _labels(given) for _ in range(count)]
    solids = given.solids() if any(labels) else []
    if not solids or len(labels) != len(solids):
        return [shape], [[]]
    return [solid.wrapped for solid in solids], [[label] if label else [] for label in labels]


def _labels(given: Any) -> Iterator[tuple[str, int]]:
    """The label of each shape that has no children, and how many solids it has."""
    children = getattr(given, "children", ())
    if isinstance(children, tuple) and children:
        for child in children:
            yield from _labels(child)
    elif label := getattr(given, "label", ""):
        yield label, len(given.solids())
