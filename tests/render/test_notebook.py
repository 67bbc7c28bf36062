"""What Jupyter shows: asked of a real kernel that runs a real notebook."""

from __future__ import annotations

import re
from base64 import b64decode
from io import BytesIO
from typing import Any

import cadquery as cq
import pytest
from PIL import Image

from gyroid_cad.errors import FitError
from gyroid_cad.filling.fill import fill
from gyroid_cad.lattice import Lattice
from gyroid_cad.render.picture import MOST_DRAWN_PATCHES, SIZE
from gyroid_cad.surface.fit import FitSettings

CELLS = [
    "from gyroid_cad import FitSettings, Lattice\nLattice((2, 1, 1), 10, 0.8, fit=FitSettings(5))",
    "import sys\nsorted({name.split('.')[0] for name in sys.modules} & {'OCP', 'cadquery', 'build123d', 'vtkmodules'})",
    "Lattice((1, 1, 1), 10, '0.1*x', fit=FitSettings(4))",
]


@pytest.fixture(scope="module")
def outputs() -> list[dict[str, Any]]:
    """What the cells of a notebook put out, run by Jupyter's own client and IPython's kernel."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in CELLS])
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    nbformat.validate(notebook)
    return [cell.outputs[-1].data for cell in notebook.cells]


def shown_picture(html: str) -> Image.Image:
    (encoded,) = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return Image.open(BytesIO(b64decode(encoded)))


def test_a_lattice_at_the_end_of_a_cell_is_shown_as_a_picture_and_a_table(outputs: list[dict[str, Any]]) -> None:
    data = outputs[0]
    picture = shown_picture(data["text/html"])
    assert picture.size == SIZE
    assert picture.getchannel("A").getextrema() == (0, 255)
    assert data["image/png"].strip() in data["text/html"]
    volume = Lattice((2, 1, 1), 10, 0.8).exact_volume
    for text in ("gyroid lattice", "2 x 1 x 1, 10 mm each", "0.8 mm", f"{volume:.5g} mm3"):
        assert text in data["text/html"]
    assert data["text/plain"].startswith("Lattice(cells=(2, 1, 1)")


def test_nothing_of_it_is_fetched_from_elsewhere(outputs: list[dict[str, Any]]) -> None:
    assert "http" not in outputs[0]["text/html"]
    assert "<script" not in outputs[0]["text/html"]


def test_the_picture_took_neither_kernel_nor_viewer(outputs: list[dict[str, Any]]) -> None:
    assert outputs[1]["text/plain"] == "[]"


def test_a_lattice_that_cannot_be_says_why_in_place_of_its_picture(outputs: list[dict[str, Any]]) -> None:
    assert "image/png" not in outputs[2]
    assert "not shown" in outputs[2]["text/html"]
    assert "expected at least" in outputs[2]["text/html"]
    assert "<img" not in outputs[2]["text/html"]


def test_a_trimmed_lattice_and_a_filled_part_are_shown_by_the_triangles_of_their_faces() -> None:
    trimmed = Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(5), trim="box")
    filled = fill(cq.Workplane().box(6, 5, 4), 10, 0.8, fit=FitSettings(5), material_density=2.7)
    for thing, words in ((trimmed, "10 x 10 x 10 mm"), (filled, "cells of 10 mm")):
        data, _ = thing._repr_mimebundle_()
        assert words in data["text/html"]
        opaque = shown_picture(data["text/html"]).getchannel("A").histogram()[255]
        assert 0.1 < opaque / (SIZE[0] * SIZE[1]) < 0.9
    assert f"{filled.report.mass:.4g} g of" in data["text/html"]


def test_a_block_too_large_to_draw_is_shown_by_its_numbers_alone_and_at_once() -> None:
    side = round(MOST_DRAWN_PATCHES ** (1 / 3))
    data, _ = Lattice((side, side, side), 10, 0.8)._repr_mimebundle_()
    assert set(data) == {"text/html"}
    assert "cells in all in a picture" in data["text/html"]
    assert "density" in data["text/html"]
    varying, _ = Lattice((side, side, side), 10, "0.8 + 0.0001*x")._repr_mimebundle_()
    assert "density" not in varying["text/html"]


def test_what_is_shown_as_text_is_no_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Lattice, *view: Any) -> bytes:
        raise FitError("a <b>gap</b> & more")

    monkeypatch.setattr(Lattice, "picture", fail)
    data, _ = Lattice((1, 1, 1), 10, 0.8)._repr_mimebundle_()
    assert "a &lt;b&gt;gap&lt;/b&gt; &amp; more" in data["text/html"]
