"""Names: what a module offers to others is called by a name of its own."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import gyroid_cad

FOLDER = Path(gyroid_cad.__file__).parent


def offered(path: Path) -> list[str]:
    """Names in a module's ``__all__`` that it defines itself."""
    tree = ast.parse(path.read_text())
    named: list[str] = []
    defined: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            defined.add(node.name)
        for target in node.targets if isinstance(node, ast.Assign) else ():
            defined |= {part.id for part in ast.walk(target) if isinstance(part, ast.Name)}
            if isinstance(target, ast.Name) and target.id == "__all__":
                named = ast.literal_eval(node.value)  # type: ignore[attr-defined]
    return [name for name in named if name in defined]


def test_no_two_modules_offer_one_name_for_two_things() -> None:
    homes = defaultdict(list)
    for path in sorted(FOLDER.rglob("*.py")):
        for name in offered(path):
            homes[name].append(str(path.relative_to(FOLDER)))
    assert homes["NurbsSurface"] == ["nurbs/surface.py"]
    assert {name: paths for name, paths in homes.items() if len(paths) > 1} == {}
