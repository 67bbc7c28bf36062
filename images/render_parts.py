"""Render filled parts, cut open: whole STEP files side by side.

Run from the repository's root after ``examples/light_bracket.py`` has left its files somewhere:
``python images/render_parts.py FOLDER``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq
from sheet import Sheet, Vector, beside

from gyroid_cad.kernel.reading import lattice_sides
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_shape

_SIZE, _CAPTION_HEIGHT = (1500, 580), 60
_CAMERA: Vector = (1.5, -2.2, 1.5)
_GAP = 0.12
_PART_COLOUR = (0.78, 0.80, 0.84)
# Where the part with a skin is cut, along y in mm: between its near side and the holes.
_CUT = 3.4
_CAPTIONS = ("the part", "filled", "with a skin, cut open")


def main(folder: str) -> Path:
    """Draw the bracket, what fills it, and both with a skin and cut open, from left to right."""
    part, light, skinned = (
        cq.importers.importStep(str(Path(folder) / name)).val()
        for name in ("bracket.step", "bracket_light.step", "bracket_with_skin.step")
    )
    far = 2 * part.BoundingBox().DiagonalLength
    behind = cq.Workplane().box(far, far, far).translate((0, _CUT + far / 2, 0))
    shown = [_facets(part), [facets_of_shape(light.wrapped)], _facets(skinned.intersect(behind.val()))]
    groups = beside(shown, _CAMERA, _GAP)
    sheet, size = Sheet(_SIZE), (_SIZE[0], _SIZE[1] - _CAPTION_HEIGHT)
    sheet.put(draw([one for group in groups for one in group], size, _CAMERA))
    sheet.caption(groups, _CAPTIONS, size, _CAMERA)
    return sheet.save("light_bracket")


def _facets(shape: cq.Shape) -> list[Facets]:
    """The part's own faces in a colour of their own, but not those of the lattice or the cut."""
    sides = lattice_sides(shape.wrapped)
    own = [side is None and abs(face.Center().y - _CUT) > 1e-6 for face, side in zip(shape.Faces(), sides, strict=True)]
    return [facets_of_shape(shape.wrapped, [_PART_COLOUR if colour else None for colour in own])]


if __name__ == "__main__":
    print(main(sys.argv[1]))
