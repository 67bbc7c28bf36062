"""The histograms of a mesh's quality as a picture."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.quality import Quality, hexahedron_nodes, quality_report
from gyroid_cad.mesh.finite_elements.summaries import draw_quality

image = pytest.importorskip("matplotlib.image", reason="pictures need matplotlib")


def report_on(count: int, amount: float = 0.1, elements: int = 30) -> Quality:
    """On perturbed cubes."""
    nodes = hexahedron_nodes(count)
    points = nodes + amount * np.random.default_rng(1).uniform(-1, 1, (elements, count, 3))
    return quality_report(points.reshape(-1, 3), np.arange(elements * count).reshape(elements, count))


@pytest.mark.parametrize("count", [8, 20])
def test_a_picture_is_a_png_with_a_row_of_histograms_for_every_four_measures(tmp_path: Path, count: int) -> None:
    report = report_on(count)
    pixels = image.imread(draw_quality(report, tmp_path / "quality.png"))
    rows = -(-len(report.measures) // 4)
    assert pixels.shape[0] / pixels.shape[1] == pytest.approx(0.19 * rows, abs=0.04)
    assert list(tmp_path.iterdir()) == [tmp_path / "quality.png"]


def test_equal_reports_make_equal_files_and_others_do_not(tmp_path: Path) -> None:
    files = [
        draw_quality(report, tmp_path / f"{number}.png").read_bytes()
        for number, report in enumerate((report_on(8), report_on(8), report_on(8, 0.2)))
    ]
    assert files[0] == files[1] != files[2]


def test_a_mesh_of_nothing_but_collapsed_elements_is_drawn_too(tmp_path: Path) -> None:
    report = quality_report(np.zeros((8, 3)), [range(8)])
    assert report.measures["aspect_ratio"].undefined == 1
    assert draw_quality(report, tmp_path / "flat.png", title="flat").stat().st_size > 1000


@pytest.mark.parametrize("name", ["quality.pdf", "quality", "missing/quality.png"])
def test_a_path_that_no_picture_can_have_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParameterError, match=r"\.png|existing folder"):
        draw_quality(report_on(8), tmp_path / name)


def test_without_matplotlib_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ParameterError, match="pip install matplotlib"):
        draw_quality(report_on(8), tmp_path / "quality.png")
    assert list(tmp_path.iterdir()) == []
