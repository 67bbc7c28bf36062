"""gyroid-cad doctor: what is installed, and whether one cell can be built, written and read."""

from __future__ import annotations

import json
import re
import shutil
import sys
import tomllib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from gyroid_cad import __version__
from gyroid_cad.cli import installation as doctor
from gyroid_cad.cli import self_test
from gyroid_cad.cli.app import main
from gyroid_cad.cli.installation import OPTIONAL, REQUIRED, Diagnosis, diagnose, kernel_version
from gyroid_cad.errors import MissingHostError

Captured = pytest.CaptureFixture[str]

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
SELF_TEST = ("kernel loads", "one cell is built", "STEP is written and read", "STL is written and closed")


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=\[ ]", requirement)[0] for requirement in requirements}


@pytest.fixture(scope="module")
def healthy() -> Diagnosis:
    return diagnose()


def states(diagnosis: Diagnosis) -> dict[str, str]:
    return {finding.subject: finding.state for finding in diagnosis.findings}


def test_the_packages_it_looks_for_are_those_that_pyproject_asks_for() -> None:
    # The kernel has a line of its own.
    assert {*REQUIRED, "cadquery-ocp"} == names(PROJECT["dependencies"])
    extras = {name for some in PROJECT["optional-dependencies"].values() for name in names(some)}
    # VTK comes with the kernel's usual wheel.
    assert set(OPTIONAL) - {"vtk"} <= extras


def test_where_the_tests_run_all_that_is_required_is_there_and_works(healthy: Diagnosis) -> None:
    assert healthy.ok
    found = {finding.subject: finding for finding in healthy.findings}
    assert found["gyroid_cad"].detail == __version__
    assert found["kernel"].detail == kernel_version()
    assert found["one cell is built"].detail.startswith("84 faces, valid, closed")
    for subject in SELF_TEST:
        assert found[subject].required
        assert found[subject].seconds is not None


def test_the_kernel_has_the_version_that_its_wheel_says(healthy: Diagnosis) -> None:
    (told,) = [finding.detail for finding in healthy.findings if finding.subject == "kernel loads"]
    occt = re.search(r"OCCT (\d+\.\d+\.\d+)", kernel_version())
    assert occt is not None
    assert told.startswith(f"OCP {occt[1]}")


def test_the_self_test_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert diagnose().ok
    assert not list(tmp_path.iterdir())


def test_a_missing_package_that_is_required_is_a_failure_and_another_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    real: Callable[[str], str | None] = doctor._version

    def without(name: str) -> Callable[[str], str | None]:
        return lambda requested: None if requested == name else real(requested)

    monkeypatch.setattr(doctor, "_self_test", lambda: iter(()))
    for name, well in (("meshio", False), ("mapdl-archive", True)):
        monkeypatch.setattr(doctor, "_version", without(name))
        diagnosis = diagnose()
        assert (diagnosis.ok, states(diagnosis)[name]) == (well, "missing")


HOSTS = {"cadquery": "CadQuery takes the cell", "build123d": "build123d takes the cell"}


def test_a_host_that_is_installed_takes_a_cell_and_another_is_told_how_to_come(healthy: Diagnosis) -> None:
    found = {finding.subject: finding for finding in healthy.findings}
    for name, subject in HOSTS.items():
        if find_spec(name):
            assert found[subject].state == found[name].state == "good"
            assert found[subject].detail.endswith("of 84 faces")
        else:
            assert subject not in found
            assert found[name].state == "missing"
            assert found[name].detail.endswith(MissingHostError(name).remedy)


def test_a_host_that_is_installed_and_does_not_load_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    # As CadQuery 2.8 does where something has brought the kernel's next version.
    real: Callable[[str], str | None] = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: "2.8.0" if name == "cadquery" else real(name))
    monkeypatch.setitem(sys.modules, "cadquery", None)
    diagnosis = diagnose()
    assert not diagnosis.ok
    assert [finding.subject for finding in diagnosis.findings if finding.state == "failed"] == [HOSTS["cadquery"]]


def test_wheels_of_two_kernels_laid_over_one_another_are_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    # As pip lays them where our plain package is added to build123d 0.12.
    wheels = {"cadquery-ocp": "8.0.1.1.0", "cadquery-ocp-novtk": "7.9.3.1.1"}
    monkeypatch.setattr(doctor, "_self_test", lambda: iter(()))
    monkeypatch.setattr(doctor, "_version", lambda name: wheels.get(name, "1"))
    (kernel,) = [finding for finding in diagnose().findings if finding.subject == "kernel"]
    assert kernel.state == "failed"
    assert all(f"{name} {told}" in kernel.detail for name, told in wheels.items())
    assert not diagnose().ok
    wheels["cadquery-ocp-novtk"] = wheels["cadquery-ocp"]
    assert diagnose().ok


def test_programs_are_looked_for_and_not_required(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(doctor, "_self_test", lambda: iter(()))
    program = tmp_path / "ccx"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert shutil.which("ccx") == str(program)
    assert states(diagnose())["ccx"] == "good"
    program.unlink()
    diagnosis = diagnose()
    assert (states(diagnosis)["ccx"], diagnosis.ok) == ("missing", True)


def test_a_step_file_that_comes_back_wrong_is_status_one_and_named(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(path: Any) -> Any:
        from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

        return BRepPrimAPI_MakeBox(1, 1, 1).Shape()

    monkeypatch.setattr(self_test, "read_step", wrong)
    assert main(["doctor", "--json"]) == 1
    out, err = capsys.readouterr()
    shown = json.loads(out)
    assert (shown["ok"], err) == (False, "")
    found = {finding["subject"]: finding for finding in shown["findings"]}
    assert [found[subject]["state"] for subject in SELF_TEST] == ["good", "good", "failed", "good"]
    assert "it comes back as Topology(solids=1, faces=6" in found["STEP is written and read"]["detail"]


def test_the_table_and_the_json_say_the_same(capsys: Captured, healthy: Diagnosis) -> None:
    assert main(["doctor", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert [(f["subject"], f["state"]) for f in shown["findings"]] == list(states(healthy).items())
    assert main(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines] == [*states(healthy), "verdict"]
    assert "ok" in lines[-1]


def test_the_version_tells_the_kernels_and_loads_none(capsys: Captured) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"gyroid-cad {__version__}, {kernel_version()}\n"


def test_without_a_kernel_the_version_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_version", lambda name: None)
    assert kernel_version() == "no kernel: cadquery-ocp is not installed"
