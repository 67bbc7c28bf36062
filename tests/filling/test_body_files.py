"""Files of bodies that share their faces: products of an assembly in STEP, and regions of STL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gyroid_cad.errors import ParameterError
from gyroid_cad.filling.filled import Filled
from gyroid_cad.kernel.assembly import read_bodies
from gyroid_cad.kernel.check import faces_of
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import numbered_corners, read_triangles
from gyroid_cad.mesh.triangles.measures import unmatched_edges
from gyroid_cad.mesh.triangles.writing import read_regions
from gyroid_cad.surface.fit import FitSettings

CELL = 6.0
BLOCK = Lattice((1, 1, 1), CELL, 0.6, trim="box", kind="bodies", fit=FitSettings(5))


@pytest.fixture(scope="module")
def made() -> Filled:
    return BLOCK.filled()


def test_each_body_may_be_a_product_by_its_name(made: Filled, tmp_path: Path) -> None:
    BLOCK.write(tmp_path / "core.step", products=True)
    shapes, names = read_bodies(tmp_path / "core.step")
    assert names == [["wall"], ["fluid-a"], ["fluid-b"]]
    assert [len(faces_of(shape)) for shape in shapes] == [len(called) for called in made.face_names.values()]
    text = (tmp_path / "core.step").read_text()
    assert text.count("=NEXT_ASSEMBLY_USAGE_OCCURRENCE(") == 3
    for name in ("wall/a", "wall/b"):
        assert text.count(f"ADVANCED_FACE('{name}'") == sum(called.count(name) for called in made.face_names.values())
    # A program that shows names of products alone.
    gmsh = pytest.importorskip("gmsh", exc_type=ImportError)
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(tmp_path / "core.step"))
        shown = [gmsh.model.getEntityName(*volume) for volume in gmsh.model.getEntities(3)]
    finally:
        gmsh.finalize()
    assert [name.split("/")[-1] for name in shown] == list(made.domains)


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
def test_bodies_without_names_are_products_that_are_numbered(tmp_path: Path) -> None:
    sheet = Lattice((1, 1, 1), CELL, 0.6, trim="box", keep_islands=True, fit=FitSettings(5))
    sheet.write(tmp_path / "sheet.step", products=True)
    assert [name for (name,) in read_bodies(tmp_path / "sheet.step")[1]] == ["sheet 1", "sheet 2", "sheet 3"]


def test_the_regions_of_a_body_close_it_and_have_the_names_of_its_faces(made: Filled, tmp_path: Path) -> None:
    volumes = {}
    for body in made.domains:
        made.write(tmp_path / "body.stl", regions=body, deviation=0.05)
        regions = read_regions(tmp_path / "body.stl")
        assert set(regions) == {
            name.replace("/", "_").replace("-", "_").replace(" ", "_") for name in made.face_names[body]
        }
        vertices, triangles, kept = numbered_corners(np.concatenate(list(regions.values())))
        assert kept.all()
        assert unmatched_edges(triangles) == 0
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        volumes[body] = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
    # Facets between two bodies are the same in either: together they are the block, to rounding.
    assert sum(volumes.values()) == pytest.approx(CELL**3, rel=1e-9)
    assert volumes == pytest.approx(made.report.volumes, rel=2e-2)


def test_the_regions_of_all_bodies_have_each_face_once(made: Filled, tmp_path: Path) -> None:
    made.write(tmp_path / "all.stl", regions="all", deviation=0.05)
    regions = read_regions(tmp_path / "all.stl")
    sides = [np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0]).sum(axis=0) / 2 for some in regions.values()]
    outside = [side for name, side in zip(regions, sides, strict=True) if "face" in name]
    assert sum(np.abs(outside).sum(axis=1)) == pytest.approx(6 * CELL**2, rel=1e-9)
    assert {"wall_a", "wall_b"} < regions.keys()
    # Any reader of STL has all of it.
    assert len(read_triangles(tmp_path / "all.stl")[1]) == sum(map(len, regions.values()))


def test_files_of_bodies_are_refused_what_they_cannot_hold(made: Filled, tmp_path: Path) -> None:
    network = Lattice((1, 1, 1), CELL, density=0.3, trim="box", kind="network-a")
    for write, given, message in [
        (BLOCK.write, {"paths": ["a.stl"]}, "or .stl in regions"),
        (BLOCK.write, {"paths": ["a.3mf"], "regions": "all"}, "can hold regions"),
        (made.write, {"paths": ["a.stl"], "regions": "skin"}, "all or wall or fluid-a or fluid-b"),
        (made.write, {"paths": ["a.stl"], "regions": "fluid"}, "regions = 'fluid'"),
        (made.write, {"paths": ["a.step"], "regions": "all"}, "a file ending in .stl"),
        (network.write, {"paths": ["a.stl"], "regions": "all"}, "none but of the kind bodies"),
        (Lattice((1, 1, 1), CELL, 0.6).write, {"paths": ["a.step"], "instances": True, "products": True}, "products"),
    ]:
        paths = [tmp_path / path for path in given.pop("paths")]
        with pytest.raises(ParameterError, match=message):
            write(*paths, **given)
        assert not any(path.exists() for path in paths)
