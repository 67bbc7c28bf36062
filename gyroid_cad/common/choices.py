"""Options that are one of a few words: their types, and the words themselves for what asks at run time.

Nothing else is loaded with them, so that ``--help`` and a shell's completion may ask too.

>>> KINDS
('sheet', 'network-a', 'network-b', 'channels', 'bodies', 'surface')
"""

from __future__ import annotations

from typing import Literal, get_args

__all__ = [
    "BLOCK_KINDS",
    "BODY_NAMES",
    "FITS",
    "KINDS",
    "PROFILES",
    "ROUTES",
    "SCHEMAS",
    "SURFACE_NAMES",
    "TARGETS",
    "TRIMS",
    "BodyName",
    "CheckedBy",
    "FitName",
    "Kind",
    "Profile",
    "Route",
    "Schema",
    "SurfaceName",
    "Trim",
]

Kind = Literal["sheet", "network-a", "network-b", "channels", "bodies", "surface"]
# Of bodies that share their faces: whose are written as regions of an STL file.
BodyName = Literal["all", "wall", "fluid-a", "fluid-b", "skin"]
SurfaceName = Literal["gyroid", "diamond", "primitive"]
Trim = Literal["box"]
# To a filled part: through exact solids, or through triangles alone.
Route = Literal["brep", "triangles"]
# Of STEP files.
Schema = Literal["ap214", "ap242"]
# Of what is announced as valid: by the numbers of edges and the control nets, or by the kernel.
CheckedBy = Literal["nets", "kernel"]
# By whose limits a file is checked.
Profile = Literal["default", "creo", "nx"]
# On the command line, where no FitSettings can be given.
FitName = Literal["smooth", "paper"]

KINDS: tuple[Kind, ...] = get_args(Kind)
# The bare surface of a block of cells bounds nothing.
BLOCK_KINDS: tuple[Kind, ...] = KINDS[:-1]
SURFACE_NAMES: tuple[SurfaceName, ...] = get_args(SurfaceName)
TRIMS: tuple[Trim, ...] = get_args(Trim)
SCHEMAS: tuple[Schema, ...] = get_args(Schema)
ROUTES: tuple[Route, ...] = get_args(Route)
PROFILES: tuple[Profile, ...] = get_args(Profile)
BODY_NAMES: tuple[BodyName, ...] = get_args(BodyName)
# What else than cell size, thickness and density may describe a lattice.
TARGETS = ("porosity", "pore_size", "throat", "hydraulic_diameter", "area_per_volume", "curvature_radius")
FITS: tuple[FitName, ...] = get_args(FitName)
