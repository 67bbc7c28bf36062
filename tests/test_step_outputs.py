"""The committed results are what the manifest says, and what the code makes today."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import trimesh
from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.kernel.step import read_step

FOLDER = Path(__file__).parents[1] / "step_outputs"
MANIFEST: list[dict[str, Any]] = json.loads((FOLDER / "manifest.json").read_text())
SOLIDS = [entry for entry in MANIFEST if not entry["file"].endswith(".stl")]


def rebuild_script(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("rebuild", FOLDER / "rebuild.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "rebuild", module)
    spec.loader.exec_module(module)
    return module


def read_solid(path: Path) -> TopoDS_Shape:
    if path.suffix == ".step":
        return read_step(path)
    shape = TopoDS_Shape()
    assert BRepTools.Read_s(shape, str(path), BRep_Builder())
    return shape


@pytest.mark.parametrize("entry", MANIFEST, ids=lambda entry: entry["file"])
def test_a_committed_file_has_the_bytes_of_the_manifest(entry: dict[str, Any]) -> None:
    content = (FOLDER / entry["file"]).read_bytes()
    assert len(content) == entry["bytes"]
    assert hashlib.sha256(content).hexdigest() == entry["sha256"]


@pytest.mark.parametrize("entry", SOLIDS, ids=lambda entry: entry["file"])
def test_a_committed_solid_is_valid_closed_and_of_the_volume_named(entry: dict[str, Any]) -> None:
    shape = read_solid(FOLDER / entry["file"])
    counted = topology(shape)
    assert is_valid(shape)
    assert counted.closed
    assert (counted.solids, counted.faces) == (1, entry["faces"])
    assert enclosed_volume(shape) == pytest.approx(entry["volume"], rel=1e-9)


def test_the_committed_stl_is_closed() -> None:
    (entry,) = [entry for entry in MANIFEST if entry["file"].endswith(".stl")]
    mesh = trimesh.load_mesh(FOLDER / entry["file"])
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(entry["volume"], rel=2e-2)


def test_rebuilding_gives_the_same_solids(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    rebuild_script(monkeypatch).main(tmp_path)
    rebuilt = json.loads((tmp_path / "manifest.json").read_text())
    # Last digits may differ between machines, so the files' hashes are not compared.
    for new, old in zip(rebuilt, MANIFEST, strict=True):
        for key in ("file", "cells", "cell_size", "rational", "schema", "faces"):
            assert new[key] == old[key]
        assert new["volume"] == pytest.approx(old["volume"], rel=1e-12)
