"""The order of a solid's faces, edges and vertices is that of where they are, whatever made it."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest
from OCP.BRep import BRep_Builder
from OCP.TopAbs import TopAbs_FACE, TopAbs_FORWARD
from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid

from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_solid
from gyroid_cad.kernel.ordered import in_order
from gyroid_cad.kernel.part import measure

cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")

SOLIDS = {
    "box": cq.Workplane().box(6, 5, 4),
    "plate with a hole": cq.Workplane().box(6, 5, 4).faces(">Z").workplane().hole(2),
    "hollow": cq.Workplane().sphere(4).cut(cq.Workplane().sphere(2)),
    "ring": cq.Workplane().add(cq.Solid.makeTorus(5, 1)),
    "loft": cq.Workplane().ellipse(4, 3).workplane(offset=5).ellipse(2, 2).loft(),
}


def solid(name: str) -> TopoDS_Solid:
    return as_solid(SOLIDS[name].solids().val().wrapped)


def shuffled(given: TopoDS_Solid, seed: int) -> TopoDS_Solid:
    """The same faces in another order."""
    builder, made, shell = BRep_Builder(), TopoDS_Solid(), TopoDS_Shell()
    builder.MakeSolid(made)
    builder.MakeShell(shell)
    faces = list(parts_of(given, TopAbs_FACE))
    random.Random(seed).shuffle(faces)
    for face in faces:
        builder.Add(shell, face)
    shell.Closed(True)
    builder.Add(made, shell.Oriented(TopAbs_FORWARD))
    return made


def text(made: TopoDS_Solid, path: Path) -> bytes:
    write_brep(made, path)
    return path.read_bytes()


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_in_order_is_the_same_solid(name: str) -> None:
    given, made = solid(name), in_order(solid(name))
    assert is_valid(made)
    assert topology(made) == topology(given)
    assert measure(made) == pytest.approx(measure(given), rel=1e-9)


@pytest.mark.parametrize("name", [name for name in SOLIDS if name != "hollow"])
def test_the_order_does_not_depend_on_the_one_before(name: str, tmp_path: Path) -> None:
    orders = {text(in_order(shuffled(solid(name), seed)), tmp_path / "a.brep") for seed in range(4)}
    assert len(orders) == 1


# Slow: two processes load the kernel and its host, and offset a part.
@pytest.mark.slow
def test_a_skin_gives_the_same_bytes_in_every_process(tmp_path: Path) -> None:
    # The kernel's offsets go by addresses in memory, which differ from process to process.
    program = (
        "import sys, cadquery as cq\n"
        "from gyroid_cad.kernel.brep import write_brep\n"
        "from gyroid_cad.kernel.part import require_part\n"
        "from gyroid_cad.kernel.skin import hollow\n"
        "plate = cq.Workplane().box(20, 15, 8).faces('>Z').workplane().hole(5)\n"
        "write_brep(hollow(require_part(plate.val().wrapped), 1.0).core.shape, sys.argv[1])\n"
    )
    paths = [tmp_path / f"{number}.brep" for number in range(2)]
    for process in [subprocess.Popen([sys.executable, "-c", program, str(path)]) for path in paths]:
        assert process.wait() == 0
    assert paths[0].read_bytes() == paths[1].read_bytes()
