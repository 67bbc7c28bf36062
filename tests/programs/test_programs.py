"""Programs of others take our files as they are: one solid, all faces, watertight, nothing to repair."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder

from gyroid_cad.errors import SealedVoidsWarning
from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.check import topology
from gyroid_cad.kernel.step import read_step
from gyroid_cad.lattice import Lattice

KINDS = ("uniform", "graded", "mapped", "cut", "several", "filled", "skinned")
# Meshers take seconds for each.
MESHED = pytest.mark.parametrize("sample", ["uniform", "cut"], indirect=True)
# Exact solids; OpenCascade integrates them with its usual accuracy in FreeCAD, meshers put chords in the place of arcs.
BY_KERNEL, BY_MESH = 2e-4, 0.05
# In FreeCAD's own Python: the file is opened, counted, checked and written anew.
IN_FREECAD = """
import json, os, Part
shape = Part.Shape()
shape.read(os.environ["GYROID_READ"])
shape.check()
shape.exportStep(os.environ["GYROID_WRITTEN"])
found = [len(shape.Solids), len(shape.Faces), shape.isValid(), shape.Volume]
print("FOUND", json.dumps(found))
"""

Record = Callable[[str, float], None]


class Sample(NamedTuple):
    """Files of one solid, and what stands in them."""

    step: Path
    stl: Path
    three_mf: Path
    report: Any


def made(kind: str) -> Any:
    if kind == "uniform":
        return Lattice((1, 1, 1), 10.0, 0.8)
    if kind == "graded":
        return Lattice((1, 1, 1), 10.0, "0.7 + 0.02*x")
    if kind == "mapped":
        return Lattice((1, 1, 1), 10.0, 0.8, map="bend:angle=20")
    if kind in ("cut", "several"):
        return Lattice((1, 1, 1), 10.0, 0.8, trim="box", keep_islands=kind == "several")
    if kind == "filled":
        return fill(BRepPrimAPI_MakeCylinder(2.0, 3.0).Shape(), 5.0, density=0.3)
    with pytest.warns(SealedVoidsWarning):
        return fill(BRepPrimAPI_MakeBox(8.0, 5.0, 5.0).Shape(), 5.0, density=0.3, skin=0.6)


@pytest.fixture(scope="module", params=KINDS)
def sample(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Sample:
    folder, solid = tmp_path_factory.mktemp("programs"), made(request.param)
    step, stl, three_mf = (folder / f"solid.{ending}" for ending in ("step", "stl", "3mf"))
    solid.write(step, stl, three_mf, deviation=0.05)
    return Sample(step, stl, three_mf, solid.report() if callable(solid.report) else solid.report)


def program(*names: str) -> str:
    found = next((path for path in map(shutil.which, names) if path), None)
    return found or pytest.skip(f"no {names[0]} on this machine")


def said(command: Sequence[str | Path], **environment: str) -> str:
    """What a program says where it ends well."""
    offscreen = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "LC_ALL": "C.UTF-8", **environment}
    ended = subprocess.run(
        [*map(str, command)], stdin=subprocess.DEVNULL, capture_output=True, timeout=300, env=offscreen, check=True
    )
    return (ended.stdout + ended.stderr).decode(errors="replace")


def in_freecad(step: Path, folder: Path) -> tuple[int, int, bool, float]:
    """Solids, faces, validity and volume of a file that FreeCAD opens, and of which what it writes holds as much."""
    freecad = program("freecadcmd", "FreeCADCmd", "freecad.cmd")
    (folder / "look.py").write_text(IN_FREECAD)
    again = folder / "again.step"
    text = said([freecad, folder / "look.py"], GYROID_READ=str(step), GYROID_WRITTEN=str(again))
    solids, faces, valid, volume = json.loads(text.split("FOUND", 1)[1].splitlines()[0])
    back = topology(read_step(again))
    assert (back.solids, back.faces, back.closed) == (solids, faces, True)
    return solids, faces, valid, volume


def test_freecad_opens_valid_solids_and_writes_them_anew(sample: Sample, tmp_path: Path) -> None:
    solids, faces, valid, volume = in_freecad(sample.step, tmp_path)
    assert (solids, faces, valid) == (sample.report.solids, sample.report.faces, True)
    assert volume == pytest.approx(sample.report.volume, rel=BY_KERNEL)


# FreeCAD's check before Boolean operations takes a minute and more for what has hundreds of faces.
@pytest.mark.parametrize("sample", ["filled"], indirect=True)
def test_freecads_check_before_boolean_operations_finds_nothing(sample: Sample, tmp_path: Path) -> None:
    freecad = program("freecadcmd", "FreeCADCmd", "freecad.cmd")
    (tmp_path / "look.py").write_text(IN_FREECAD.replace("shape.check()", "shape.check(True)"))
    text = said(
        [freecad, tmp_path / "look.py"], GYROID_READ=str(sample.step), GYROID_WRITTEN=str(tmp_path / "again.step")
    )
    # What it finds it raises.
    assert "FOUND" in text
    assert "BOPAlgo" not in text


def test_freecad_opens_an_assembly_as_one_cell_at_each_of_its_places(cell: Lattice, tmp_path: Path) -> None:
    lattice, step = replace(cell, cells=(2, 1, 1)), tmp_path / "assembly.step"
    lattice.write(step, instances=True)
    solids, _, valid, volume = in_freecad(step, tmp_path)
    assert (solids, valid) == (2, True)
    assert volume == pytest.approx(lattice.report().volume, rel=BY_KERNEL)


@pytest.mark.parametrize("ending", ["stl", "three_mf"])
def test_prusa_slicer_finds_triangles_with_nothing_to_repair(sample: Sample, ending: str) -> None:
    text = said([program("prusa-slicer", "PrusaSlicer"), "--info", getattr(sample, ending)])
    found = dict(re.findall(r"^(\w+) = +(\S+)$", text, re.MULTILINE))
    assert found["manifold"] == "yes"
    # Told only where its reader had to change something.
    assert not {"facets_removed", "edges_fixed", "facets_reversed", "backwards_edges", "open_edges"} & set(found)
    assert float(found["volume"]) == pytest.approx(sample.report.volume, rel=1e-2)


def test_admesh_finds_every_edge_of_an_stl_file_matched_and_changes_nothing(sample: Sample) -> None:
    text = said([program("admesh"), sample.stl])
    before, after = re.findall(r"Number of facets +: +(\d+) +(\d+)", text)[0]
    disconnected = re.findall(r"disconnected [a-z]+ *: +(\d+)", text)
    changed = re.findall(r"(?:Degenerate facets|Edges fixed|Facets \w+|Backwards edges|Normals fixed) +: +(\d+)", text)
    assert (before, len(disconnected), len(changed)) == (after, 4, 7)
    assert set(disconnected + changed) == {"0"}


def test_steputils_parses_every_entity_and_finds_what_each_refers_to(sample: Sample) -> None:
    p21 = pytest.importorskip("steputils.p21", reason="no steputils")
    (data,) = p21.readfile(str(sample.step)).data
    text = sample.step.read_text("ascii").split("DATA;", 1)[1]
    numbers = set(re.findall(r"^(#\d+)=", text, re.MULTILINE))
    assert set(data.instances) == numbers
    assert set(re.findall(r"#\d+", text)) <= set(data.instances)
    simple = [one.entity.name for one in data.instances.values() if hasattr(one, "entity")]
    assert simple.count("ADVANCED_FACE") == sample.report.faces


@MESHED
def test_netgen_fills_the_solid_with_tetrahedra(sample: Sample, record_property: Record) -> None:
    occ = pytest.importorskip("netgen.occ", reason="no netgen-mesher")
    mesh = occ.OCCGeometry(str(sample.step)).GenerateMesh(maxh=2.0)
    points = np.array([tuple(point.p) for point in mesh.Points()])
    corners = points[[[vertex.nr - 1 for vertex in one.vertices] for one in mesh.Elements3D()]]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    # Its own sense of turning is the opposite one.
    assert volumes.max() < 0
    record_property("smallest tetrahedron in mm3", float(-volumes.max()))
    assert -volumes.sum() == pytest.approx(sample.report.volume, rel=BY_MESH)


@MESHED
def test_gmsh_fills_the_solid_with_tetrahedra(sample: Sample, record_property: Record) -> None:
    gmsh = pytest.importorskip("gmsh", reason="no gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
        gmsh.model.occ.importShapes(str(sample.step))
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(3)
        tetrahedra = np.concatenate(gmsh.model.mesh.getElements(3)[1])
        gamma = gmsh.model.mesh.getElementQualities(tetrahedra, "gamma")
        volume = gmsh.model.mesh.getElementQualities(tetrahedra, "volume").sum()
    finally:
        gmsh.finalize()
    record_property("smallest gamma", float(gamma.min()))
    assert gamma.min() > 0
    assert volume == pytest.approx(sample.report.volume, rel=BY_MESH)
