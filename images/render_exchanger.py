"""Render a counter-flow heat exchanger: its bodies one by one, and all of it cut open.

Run from the repository's root after ``examples/counter_flow_in_cadquery.py`` has left its files somewhere:
``python images/render_exchanger.py FOLDER``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq
from sheet import Sheet, Vector, beside

from gyroid_cad.kernel.assembly import read_bodies
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_shape

_SIZE, _CAPTION_HEIGHT = (1500, 560), 60
_CAMERA: Vector = (1.2, 2.0, 1.3)
_GAP = 0.1
_COLOURS = {"wall": (0.78, 0.80, 0.84), "fluid-a": (0.80, 0.33, 0.25), "fluid-b": (0.30, 0.50, 0.75)}
_HEADERS = (0.62, 0.64, 0.68)
_CAPTIONS = ("fluid a, from end to end", "fluid b, from stub to stub", "with wall and headers, cut open")


def main(folder: str) -> Path:
    """Draw both fluids, and the whole exchanger without what lies above its middle."""
    shapes, names = read_bodies(Path(folder) / "counter_flow.step")
    bodies = [(names_of[0], cq.Shape.cast(shape)) for shape, names_of in zip(shapes, names, strict=True)]
    far = 100.0
    below = cq.Workplane().box(far, far, far).translate((0, 0, -far / 2)).val()
    whole = [_facets(name, body.intersect(below)) for name, body in bodies]
    fluids = [[_facets(name, body)] for name, body in bodies if name.startswith("fluid")]
    groups = beside([*fluids, whole], _CAMERA, _GAP)
    sheet, size = Sheet(_SIZE), (_SIZE[0], _SIZE[1] - _CAPTION_HEIGHT)
    sheet.put(draw([one for group in groups for one in group], size, _CAMERA))
    sheet.caption(groups, _CAPTIONS, size, _CAMERA)
    return sheet.save("counter_flow")


def _facets(name: str, shape: cq.Shape) -> Facets:
    return facets_of_shape(shape.wrapped, [_COLOURS.get(name, _HEADERS)] * len(shape.Faces()))


if __name__ == "__main__":
    print(main(sys.argv[1]))
