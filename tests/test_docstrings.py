"""Docstrings: they begin with what a thing is or does, public names show an example, and every example runs."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from test_rooms import MODULES, TREES

import gyroid_cad
from gyroid_cad import Filled, Lattice, Mesh, PrintCheck, Printer, VolumePatches

PACKAGES = ("gyroid_cad", "gyroid_cad.maps", "gyroid_cad.fields", "gyroid_cad.cq_plugin", "gyroid_cad.bd_objects")
CLASSES = (Lattice, Filled, Mesh, VolumePatches, Printer, PrintCheck)
# Words that begin a clause or stand for a thing, where a verb or a noun would say it.
NEITHER = {
    *("What", "Whether", "How", "Why", "Who", "Which", "Where", "When", "If", "There"),
    *("This", "That", "These", "Those", "It", "They"),
}
HOSTS = {"cadquery", "build123d"}


def documented() -> Iterator[tuple[str, str]]:
    """Every module, class and function by its name, and its docstring if it has one."""
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                yield f"{module}.{getattr(node, 'name', '')}".rstrip("."), text


def public() -> dict[str, Any]:
    """What users call, by its name: all that the packages offer, and what their classes can do."""
    found = {
        f"{package}.{name}": (package, name)
        for package in PACKAGES
        for name in exported(package)
        if name != "__version__"
    }
    for owner in CLASSES:
        for name in dir(owner):
            member = inspect.getattr_static(owner, name)
            called = getattr(member, "__func__", getattr(member, "fget", member))
            if not name.startswith("_") and inspect.isfunction(called) and called.__module__.startswith("gyroid_cad"):
                found[f"{owner.__name__}.{name}"] = called
    return found


def exported(package: str) -> list[str]:
    """Names in a module's ``__all__``, read without loading a host."""
    tree = TREES[package.removeprefix("gyroid_cad").lstrip(".") or "__init__"]
    (listed,) = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
    ]
    return list(ast.literal_eval(listed))


PUBLIC = public()


@pytest.mark.parametrize("name", PUBLIC)
def test_what_users_call_shows_an_example(name: str) -> None:
    thing = PUBLIC[name]
    if isinstance(thing, tuple):
        package, name = thing
        if package.endswith(("cq_plugin", "bd_objects")):
            pytest.importorskip("cadquery" if package.endswith("cq_plugin") else "build123d")
        thing = getattr(import_module(package), name)
    # Not one that is inherited.
    assert ">>> " in (thing.__doc__ or ""), name


def test_a_docstring_begins_with_a_verb_or_a_noun_and_its_first_line_is_a_sentence() -> None:
    first = {name: text.splitlines()[0] for name, text in documented()}
    assert len(first) > 500
    assert [line for line in first.values() if re.split(r"\W", line, maxsplit=1)[0] in NEITHER] == []
    assert [line for line in first.values() if not line.rstrip('"').endswith(".")] == []


WITH_EXAMPLES = sorted(module for module, path in MODULES.items() if ">>> " in path.read_text())


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_the_examples_of_a_module_run_and_give_what_they_show(
    module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    needed = {"cq_plugin": "cadquery", "bd_objects": "build123d"}.get(module)
    if needed:
        pytest.importorskip(needed)
    loaded = import_module("gyroid_cad" if module == "__init__" else f"gyroid_cad.{module}")
    names = {name: getattr(gyroid_cad, name) for name in gyroid_cad.__all__} | vars(loaded)
    runner, said = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE), []
    examples = [found for found in doctest.DocTestFinder().find(loaded, globs=names) if found.examples]
    for example in examples:
        if all(is_there(host) for host in HOSTS if f"import {host}" in example.docstring + "".join(sources(example))):
            runner.run(example, out=said.append)
    assert examples
    assert runner.failures == 0, "".join(said)


def sources(example: doctest.DocTest) -> Iterator[str]:
    for line in example.examples:
        yield line.source.replace("from ", "import ")


def is_there(host: str) -> bool:
    try:
        import_module(host)
    except ModuleNotFoundError:
        return False
    return True
