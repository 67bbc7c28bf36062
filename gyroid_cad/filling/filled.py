"""A filled part: its solids by name, its report, and its files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from gyroid_cad.builds.solid import write_shape
from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.choices import BODY_NAMES, BodyName, Schema
from gyroid_cad.common.formats import (
    MESH_FORMATS,
    PART_FORMATS,
    STL,
    TRIANGLE_FORMATS,
    format_of,
    require_formats,
    require_meshing,
    require_regions,
    require_settings,
)
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.errors import ParameterError
from gyroid_cad.filling.report import FillReport
from gyroid_cad.filling.tetrahedra import Meshed, element_length, require_elements, tetrahedra_of
from gyroid_cad.filling.wanted import BODIES, FLUID_A, FLUID_B, SKIN, WALL
from gyroid_cad.host_shapes import HostShapes
from gyroid_cad.kernel.check import compound_of, topology
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.solid import KernelShape, another_handle
from gyroid_cad.kernel.stl import triangles_of_bodies
from gyroid_cad.mesh.finite_elements.files import require_mesh_format
from gyroid_cad.mesh.tetrahedra.data import TetrahedralMesh
from gyroid_cad.mesh.triangles.stl import require_near_origin
from gyroid_cad.mesh.triangles.writing import region_name, write_regions
from gyroid_cad.render.notebook import MimeBundle, mime_bundle, shape_picture
from gyroid_cad.render.picture import CAMERA, SIZE, require_view
from gyroid_cad.step.header import StepHeader
from gyroid_cad.step.products import BodyLabels
from gyroid_cad.wall.areas import ShapeSize

__all__ = ["Filled"]

# By which STEP knows them, so that no reader rounds them.
_ALL = BODY_NAMES[0]
_COLOURS = {WALL: "yellow", FLUID_A: "red", FLUID_B: "blue", SKIN: "white"}


@dataclass(frozen=True, slots=True, eq=False)
class Filled(HostShapes):
    """A filled part.

    Attributes
    ----------
    domains : dict
        Shape by name: "sheet", "network-a", "network-b", "surface"; "channel-a" and "channel-b"; or of bodies "wall",
        "fluid-a", "fluid-b" and, if there is one, "skin".
    report : FillReport
    sizes : dict
        Volume, area and, where it is known as exactly, centroid of each solid, by the name of its domain.
    face_names : dict
        Of bodies, names of all faces in the order in which the kernel counts them, likewise.

    Examples
    --------
    >>> import cadquery as cq
    >>> from gyroid_cad import FitSettings, fill
    >>> block = cq.Workplane().box(4, 4, 4, centered=False)
    >>> filled = fill(block, cell_size=8, density=0.3, fit=FitSettings(5))
    >>> list(filled.domains), filled.report.valid
    (['sheet'], True)
    """

    domains: dict[str, KernelShape]
    report: FillReport
    sizes: dict[str, tuple[ShapeSize, ...]]
    face_names: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def solid(self) -> KernelShape:
        """One TopoDS_Solid, or a TopoDS_Compound of all of them, under a handle of the caller's own.

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import FitSettings, fill
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, fit=FitSettings(5))
        >>> filled.solid().ShapeType()
        <TopAbs_ShapeEnum.TopAbs_SOLID: 2>
        """

        shapes = list(self.domains.values())
        return another_handle(shapes[0]) if len(shapes) == 1 else compound_of(shapes)

    def named_solids(self) -> dict[str, KernelShape]:
        """Shapes by the names of their domains, each under a handle of the caller's own.

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import FitSettings, fill
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, fit=FitSettings(5))
        >>> list(filled.named_solids())
        ['sheet']
        """
        return {name: another_handle(shape) for name, shape in self.domains.items()}

    def picture(self, size: tuple[int, int] = SIZE, camera: Point = CAMERA) -> bytes:
        """The filled part drawn, as a PNG file, as :meth:`gyroid_cad.Lattice.picture` draws a lattice.

        Raises
        ------
        ParameterError, ExportError

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import FitSettings, fill
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, fit=FitSettings(5))
        >>> filled.picture(size=(120, 100))[1:4]
        b'PNG'
        """
        return shape_picture(self.solid(), *require_view(size, camera))

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> MimeBundle:
        return mime_bundle("filled part", self.report.rows, self.picture)

    def __str__(self) -> str:
        return str(self.report)

    def deviation(self, given: float | None = None) -> float:
        """Return the largest distance of triangles from the faces, in mm: the usual one if none is given.

        Raises
        ------
        ParameterError

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import FitSettings, fill
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, fit=FitSettings(5))
        >>> filled.deviation(), filled.deviation(0.1)
        (0.008, 0.1)
        """
        usual = min(self.report.cell_size / 1000, (self.report.thickness or self.report.cell_size) / 10)
        limit = usual if given is None else finite_number("deviation", given)
        require_meshing(limit)
        return limit

    def mesh(
        self,
        element_size: float | None = None,
        elements_through: float | None = None,
        order: int = 1,
        progress: Progress | None = None,
    ) -> TetrahedralMesh:
        """Tetrahedra of all bodies in one mesh: where bodies share a face, they share its nodes.

        Nodes on the surface lie on the exact faces. The mesh has the names of the bodies and of their faces. It is made
        by Netgen from triangles of our own: ``pip install 'gyroid_cad[mesh]'``.

        Parameters
        ----------
        element_size : float, optional
            Length of the elements' edges, in mm; where bodies are narrow they are shorter.
        elements_through : float, optional
            Instead, how many elements there are through the wall, about: 2 if neither is given.
        order : {1, 2}
            Elements of 4 nodes, or of 10.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError
            Also of the bare surface, or if Netgen is not installed.
        KernelError
            If no mesh is found whose elements are sound and whose volumes are those of the bodies.

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import FitSettings, fill
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, fit=FitSettings(5))
        >>> mesh = filled.mesh(element_size=1)
        >>> mesh.names, mesh.element.name
        (('sheet',), 'tetra')
        """
        if not self.report.closed:
            raise ParameterError("kind", self.report.kind, "another: the bare surface bounds no volume to mesh")
        require_elements(element_size, elements_through, order)
        walls = self.report.min_wall, self.report.cell_size
        size = element_length(element_size, elements_through, *walls)
        volumes = {name: sum(one.volume for one in some) for name, some in self.sizes.items()}
        return tetrahedra_of(Meshed(self.domains, self.face_names, volumes), size, order, progress)

    def write(
        self,
        *paths: str | os.PathLike[str],
        schema: Schema = "ap214",
        deviation: float | None = None,
        angle: float = 15.0,
        progress: Progress | None = None,
        author: str = "",
        organisation: str = "",
        pcurves: bool = False,
        products: bool = False,
        regions: BodyName | None = None,
        element_size: float | None = None,
        elements_through: float | None = None,
        order: int = 1,
    ) -> None:
        """Write the filled part, as :meth:`gyroid_cad.Lattice.write` does a lattice.

        Into files of meshes (.vtu, .msh, .inp, .cdb, .bdf, .nas) go tetrahedra, as of :meth:`mesh`, which takes the
        last three parameters.

        Parameters
        ----------
        products : bool
            Of several bodies make each a product of an assembly in STEP files, for programs that show no names of
            solids, as Gmsh does not.
        regions : {"all", "wall", "fluid-a", "fluid-b", "skin"}, optional
            Of bodies write STL as text, faces of each name as a region, as OpenFOAM's meshers take them: those of a
            body, which they close, or of all bodies, each face once and turned as the first body has it.

        Raises
        ------
        ParameterError, ExportError

        Examples
        --------
        >>> import cadquery as cq
        >>> from gyroid_cad import FitSettings, fill
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, fit=FitSettings(5))
        >>> filled.write("light.step", "light.stl", deviation=0.1)
        """
        targets, limit = require_formats(paths, (*PART_FORMATS, *MESH_FORMATS)), self.deviation(deviation)
        meshes = [require_mesh_format(path) for path in targets if format_of(path) in MESH_FORMATS]
        require_elements(element_size, elements_through, order, bool(meshes))
        header = StepHeader(schema, author, organisation, pcurves, products)
        require_settings((1, 1, 1), limit, angle)
        require_regions(self.report.kind, targets, regions)
        if regions is not None and regions not in (_ALL, *self.domains):
            raise ParameterError("regions", regions, f"{_ALL} or {' or '.join(self.domains)}")
        for path in (path for path in targets if format_of(path) in TRIANGLE_FORMATS):
            if not self.report.closed:
                raise ParameterError("output", str(path), "STEP or BREP: the bare surface bounds no volume to print")
            require_near_origin(path, corners_of(box_round(self.domains.values())), limit)
        # What can fail comes before the first file.
        mesh = self.mesh(element_size, elements_through, order, progress) if meshes else None
        sizes = [size for name in self.domains for size in self.sizes[name]]
        labels = self._labels()
        for path in (path for path in targets if path not in meshes):
            with timed(self.report.seconds, f"write {path.name}", progress):
                if regions is not None and format_of(path) is STL:
                    self._write_regions(path, regions, limit, angle)
                else:
                    write_shape(self.solid(), sizes, path, header, limit, angle, labels)
        if mesh is not None:
            mesh.write(*meshes, progress=progress)

    def _write_regions(self, path: Path, body: BodyName, deviation: float, angle: float) -> None:
        made = triangles_of_bodies(self.domains.values(), path, deviation, angle)
        names = [name for domain in self.domains for name in self.face_names[domain]]
        domains = [domain for domain in self.domains for _ in self.face_names[domain]]
        wanted = [use for use, domain in enumerate(domains) if body in (_ALL, domain)]
        if body == _ALL:
            wanted = made.first_uses()
        triangles, use = made.of(wanted)
        write_regions(made.vertices, triangles, [region_name(names[number]) for number in use.tolist()], path)

    def _labels(self) -> BodyLabels:
        """Names of all solids; of bodies that share their faces colours and the names of those too."""
        names = [name for name, shape in self.domains.items() for _ in range(topology(shape).solids)]
        if self.report.kind != BODIES:
            return BodyLabels(names)
        called = [name for domain in self.domains for name in self.face_names[domain]]
        return BodyLabels(names, [_COLOURS[name] for name in names], called)
