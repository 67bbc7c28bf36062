"""The gyroid as exact-grade B-rep solids.

Names are loaded when first used, so that ``import gyroid_cad`` costs next to nothing and loads neither
the CAD kernel nor CadQuery nor build123d.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gyroid_cad.version import __version__

if TYPE_CHECKING:
    from gyroid_cad.assembly import Assembly, AssemblyReport
    from gyroid_cad.block_maps import Bend, Cylinder, Sphere, Twist
    from gyroid_cad.errors import ExportError, FitError, GyroidError, KernelError, ParameterError, SoundnessError
    from gyroid_cad.field_makers import (
        between_planes,
        constant,
        distance_from_axis,
        distance_from_point,
        expression,
        linear,
        radial,
        sampled,
        smooth_maximum,
        smooth_minimum,
    )
    from gyroid_cad.fields import Field
    from gyroid_cad.filling import Filled, FillReport, fill
    from gyroid_cad.fit import FitReport, FitSettings, fit_patch, fit_report
    from gyroid_cad.lattice import Lattice, LatticeReport
    from gyroid_cad.maps import SpaceMap
    from gyroid_cad.mesh.abaqus import write_periodic_equations
    from gyroid_cad.mesh.hexahedra import Mesh
    from gyroid_cad.mesh.mesh_files import write_mesh
    from gyroid_cad.mesh.volume_files import write_volumes
    from gyroid_cad.mesh.volumes import VolumePatches
    from gyroid_cad.meshing import mesh_quality
    from gyroid_cad.nurbs import NurbsSurface
    from gyroid_cad.printers import Printer
    from gyroid_cad.printing import PrintCheck, print_check
    from gyroid_cad.triangles import TriangleReport

__all__ = [
    "Assembly",
    "AssemblyReport",
    "Bend",
    "Cylinder",
    "ExportError",
    "Field",
    "FillReport",
    "Filled",
    "FitError",
    "FitReport",
    "FitSettings",
    "GyroidError",
    "KernelError",
    "Lattice",
    "LatticeReport",
    "Mesh",
    "NurbsSurface",
    "ParameterError",
    "PrintCheck",
    "Printer",
    "SoundnessError",
    "SpaceMap",
    "Sphere",
    "TriangleReport",
    "Twist",
    "VolumePatches",
    "__version__",
    "between_planes",
    "constant",
    "distance_from_axis",
    "distance_from_point",
    "expression",
    "fill",
    "fit_patch",
    "fit_report",
    "linear",
    "mesh_quality",
    "print_check",
    "radial",
    "sampled",
    "smooth_maximum",
    "smooth_minimum",
    "write_mesh",
    "write_periodic_equations",
    "write_volumes",
]

_HOMES = {
    "assembly": ("Assembly", "AssemblyReport"),
    "block_maps": ("Bend", "Cylinder", "Sphere", "Twist"),
    "errors": ("ExportError", "FitError", "GyroidError", "KernelError", "ParameterError", "SoundnessError"),
    "fields": ("Field",),
    "field_makers": (
        "between_planes",
        "constant",
        "distance_from_axis",
        "distance_from_point",
        "expression",
        "linear",
        "radial",
        "sampled",
        "smooth_maximum",
        "smooth_minimum",
    ),
    "filling": ("FillReport", "Filled", "fill"),
    "fit": ("FitReport", "FitSettings", "fit_patch", "fit_report"),
    "lattice": ("Lattice", "LatticeReport"),
    "maps": ("SpaceMap",),
    "mesh.abaqus": ("write_periodic_equations",),
    "mesh.hexahedra": ("Mesh",),
    "mesh.mesh_files": ("write_mesh",),
    "mesh.volume_files": ("write_volumes",),
    "mesh.volumes": ("VolumePatches",),
    "meshing": ("mesh_quality",),
    "nurbs": ("NurbsSurface",),
    "printing": ("PrintCheck", "print_check"),
    "printers": ("Printer",),
    "triangles": ("TriangleReport",),
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"gyroid_cad.{module}"), name)
    raise AttributeError(f"module 'gyroid_cad' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
