"""Who may import whom: the order of the modules, and what loads the kernel and its hosts."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.util import resolve_name
from pathlib import Path

import pytest

import gyroid_cad

FOLDER = Path(gyroid_cad.__file__).parent

# Each module may import only from rows above its own; those of one row know nothing of each other.
ROWS = [
    ["errors"],
    ["version"],
    ["arrays", "roots"],
    ["checks", "stages", "remembered"],
    ["picture", "printers"],
    ["expressions"],
    ["fields"],
    ["field_makers"],
    ["maps"],
    ["block_maps"],
    ["weierstrass"],
    ["patch"],
    ["nurbs"],
    ["nurbs_volume"],
    ["fit_settings"],
    ["fit"],
    ["symmetry", "tube"],
    ["bounding_cells"],
    ["families"],
    ["grading"],
    ["complex"],
    ["wall"],
    ["exact_wall"],
    ["soundness", "refit", "covering", "rims", "quadrature", "loops"],
    ["sections", "throats"],
    ["trimming"],
    ["box_caps"],
    ["box_cut"],
    ["files"],
    ["formats"],
    ["mesh"],
    ["mesh.places", "mesh.elements", "mesh.corner_measures", "mesh.templates", "mesh.three_mf"],
    ["mesh.shells", "mesh.triangle_files", "mesh.triangle_measures", "mesh.wall_thickness"],
    ["mesh.determinants", "mesh.hexahedra", "mesh.volumes", "mesh.measuring"],
    ["mesh.summaries", "mesh.periodic", "mesh.volume_files", "mesh.subdivision"],
    ["mesh.quality", "mesh.abaqus", "mesh.triangulation"],
    ["mesh.quality_picture", "mesh.mesh_files", "mesh.corners"],
    ["mesh.stl"],
    ["kernel"],
    ["kernel.surfaces", "kernel.origin"],
    ["kernel.geometry"],
    ["kernel.solid"],
    ["kernel.check"],
    ["kernel.boxed"],
    ["kernel.step_text"],
    ["kernel.step"],
    ["kernel.brep", "kernel.assembly"],
    ["kernel.stl", "kernel.coloured"],
    ["kernel.part"],
    ["kernel.split", "kernel.offset"],
    ["kernel.depth", "kernel.finding"],
    ["kernel.core", "kernel.joining"],
    ["kernel.skin", "kernel.regional", "kernel.reading"],
    ["kernel.selection"],
    ["wall_fit", "memory"],
    ["laying"],
    ["meshing", "notebook"],
    ["build", "triangles"],
    ["paper", "limits", "report", "assembly"],
    ["lattice", "regions"],
    ["infill"],
    ["filled_part"],
    ["filling"],
    ["printing", "doctor"],
    ["lattice_report"],
    ["lattice_report.distributions", "lattice_report.nearest", "lattice_report.drawing", "lattice_report.charts"],
    ["lattice_report.style", "lattice_report.words"],
    ["lattice_report.inscribed", "lattice_report.wall_thickness", "lattice_report.facets"],
    ["lattice_report.pores"],
    ["lattice_report.file_data"],
    ["lattice_report.data"],
    ["lattice_report.page"],
    ["__init__"],
    ["cq_plugin", "bd_objects", "viewer", "progress", "config"],
    ["tables"],
    ["cli_lattice", "cli_doctor", "cli_completion"],
    ["cli_fill", "cli_mesh", "cli_print", "cli_report", "cli_view"],
    ["cli"],
    ["__main__"],
]
ROW = {module: row for row, modules in enumerate(ROWS) for module in modules}
# Which module, or folder of modules, may load a heavy package.
OWNERS = {
    "OCP": ("kernel.",),
    "cadquery": ("cq_plugin", "viewer"),
    "build123d": ("bd_objects",),
    # CadQuery's viewer is made of it.
    "vtkmodules": ("viewer",),
}


def module_name(path: Path) -> str:
    parts = path.relative_to(FOLDER).with_suffix("").parts
    return ".".join(parts[:-1]) if len(parts) > 1 and parts[-1] == "__init__" else ".".join(parts)


MODULES = {module_name(path): path for path in sorted(FOLDER.rglob("*.py"))}


def imported(module: str) -> set[str]:
    """Every module named by an import statement, wherever in the source it stands, by its full name."""
    package = ".".join(["gyroid_cad", *module.split(".")[:-1]])
    names = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            source = resolve_name("." * node.level + (node.module or ""), package) if node.level else node.module
            assert source is not None
            names |= {f"{source}.{alias.name}" for alias in node.names}
    return names


def imported_of_ours(module: str) -> set[str]:
    """Those of the package's own modules among them; a name in a module stands for the module."""
    ours = set()
    for name in imported(module):
        if name.split(".")[0] != "gyroid_cad":
            continue
        inner = name.removeprefix("gyroid_cad").lstrip(".")
        while inner and inner not in MODULES:
            inner = inner.rpartition(".")[0]
        ours.add(inner or "__init__")
    return ours


def loaded_by(statement: str) -> set[str]:
    """Top-level packages that a fresh interpreter has loaded after a statement."""
    program = f"import sys\n{statement}\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_every_module_has_its_place_in_the_order() -> None:
    assert set(MODULES) == set(ROW)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_only_from_those_before_it(module: str) -> None:
    later = {other for other in imported_of_ours(module) if ROW[other] >= ROW[module]}
    assert not later, f"{module} imports {', '.join(sorted(later))}"


@pytest.mark.parametrize("module", MODULES)
def test_only_its_owner_imports_a_heavy_package(module: str) -> None:
    packages = {name.split(".")[0] for name in imported(module)}
    for package, owners in OWNERS.items():
        if package in packages:
            assert module.startswith(owners), f"{module} imports {package}"


@pytest.mark.parametrize("package", OWNERS)
def test_each_heavy_package_is_really_found_by_this_reading_of_the_source(package: str) -> None:
    assert any(name.split(".")[0] == package for module in MODULES for name in imported(module))


def test_imports_are_found_in_functions_and_for_type_checkers_too() -> None:
    assert "kernel.stl" in imported_of_ours("build")
    assert "lattice" in imported_of_ours("cli")
    assert "lattice" in imported_of_ours("__init__")


@pytest.mark.parametrize("statement", ["import gyroid_cad", "from gyroid_cad.lattice import Lattice"])
def test_importing_the_package_or_describing_a_lattice_loads_neither_kernel_nor_host(statement: str) -> None:
    assert not loaded_by(statement) & set(OWNERS)


def test_importing_the_package_loads_no_numerics_either() -> None:
    assert not loaded_by("import gyroid_cad") & {"numpy", "scipy", "click", "rich", "psutil"}


def test_building_a_solid_loads_the_kernel_but_no_host() -> None:
    statement = "from gyroid_cad import *; Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(4)).solid()"
    assert loaded_by(statement) & set(OWNERS) == {"OCP"}


def test_every_public_name_resolves_and_others_do_not() -> None:
    for name in gyroid_cad.__all__:
        assert getattr(gyroid_cad, name) is not None
    assert dir(gyroid_cad) == sorted(gyroid_cad.__all__)
    with pytest.raises(AttributeError, match="no attribute 'gyroidal'"):
        gyroid_cad.gyroidal  # noqa: B018


@pytest.mark.parametrize("name", ["Lattice", "FitSettings", "NurbsSurface", "ParameterError", "fit_patch"])
def test_a_public_name_is_the_one_of_its_home_module(name: str) -> None:
    value = getattr(gyroid_cad, name)
    assert value is getattr(sys.modules[value.__module__], name)
    assert value.__module__.startswith("gyroid_cad.")


def test_no_public_name_is_a_modules_too_which_would_take_its_place_when_it_is_loaded() -> None:
    assert not set(gyroid_cad.__all__) & set(MODULES)
