"""Sheets that pictures are put on: what the package's rasteriser drew, captions, and bars of colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gyroid_cad.render.drawing import bounds, projection
from gyroid_cad.render.facets import Facets
from gyroid_cad.render.picture import view_axes

FOLDER = Path(__file__).parent
INK = (46, 41, 33)
# Colours of a PNG file that look like all of them; such a file is a third as large.
_PALETTE = 160
# Of each of red, green and blue, where that is not enough: in steps so coarse a file is half as large.
_COLOUR_STEP = 5
_LETTERS = 20
# Of a bar of colours, in pixels; and how many numbers stand beside it.
_BAR_WIDTH, _MARKS = 22, 3

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Vector = tuple[float, float, float]


class Sheet:
    """A white sheet.

    Parameters
    ----------
    size : tuple of int
        Width and height in pixels.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._image = Image.new("RGBA", size, "white")
        self._font = ImageFont.truetype(Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", _LETTERS)

    def put(self, image: Bytes, left: int = 0, top: int = 0) -> None:
        """Put an image on the sheet; what is transparent lets through what was there."""
        self._image.alpha_composite(Image.fromarray(image), (left, top))

    def write(self, text: str, x: float, y: float, anchor: str = "mm") -> None:
        """Write a line of text, with its middle at a place, or as Pillow's anchors say."""
        ImageDraw.Draw(self._image).text((x, y), text, INK, self._font, anchor)

    def caption(
        self, groups: Sequence[Sequence[Facets]], texts: Sequence[str], size: tuple[int, int], camera: Vector
    ) -> None:
        """Write a line of text below each group of a picture that was drawn at the sheet's upper left corner."""
        drawn = [one for group in groups for one in group]
        matrix, offset = projection(drawn, size, camera)
        for group, text in zip(groups, texts, strict=True):
            low, high = bounds(group, matrix)
            self.write(text, (low[0] + high[0]) / 2 + offset[0], (size[1] + self._image.height) / 2)

    def put_bar(self, colours: Floats, largest: float, title: str, left: int, top: int, height: int) -> None:
        """Put a bar of colours, the first at its foot, with numbers from 0 to the largest to the right of it."""
        rows = np.linspace(len(colours) - 1, 0, height).round().astype(int)
        bar = np.full((height, _BAR_WIDTH, 4), 255, dtype=np.uint8)
        bar[..., :3] = np.round(255 * colours[rows])[:, np.newaxis]
        self.put(bar, left, top)
        self.write(title, left, top - _LETTERS, "lm")
        for part in np.linspace(0, 1, _MARKS).tolist():
            self.write(f"{part * largest:.1f}", left + 1.3 * _BAR_WIDTH, top + (1 - part) * height, "lm")

    def save(self, name: str, many_colours: bool = False) -> Path:
        """Save the sheet as a PNG file in this folder, in few colours or, of pictures that are full of them, in all."""
        target, image = FOLDER / f"{name}.png", self._image.convert("RGB")
        if many_colours:
            image = image.point(lambda part: min(_COLOUR_STEP * ((part + _COLOUR_STEP // 2) // _COLOUR_STEP), 255))
        else:
            image = image.quantize(_PALETTE, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        image.save(target, optimize=True)
        return target


def beside(groups: Sequence[Sequence[Facets]], camera: Vector, gap: float = 0.08) -> list[list[Facets]]:
    """Move groups of facets to the right of each other, on one ground.

    Parameters
    ----------
    groups : sequence of sequence of Facets
    camera : tuple of float
        Direction to the viewer.
    gap : float
        Between two, in parts of the first one's width.
    """
    axes = view_axes(camera)
    boxes = [bounds(group, axes) for group in groups]
    apart = gap * (boxes[0][1] - boxes[0][0])[0]
    placed, start = [], 0.0
    for group, (low, high) in zip(groups, boxes, strict=True):
        shift = axes.T @ [start - low[0], -low[1], -low[2]]
        moved = np.pad(shift[:, np.newaxis], ((0, 0), (3, 0)))
        placed.append([replace(one, places=one.places + moved) for one in group])
        start += float(high[0] - low[0]) + apart
    return placed


def mixed(colours: Sequence[Vector], values: Floats) -> Floats:
    """Colours of values from 0 to 1, between the first of some colours and the last; shape (..., 3)."""
    places = np.clip(values, 0, 1) * (len(colours) - 1)
    return np.stack(
        [np.interp(places, range(len(colours)), channel) for channel in zip(*colours, strict=True)], axis=-1
    )
