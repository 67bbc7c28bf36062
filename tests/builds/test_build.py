"""A build's stages, its checks, its memory and what it refuses to write."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest
from OCP.TopoDS import TopoDS_Shape

import gyroid_cad.kernel.check
import gyroid_cad.kernel.solid
from gyroid_cad.builds import solid as build_module
from gyroid_cad.builds.solid import Build, Progress
from gyroid_cad.common import memory
from gyroid_cad.common.formats import PART_FORMATS, listed_endings, require_formats, require_settings
from gyroid_cad.errors import FitError, KernelError, ParameterError
from gyroid_cad.fields.field import Field
from gyroid_cad.fields.makers import linear
from gyroid_cad.kernel.check import enclosed_volume, topology
from gyroid_cad.step.counts import Topology
from gyroid_cad.step.header import StepHeader
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall import fitted
from gyroid_cad.wall.fitted import LatticeSpec
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall

Realise = Callable[..., TopoDS_Shape]

CELLS = (1, 1, 1)
COARSE = FitSettings(4)
MEMORY = SimpleNamespace(available=1_000_000_000)


def build(
    cells: tuple[int, int, int],
    cell_size: float,
    thickness: float | Field,
    settings: FitSettings,
    progress: Progress | None = None,
) -> Build:
    return build_module.build(LatticeSpec(cells, Grading(cell_size, thickness), settings, 1e-2), progress)


@pytest.fixture
def forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """No build is remembered from before, nor this one after."""
    monkeypatch.setattr(build_module, "_builds", type(build_module._builds)())
    monkeypatch.setattr(fitted, "_fitted", type(fitted._fitted)())


@pytest.fixture
def one_build() -> Build:
    return build(CELLS, 10.0, 0.8, COARSE)


def targets(folder: Path, *names: str) -> list[Path]:
    return require_formats([folder / name for name in names])


@pytest.mark.usefixtures("forgotten")
def test_every_stage_is_told_from_nought_to_done_and_timed() -> None:
    told: dict[str, list[tuple[int, int]]] = {}
    made = build(CELLS, 10.0, 0.8, COARSE, lambda stage, done, total: told.setdefault(stage, []).append((done, total)))
    assert list(told) == ["complex", "fit", "wall", "solid", "check"]
    for steps in told.values():
        assert steps[0] == (0, 1)
        assert steps[-1] == (1, 1)
        assert all(0 <= done <= total for done, total in steps)
    assert list(made.seconds) == list(told)
    assert all(seconds >= 0 for seconds in made.seconds.values())


@pytest.mark.usefixtures("forgotten")
def test_a_wall_that_varies_is_checked_before_it_is_fitted_and_measured_after() -> None:
    made = build(CELLS, 10.0, linear(0.6, x=0.02), COARSE)
    assert list(made.seconds) == ["complex", "soundness", "deviation", "fit", "solid", "check"]
    fitted = made.fitted
    assert fitted.refit is not None
    assert fitted.refit.control_points == len(fitted.wall.weights)
    assert fitted.samples_per_patch["deviation"] == fitted.refit.samples**2
    assert fitted.min_thickness == fitted.refit.min_thickness < fitted.refit.max_thickness


@pytest.mark.usefixtures("forgotten")
def test_the_control_points_a_varying_wall_takes_are_asked_of_memory_again(monkeypatch: pytest.MonkeyPatch) -> None:
    requested: list[int] = []
    monkeypatch.setattr(fitted, "require_memory", lambda cells, size, n=10, **_: requested.append(n))
    made = build_module.build(LatticeSpec(CELLS, Grading(10.0, linear(0.6, x=0.02)), COARSE, 1e-4))
    assert requested[0] == 4 < requested[-1] == len(made.fitted.wall.weights)


@pytest.mark.usefixtures("forgotten")
def test_the_same_lattice_is_built_once_and_only_the_last_few_are_kept() -> None:
    first = build(CELLS, 10.0, 0.8, COARSE)
    assert build(CELLS, 10.0, 0.8, FitSettings(4)) is first
    others = [build(CELLS, 10.0, 0.8 + step / 10, COARSE) for step in range(1, 4)]
    assert build(CELLS, 10.0, 0.8 + 3 / 10, COARSE) is others[-1]
    assert build(CELLS, 10.0, 0.8, COARSE) is not first


@pytest.mark.usefixtures("forgotten")
def test_the_lattice_used_last_outlives_the_one_used_before() -> None:
    first, second = (build(CELLS, 10.0, thickness, COARSE) for thickness in (0.8, 0.9))
    assert build(CELLS, 10.0, 0.8, COARSE) is first
    build(CELLS, 10.0, 1.0, COARSE)
    assert build(CELLS, 10.0, 0.8, COARSE) is first
    assert build(CELLS, 10.0, 0.9, COARSE) is not second


def test_a_build_has_looked_at_its_own_solid(one_build: Build) -> None:
    assert one_build.topology == topology(one_build.solid())
    assert one_build.topology.closed
    assert one_build.volume == enclosed_volume(one_build.solid())
    assert one_build.volume == pytest.approx(one_build.fitted.wall.volume(), rel=1e-12)
    assert one_build.valid()


def test_each_caller_gets_a_shape_of_its_own(one_build: Build) -> None:
    first, second = one_build.solid(), one_build.solid()
    assert first is not second
    assert first.IsEqual(second)


def test_more_cells_than_memory_holds_are_refused_in_gigabytes(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParameterError, match=r"at most about \d+ cells .* [\d.e+]+ GB .* [\d.]+ GB are free"):
        build((10_000, 10_000, 10_000), 10.0, 0.8, COARSE)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=1_000_000))
    with pytest.raises(ParameterError, match="at most about 0 cells"):
        build(CELLS, 10.0, 0.85, COARSE)


def test_as_many_cells_as_the_refusal_names_would_have_been_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(psutil, "virtual_memory", lambda: MEMORY)
    with pytest.raises(ParameterError) as caught:
        memory.require_memory((1000, 1, 1), 1_500_000)
    most = int(re.findall(r"about (\d+) cells", str(caught.value))[0])
    memory.require_memory((most, 1, 1), 1_500_000)
    with pytest.raises(ParameterError):
        memory.require_memory((most + 1, 1, 1), 1_500_000)


def test_the_memory_that_files_take_is_asked_for_before_anything_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    enough_to_build = SimpleNamespace(available=405_000_000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: enough_to_build)
    memory.require_memory(CELLS, 1_500_000)
    with pytest.raises(ParameterError, match="GB"):
        require_settings(CELLS, 0.01, 15.0)


@pytest.mark.usefixtures("forgotten")
def test_a_shape_that_is_not_closed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def with_open_edges(shape: TopoDS_Shape) -> Topology:
        return Topology(solids=1, faces=84, open_edges=7)

    monkeypatch.setattr(build_module, "topology", with_open_edges)
    with pytest.raises(KernelError, match="7 edges do not bound exactly two faces"):
        build(CELLS, 10.0, 0.8, COARSE)


@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize("wrong", ["inside out", "of other walls"])
def test_a_shape_that_encloses_another_volume_than_its_nets_is_refused(
    monkeypatch: pytest.MonkeyPatch, wrong: str
) -> None:
    build_solid = gyroid_cad.kernel.solid.build_solid
    thicker = build(CELLS, 10.0, 0.81, COARSE).solid()

    def wrongly(wall: Wall, progress: Callable[[int, int], None] | None = None) -> TopoDS_Shape:
        return build_solid(wall, progress).Reversed() if wrong == "inside out" else thicker

    monkeypatch.setattr(build_module, "build_solid", wrongly)
    with pytest.raises(KernelError, match=r"encloses -?[\d.]+ mm3, its control nets [\d.]+ mm3"):
        build(CELLS, 10.0, 0.8, COARSE)


@pytest.mark.usefixtures("forgotten")
def test_a_build_that_failed_is_not_remembered() -> None:
    for _ in range(2):
        with pytest.raises(FitError):
            build(CELLS, 10.0, 0.8, FitSettings.paper())
    assert not build_module._builds


@pytest.mark.usefixtures("forgotten")
def test_a_solid_the_kernel_calls_invalid_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_module, "is_valid", lambda shape: False)
    made = build(CELLS, 10.0, 0.8, COARSE)
    with pytest.raises(KernelError, match="invalid; nothing was written"):
        made.write(targets(tmp_path, "a.step", "a.brep", "a.stl"), StepHeader(), 0.01, 15.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("forgotten")
def test_the_kernels_check_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    requested: list[TopoDS_Shape] = []
    monkeypatch.setattr(build_module, "is_valid", lambda shape: not requested.append(shape))
    made = build(CELLS, 10.0, 0.8, COARSE)
    assert made.valid()
    assert made.valid()
    assert len(requested) == 1


def test_the_ending_chooses_the_format_whatever_its_case(one_build: Build, tmp_path: Path) -> None:
    names = ["a.step", "b.STP", "c.brep", "d.Stl"]
    one_build.write(targets(tmp_path, *names), StepHeader(), 0.1, 15.0)
    starts = {path.name: path.read_bytes()[:13] for path in tmp_path.iterdir()}
    assert set(starts) == set(names)
    assert starts["a.step"] == starts["b.STP"] == b"ISO-10303-21;"
    assert b"DBRep_DrawableShape" in (tmp_path / "c.brep").read_bytes()[:40]
    assert starts["d.Stl"] not in (starts["a.step"], starts["c.brep"])
    assert {f"write {name}" for name in names} <= set(one_build.seconds)


@pytest.mark.parametrize("name", ["part.dwg", "part", ".step", "part.step.bz2", "part.stepx"])
def test_an_unknown_ending_is_refused_with_those_that_are_known(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParameterError) as caught:
        require_formats([tmp_path / name])
    assert listed_endings(PART_FORMATS) in str(caught.value)
    assert name in str(caught.value)


def test_a_file_may_be_named_once_only_also_through_a_link_or_a_detour(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    (tmp_path / "link.step").symlink_to(tmp_path / "part.step")
    for other in (tmp_path / "part.step", tmp_path / "below" / ".." / "part.step", tmp_path / "link.step"):
        with pytest.raises(ParameterError, match="each file once"):
            require_formats([tmp_path / "part.step", other])
    assert len(require_formats([tmp_path / "part.step", tmp_path / "part.stp"])) == 2


def test_settings_of_files_are_checked_with_no_file_in_sight() -> None:
    require_settings([], 0.1, 15.0)
    for bad in ((0.0, 15.0), (0.1, 90.0)):
        with pytest.raises(ParameterError):
            require_settings([], *bad)
