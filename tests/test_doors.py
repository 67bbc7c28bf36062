"""Every option of the table of doors is given at every door with a real value, and the result looked at.

A door is a function that is given options by the table's words; whatever it makes is looked at alike. The names in the
table are those that the doors take, no more and no fewer.
"""

from __future__ import annotations

import inspect
import json
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import tomli_w
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.GeomAbs import GeomAbs_BSplineSurface
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS
from remembered import filled_once

from gyroid_cad import Design, FitError, IslandsWarning, Lattice, design, fill
from gyroid_cad.cli.app import commands, main
from gyroid_cad.common.choices import TARGETS
from gyroid_cad.common.doors import DOORS, FILL, LATTICE, Absent
from gyroid_cad.filling import fill as filling
from gyroid_cad.filling.filled import Filled
from gyroid_cad.kernel import apart
from gyroid_cad.kernel.brep import read_brep, write_brep
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.part import measure
from gyroid_cad.surface.fit import FitSettings

cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
bd = pytest.importorskip("build123d", reason="build123d is not installed")

from gyroid_cad import bd_objects, cq_plugin  # noqa: E402 (they need the hosts)

# Of a part to fill, and of the cells that fill it: an eighth of a cell, which is as dense as the whole.
SIDE, CELL = 4.0, 8.0
Given = dict[str, Any]
Captured = pytest.CaptureFixture[str]


@dataclass(frozen=True)
class Made:
    """What came out of a door: a shape, the file that was written, what was said, and what was told on the way."""

    shape: Any = None
    file: Path = Path()
    said: str = ""
    stages: list[str] = field(default_factory=list)
    report: Mapping[str, Any] = field(default_factory=dict)

    @property
    def volume(self) -> float:
        return measure(self.shape)[0]

    @property
    def box(self) -> Any:
        return bounding_box(self.shape)

    @property
    def extent(self) -> Any:
        return np.ptp(self.box, axis=0)

    @property
    def between_corners(self) -> Any:
        """Largest distances between vertices along each axis: a cut face's box is that of all its surface."""
        points = [BRep_Tool.Pnt_s(TopoDS.Vertex_s(corner)) for corner in parts_of(self.shape, TopAbs_VERTEX)]
        return np.ptp([(point.X(), point.Y(), point.Z()) for point in points], axis=0)

    @property
    def solids(self) -> int:
        return len(list(parts_of(self.shape, TopAbs_SOLID)))

    @property
    def levels(self) -> set[tuple[float, float]]:
        """Lowest and highest corners of each solid, along z."""
        found = set()
        for solid in parts_of(self.shape, TopAbs_SOLID):
            z = [BRep_Tool.Pnt_s(TopoDS.Vertex_s(corner)).Z() for corner in parts_of(solid, TopAbs_VERTEX)]
            found.add((round(min(z), 6), round(max(z), 6)))
        return found

    @property
    def faces(self) -> int:
        return len(list(parts_of(self.shape, TopAbs_FACE)))

    @property
    def poles(self) -> int:
        """The most control points along a side of any face."""
        surfaces = [BRepAdaptor_Surface(TopoDS.Face_s(face)) for face in parts_of(self.shape, TopAbs_FACE)]
        return max(s.BSpline().NbUPoles() for s in surfaces if s.GetType() == GeomAbs_BSplineSurface)

    @property
    def triangles(self) -> int:
        """Of a binary STL file."""
        return int.from_bytes(self.file.read_bytes()[80:84], "little")


Look = Callable[[Made, Made], bool]


@dataclass(frozen=True)
class Case:
    """Options beside or instead of the usual ones, and whether what they make is what was asked for."""

    given: Given
    look: Look
    without: tuple[str, ...] = ()


def block_at(corner: float, side: float = SIDE) -> Any:
    return BRepPrimAPI_MakeBox(gp_Pnt(corner, corner, corner), side, side, side).Shape()


def grown(made: Made, usual: Made) -> bool:
    return made.volume > 1.01 * usual.volume


def weighed(made: Made, usual: Made) -> bool:
    """Whether the mass in g, of a report or in the table, is that of the material."""
    mass = made.report["mass"] if made.report else float(re.findall(r"mass +([\d.]+) g", made.said)[0])
    return near(mass, 2.7e-3 * made.volume, 1e-3)


def smaller(made: Made, usual: Made) -> bool:
    return 0 < made.volume < usual.volume


def changed(made: Made, usual: Made) -> bool:
    return not near(made.volume, usual.volume, 1e-6) and near(made.volume, usual.volume, 0.3)


def near(value: Any, expected: Any, rel: float = 2e-2) -> bool:
    return bool(np.allclose(value, expected, rtol=rel, atol=rel))


def told(made: Made, *words: str) -> bool:
    return all(word in made.said for word in words)


def sized(made: Made, usual: Made) -> bool:
    """Whether the file has a few triangles, as large as they may be."""
    return 0 < made.triangles < 4000


def nodes_of(made: Made) -> int:
    """Nodes of an Abaqus file of tetrahedra."""
    before, elements = made.file.read_text().split("*ELEMENT, TYPE=C3D4, ELSET=sheet")
    return len(before.split("NSET=ALL_NODES")[1].split()) if elements else 0


USUAL: dict[str, Given] = {
    "build": {"cells": (1, 1, 1), "cell size": 10, "thickness": 0.8, "control points": 4},
    "fill": {"part": block_at(0), "cell size": CELL, "density": 0.2, "control points": 4},
}
PAPER = ("cell size", "thickness", "density")


def header(made: Made) -> str:
    return made.file.read_text(encoding="ascii").split("ENDSEC;")[0]


def corners_are_poles(text: str) -> bool:
    """Whether vertices stand on points that are control points too: so only what no kernel made is written."""
    corners = set(re.findall(r"=VERTEX_POINT\('',(#\d+)\)", text))
    return bool(corners & set(re.findall(r"#\d+", "".join(re.findall(r"=B_SPLINE_CURVE[^;]*", text)))))


def described_by(made: Design, look: Look, instead: str) -> dict[str, Case]:
    """Cases of a lattice that is described by its pores, its area or its curvature beside its cell."""
    names = {name.replace("_", " "): getattr(made, name) for name in TARGETS[1:]}
    return {name: Case({name: value}, look, (instead,)) for name, value in names.items()}


WRITTEN = {
    "file": Case({"file": "made.brep"}, lambda made, usual: read_brep(made.file).ShapeType() is not None),
    "schema": Case({"file": "made.step", "schema": "ap242"}, lambda made, usual: b"AP242" in made.file.read_bytes()),
    "author": Case(
        {"file": "made.step", "author": "Zoë O'Neill"},
        lambda made, usual: "('Zo\\X2\\00EB\\X0\\ O''Neill')" in header(made),
    ),
    "organisation": Case(
        {"file": "made.step", "organisation": "A \\ B"}, lambda made, usual: "('A \\\\ B')" in header(made)
    ),
    "pcurves": Case({"file": "made.step", "pcurves": True}, lambda made, usual: b"=PCURVE(" in made.file.read_bytes()),
    "deviation": Case({"file": "made.stl", "deviation": 0.2}, sized),
    "products": Case(
        {"file": "made.step", "kind": "bodies", "products": True},
        lambda made, usual: made.file.read_bytes().count(b"=NEXT_ASSEMBLY_USAGE_OCCURRENCE(") == 3,
    ),
    "regions": Case(
        {"file": "made.stl", "kind": "bodies", "regions": "fluid-a", "deviation": 0.2},
        lambda made, usual: b"endsolid wall_a" in made.file.read_bytes(),
    ),
    "angle": Case({"file": "made.stl", "deviation": 0.5, "angle": 80}, sized),
    "check": Case(
        {"file": "made.brep", "check": True}, lambda made, usual: told(made, "largest tolerance", "closed, valid")
    ),
    "printer": Case({"file": "made.brep", "printer": "form2"}, lambda made, usual: told(made, "Form 2")),
    "progress": Case({"cell size": 9, "progress": True}, lambda made, usual: len(set(made.stages)) > 1),
    "json": Case({"file": "made.brep", "json": True}, lambda made, usual: json.loads(made.said)["files"] != []),
    "quiet": Case({"file": "made.brep", "quiet": True}, lambda made, usual: made.said == "" and made.file.exists()),
    "print config": Case({"print config": True}, lambda made, usual: told(made, "cell_size = ")),
    "allow outside": Case(
        {"file": "../outside.brep", "allow outside": True}, lambda made, usual: made.file.resolve().exists()
    ),
    "debug": Case({"cell size": -1, "debug": True}, lambda made, usual: told(made, "Traceback", "--cell-size = -1")),
}
CASES: dict[str, dict[str, Case]] = {
    "build": {
        **WRITTEN,
        "cells": Case({"cells": (2, 1, 1)}, lambda made, usual: near(made.extent - usual.extent, (10, 0, 0))),
        "cell size": Case({"cell size": 12}, lambda made, usual: made.extent[0] > usual.extent[0] + 2),
        "thickness": Case({"thickness": 1.2}, lambda made, usual: near(made.volume / usual.volume, 1.5)),
        "density": Case({"density": 0.3}, lambda made, usual: near(made.volume, 300), ("thickness",)),
        "porosity": Case({"porosity": 0.7}, lambda made, usual: near(made.volume, 300), ("thickness",)),
        **described_by(
            design(cell_size=10, thickness=1.2), lambda made, usual: near(made.volume / usual.volume, 1.5), "thickness"
        ),
        "surface": Case({"surface": "diamond"}, lambda made, usual: near(made.faces / usual.faces, 2, 0.5)),
        "tolerance": Case({"tolerance": 1e-4}, lambda made, usual: made.poles > usual.poles),
        "compact": Case({"compact": 3e-3}, lambda made, usual: made.poles == 6, ("control points",)),
        "fit": Case({"fit": "paper"}, lambda made, usual: told(made, "4.36e-03"), ("control points",)),
        "control points": Case({"control points": 6}, lambda made, usual: (made.poles, usual.poles) == (6, 4)),
        "trim": Case({"trim": "box"}, lambda made, usual: near(made.between_corners, 10, 1e-6) and made.solids == 1),
        **{name: Case({**WRITTEN[name].given, "trim": "box"}, WRITTEN[name].look) for name in ("products", "regions")},
        "keep islands": Case({"trim": "box", "keep islands": True}, lambda made, usual: made.solids == 3),
        "kind": Case(
            {"trim": "box", "kind": "bodies"}, lambda made, usual: near(made.volume, 1000) and made.solids == 3
        ),
        "scale field": Case({"scale field": "1 + 0.02*x"}, grown),
        "map": Case({"map": "bend:angle=40"}, lambda made, usual: not near(made.extent, usual.extent)),
        "origin": Case({"origin": (5, 6, 7)}, lambda made, usual: near(made.box - usual.box, [[5, 6, 7]] * 2, 1e-6)),
        "rotation": Case(
            {"rotation": (0, 0, 90)},
            lambda made, usual: near(made.extent, usual.extent[[1, 0, 2]]) and near(made.volume, usual.volume, 1e-6),
        ),
        "thickness factor": Case(
            {"thickness factor": 0.16, "scale": 5}, lambda made, usual: near(made.volume, usual.volume), PAPER
        ),
        "bc length": Case(
            {"thickness factor": 0.16, "bc length": 2, "scale": 5},
            lambda made, usual: near(made.volume / usual.volume, 4, 0.1),
            PAPER,
        ),
        "scale": Case(
            {"thickness factor": 0.16, "scale": 10}, lambda made, usual: near(made.volume / usual.volume, 8), PAPER
        ),
        "angle": Case(
            {"file": "made.stl", "trim": "box", "deviation": 0.5, "angle": 80},
            sized,
        ),
        "kernel check": Case(
            {"file": "made.step", "kernel check": True},
            lambda made, usual: not corners_are_poles(made.file.read_text()),
        ),
        "instances": Case(
            {"file": "made.step", "cells": (2, 1, 1), "instances": True},
            lambda made, usual: made.file.read_bytes().count(b"NEXT_ASSEMBLY_USAGE_OCCURRENCE(") == 2,
        ),
        "alignment": Case({"alignment": False}, lambda made, usual: near(made.box[0], 0, 1e-5)),
        "combination": Case({"combination": False}, lambda made, usual: made.solids == 1),
        "clean": Case({"clean": True}, lambda made, usual: made.faces == usual.faces),
    },
    "fill": {
        **WRITTEN,
        "part": Case({"part": block_at(0, 3)}, lambda made, usual: near(made.between_corners, 3)),
        "cell size": Case({"cell size": 4}, lambda made, usual: made.faces > usual.faces),
        "thickness": Case({"thickness": 1.2}, grown, ("density",)),
        "density": Case({"density": 0.3}, lambda made, usual: near(made.volume, 0.3 * SIDE**3, 0.1)),
        "porosity": Case({"porosity": 0.7}, lambda made, usual: near(made.volume, 0.3 * SIDE**3, 0.1), ("density",)),
        **described_by(
            design(cell_size=CELL, density=0.3), lambda made, usual: near(made.volume, 0.3 * SIDE**3, 0.1), "density"
        ),
        "surface": Case({"surface": "diamond"}, lambda made, usual: made.faces > usual.faces),
        "tolerance": Case(
            {"density": "0.2 + 0.005*x", "tolerance": 2e-5}, lambda made, usual: made.poles > 10, ("control points",)
        ),
        "compact": Case({"compact": 3e-3}, lambda made, usual: made.poles == 6, ("control points",)),
        "fit": Case({"fit": "paper"}, lambda made, usual: told(made, "4.36e-03"), ("control points",)),
        "control points": Case({"control points": 6}, lambda made, usual: (made.poles, usual.poles) == (6, 4)),
        "keep islands": Case({"part": block_at(0, CELL), "keep islands": True}, lambda made, usual: made.solids == 3),
        "kind": Case({"kind": "network-a"}, lambda made, usual: near(made.volume, usual.volume, 0.1)),
        "skin": Case({"skin": 0.5}, lambda made, usual: near(made.between_corners, SIDE, 1e-6) and grown(made, usual)),
        "openings": Case(
            {"skin": 0.5, "openings": [">Z"]},
            lambda made, usual: grown(made, usual) and made.volume < SIDE**3 - 0.7 * 3 * 3 * 3.5,
        ),
        "plug": Case(
            {"kind": "bodies", "skin": 0.5, "openings": ["a:>Z", "b:<Z"], "plug": 1.0},
            lambda made, usual: {(0, SIDE), (0, SIDE - 1), (1, SIDE)} <= made.levels,
        ),
        "core": Case(
            {"core": block_at(0.5, 3)},
            lambda made, usual: near(made.between_corners, SIDE, 1e-6) and SIDE**3 - 3**3 < made.volume < SIDE**3,
        ),
        "solids": Case(
            {"part": compound_of([block_at(20, 3), block_at(0)]), "solids": [2]},
            lambda made, usual: made.solids == 1 and near(made.volume, usual.volume, 1e-6),
        ),
        "partial": Case(
            {"cells": (1, 1, 1), "map": "cylinder:radius=6", "tolerance": 1e-2, "partial": True},
            smaller,
            ("control points",),
        ),
        "origin": Case({"origin": (2, 0, 0)}, changed),
        "rotation": Case({"rotation": (0, 0, 30)}, changed),
        "drop islands": Case(
            {"part": BRepPrimAPI_MakeBox(6.0, 6.0, 1.0).Shape(), "drop islands": True},
            # Two pieces of this plate are left otherwise, the smaller one of 1.08 mm3.
            lambda made, usual: made.solids == 1 and near(made.volume, 5.344, 1e-3),
        ),
        "route": Case(
            {"file": "made.stl", "route": "triangles", "deviation": 0.2},
            lambda made, usual: sized(made, usual) and (told(made, "no B-rep was made") or made.report["faces"] < 4000),
        ),
        "fillet": Case(
            {"file": "made.stl", "route": "triangles", "deviation": 0.2, "skin": 0.5, "fillet": 0.3},
            lambda made, usual: made.triangles > 4000,
        ),
        "repair": Case(
            {"file": "made.stl", "route": "triangles", "deviation": 0.2, "repair": True},
            sized,
        ),
        "material density": Case({"material density": 2.7}, weighed),
        "lattice": Case(
            {"lattice": Lattice((2, 2, 2), CELL, density=0.2, origin=(-8, -8, -8), fit=FitSettings(4))},
            lambda made, usual: near(made.volume, usual.volume),
            ("cell size", "density", "control points"),
        ),
        "cells": Case({"cells": (1, 1, 1)}, lambda made, usual: near(made.volume, usual.volume)),
        "scale field": Case({"cells": (1, 1, 1), "scale field": "1 - 0.02*x"}, smaller),
        "map": Case({"cells": (1, 1, 1), "map": "twist:angle=30"}, changed),
        "thickness factor": Case({"cells": (1, 1, 1), "thickness factor": 0.2, "scale": 4}, grown, PAPER),
        "bc length": Case({"cells": (1, 1, 1), "thickness factor": 0.2, "bc length": 3.6}, smaller, PAPER),
        "scale": Case({"cells": (1, 1, 1), "thickness factor": 0.1, "scale": 4}, smaller, PAPER),
        "element size": Case({"file": "made.inp", "element size": 2.0}, lambda made, usual: 5 < nodes_of(made) < 1500),
        "elements through": Case(
            {"file": "made.inp", "elements through": 1}, lambda made, usual: 5 < nodes_of(made) < 1500
        ),
        "order": Case(
            {"file": "made.inp", "element size": 2.0, "order": 2}, lambda made, usual: "C3D10" in made.file.read_text()
        ),
        "combination": Case({"combination": bd.Mode.PRIVATE}, lambda made, usual: near(made.volume, usual.volume)),
    },
}
TABLES = {"build": LATTICE, "fill": FILL}


def at_door(door: str, table: str, given: Given) -> Given:
    """Options under the names that a door has for them; those it has none for are left out."""
    rows = {row.option: getattr(row, door) for row in TABLES[table]}
    in_fit = isinstance(rows["control points"], Absent)
    names = {rows[option]: value for option, value in given.items() if not isinstance(rows[option], Absent)}
    if in_fit and "control points" in given:
        names["fit"] = FitSettings(given["control points"])
    elif in_fit and "fit" in given:
        names["fit"] = FitSettings.paper()
    return names


def python(table: str, given: Given, folder: Path, captured: Captured) -> Made:
    stages: list[str] = []
    names = at_door("python", table, given)
    path = names.pop("paths", None)
    if "progress" in names:
        names["progress"] = lambda stage, done, total: stages.append(stage)
    if table == "fill":
        maker: Any = fill if "progress" in names else known
    else:
        maker = Lattice.paper if "thickness_factor" in names else Lattice
    own = taken(fill if table == "fill" else maker)
    if names.get("route") != "triangles":
        # Of triangles that a solid is written as.
        own -= {"deviation"}
    made = maker(**{name: value for name, value in names.items() if name in own})
    rest = {name: value for name, value in names.items() if name not in own}
    report = made.report.as_dict() if table == "fill" else {}
    if path is None:
        return Made(made.solid(**rest), stages=stages, report=report)
    made.write(folder / path, **rest)
    shape = made.solid() if hasattr(made, "solid") else None
    return Made(shape, folder / path, stages=stages, report=report)


def shell(table: str, given: Given, folder: Path, captured: Captured) -> Made:
    arguments = [table]
    for name, value in at_door("shell", table, {"file": "made.brep", **given}).items():
        if not name.startswith("--"):
            write_brep(value, folder / "part.brep")
            arguments.insert(1, "part.brep")
        elif name == "--core":
            write_brep(value, folder / "core.brep")
            arguments += [name, "core.brep"]
        elif value is True:
            arguments.append(name)
        elif isinstance(value, list):
            arguments += [word for item in value for word in (name, str(item))]
        else:
            arguments += [name, *map(str, value if isinstance(value, tuple) else [value])]
    return answered(arguments, given, folder, captured)


def toml(table: str, given: Given, folder: Path, captured: Captured) -> Made:
    keys = at_door("toml", table, {"file": "made.brep", **given})
    for key in {"part", "core"} & keys.keys():
        write_brep(keys[key], folder / f"{key}.brep")
        keys[key] = f"{key}.brep"
    (folder / "options.toml").write_text(tomli_w.dumps(keys))
    return answered([table, "options.toml"], given, folder, captured)


def answered(arguments: list[str], given: Given, folder: Path, captured: Captured) -> Made:
    """What the program, run in a folder, made and said."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        main(arguments)
    out, err = captured.readouterr()
    # JSON is read from standard output alone.
    said = out if "--json" in arguments or given.get("json") else out + err
    file = folder / given.get("file", "made.brep")
    shape = read_brep(file) if file.exists() and file.suffix == ".brep" else None
    return Made(shape, file, said, report=json.loads(said) if "--json" in arguments else {})


def cadquery(table: str, given: Given, folder: Path, captured: Captured) -> Made:
    names = at_door("cadquery", table, given)
    if table == "build":
        return Made(cq.Workplane().gyroid(**names).val().wrapped)
    return Made(cq.Workplane(obj=cq.Shape.cast(given["part"])).gyroid_fill(**names).val().wrapped)


def build123d(table: str, given: Given, folder: Path, captured: Captured) -> Made:
    words = {"alignment": bd.Align.MIN, "combination": bd.Mode.PRIVATE}
    names = at_door("build123d", table, {option: words.get(option, value) for option, value in given.items()})
    if table == "build":
        return Made(bd_objects.Gyroid(**names).wrapped)
    filled = bd_objects.GyroidFill(**names)
    return Made(filled.wrapped, report=filled.report.as_dict())


MAKERS = {"python": python, "shell": shell, "toml": toml, "cadquery": cadquery, "build123d": build123d}
REACHED = [
    pytest.param(table, row.option, door, id=f"{table}-{row.option}-{door}")
    for table, rows in TABLES.items()
    for row in rows
    for door in DOORS
    if not isinstance(getattr(row, door), Absent)
]


def test_each_option_has_a_case() -> None:
    for table, rows in TABLES.items():
        assert {row.option for row in rows} == CASES[table].keys()


known = filled_once(fill)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts are read without a process of their own, and filled once with what every door hands over."""
    monkeypatch.setattr(apart, "read_apart", lambda path, reader: reader(str(path)))
    for module in (filling, cq_plugin, bd_objects):
        monkeypatch.setattr(module, "fill", known)


@pytest.fixture(scope="module")
def usual() -> dict[str, Made]:
    """What each table's usual options make, in Python."""
    lattice = Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(4))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IslandsWarning)
        filled = fill(block_at(0), CELL, density=0.2, fit=FitSettings(4))
    return {"build": Made(lattice.solid()), "fill": Made(filled.solid())}


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning", "ignore::gyroid_cad.errors.SealedVoidsWarning")
@pytest.mark.parametrize(("table", "option", "door"), REACHED)
def test_an_option_does_what_it_says(
    table: str, option: str, door: str, usual: dict[str, Made], tmp_path: Path, capsys: Captured
) -> None:
    case = CASES[table][option]
    given = {name: value for name, value in USUAL[table].items() if name not in case.without} | case.given
    (tmp_path / "folder").mkdir()
    try:
        made = MAKERS[door](table, given, tmp_path / "folder", capsys)
    except FitError as refused:
        made = Made(said=str(refused))
    assert case.look(made, usual[table]), made


def taken(function: Callable[..., Any]) -> set[str]:
    """Parameters of a function, but for the shape that a method is of."""
    return set(inspect.signature(function).parameters) - {"self", "args", "kwargs"}


def shell_names(command: str) -> set[str]:
    options = commands.get_command(click.Context(commands), command).params
    return {max(option.opts, key=len) if option.param_type_name == "option" else "PART" for option in options}


NAMES = {
    ("build", "python"): taken(Lattice) | taken(Lattice.paper) | taken(Lattice.write),
    ("build", "shell"): shell_names("build") - {"PART"},
    ("build", "cadquery"): taken(cq_plugin.gyroid),
    ("build", "build123d"): taken(bd_objects.Gyroid.__init__),
    ("fill", "python"): taken(fill) | taken(Filled.write),
    ("fill", "shell"): shell_names("fill"),
    ("fill", "cadquery"): taken(cq_plugin.gyroid_fill),
    ("fill", "build123d"): taken(bd_objects.GyroidFill.__init__),
}


@pytest.mark.parametrize(("table", "door"), NAMES)
def test_the_table_has_the_names_that_a_door_takes_no_more_and_no_fewer(table: str, door: str) -> None:
    names = {getattr(row, door) for row in TABLES[table]}
    assert {name for name in names if not isinstance(name, Absent)} == NAMES[table, door]


def test_where_a_door_lacks_an_option_a_reason_is_given() -> None:
    absent = [getattr(row, door) for rows in TABLES.values() for row in rows for door in DOORS]
    assert all(len(entry.reason) > 10 for entry in absent if isinstance(entry, Absent))
