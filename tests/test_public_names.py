"""The public names: about twenty at the top, none of them a host's, and those of before where they were."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

import gyroid_cad
from gyroid_cad import Lattice
from gyroid_cad.former import FORMER_MODULES
from gyroid_cad.surface.fit import FitSettings

LATTICE = Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(4))

# Names of the top as it was, and where they are.
MOVED = {
    **dict.fromkeys(("Bend", "Cylinder", "SpaceMap", "Sphere", "Twist"), "maps"),
    **dict.fromkeys(("between_planes", "constant", "distance_from_axis", "distance_from_point"), "fields"),
    **dict.fromkeys(("expression", "linear", "radial", "sampled", "smooth_maximum", "smooth_minimum"), "fields"),
    **dict.fromkeys(("Assembly", "AssemblyReport"), "builds.assembly"),
    "TriangleReport": "builds.triangles",
    "NurbsSurface": "nurbs.surface",
    "fit_patch": "surface.fit",
    **dict.fromkeys(("FitReport", "fit_report"), "surface.fit_report"),
    "SoundnessError": "SelfIntersectionError",
}
# A name that each module of before had.
FORMER_NAMES = {
    "block_maps": "Cylinder",
    "bounding_cells": "bounding_cell",
    "complex": "build_complex",
    "exact_wall": "exact_measures",
    "families": "SURFACES",
    "field_makers": "linear",
    "fit": "fit_patch",
    "fit_settings": "FitSettings",
    "mesh.abaqus": "write_abaqus",
    "mesh.hexahedra": "Mesh",
    "mesh.mesh_files": "write_mesh",
    "mesh.periodic": "PeriodicPairs",
    "mesh.quality": "quality_report",
    "mesh.summaries": "Quality",
    "mesh.volume_files": "write_mfem_field",
    "mesh.volumes": "VolumePatches",
    "meshing": "mesh_quality",
    "patch": "PARAMETERISATIONS",
    "printers": "Printer",
    "symmetry": "orbit",
    "triangles": "Triangles",
    "tube": "tube_law",
    "weierstrass": "GYROID",
}


def starred(package: str) -> set[str]:
    """Names that ``import *`` brings from a package."""
    space: dict[str, object] = {}
    exec(f"from {package} import *", space)
    return set(space) - {"__builtins__"}


def test_a_star_imports_about_twenty_names_and_none_that_a_host_has() -> None:
    ours = starred("gyroid_cad")
    assert 15 <= len(ours) <= 27
    assert "Lattice" in ours
    assert not ours & (starred("cadquery") | starred("build123d"))


@pytest.mark.parametrize("name", MOVED)
def test_a_name_of_the_top_as_it_was_still_works_and_says_where_it_is_now(name: str) -> None:
    place = MOVED[name]
    said = f"gyroid_cad.{place}" if name == "SoundnessError" else f"gyroid_cad.{place}.{name}"
    with pytest.warns(DeprecationWarning, match=rf"^gyroid_cad\.{name} is now {said};") as warned:
        old = getattr(gyroid_cad, name)
    # The one who asked is named, not the package.
    assert warned[0].filename == __file__
    home, _, now = said.rpartition(".")
    assert old is getattr(import_module(home), now)
    assert name not in dir(gyroid_cad)


def test_the_error_that_was_renamed_is_caught_under_its_old_name() -> None:
    with pytest.warns(DeprecationWarning, match="SelfIntersectionError"):
        from gyroid_cad.errors import SoundnessError
    with pytest.raises(SoundnessError, match="folds over"):
        Lattice((1, 1, 1), 10, "3 + 0.1*x", fit=FitSettings(4), tolerance=1e-2).fitted()


@pytest.mark.parametrize("module", FORMER_MODULES)
def test_a_module_of_before_still_hands_out_its_names(module: str) -> None:
    name = FORMER_NAMES[module.removeprefix("gyroid_cad.")]
    with pytest.warns(DeprecationWarning, match=rf"^{module}\.{name} is now ") as warned:
        value = getattr(import_module(module), name)
    assert warned[0].filename == __file__
    homes = [import_module(home) for home in FORMER_MODULES[module]]
    assert value in [getattr(home, name, None) for home in homes]
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        import_module(module).nothing  # noqa: B018


@pytest.mark.parametrize(("module", "name"), [("wall", "Wall"), ("nurbs", "NurbsSurface")])
def test_a_room_that_has_the_name_of_a_module_hands_out_that_modules_names(module: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"^gyroid_cad\.{module}\.{name} is now "):
        assert getattr(import_module(f"gyroid_cad.{module}"), name).__name__ == name


def test_no_module_of_before_hides_one_of_today_and_others_are_not_found() -> None:
    folder = Path(gyroid_cad.__file__).parent
    for module in FORMER_MODULES:
        inner = folder.joinpath(*module.split(".")[1:])
        assert not inner.with_suffix(".py").exists()
        assert not inner.is_dir()
    with pytest.raises(ModuleNotFoundError):
        import_module("gyroid_cad.gyroidal")


def test_functions_that_wrote_files_still_write_what_methods_write(tmp_path: Path) -> None:
    mesh, volumes = LATTICE.hexahedra(1), LATTICE.volumes()
    pairs = LATTICE.periodic_pairs(mesh)
    mesh.write(tmp_path / "mesh.inp", pairs=pairs)
    volumes.write(tmp_path / "volumes.xml")
    volumes.write_field(range(len(volumes.control_points)), tmp_path / "field.gf")
    pairs.write(tmp_path / "equations.inp", reference=9999)
    with pytest.warns(DeprecationWarning, match="is now the method write"):
        from gyroid_cad import write_mesh, write_periodic_equations, write_volumes
    with pytest.warns(DeprecationWarning, match="is now the method write_field"):
        from gyroid_cad.mesh.volume_files import write_mfem_field
    write_mesh(mesh, tmp_path / "old_mesh.inp", pairs)
    write_volumes(volumes, tmp_path / "old_volumes.xml")
    write_mfem_field(volumes, range(len(volumes.control_points)), tmp_path / "old_field.gf")
    with (tmp_path / "old_equations.inp").open("w") as file:
        write_periodic_equations(pairs, file, 9999)
    for name in ("mesh.inp", "volumes.xml", "field.gf", "equations.inp"):
        assert (tmp_path / f"old_{name}").read_text() == (tmp_path / name).read_text()


def test_everything_that_writes_itself_takes_many_paths_and_checks_each_before_it_writes_any(tmp_path: Path) -> None:
    mesh, volumes = LATTICE.hexahedra(1), LATTICE.volumes()
    writers = {
        ".stl": LATTICE.write,
        ".3mf": LATTICE.triangles(0.5).write,
        ".step": LATTICE.assembly().write,
        ".vtu": mesh.write,
        ".xml": volumes.write,
        ".gf": lambda *paths: volumes.write_field(range(len(volumes.control_points)), *paths),
        ".inp": lambda *paths: LATTICE.periodic_pairs(mesh).write(*paths, reference=9999),
    }
    for ending, write in writers.items():
        with pytest.raises(gyroid_cad.ParameterError, match=r"output = .+nowhere"):
            write(tmp_path / f"a{ending}", tmp_path / f"nowhere{ending}" / f"b{ending}")
        with pytest.raises(gyroid_cad.ParameterError, match="output"):
            write(tmp_path / f"a{ending}", tmp_path / "b.txt")
        with pytest.raises(gyroid_cad.ParameterError, match="at least one file name"):
            write()
    assert list(tmp_path.iterdir()) == []
    for ending, write in writers.items():
        write(str(tmp_path / f"a{ending}"), tmp_path / f"b{ending}")
        assert all((tmp_path / f"{name}{ending}").stat().st_size for name in "ab")
