"""The numbers of a report: a section for each thing looked at, as plain values ready for JSON.

A section is a function from what is reported on to a dict of plain values; :data:`LATTICE_SECTIONS` and
:data:`FILE_SECTIONS` list them in the order of the page. To add one, add its name and its function there: the page
shows what it does not know as a table. Where there is nothing to say, the dict is ``{"none": reason}``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from gyroid_cad.builds.meshes import mesh_quality
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.common.tables import cell_shown
from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.printing.print_check import print_check
from gyroid_cad.printing.printers import printer_named
from gyroid_cad.printing.verdict import PrintCheck
from gyroid_cad.render.facets import Facets, facets_of_shape, facets_of_wall
from gyroid_cad.report.file_sections import FileContents, file_section, read_contents
from gyroid_cad.report.pores import ChannelSpheres, pores_of
from gyroid_cad.report.wall_thickness import wall_thickness
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.surface.fit_report import fit_report
from gyroid_cad.version import __version__
from gyroid_cad.wall.areas import distinct_patches, exact_areas, fitted_areas

__all__ = [
    "FILE_SECTIONS",
    "LATTICE_SECTIONS",
    "NONE",
    "Report",
    "Subject",
    "report_on_file",
    "report_on_lattice",
    "require_subdivisions",
]

Values = dict[str, Any]

NONE = "none"
USUAL_SUBDIVISIONS = 8
USUAL_PRINTER = "form2"
_MOST_SUBDIVISIONS = 64


@dataclass(frozen=True, slots=True)
class Subject:
    """A lattice that is reported on.

    Attributes
    ----------
    lattice : Lattice
    subdivisions : int
        Of the mesh whose quality is measured, along each side of a patch.
    printer : str
        By which it is checked.
    """

    lattice: Lattice
    subdivisions: int = USUAL_SUBDIVISIONS
    printer: str = USUAL_PRINTER


@dataclass(frozen=True, slots=True)
class Report:
    """Report on a lattice or a file, by sections.

    Attributes
    ----------
    title : str
    kind : {"lattice", "file"}
    sections : mapping of str to dict
        Plain values by their names, in the order of the page.
    facets : Facets, optional
        What the pictures show; none if there is nothing to be seen.
    seconds : dict
        By section.
    """

    title: str
    kind: str
    sections: Mapping[str, Values]
    facets: Facets | None
    seconds: Mapping[str, float]

    def as_dict(self) -> Values:
        """Everything but the pictures, as plain values ready for JSON."""
        return {
            "title": self.title,
            "kind": self.kind,
            "version": __version__,
            **{name: dict(values) for name, values in self.sections.items()},
            "seconds": dict(self.seconds),
        }


def report_on_lattice(
    lattice: Lattice,
    subdivisions: int = USUAL_SUBDIVISIONS,
    progress: Progress | None = None,
    printer: str = USUAL_PRINTER,
) -> Report:
    """Measure a lattice and gather what its pictures show.

    Parameters
    ----------
    lattice : Lattice
    subdivisions : int
        Of the mesh whose quality is measured, along each side of a patch, from 1 to 64.
    progress : callable, optional
        Called with (stage, done, total).
    printer : str
        By which it is checked: one that is known, or a TOML file.

    Raises
    ------
    ParameterError
        Also if memory would not do, or the lattice cannot exist.
    KernelError
        If the solid of a trimmed lattice cannot be made.
    """
    subject = Subject(lattice, require_subdivisions(subdivisions), printer)
    printer_named(printer)
    seconds: dict[str, float] = {}
    sections = {}
    with timed(seconds, "wall", progress):
        lattice.fitted(progress)
    for name, section in LATTICE_SECTIONS.items():
        with timed(seconds, name.replace("_", " "), progress):
            sections[name] = section(subject)
    with timed(seconds, "facets", progress):
        facets = _facets(lattice)
    counts = " x ".join(map(str, lattice.cells))
    title = f"{lattice.surface}, {counts} {cell_shown(lattice.cell_size, lattice.grading().cells_alike)}"
    return Report(title[0].upper() + title[1:], "lattice", sections, facets, seconds)


def report_on_file(path: str, progress: Progress | None = None) -> Report:
    """Measure what a STEP, BREP, STL or 3MF file holds and gather what its pictures show.

    Parameters
    ----------
    path : str
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If the ending is not known, or there is no such file.
    ExportError
        If it cannot be read.
    """
    seconds: dict[str, float] = {}
    with timed(seconds, "read", progress):
        contents = read_contents(path)
    sections = {}
    for name, section in FILE_SECTIONS.items():
        with timed(seconds, name.replace("_", " "), progress):
            sections[name] = section(contents)
    return Report(contents.path.name, "file", sections, contents.facets, seconds)


def require_subdivisions(subdivisions: int) -> int:
    """Refuse what is no number of subdivisions.

    Raises
    ------
    ParameterError
    """
    whole = isinstance(subdivisions, int) and not isinstance(subdivisions, bool)
    if not (whole and 1 <= subdivisions <= _MOST_SUBDIVISIONS):
        raise ParameterError("subdivisions", subdivisions, f"a whole number from 1 to {_MOST_SUBDIVISIONS}")
    return subdivisions


def _facets(lattice: Lattice) -> Facets:
    if lattice.trim is None:
        return facets_of_wall(lattice.fitted().wall)
    return facets_of_shape(lattice.built().solid())


def parameters_section(subject: Subject) -> Values:
    """Section on the parameters."""
    lattice = subject.lattice
    fields = {name: getattr(lattice, name) for name in ("thickness", "density", "scale_field", "map")}
    return {
        "surface": lattice.surface,
        "cells": list(lattice.cells),
        "cell_size": lattice.cell_size,
        **{
            name: value if isinstance(value, float) else str(value)
            for name, value in fields.items()
            if value is not None
        },
        **({} if lattice.trim is None else {"trim": lattice.trim}),
        **({} if lattice.tolerance is None else {"tolerance": lattice.tolerance}),
        **({} if lattice.compact is None else {"compact": lattice.compact}),
        "control_points": len(lattice.fitted().wall.weights),
    }


def measures_section(subject: Subject) -> Values:
    """Density, volume and areas, of the fitted lattice and of the exact one."""
    lattice = subject.lattice
    fitted = lattice.fitted()
    low, high = (np.array(corner) for corner in lattice.bounding_box())
    block = lattice.exact_volume / lattice.volume_fraction
    values: Values = {
        "density": lattice.volume_fraction,
        "porosity": 1 - lattice.volume_fraction,
        "wall_thickness": lattice.wall_thickness,
        "block_volume": block,
        "bounding_box_low": low.tolist(),
        "bounding_box_high": high.tolist(),
        "extent": (high - low).tolist(),
        "patches": lattice.built().patches if lattice.trim else fitted.complex.patch_count,
    }
    if lattice.trim:
        return values | _trimmed_measures(lattice)
    areas = fitted_areas(fitted.wall)
    exact = exact_areas(fitted.complex, fitted.spec.grading, *distinct_patches(fitted.wall))
    volume = fitted.wall.volume()
    return values | {
        "pieces": fitted.complex.component_count,
        "boundary_edges": int(fitted.complex.free.sum()),
        "non_manifold_edges": fitted.complex.non_manifold_edges,
        "volume": volume,
        "volume_exact": lattice.exact_volume,
        "volume_error": volume / lattice.exact_volume - 1,
        "face_a_area": areas.face_a,
        "face_b_area": areas.face_b,
        "faces_area": areas.faces,
        "faces_area_exact": exact.faces,
        "faces_area_error": areas.faces / exact.faces - 1,
        "rim_area": areas.rim,
        "area": areas.total,
        "area_per_volume": areas.total / volume,
        "faces_area_per_block_volume": exact.faces / block,
    }


def _trimmed_measures(lattice: Lattice) -> Values:
    """Measures of the solid that is cut to the block, by the kernel."""
    from gyroid_cad.kernel.reading import described

    built = lattice.built()
    found = described(built.solid())
    exact = lattice.exact_volume - built.islands.dropped_volume if lattice.uniform else None
    return {
        "density": built.density,
        "porosity": 1 - built.density,
        "solids": found.topology.solids,
        "islands": built.islands.kept,
        "islands_volume": built.islands.kept_volume,
        "dropped": built.islands.dropped,
        "dropped_volume": built.islands.dropped_volume,
        "faces": found.topology.faces,
        "valid": found.valid,
        "closed": found.topology.closed,
        "volume": built.volume,
        **({} if exact is None else {"volume_exact": exact, "volume_error": built.volume / exact - 1}),
        "area": found.area,
        "area_per_volume": found.area / built.volume,
    }


def fit_section(subject: Subject) -> Values:
    """Section on the fitted lattice against the exact one."""
    lattice = subject.lattice
    fitted = lattice.fitted()
    if fitted.refit is not None:
        refit = fitted.refit
        return {
            "control_points": refit.control_points,
            "max_deviation": refit.max_deviation,
            "max_normal_angle": refit.max_normal_angle,
            "max_wall_error": refit.max_wall_error,
            "samples_per_patch": refit.samples**2,
        }
    found = fit_report(fit_patch(fitted.spec.settings, lattice.minimal_surface.family))
    return {
        "control_points": fitted.spec.settings.control_points,
        "max_deviation": found.max_distance * lattice.cell_size,
        "rms_deviation": found.rms_distance * lattice.cell_size,
        "max_normal_angle": found.max_normal_angle,
        "max_mean_curvature": found.max_mean_curvature / lattice.cell_size,
        "edge_gap": found.edge_gap * lattice.cell_size,
    }


def wall_section(subject: Subject) -> Values:
    """Section on the fitted wall's thickness."""
    found = wall_thickness(subject.lattice.fitted())
    return {"thickness": found.thickness.as_dict(), "error": found.error.as_dict()}


def pores_section(subject: Subject) -> Values:
    """Section on the sizes of pores."""
    found = pores_of(subject.lattice.fitted())
    return {
        "beyond": found.beyond,
        "spacing": found.spacing,
        "porosity_counted": found.porosity,
        "channel_a": _spheres(found.channel_a),
        "channel_b": _spheres(found.channel_b),
        "sizes": found.sizes.as_dict(),
    }


def _spheres(found: ChannelSpheres | None) -> Values:
    if found is None:
        return {NONE: "no sphere is largest inside"}
    return {"count": found.count, "min_diameter": found.smallest, "max_diameter": found.largest}


def quality_section(subject: Subject) -> Values:
    """Section on the quality of this lattice's hexahedra."""
    lattice = subject.lattice
    if lattice.trim:
        return {NONE: "meshes are made of whole patches: without trim"}
    # Of cells that are all alike one has every element there is.
    shown = Lattice((1, 1, 1), **_all_but_cells(lattice)) if lattice.uniform else lattice
    try:
        mesh = shown.hexahedra(subject.subdivisions)
    except ParameterError as problem:
        return {NONE: str(problem)}
    quality = mesh_quality(mesh).as_dict()
    return {
        "subdivisions": subject.subdivisions,
        "layers": 1,
        "cells": prod(shown.cells),
        **quality,
    }


def print_check_section(subject: Subject) -> Values:
    """Section on the print check of a lattice."""
    if subject.lattice.trim:
        return {NONE: "a trimmed lattice is checked as the STL file that it is written to"}
    return _checked(print_check(subject.lattice, subject.printer))


def file_print_check_section(contents: FileContents) -> Values:
    """Section on the print check of a file of triangles."""
    if contents.triangles is None:
        return {NONE: "only triangles are checked: write the part as STL or 3MF"}
    try:
        return _checked(print_check(contents.triangles))
    except ParameterError as problem:
        return {NONE: str(problem)}


def _checked(check: PrintCheck) -> Values:
    findings = [{"of": of, "finding": finding, "verdict": verdict} for of, finding, verdict in check.rows()]
    return {"printer": check.printer.name, "passed": check.passed, "findings": findings}


def _all_but_cells(lattice: Lattice) -> dict[str, Any]:
    names = ("cell_size", "thickness", "density", "fit", "tolerance", "surface")
    return {name: getattr(lattice, name) for name in names}


LATTICE_SECTIONS: dict[str, Callable[[Subject], Values]] = {
    "parameters": parameters_section,
    "measures": measures_section,
    "wall": wall_section,
    "pores": pores_section,
    "fit": fit_section,
    "quality": quality_section,
    "print_check": print_check_section,
}
FILE_SECTIONS: dict[str, Callable[[FileContents], Values]] = {
    "file": file_section,
    "print_check": file_print_check_section,
}
