"""Files checked by the limits of those who receive them: what passes, what breaks a limit, and what cannot be read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeVertex
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Pln, gp_Pnt
from OCP.TopAbs import TopAbs_EDGE

from gyroid_cad import ExportError, Lattice, ParameterError, check_file
from gyroid_cad.builds.file_check import CRITERIA, MESH_CRITERIA
from gyroid_cad.common.verdicts import Worst
from gyroid_cad.kernel import apart
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import as_edge
from gyroid_cad.kernel.step import write_step

BOX = BRepPrimAPI_MakeBox(4.0, 5.0, 6.0).Shape()
KINDS: dict[str, dict[str, Any]] = {
    "uniform": {},
    "graded": {"thickness": "0.7 + 0.02*x"},
    "mapped": {"map": "bend:angle=20"},
    "trimmed": {"trim": "box"},
    "diamond": {"surface": "diamond"},
}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are read without a process of their own."""
    monkeypatch.setattr(apart, "read_apart", lambda path, reader: reader(str(path)))


def broken(path: Path, **options: Any) -> set[str]:
    return {check.name for check in check_file(path, **options).checks if not check.ok}


def chamfered(by: float) -> Any:
    chamfer = BRepFilletAPI_MakeChamfer(BOX)
    chamfer.Add(by, as_edge(next(parts_of(BOX, TopAbs_EDGE))))
    return chamfer.Shape()


@pytest.mark.parametrize("ending", ["step", "brep"])
def test_a_box_passes_and_is_told_as_it_is(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"box.{ending}"
    (write_step if ending == "step" else write_brep)(BOX, path)
    found = check_file(path)
    assert (found.ok, found.solids, found.faces, found.closed, found.valid) == (True, 1, 6, True, True)
    assert found.volume == pytest.approx(120)
    assert [check.name for check in found.checks] == [criterion.name for criterion in CRITERIA]


def test_json_has_the_keys_that_scripts_ask_for_and_nothing_that_json_lacks(tmp_path: Path) -> None:
    write_step(BOX, tmp_path / "box.step")
    shown = check_file(tmp_path / "box.step").as_dict()
    assert list(shown) == ["file", "ok", "solids", "faces", "closed", "valid", "volume", "checks"]
    assert all(list(check) == ["name", "worst", "limit", "ok", "place"] for check in shown["checks"])
    assert json.loads(json.dumps(shown, allow_nan=False))["checks"][5]["name"] == "smallest edge"


def test_each_profile_takes_what_it_takes(tmp_path: Path) -> None:
    write_step(chamfered(0.01), tmp_path / "small.step")
    # The chamfer's ends are 0.014 mm long: too short for Creo, not for NX.
    assert broken(tmp_path / "small.step") == broken(tmp_path / "small.step", profile="creo") == {"smallest edge"}
    assert broken(tmp_path / "small.step", profile="nx") == set()


@pytest.mark.parametrize("criterion", [*CRITERIA, *MESH_CRITERIA], ids=lambda one: one.name)
def test_a_limit_holds_at_its_value_and_breaks_beyond_it(criterion: Any) -> None:
    for profile in ("default", "creo", "nx"):
        limit = getattr(criterion, profile)
        if limit is None:
            assert criterion.check(Worst(1e9), profile).ok
            assert criterion.check(Worst(-1e9), profile).ok
        else:
            assert criterion.check(Worst(limit), profile).ok
            assert criterion.check(Worst(), profile).ok
            beyond = limit - 1e-9 if criterion.at_least else limit + 1e-9
            assert not criterion.check(Worst(beyond), profile).ok


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
@pytest.mark.parametrize("kind", KINDS)
def test_a_lattice_of_each_kind_passes(tmp_path: Path, kind: str) -> None:
    options = {"cells": (1, 1, 1), "cell_size": 10, "thickness": 0.8, **KINDS[kind]}
    Lattice(**options).write(tmp_path / "lattice.step")
    assert broken(tmp_path / "lattice.step") == set()


def test_a_lattice_of_cells_of_two_millimetres_is_too_narrowly_curved_for_creo_alone(tmp_path: Path) -> None:
    Lattice((1, 1, 1), 2, 0.2).write(tmp_path / "fine.step")
    assert broken(tmp_path / "fine.step") == set()
    assert broken(tmp_path / "fine.step", profile="creo") == {"smallest segment", "radius of curvature"}


@pytest.mark.parametrize("ending", ["stl", "3mf", "obj", "ply"])
def test_a_mesh_passes_whole_and_fails_with_a_hole(tmp_path: Path, ending: str) -> None:
    ball = trimesh.creation.icosphere(2, 5.0)
    ball.export(tmp_path / f"ball.{ending}")
    found = check_file(tmp_path / f"ball.{ending}")
    assert (found.ok, found.solids, found.faces, found.closed, found.valid) == (True, 1, len(ball.faces), True, True)
    assert found.volume == pytest.approx(ball.volume, rel=1e-5)
    assert found.checks[-1].worst == ("millimetre" if ending == "3mf" else "none")
    ball.update_faces(np.arange(len(ball.faces)) > 0)
    ball.export(tmp_path / f"hole.{ending}")
    found = check_file(tmp_path / f"hole.{ending}")
    assert (found.ok, found.closed, found.volume) == (False, False, None)
    assert broken(tmp_path / f"hole.{ending}") == {"watertight"}


def test_what_is_inside_out_turned_over_crossing_or_flat_is_told_of_a_mesh(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(1, 5.0)
    other = ball.copy()
    other.apply_translation((3.0, 0.1, 0.2))
    flat = trimesh.Trimesh(np.concatenate([ball.vertices, [[0, 0, 9.0]]]), [*ball.faces, [42, 42, 0]], process=False)
    made = {
        "inside out": trimesh.Trimesh(ball.vertices, ball.faces[:, ::-1], process=False),
        "orientation": trimesh.Trimesh(ball.vertices, [ball.faces[0, ::-1], *ball.faces[1:]], process=False),
        "self-intersection": trimesh.util.concatenate([ball, other]),
        "degenerate triangles": flat,
    }
    for name, mesh in made.items():
        mesh.export(tmp_path / "mesh.stl")
        assert broken(tmp_path / "mesh.stl") == {name}


def test_what_has_no_face_or_no_border_is_told(tmp_path: Path) -> None:
    write_brep(BRepBuilderAPI_MakeVertex(gp_Pnt(0, 0, 0)).Vertex(), tmp_path / "point.brep")
    with pytest.raises(ExportError, match=r"point\.brep holds no face: there is nothing to check"):
        check_file(tmp_path / "point.brep")
    write_brep(BRepBuilderAPI_MakeFace(gp_Pln()).Face(), tmp_path / "plane.brep")
    assert broken(tmp_path / "plane.brep") == {"solids", "open borders"}
    write_brep(BOX.Reversed(), tmp_path / "reversed.brep")
    assert broken(tmp_path / "reversed.brep") == {"inside out"}


def test_bad_input_is_told_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "part.step").write_text("solid")
    (tmp_path / "part.dwg").write_text("")
    with pytest.raises(ParameterError, match=r"file = .*part\.dwg': expected a file name ending in \.step"):
        check_file(tmp_path / "part.dwg")
    with pytest.raises(ExportError, match=r"part\.step could not be read as STEP"):
        check_file(tmp_path / "part.step")
    with pytest.raises(ExportError, match=r"nowhere\.brep could not be read"):
        check_file(tmp_path / "nowhere.brep")
    with pytest.raises(ParameterError, match="profile = 'catia': expected default or creo or nx"):
        check_file(tmp_path / "part.step", profile="catia")  # type: ignore[arg-type]
