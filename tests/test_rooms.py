"""Who may import whom: the order of the rooms, and what loads the kernel and its hosts."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib.util import resolve_name
from pathlib import Path

import pytest

import gyroid_cad

FOLDER = Path(gyroid_cad.__file__).parent

# Each room may import only from rooms above its own; those of one row know nothing of each other.
ROWS = [
    ["former", "version"],
    ["errors"],
    ["common"],
    ["maps", "nurbs"],
    ["fields"],
    ["surface"],
    ["wall"],
    ["trim", "mesh", "step"],
    ["kernel"],
    ["builds", "render", "host_shapes"],
    # Of a block of any kind but the sheet a part that is filled is made.
    ["filling"],
    ["lattice"],
    ["printing"],
    ["report", "cq_plugin", "bd_objects"],
    ["__init__"],
    ["cli"],
    ["__main__"],
]
ROW = {room: row for row, rooms in enumerate(ROWS) for room in rooms}
# A module that may import from a later room, and why.
EXCEPTIONS: dict[tuple[str, str], str] = {}
# Which rooms or modules may load a heavy package.
OWNERS = {
    "OCP": ("kernel",),
    "cadquery": ("cq_plugin", "cli.window", "host_shapes"),
    "build123d": ("bd_objects", "host_shapes"),
    # CadQuery's viewer is made of it, and distances to triangles are asked of it.
    "vtkmodules": ("cli.window", "mesh.triangles.distances"),
}
MOST_LINES = 400
MOST_IMPORTS_IN_FUNCTIONS = 60
# In a hundred modules.
MOST_MODULES_WITH_ONE_IMPORTER = 15.5
# Beside the tools of "common": progress, memory, files, packing and the like, that every road takes.
MOST_FILES_TO_STEP, MOST_TOOLS_TO_STEP, MOST_ROOMS_TO_STEP = 26, 9, 9


def module_name(path: Path) -> str:
    parts = path.relative_to(FOLDER).with_suffix("").parts
    return ".".join(parts[:-1]) if len(parts) > 1 and parts[-1] == "__init__" else ".".join(parts)


MODULES = {module_name(path): path for path in sorted(FOLDER.rglob("*.py"))}
TREES = {module: ast.parse(path.read_text()) for module, path in MODULES.items()}


def sources(module: str, node: ast.Import | ast.ImportFrom) -> set[str]:
    """Full names that an import statement takes."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    package = ".".join(["gyroid_cad", *module.split(".")[:-1]])
    if MODULES[module].name == "__init__.py":
        package = f"gyroid_cad.{module}" if module != "__init__" else "gyroid_cad"
    source = resolve_name("." * node.level + (node.module or ""), package) if node.level else node.module
    assert source is not None
    return {f"{source}.{alias.name}" for alias in node.names}


def is_loader(node: ast.AST) -> bool:
    """A call of ``import_module`` or ``__import__``, however it is reached."""
    if not isinstance(node, ast.Call):
        return False
    name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
    return name in {"import_module", "__import__"}


def loaded_text(node: ast.AST) -> str:
    """The constant beginning of the name that a loader is given."""
    assert isinstance(node, ast.Call)
    first = node.args[0]
    if isinstance(first, ast.JoinedStr):
        first = first.values[0]
    return first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else ""


def imported(module: str) -> set[str]:
    """Every module named by an import statement or a loader, wherever in the source it stands, by its full name."""
    names = set()
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names |= sources(module, node)
        elif is_loader(node):
            names.add(loaded_text(node).rstrip("."))
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


def room_of(module: str) -> str:
    return module.split(".", maxsplit=1)[0]


def imports_in_functions() -> Iterator[tuple[str, int]]:
    """Module and line of every import that runs only when a function is called."""
    for module, tree in TREES.items():
        found = {
            node.lineno
            for function in ast.walk(tree)
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            for node in ast.walk(function)
            if isinstance(node, ast.Import | ast.ImportFrom) or is_loader(node)
        }
        yield from ((module, line) for line in sorted(found))


def loaded_by(statement: str) -> set[str]:
    """Top-level packages that a fresh interpreter has loaded after a statement."""
    program = f"import sys\n{statement}\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_every_module_stands_in_a_room() -> None:
    assert {room_of(module) for module in MODULES} == set(ROW)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_only_from_rooms_before_its_own(module: str) -> None:
    room = room_of(module)
    later = {
        other
        for other in imported_of_ours(module)
        if room_of(other) != room and ROW[room_of(other)] >= ROW[room] and (module, other) not in EXCEPTIONS
    }
    # The package's own module loads names when they are first used, whatever room they live in.
    assert module == "__init__" or not later, f"{module} imports {', '.join(sorted(later))}"


@pytest.mark.parametrize("room", sorted({room_of(module) for module in MODULES if "." in module}))
def test_no_circle_runs_inside_a_room(room: str) -> None:
    inside = {
        module: {other for other in imported_of_ours(module) if room_of(other) == room and other != module}
        for module in MODULES
        if room_of(module) == room and MODULES[module].name != "__init__.py"
    }
    faces = {module for module in MODULES if MODULES[module].name == "__init__.py"}
    try:
        TopologicalSorter({module: others - faces for module, others in inside.items()}).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


@pytest.mark.parametrize("module", MODULES)
def test_a_private_name_stays_in_its_module(module: str) -> None:
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gyroid_cad"):
            private = [alias.name for alias in node.names if alias.name.startswith("_") and alias.name != "__version__"]
            assert not private, f"{module}, line {node.lineno}"


@pytest.mark.parametrize("module", MODULES)
def test_only_its_owner_imports_a_heavy_package(module: str) -> None:
    packages = {name.split(".")[0] for name in imported(module)}
    for package, owners in OWNERS.items():
        if package in packages:
            assert module.startswith(owners), f"{module} imports {package}"


@pytest.mark.parametrize("package", OWNERS)
def test_each_heavy_package_is_really_found_by_this_reading_of_the_source(package: str) -> None:
    assert any(name.split(".")[0] == package for module in MODULES for name in imported(module))


@pytest.mark.parametrize("module", MODULES)
def test_no_file_is_longer_than_can_be_read_in_one_go(module: str) -> None:
    assert len(MODULES[module].read_text().splitlines()) <= MOST_LINES


def test_imports_inside_functions_are_few() -> None:
    found = list(imports_in_functions())
    assert len(found) <= MOST_IMPORTS_IN_FUNCTIONS, found


def test_few_modules_serve_only_one_other() -> None:
    importers: dict[str, set[str]] = {module: set() for module in MODULES}
    for module in MODULES:
        # The command line loads its commands by name: then its folder is what is imported.
        for other in imported_of_ours(module) - {module, "cli"}:
            importers[other].add(module)
    alone = sorted(module for module, users in importers.items() if len(users) == 1)
    assert len(alone) <= MOST_MODULES_WITH_ONE_IMPORTER / 100 * len(MODULES), alone


def test_the_way_from_a_thickness_to_a_step_file_is_short(tmp_path: Path) -> None:
    """Files with a function that runs on the way, from a cold start; all of them, not only those that see the wall."""
    program = f"""
import sys
from pathlib import Path
from gyroid_cad import Lattice
import gyroid_cad.builds.solid
entered = set()
def note(frame, event, argument):
    code = frame.f_code
    # The import system asks every module for attributes of its own, and every finder for every module.
    asked = code.co_name in ("<module>", "__getattr__") or code.co_filename.endswith("former.py")
    if event == "call" and not asked and code.co_filename.startswith({str(FOLDER)!r}):
        entered.add(code.co_filename)
sys.setprofile(note)
Lattice(cells=(1, 1, 1), cell_size=10, thickness=0.8).write({str(tmp_path / "cell.step")!r})
sys.setprofile(None)
print(*sorted(entered), sep="\\n")
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    files = [Path(line).relative_to(FOLDER) for line in run.stdout.splitlines()]
    files = [file for file in files if file.name != "__init__.py"]
    tools = [file for file in files if file.parts[0] == "common"]
    assert 10 < len(files) - len(tools) <= MOST_FILES_TO_STEP, files
    assert len(tools) <= MOST_TOOLS_TO_STEP, tools
    assert len({file.parts[0] for file in files}) <= MOST_ROOMS_TO_STEP


def test_imports_are_found_in_functions_and_for_type_checkers_too() -> None:
    assert "kernel.stl" in imported_of_ours("builds.solid")
    assert "lattice" in imported_of_ours("cli.lattice_options")
    assert "lattice" in imported_of_ours("__init__")
    assert any(module == "cli.fill" for module, _ in imports_in_functions())


@pytest.mark.parametrize("statement", ["import gyroid_cad", "from gyroid_cad.lattice import Lattice"])
def test_importing_the_package_or_describing_a_lattice_loads_neither_kernel_nor_host(statement: str) -> None:
    assert not loaded_by(statement) & set(OWNERS)


def test_importing_the_package_loads_no_numerics_either() -> None:
    assert not loaded_by("import gyroid_cad") & {"numpy", "scipy", "click", "rich", "psutil"}


def test_building_a_solid_loads_the_kernel_but_no_host() -> None:
    statement = "from gyroid_cad import Lattice, FitSettings; Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(4)).solid()"
    assert loaded_by(statement) & set(OWNERS) == {"OCP"}


def test_every_public_name_resolves_and_others_do_not() -> None:
    for name in gyroid_cad.__all__:
        assert getattr(gyroid_cad, name) is not None
    assert dir(gyroid_cad) == sorted(gyroid_cad.__all__)
    with pytest.raises(AttributeError, match="no attribute 'gyroidal'"):
        gyroid_cad.gyroidal  # noqa: B018


@pytest.mark.parametrize("name", ["Lattice", "FitSettings", "ParameterError", "fill"])
def test_a_public_name_is_the_one_of_its_home_module(name: str) -> None:
    value = getattr(gyroid_cad, name)
    assert value is getattr(sys.modules[value.__module__], name)
    assert value.__module__.startswith("gyroid_cad.")


def test_no_public_name_is_a_modules_too_which_would_take_its_place_when_it_is_loaded() -> None:
    assert not set(gyroid_cad.__all__) & set(MODULES)
