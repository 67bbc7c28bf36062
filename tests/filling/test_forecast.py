"""What filling takes is known, and refused if it is too much, before any of it is done."""

from __future__ import annotations

from pathlib import Path

import cadquery as cq
import numpy as np
import pytest

from gyroid_cad.errors import ParameterError
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.forecast import forecast_of
from gyroid_cad.filling.part import part_of
from gyroid_cad.surface.fit import FitSettings

COARSE = FitSettings(5)
TRAY = cq.Workplane().box(40, 30, 12).faces(">Z").shell(-1)


def test_faces_are_forecast_within_a_third() -> None:
    box = cq.Workplane().box(9, 9, 9)
    expected = forecast_of(part_of(box), 4.0)
    assert fill(box, 4.0, density=0.3, fit=COARSE).report.faces == pytest.approx(expected.faces, rel=1 / 3)


@pytest.mark.parametrize(("side", "cell"), [(20, 0.3), (1e6, 7)])
def test_cells_that_memory_would_not_hold_are_refused_in_one_line(side: float, cell: float) -> None:
    words = r"^cell_size = .*: expected at least about [\d.e+]+ mm for this part: .* cells take about"
    with pytest.raises(ParameterError, match=words) as refused:
        fill(cq.Workplane().box(side, side, side), cell, density=0.3)
    assert "\n" not in str(refused.value)


def test_a_large_part_that_is_thin_is_not_refused_for_the_size_of_its_box() -> None:
    shell = part_of(cq.Workplane().box(400, 400, 400).faces(">Z").shell(-2))
    assert np.prod((shell.high - shell.low) / 8) > 100_000
    assert forecast_of(shell, 8.0).cells < 80_000


@pytest.mark.parametrize(
    ("part", "thickness"),
    [(TRAY, 1.0), (cq.Workplane().sphere(3), 6.0), (cq.Workplane().circle(4).extrude(20), 8.0)],
    ids=["tray", "ball", "rod"],
)
def test_the_thickness_of_a_part_is_that_of_the_largest_ball_in_it(part: cq.Workplane, thickness: float) -> None:
    known = part_of(part)
    assert known.thickest(1.02 * thickness) == pytest.approx(thickness, rel=0.12)
    assert known.thickest(0.9 * thickness) > 0.9 * thickness


@pytest.mark.parametrize(("option", "value"), [("thickness", 1.2), ("density", 0.4)])
def test_sheet_metal_thinner_than_the_wall_is_refused_at_once_with_the_option_that_was_given(
    option: str, value: float
) -> None:
    stages: list[str] = []
    words = rf"^{option} = {value}: expected a wall below the part's thickness, about 1\.\d* mm where it is thickest"
    with pytest.raises(ParameterError, match=words):
        fill(TRAY, 9.0, **{option: value}, progress=lambda stage, done, total: stages.append(stage))
    assert stages == ["read", "read"]


def test_the_same_part_gives_the_same_file_byte_by_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    part = cq.Workplane().circle(3).extrude(5).faces(">Z").workplane().hole(2)
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        fill(part, 6.0, density=0.3, fit=COARSE).write(tmp_path / folder / "light.step")
    assert (tmp_path / "one" / "light.step").read_bytes() == (tmp_path / "two" / "light.step").read_bytes()
