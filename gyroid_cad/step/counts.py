"""Counts of a solid's parts, and of those in the text of a STEP file."""

from __future__ import annotations

import os
import re
from collections import Counter
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

from gyroid_cad.errors import ExportError

__all__ = ["Topology", "require_counts", "topology_in_step"]

# Entities that count, each from its line's beginning: the kernel's writer folds lines, and has blanks.
_COUNTED = re.compile(
    rb"\n#\d+\s*=\s*(?:(MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS|ADVANCED_FACE|FACE_SURFACE)\s*\("
    rb"|ORIENTED_EDGE\s*\('[^']*',\s*\*,\s*\*,\s*#(\d+))"
)


@dataclass(frozen=True, slots=True)
class Topology:
    """Counts of a shape's parts.

    Attributes
    ----------
    solids, faces : int
    open_edges : int
        Edges that do not bound exactly two faces, once in each direction.
    """

    solids: int
    faces: int
    open_edges: int

    @property
    def closed(self) -> bool:
        return self.solids > 0 and self.open_edges == 0


def topology_in_step(path: str | os.PathLike[str]) -> Topology:
    """Count the solids, faces and edges that are not used twice in the text of a STEP file, whoever wrote it.

    No kernel is asked, so that what its writer left out is seen. A face is an ``ADVANCED_FACE`` (ISO 10303-511),
    and an edge is used by each ``ORIENTED_EDGE`` that names it.
    """
    with open(path, "rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as text:
        found = Counter(match.group(1, 2) for match in _COUNTED.finditer(text))
    kinds = Counter({kind: count for (kind, _), count in found.items() if kind})
    return Topology(
        solids=kinds[b"MANIFOLD_SOLID_BREP"] + kinds[b"BREP_WITH_VOIDS"],
        faces=kinds[b"ADVANCED_FACE"] + kinds[b"FACE_SURFACE"],
        open_edges=sum(count != 2 for (kind, _), count in found.items() if not kind),
    )


def require_counts(path: str | os.PathLike[str], written: Path, wanted: Topology, least: Topology) -> None:
    """Refuse a file that does not hold all of a shape, or not as closed.

    Parameters
    ----------
    path : path-like
        That it is meant for.
    written : Path
    wanted : Topology
    least : Topology
        Copies of one solid may be written once, with the places where they stand: then there are fewer.

    Raises
    ------
    ExportError
    """
    found = topology_in_step(written)
    whole = least.solids <= found.solids <= wanted.solids and least.faces <= found.faces <= wanted.faces
    if not whole or found.open_edges > wanted.open_edges:
        raise ExportError(
            f"{path} was not written: its text held {found.solids} of {wanted.solids} solids, "
            f"{found.faces} of {wanted.faces} faces and {found.open_edges} open edges; BREP holds the shape as it is"
        )
