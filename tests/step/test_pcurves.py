"""Curves of edges in the parameters of their faces: what the surface carries them to is the curve in space."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Plane
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from scipy.interpolate import BSpline

from gyroid_cad import FitSettings, Lattice, check_file, fill
from gyroid_cad.cli.app import main
from gyroid_cad.kernel.check import is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_edge, as_face
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.step.header import StepHeader

Floats = NDArray[np.float64]

COARSE = FitSettings(6)
WITH = StepHeader(pcurves=True)


class File:
    """A STEP file's entities, and what their curves and surfaces are, from the text alone."""

    def __init__(self, path: Path) -> None:
        self.entities = dict(re.findall(r"^#(\d+)=(.*);$", path.read_text(), re.MULTILINE))

    def of(self, kind: str) -> list[str]:
        return [text for text in self.entities.values() if text.startswith(f"{kind}(")]

    def given(self, number: str) -> tuple[str, list[Any]]:
        """An entity's name, and what is in its brackets: numbers, references, and lists of these."""
        name, rest = re.fullmatch(r"(\w+)\((.*)\)", self.entities[number], re.DOTALL).groups()  # type: ignore[union-attr]
        rest = re.sub(r"'[^']*'|\.\w+\.|\*|\$", "None", rest)
        rest = re.sub(r"#(\d+)", r"'\1'", rest)
        return name, eval(f"[{rest}]".replace("(", "[").replace(")", "]"), {"None": None})

    def place(self, number: str) -> Floats:
        return np.array(self.given(number)[1][1])

    def curve(self, number: str, t: Floats) -> Floats:
        """Points of a curve, in space or in parameters."""
        name, given = self.given(number)
        if name == "LINE":
            _, (_, way, rate) = self.given(given[2])
            return np.asarray(self.place(given[1]) + rate * t[:, np.newaxis] * self.place(way))
        if name == "CIRCLE":
            origin, axis, along = self.frame(given[1])
            return np.asarray(
                origin + given[2] * (np.outer(np.cos(t), along) + np.outer(np.sin(t), np.cross(axis, along)))
            )
        assert name == "B_SPLINE_CURVE_WITH_KNOTS", name
        poles = np.array([self.place(pole) for pole in given[2]])
        return np.asarray(BSpline(np.repeat(given[7], given[6]), poles, given[1])(t))

    def ends(self, number: str) -> tuple[float, float]:
        """Parameters between which an edge's curve is looked at: all of a spline, a turn of a circle."""
        name, given = self.given(number)
        return (given[7][0], given[7][-1]) if name.startswith("B_SPLINE") else (0.0, 1.0)

    def surface(self, number: str, uv: Floats) -> Floats:
        name, given = self.given(number)
        if name == "B_SPLINE_SURFACE_WITH_KNOTS":
            net = np.array([[self.place(pole) for pole in row] for row in given[3]])
            knots = [np.repeat(values, counts) for values, counts in ((given[10], given[8]), (given[11], given[9]))]
            rows, columns = (
                BSpline.design_matrix(np.clip(part, vector[0], vector[-1]), vector, degree).toarray()
                for part, vector, degree in zip(uv.T, knots, given[1:3], strict=True)
            )
            return np.einsum("qi,qj,ijk->qk", rows, columns, net)
        origin, axis, along = self.frame(given[1])
        u, v = uv.T
        turned = np.outer(np.cos(u), along) + np.outer(np.sin(u), np.cross(axis, along))
        if name == "CYLINDRICAL_SURFACE":
            return np.asarray(origin + given[2] * turned + np.outer(v, axis))
        if name == "SPHERICAL_SURFACE":
            return np.asarray(origin + given[2] * (np.cos(v)[:, np.newaxis] * turned + np.outer(np.sin(v), axis)))
        assert name == "TOROIDAL_SURFACE", name
        across = given[2] + given[3] * np.cos(v)
        return np.asarray(origin + across[:, np.newaxis] * turned + np.outer(given[3] * np.sin(v), axis))

    def frame(self, number: str) -> list[Floats]:
        return [self.place(part) for part in self.given(number)[1][1:]]

    def apart(self) -> Floats:
        """The largest distance of each curve in parameters, carried by its surface, from its edge's curve in space."""
        found = []
        for text in self.of("SURFACE_CURVE") + self.of("SEAM_CURVE"):
            in_space, *pcurves = re.findall(r"#(\d+)", text)
            t = np.linspace(*self.ends(in_space), 41)
            for pcurve in pcurves:
                surface, held = re.findall(r"#(\d+)", self.entities[pcurve])
                in_parameters = re.findall(r"#(\d+)", self.entities[held])[0]
                carried = self.surface(surface, self.curve(in_parameters, t))
                found.append(np.linalg.norm(carried - self.curve(in_space, t), axis=1).max())
        return np.array(found)


def cylinder() -> cq.Workplane:
    return cq.Workplane().cylinder(3, 2).translate((1, 2, 3))


PARTS = {
    "box": lambda: cq.Workplane().box(4, 3, 2),
    "cylinder": cylinder,
    "ball": lambda: cq.Workplane().sphere(2),
    "ring": lambda: cq.Workplane(obj=cq.Solid.makeTorus(3, 1)),
}


@pytest.mark.parametrize("name", PARTS)
def test_surfaces_carry_curves_in_parameters_to_those_in_space_at_the_same_parameter(name: str, tmp_path: Path) -> None:
    filled = fill(PARTS[name](), 8.0, density=0.3, fit=COARSE)
    filled.write(tmp_path / "with.step", pcurves=True)
    apart = File(tmp_path / "with.step").apart()
    # Every edge of the lattice's faces has at least one.
    assert len(apart) >= filled.report.faces
    assert apart.max() < 1.5e-7


def test_whole_patches_have_them_on_both_faces_of_every_edge(tmp_path: Path) -> None:
    Lattice((1, 1, 1), 8.0, 0.8, fit=COARSE).write(tmp_path / "cell.step", pcurves=True)
    file = File(tmp_path / "cell.step")
    assert len(file.apart()) == 2 * len(file.of("EDGE_CURVE")) == 2 * len(file.of("SURFACE_CURVE"))
    assert file.apart().max() < 1e-7


def test_a_seam_has_two_on_its_one_surface(tmp_path: Path) -> None:
    write_step(cq.Workplane().cylinder(3, 2).val().wrapped, tmp_path / "can.step", WITH)
    file = File(tmp_path / "can.step")
    (seam,) = file.of("SEAM_CURVE")
    assert len(re.findall("#", seam)) == 3
    assert file.apart().max() < 1e-12


def test_the_kernel_takes_them_for_its_own(tmp_path: Path) -> None:
    filled = fill(cylinder(), 8.0, density=0.3, fit=FitSettings(8))
    shape = filled.solid()

    def in_parameters(of: Any) -> list[int]:
        """Numbers of control points of all curves that are not straight, on faces that are not flat."""
        found = []
        for face in map(as_face, parts_of(of, TopAbs_FACE)):
            if not isinstance(BRep_Tool.Surface_s(face), Geom_Plane):
                curves = (
                    BRep_Tool.CurveOnSurface_s(as_edge(edge), face, 0.0, 0.0) for edge in parts_of(face, TopAbs_EDGE)
                )
                found += [curve.NbPoles() for curve in curves if isinstance(curve, Geom2d_BSplineCurve)]
        return sorted(count for count in found if count > 2)

    filled.write(tmp_path / "with.step", pcurves=True)
    filled.write(tmp_path / "without.step")
    back, bare = read_step(tmp_path / "with.step"), read_step(tmp_path / "without.step")
    assert is_valid(back)
    assert topology(back) == topology(shape)
    assert in_parameters(back) == in_parameters(shape) != in_parameters(bare)
    assert check_file(tmp_path / "with.step").ok
    ratio = (tmp_path / "with.step").stat().st_size / (tmp_path / "without.step").stat().st_size
    assert 1.0 < ratio < 2.0


def test_files_have_none_unless_they_are_asked_for(tmp_path: Path) -> None:
    fill(cylinder(), 8.0, density=0.3, fit=COARSE).write(tmp_path / "a.step")
    assert "PCURVE" not in (tmp_path / "a.step").read_text()


def test_the_shell_and_a_file_of_options_write_them_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(
        'output = "a.step"\ncells = [1, 1, 1]\ncell_size = 8\nthickness = 0.8\npcurves = true\n'
    )
    options = ["--cells", "1", "1", "1", "--cell-size", "8", "--thickness", "0.8", "--pcurves", "--quiet"]
    for arguments in (["cell.toml", "--quiet"], ["-o", "b.step", *options], ["-o", "c.step", *options, "--instances"]):
        assert main(["build", *arguments]) == 0
    counts = [(tmp_path / f"{name}.step").read_text().count("=PCURVE(") for name in "abc"]
    assert counts[0] == counts[1] == counts[2] > 0
