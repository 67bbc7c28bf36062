"""gyroid-cad check: its table, its JSON and its status."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh

from gyroid_cad import check_file
from gyroid_cad.cli.app import main
from gyroid_cad.kernel import apart

Captured = pytest.CaptureFixture[str]


def run(captured: Captured, *arguments: str | Path) -> tuple[int, str, str]:
    status = main(["check", *map(str, arguments)])
    out, err = captured.readouterr()
    return status, out, err


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    trimesh.creation.icosphere(1, 5.0).export(tmp_path / "ball.stl")
    return tmp_path / "ball.stl"


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    mesh = trimesh.creation.icosphere(1, 5.0)
    mesh.update_faces([False, *[True] * (len(mesh.faces) - 1)])
    mesh.export(tmp_path / "torn.stl")
    return tmp_path / "torn.stl"


def test_the_json_is_the_checks_own_and_the_status_is_whether_it_is_ok(
    capsys: Captured, ball: Path, torn: Path
) -> None:
    for path, expected in ((ball, 0), (torn, 1)):
        status, out, err = run(capsys, path, "--json")
        assert (status, err, out.count("\n")) == (expected, "", 1)
        assert json.loads(out) == json.loads(json.dumps(check_file(path).as_dict()))


def test_the_table_tells_what_is_broken_and_where(capsys: Captured, torn: Path) -> None:
    status, out, _ = run(capsys, torn)
    (row,) = [line for line in out.splitlines() if line.startswith("watertight")]
    assert status == 1
    assert row.split()[1:5] == ["3", "<=", "0", "broken"]
    assert "1 limit broken" in out


def test_quiet_says_nothing_and_the_status_tells(capsys: Captured, ball: Path, torn: Path) -> None:
    assert run(capsys, ball, "--quiet") == (0, "", "")
    assert run(capsys, torn, "--quiet") == (1, "", "")


def test_build_checks_each_file_that_it_wrote_and_its_status_tells(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(apart, "read_apart", lambda path, reader: reader(str(path)))
    files = [str(tmp_path / name) for name in ("cell.brep", "cell.stl")]
    cell = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--check", "--json"]
    for fit, expected in (("10", 0), ("4", 1)):
        status = main(["build", *cell, "--control-points", fit, "-o", files[0], "-o", files[1]])
        checks = json.loads(capsys.readouterr().out)["checks"]
        assert status == expected
        assert [check["file"] for check in checks] == files
        # Patches of so few control points meet at a third of a degree; triangles are closed all the same.
        assert [check["ok"] for check in checks] == [not expected, True]


def test_bad_input_is_one_line(capsys: Captured, tmp_path: Path, ball: Path) -> None:
    for name, expected in (("nowhere.stl", 2), ("nowhere.step", 1), ("nowhere.dwg", 2)):
        status, out, err = run(capsys, tmp_path / name)
        assert (status, out, err.count("\n")) == (expected, "", 1)
        assert name in err
    status, _, err = run(capsys, ball, "--profile", "catia")
    assert (status, "catia" in err) == (2, True)
