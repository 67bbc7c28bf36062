"""The kernel room on whichever OCP is installed: 7.9 or 8."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import gyroid_cad.kernel

ROOM = sorted(Path(gyroid_cad.kernel.__file__).parent.glob("*.py"))
# Where OCP 7.9 and OCP 8 keep collections.
OF_ONE_VERSION = {"OCP.TColgp", "OCP.TColStd", "OCP.TopTools", "OCP.collections"}


def taken_from_ocp(path: Path) -> Iterator[tuple[str, str, str]]:
    """Module, name in it, and the name by which it goes here, of all that a file imports from OCP."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("OCP."):
            for alias in node.names:
                yield str(node.module), alias.name, alias.asname or alias.name


@pytest.mark.parametrize("path", ROOM, ids=lambda path: path.stem)
def test_only_one_module_knows_where_a_version_keeps_its_collections(path: Path) -> None:
    found = {module for module, _, _ in taken_from_ocp(path)}
    if path.stem == "compat":
        assert found >= OF_ONE_VERSION
    else:
        assert not found & OF_ONE_VERSION


@pytest.mark.parametrize("path", [path for path in ROOM if path.stem != "compat"], ids=lambda path: path.stem)
def test_every_class_and_every_static_function_is_in_the_ocp_that_is_installed(path: Path) -> None:
    classes = {called: getattr(import_module(module), name) for module, name, called in taken_from_ocp(path)}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in classes:
            assert hasattr(classes[node.value.id], node.attr), f"{node.value.id}.{node.attr}"
