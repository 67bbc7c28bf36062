"""How a report's values are called and in what unit: a title and a note for each section, a label for each value."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

__all__ = ["LABELS", "NOTES", "TITLES", "label_of"]

TITLES: Mapping[str, str] = MappingProxyType(
    {
        "parameters": "What was asked for",
        "measures": "Density, volume and area",
        "wall": "Wall thickness",
        "pores": "Pore sizes",
        "fit": "Fitted against exact",
        "quality": "Elements",
        "file": "What the file holds",
    }
)
NOTES: Mapping[str, str] = MappingProxyType(
    {
        "measures": "Face A looks into the labyrinth that the surface's normal points to, face B into the other; the "
        "rim closes the wall where the lattice ends.",
        "wall": "Measured from one fitted face to the other along the normal of the exact mid-surface; shares are of "
        "the mid-surface's area.",
        "pores": "The pore size at a place is the diameter of the largest sphere that fits between the walls and holds "
        "the place; shares are of the pores' volume. Inscribed spheres stand where the distance to the wall is largest "
        "nearby.",
        "fit": "How far the NURBS faces are from the exact minimal surface, or from the exact wall where it varies.",
        "quality": "Of structured hexahedra, one layer across the wall; measures as Verdict defines them, bounds as in "
        "CUBIT's manual.",
    }
)
# Of each value its label, and its unit. Values of one name are called alike in every section.
LABELS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "cells": ("cells", ""),
        "cell_size": ("cell size", "mm"),
        "thickness": ("thickness", "mm"),
        "scale_field": ("scale field", ""),
        "control_points": ("control points along a patch", ""),
        "density": ("density, volume fraction", ""),
        "porosity": ("porosity", ""),
        "wall_thickness": ("wall, mean", "mm"),
        "block_volume": ("volume of the block", "mm³"),
        "bounding_box_low": ("bounding box from", "mm"),
        "bounding_box_high": ("bounding box to", "mm"),
        "extent": ("extent", "mm"),
        "pieces": ("pieces that hang together", ""),
        "free_edges": ("edges of the mid-surface that end the lattice", ""),
        "pinch_lines": ("pinch lines", ""),
        "volume": ("volume", "mm³"),
        "volume_exact": ("volume, exact", "mm³"),
        "volume_error": ("volume, fitted / exact - 1", ""),
        "face_a_area": ("area of face A", "mm²"),
        "face_b_area": ("area of face B", "mm²"),
        "faces_area": ("area of both faces", "mm²"),
        "faces_area_exact": ("area of both faces, exact", "mm²"),
        "faces_area_error": ("area, fitted / exact - 1", ""),
        "rim_area": ("area of the rim", "mm²"),
        "area": ("area in all", "mm²"),
        "area_per_volume": ("area / volume of the solid", "mm²/mm³"),
        "faces_area_per_block_volume": ("area of both faces / volume of the block", "mm²/mm³"),
        "part_of_bounding_box": ("part of the bounding box", ""),
        "max_deviation": ("deviation, largest", "mm"),
        "rms_deviation": ("deviation, root mean square", "mm"),
        "max_normal_angle": ("angle between normals, largest", "degrees"),
        "max_wall_error": ("error of the wall, relative, largest", ""),
        "max_mean_curvature": ("mean curvature, largest (exact: 0)", "1/mm"),
        "edge_gap": ("gap between neighbouring patches", "mm"),
        "samples_per_patch": ("samples a patch", ""),
        "beyond": ("beyond the block", ""),
        "spacing": ("looked up every", "mm"),
        "porosity_counted": ("porosity, counted there", ""),
        "channel_a": ("labyrinth A", ""),
        "channel_b": ("labyrinth B", ""),
        "count": ("inscribed spheres", ""),
        "smallest_diameter": ("smallest diameter", "mm"),
        "largest_diameter": ("largest diameter", "mm"),
        "open_edges": ("open edges", ""),
        "format": ("format", ""),
        "bytes": ("size", "bytes"),
        "inverted": ("elements turned inside out", ""),
        "nodes_per_element": ("nodes an element", ""),
        "subdivisions": ("subdivisions of a patch's sides", ""),
        "layers": ("layers across the wall", ""),
    }
)


def label_of(name: str) -> tuple[str, str]:
    """Label and unit of a value; of one that has none of its own, the name in words."""
    return LABELS.get(name, (name.replace("_", " "), ""))
