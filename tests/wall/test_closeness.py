"""How close a fit is to be, said in millimetres: the fewest control points that keep to it, and no second word."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gyroid_cad import Lattice
from gyroid_cad.cli.app import main
from gyroid_cad.errors import ParameterError
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import fit_report

SIZE = 10.0


def deviation(control_points: int, surface: str) -> float:
    """Of a fit, in mm."""
    return SIZE * fit_report(fit_patch(FitSettings(control_points), SURFACES[surface].family)).max_distance


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("control_points", [5, 7, 9, 11])
def test_one_control_point_fewer_would_miss_the_deviation(surface: str, control_points: int) -> None:
    stated = 1.001 * deviation(control_points, surface)
    chosen = Lattice((1, 1, 1), SIZE, density=0.2, surface=surface, compact=stated).spec().settings.control_points  # type: ignore[arg-type]
    assert deviation(chosen, surface) <= stated
    assert chosen == 5 or deviation(chosen - 1, surface) > stated
    assert chosen <= control_points


def test_the_deviation_is_of_the_paper_where_eight_control_points_hold_it() -> None:
    # The paper: 64 control points a patch hold 2.5e-5 of the cell size.
    assert Lattice((1, 1, 1), SIZE, thickness=0.8, compact=2.5e-5 * SIZE).spec().settings.control_points == 8


def test_a_graded_lattice_keeps_to_the_stated_deviation_with_fewer_control_points_than_usual() -> None:
    lattice = Lattice((1, 1, 1), SIZE, "0.6 + 0.02*x", compact=0.02)
    refit = lattice.fitted().refit
    assert refit is not None
    assert refit.max_deviation <= 0.02
    assert 5 <= len(lattice.wall().weights) < 10


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"tolerance": 1e-4}, "none beside a tolerance"),
        ({"fit": FitSettings(6)}, "none beside a tolerance"),
        ({"compact": 0}, "above 0 and below the cell size"),
        ({"compact": SIZE}, "above 0 and below the cell size"),
        ({"compact": "thin"}, "a finite number"),
    ],
)
def test_a_deviation_that_is_none_or_is_said_twice_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError, match=words) as refused:
        Lattice((1, 1, 1), SIZE, 0.8, **{"compact": 0.01, **given})
    assert refused.value.parameter == "compact"


def test_a_deviation_out_of_reach_is_refused_in_millimetres() -> None:
    with pytest.raises(ParameterError, match=r"compact = 1e-12.*1e-13 of the cell size"):
        Lattice((1, 1, 1), SIZE, 0.8, compact=1e-12).spec()


def test_options_printed_with_it_are_read_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = ("--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--compact", "0.003")
    main(["build", *given, "-o", "a.brep", "--print-config"])
    printed = capsys.readouterr().out
    assert "compact = 0.003" in printed
    (tmp_path / "a.toml").write_text(printed)
    main(["build", "a.toml", "--print-config"])
    assert capsys.readouterr().out == printed


@pytest.mark.parametrize("beside", [("--control-points", "10"), ("--control-points", "6"), ("--tolerance", "1e-4")])
def test_the_shell_refuses_it_beside_what_says_the_same(
    beside: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    given = ("build", "--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8")
    assert main([*given, "-o", "unwritten.brep", "--compact", "0.01", *beside]) == 2
    said = capsys.readouterr().err
    assert "--compact" in said
    assert len(said.strip().splitlines()) == 1
