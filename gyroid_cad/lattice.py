"""The lattice: a frozen description in millimetres, and what can be made of it."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from math import prod
from typing import TYPE_CHECKING, Any

from gyroid_cad.builds.meshes import LatticeMeshes
from gyroid_cad.builds.properties import LatticeProperties
from gyroid_cad.builds.report import LatticeReport, report_of
from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.choices import BLOCK_KINDS, BodyName, Schema
from gyroid_cad.common.formats import (
    BREP,
    TRIANGLE_FORMATS,
    format_of,
    require_assembly_formats,
    require_formats,
    require_regions,
    require_settings,
)
from gyroid_cad.common.progress import Progress
from gyroid_cad.common.tables import cells_shown
from gyroid_cad.errors import ParameterError
from gyroid_cad.host_shapes import HostShapes
from gyroid_cad.mesh.triangles.stl import require_near_origin
from gyroid_cad.render.notebook import MimeBundle, mime_bundle, shape_picture, wall_picture
from gyroid_cad.render.picture import CAMERA, MOST_DRAWN_PATCHES, SIZE, require_view
from gyroid_cad.step.header import StepHeader
from gyroid_cad.wall.limits import require_sheet
from gyroid_cad.wall.parameters import LatticeParameters, MapLike

if TYPE_CHECKING:
    from gyroid_cad.builds.assembly import Assembly, AssemblyReport
    from gyroid_cad.builds.solid import Build
    from gyroid_cad.builds.whole import WholeBuild
    from gyroid_cad.filling.filled import Filled
    from gyroid_cad.filling.report import FillReport
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["Lattice", "LatticeReport", "MapLike"]


@dataclass(frozen=True, slots=True)
class Lattice(LatticeParameters, LatticeMeshes, LatticeProperties, HostShapes):
    """A block of cells of the gyroid or another surface: alike, or with walls, cells and space that vary.

    The block of cells stands on the origin, [0, nx L] x [0, ny L] x [0, nz L]; as in the paper, patches
    are whole: the mid-surface reaches a quarter of a cell beyond the block, the wall about half its thickness more.

    Whatever may vary is given as a number, an expression of x, y and z such as "0.8 + 0.02*x", a
    :class:`~gyroid_cad.fields.Field`, or a function of three arrays. x, y and z are places on the mid-surface, in mm,
    in the lattice's own coordinates: before the scale field or the map moves anything, and before the finished lattice
    is placed by ``rotation`` and ``origin``.

    Parameters
    ----------
    cells : tuple of int
        Number of cubic cells along x, y, z.
    cell_size : float
        Period L of the cubic cell, in mm.
    thickness : number or field, optional
        Whole wall along the normal of the finished mid-surface, in mm; less than 0.37647 L where it is uniform.
    density : number or field, optional
        Volume fraction instead of thickness, less than 0.94033. Where it or the space varies the tube
        formula is inverted place by place, and the wall stretched as the space across it is.
    fit : FitSettings
        How the patch is fitted. Where the lattice is graded, its control points are the fewest to try.
    scale_field : number or field, optional
        Cells grow and shrink by it: a place p is moved to scale_field(p) p, the paper's variable BC length.
    map : SpaceMap, Cylinder, Sphere, Twist, Bend, str or callable, optional
        Of space, after the scale field; a string as on the command line, such as "cylinder:radius=30", or a
        function of x, y, z that returns three arrays.
    tolerance : float, optional
        Largest deviation of the fit in cell sizes: the number of control points rises until it is met. If left
        out, 1e-4 where the lattice is graded, and ``fit`` as it is where it is uniform.
    trim : {"box"}, optional
        Cut to the block of cells itself, with flat sides, instead of whole patches. Not where space varies.
    surface : {"gyroid", "diamond", "primitive"}
        Schwarz's diamond and primitive surfaces have walls of their own largest thickness and density.
    keep_islands : bool
        Of a trimmed lattice: keep every piece that the cut leaves unconnected. If not, small ones are dropped, which
        have less than a hundredth of what one cell holds, and of the largest piece. The report counts what is left or
        dropped, and an :class:`~gyroid_cad.IslandsWarning` says so.
    origin, rotation : tuple of float
        Where the finished lattice is placed: it is turned about the axes x, y, z, one after the other, in degrees,
        about its own origin, which then stands at ``origin``, in mm; as :func:`~gyroid_cad.fill` has it. Fields and
        maps turn and move with it.
    compact : float, optional
        Largest deviation in mm instead of ``fit`` or ``tolerance``, met by the fewest control points, 5 or more a side.
    kind : {"sheet", "network-a", "network-b", "channels", "bodies"}
        Of a lattice that is trimmed: the wall, or what :func:`~gyroid_cad.fill` makes of the block. A network's density
        is its own; where it varies, below a half.

    porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius : optional
        As of :class:`gyroid_cad.Design`: two of these and of ``cell_size``, ``thickness`` and ``density``, which then
        follow from them and are what the lattice keeps. Only a porosity beside a cell size may vary.

    Raises
    ------
    ParameterError
        Naming the parameter, its value and what is accepted.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8)
    >>> print(f"{lattice.volume_fraction:.4f}")
    0.2452
    """

    def solid(self, progress: Progress | None = None) -> KernelShape:
        """The lattice as a closed solid, checked.

        Built once and remembered; each call hands out a shape of its own that shares the geometry, so that
        moving one does not move another.

        Returns
        -------
        TopoDS_Solid
            A TopoDS_Compound of solids if the lattice falls into several.

        Raises
        ------
        KernelError
            If the kernel's shape is not closed or does not enclose the right volume.
        FitError
            If the fit's edges do not meet those of its neighbours.
        ParameterError
            If memory would not do, or the wall is so thick that the fit folds over.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).solid().ShapeType()
        <TopAbs_ShapeEnum.TopAbs_SOLID: 2>
        """
        return self.built(progress).solid() if self._of_wall else self.filled(progress).solid()

    def named_solids(self) -> dict[str, KernelShape]:
        """The solid under the name of its surface, as hosts show it; of a kind but the sheet all under their own names.

        Examples
        --------
        >>> list(Lattice((1, 1, 1), 10, thickness=0.8).named_solids())
        ['gyroid']
        """
        return {self.surface: self.solid()} if self._of_wall else self.filled().named_solids()

    def filled(self, progress: Progress | None = None) -> Filled:
        """The block as a part that was filled: what a trimmed lattice of any kind but the sheet is.

        Examples
        --------
        >>> made = Lattice((1, 1, 1), 10, thickness=0.8, trim="box", kind="bodies").filled()
        >>> list(made.domains), round(sum(made.report.volumes.values()), 6)
        (['wall', 'fluid-a', 'fluid-b'], 1000.0)
        """
        from gyroid_cad.filling.fill import filled_block

        return filled_block(self, progress)

    def report(self, progress: Progress | None = None, kernel_check: bool = False) -> LatticeReport | FillReport:
        """Build the solid if it isn't yet, check it, and say what it is; of a kind but the sheet as a part filled.

        Whole patches are checked by the numbers of their edges and their control nets, as :meth:`write` does, unless
        ``kernel_check`` has the kernel build and check the solid too; one that is trimmed it does in any case.

        Examples
        --------
        >>> report = Lattice((1, 1, 1), 10, thickness=0.8).report()
        >>> report.valid, report.closed, report.faces
        (True, True, 84)
        """
        if not self._of_wall:
            return self.filled(progress).report
        built = self.built(progress) if self.trim or kernel_check else self._whole(progress)
        built.valid(progress)
        with built.timed("fit report"):
            # Of a graded wall that is cut there is no exact volume to compare with.
            known = self.uniform or not self.trim
            exact = self.exact_volume - built.islands.dropped_volume if known else None
            block = prod(self.cells) * self.cell_size**3
            density = built.volume / block if self.trim else self.volume_fraction
        return report_of(built, self.wall_thickness, density, exact)

    def write(
        self,
        *paths: str | os.PathLike[str],
        schema: Schema = "ap214",
        deviation: float | None = None,
        angle: float = 15.0,
        progress: Progress | None = None,
        instances: bool = False,
        kernel_check: bool = False,
        author: str = "",
        organisation: str = "",
        pcurves: bool = False,
        products: bool = False,
        regions: BodyName | None = None,
    ) -> None:
        """Write files; each path's ending chooses STEP (packed too: .stpz, .step.gz), BREP, STL, 3MF, OBJ or PLY.

        Every path and setting is checked before anything is built. A file appears whole or not at all. STEP, STL and
        3MF of whole patches are made straight from the control nets, without the kernel, and checked by the numbers of
        their edges. STEP and STL are streamed; the others are in memory as a whole while they are written.

        Parameters
        ----------
        *paths : path-like
        schema : {"ap214", "ap242"}
        author, organisation : str
            Of STEP files.
        pcurves : bool
            Write edges of STEP files with their curves in faces' parameters too, for receivers that do not make them:
            the kernel builds the solid, and files grow by half.
        products : bool
            Of several bodies make each a product of an assembly in STEP files.
        regions : {"all", "wall", "fluid-a", "fluid-b"}, optional
            Of the kind "bodies" write STL as text, faces of each name as a region: of a body, or of all, each once.
        deviation : float, optional
            Of the triangles in STL and 3MF from the faces, in mm; if left out, a thousandth of the cell size, or a
            tenth of the wall if that is less.
        angle : float
            Between neighbouring triangles, in degrees: of a trimmed lattice, whose solid the kernel meshes. Triangles
            of whole patches are as large as the deviation lets them be.
        progress : callable, optional
            Called with (stage, done, total).
        instances : bool
            Write STEP files as :meth:`assembly`: one cell and its places, hundreds of times smaller; to look at, to
            lay out, to pattern on. Its cells touch and are not fused: for booleans, meshing, printing write the solid.
        kernel_check : bool
            Have the kernel build and check the solid of STEP files too, as of BREP files and of trimmed lattices.

        Raises
        ------
        ParameterError, FitError, KernelError, ExportError

        Examples
        --------
        >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8)
        >>> lattice.write("cell.step", "cell.stl", deviation=0.1)
        """
        targets, header = require_formats(paths), StepHeader(schema, author, organisation, pcurves, products)
        if deviation is not None:
            deviation = finite_number("deviation", deviation, "a length in mm, a finite number")
        require_regions(self.kind, targets, regions)
        if instances:
            require_assembly_formats(targets)
            if products:
                raise ParameterError("products", products, "none with instances, whose cells are products already")
            require_settings((1, 1, 1), deviation, angle)
            plain = {name: value for name, value in asdict(header).items() if name != "products"}
            self.assembly(progress).write(*targets, **plain, progress=progress)
            return
        if not self._of_wall:
            require_settings((1, 1, 1), deviation, angle)
            made = self.filled(progress)
            limits: dict[str, Any] = {"deviation": deviation, "angle": angle}
            made.write(*targets, **asdict(header), **limits, regions=regions, progress=progress)
            return
        solid = [path for path in targets if self.needs_solid([path])]
        flat = [path for path in targets if path not in solid]
        require_settings(self.cells, deviation, angle, solid=bool(solid))
        for path in targets:
            if format_of(path) in TRIANGLE_FORMATS:
                require_near_origin(path, self.fitted(progress).bounding_box(), self.deviation(deviation))
        asked = kernel_check or pcurves or products or self.trim
        by_kernel = solid if asked or any(format_of(path) is BREP for path in solid) else []
        if by_kernel:
            self.built(progress).write(by_kernel, header, self.deviation(deviation), angle, progress)
        elif solid:
            self._whole(progress).write(solid, header, progress)
        if flat:
            self.triangles(deviation, progress).write(*flat, progress=progress)

    def assembly(self, progress: Progress | None = None) -> Assembly:
        """One cell as a solid and where it stands, as STEP assemblies have it; no solid of all cells is built.

        Raises
        ------
        ParameterError
            If the cells differ, or are trimmed.
        FitError, KernelError
            As of :meth:`solid`.

        Examples
        --------
        >>> Lattice((3, 2, 1), 10, thickness=0.8).assembly().write("many.step")
        """
        from gyroid_cad.builds.assembly import assembly

        return assembly(self.spec(), progress)

    def assembly_report(self, progress: Progress | None = None) -> AssemblyReport:
        """Make the assembly if it isn't yet, and say what it is; nothing is written.

        Examples
        --------
        >>> Lattice((3, 2, 1), 10, thickness=0.8).assembly_report().instances
        6
        """
        return self.assembly(progress).report(self.wall_thickness, self.volume_fraction, self.exact_volume)

    def needs_solid(self, paths: Iterable[str | os.PathLike[str]]) -> bool:
        """Tell whether files with these endings need the solid: triangles of whole patches do not.

        Examples
        --------
        >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8)
        >>> lattice.needs_solid(["cell.stl"]), lattice.needs_solid(["cell.stl", "cell.step"])
        (False, True)
        """
        return bool(self.trim) or any(format_of(path) not in TRIANGLE_FORMATS for path in paths)

    def picture(self, size: tuple[int, int] = SIZE, camera: Point = CAMERA) -> bytes:
        """The lattice drawn, as a PNG file; unless it is trimmed, no kernel is asked. Notebooks show it of themselves.

        Parameters
        ----------
        size : tuple of int
            Width and height in pixels.
        camera : tuple of float
            Direction from the lattice to the viewer.

        Raises
        ------
        ParameterError
            Also of more cells than a picture could show.
        SelfIntersectionError, FitError, KernelError

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).picture(size=(120, 100))[1:4]
        b'PNG'
        """
        size, camera = require_view(size, camera)
        if prod(self.cells) > self._most_drawn:
            raise ParameterError("cells", self.cells, f"at most {self._most_drawn} cells in all in a picture")
        if self.trim:
            return shape_picture(self.solid(), size, camera)
        return wall_picture(self.fitted().wall, size, camera)

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> MimeBundle:
        return mime_bundle(f"{self.surface} lattice", self._shown, self.picture)

    @property
    def _most_drawn(self) -> int:
        return MOST_DRAWN_PATCHES // len(self.minimal_surface.cell)

    def _shown(self) -> list[tuple[str, str]]:
        """Rows that a notebook shows beside the picture."""
        rows = [("cells", cells_shown(self.cells, self.cell_size, self.grading().cells_alike))]
        drawn = prod(self.cells) <= self._most_drawn
        # What varies over so many cells would take long to measure.
        if self.uniform or drawn:
            rows += [
                ("wall", f"{self.wall_thickness:.4g} mm{'' if self.uniform else ' on average'}"),
                ("density", f"{self.volume_fraction:.4g}"),
                ("volume", f"{self.exact_volume:.5g} mm3"),
            ]
        if drawn:
            low, high = self.bounding_box()
            rows.append(("extent", " x ".join(f"{b - a:.5g}" for a, b in zip(low, high, strict=True)) + " mm"))
        return rows

    def built(self, progress: Progress | None = None) -> Build:
        """The build behind the solid and its files; warns of the islands that a cut leaves.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).built().topology.solids
        1
        """
        # With it the kernel is loaded, which triangles and meshes do without.
        from gyroid_cad.builds.solid import build

        require_sheet(self.kind)
        made = build(self.spec(), progress)
        if self.trim:
            made.islands.warn()
        return made

    @property
    def _of_wall(self) -> bool:
        return self.kind == BLOCK_KINDS[0]

    def _whole(self, progress: Progress | None = None) -> WholeBuild:
        from gyroid_cad.builds.whole import whole_build

        return whole_build(self.spec(), progress)
