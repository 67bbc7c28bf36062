"""Memory is asked of the machine, of the limits that the process was given, and of the container it is in."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gyroid_cad.common.memory import Room, cgroup_rooms, memory_rooms, require_room
from gyroid_cad.errors import ParameterError

BUILD = ["build", "-o", "a.step", "--cells", "8", "8", "4", "--cell-size", "10", "--thickness", "0.8"]
FILL = ["fill", "part.step", "-o", "a.step", "--cell-size", "8", "--density", "0.3"]


def group(folder: Path, **values: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in values.items():
        (folder / f"memory.{name}").write_text(text + "\n")


def test_a_container_of_version_2_leaves_its_limit_less_what_it_cannot_drop(tmp_path: Path) -> None:
    (tmp_path / "groups").write_text("0::/box/inner\n")
    root = tmp_path / "root"
    group(root / "box", max="1000", current="700", stat="anon 100\ninactive_file 250")
    group(root / "box" / "inner", max="max", current="400", stat="inactive_file 0")
    assert [room.free for room in cgroup_rooms(0, tmp_path / "groups", root)] == [1000 - (700 - 250)]


def test_a_container_of_version_1_is_found_where_it_is_mounted_though_its_name_is_that_outside(tmp_path: Path) -> None:
    (tmp_path / "groups").write_text("5:cpu,cpuacct:/docker/abc\n4:memory:/docker/abc\n0::/\n")
    root = tmp_path / "root"
    values = {"limit_in_bytes": "900", "usage_in_bytes": "300", "stat": "inactive_file 7\ntotal_inactive_file 50"}
    group(root / "memory", **values)
    assert [room.free for room in cgroup_rooms(0, tmp_path / "groups", root)] == [900 - 250]


def test_what_goes_beyond_a_limit_leaves_nothing_rather_than_less(tmp_path: Path) -> None:
    (tmp_path / "groups").write_text("0::/\n")
    group(tmp_path, max="100", current="300")
    assert [(room.free, room.left) for room in cgroup_rooms(10, tmp_path / "groups", tmp_path)] == [(0, 0)]


def test_where_there_are_no_control_groups_they_limit_nothing(tmp_path: Path) -> None:
    assert not list(cgroup_rooms(0, tmp_path / "missing", tmp_path))


def test_the_narrowest_of_all_rooms_counts_and_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    rooms = [Room(9000, 0, "are free"), Room(1000, 400, "are left by the limit of its container")]
    monkeypatch.setattr("gyroid_cad.common.memory.memory_rooms", lambda *_: iter(rooms))
    require_room("cells", 2, 600, str)
    with pytest.raises(ParameterError, match=r"expected 600: these take .* are left by the limit of its container"):
        require_room("cells", 2, 601, str)


def test_this_process_has_room() -> None:
    assert all(room.left > 0 for room in memory_rooms())


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not hold programs to such limits")
@pytest.mark.parametrize("limit", [400_000, 700_000, 1_300_000, 1_700_000])
@pytest.mark.parametrize("option", ["-v", "-d"])
def test_a_process_that_may_not_have_so_much_says_so_in_one_line_before_it_works(
    tmp_path: Path, option: str, limit: int
) -> None:
    command = f'ulimit {option} {limit} && exec "$0" -m gyroid_cad "$@"'
    run = subprocess.run(
        ["bash", "-c", command, sys.executable, *BUILD], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("gyroid-cad: error: --cells = (8, 8, 4): expected at most about ")
    assert run.stderr.endswith(f"(ulimit {option})\n")
    assert run.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not hold programs to such limits")
@pytest.mark.parametrize("limit", [300_000, 500_000, 800_000])
@pytest.mark.parametrize(
    "command", [FILL, ["report", "part.step", "-o", "a.html"], ["view", "part.step", "-o", "a.png"]]
)
def test_where_the_libraries_do_not_fit_in_it_is_one_line_at_once(
    tmp_path: Path, command: list[str], limit: int
) -> None:
    (tmp_path / "part.step").write_text("ISO-10303-21;")
    shell = f'ulimit -v {limit} && exec "$0" -m gyroid_cad "$@"'
    run = subprocess.run(
        ["bash", "-c", shell, sys.executable, *command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith("gyroid-cad: error: ")
    assert run.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["part.step"]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not hold programs to such limits")
@pytest.mark.parametrize("limit", [250_000, 400_000])
def test_a_print_check_that_has_no_room_does_not_ask_for_what_is_installed(tmp_path: Path, limit: int) -> None:
    (tmp_path / "a.stl").write_bytes(b"solid")
    shell = f'ulimit -v {limit} && exec "$0" -m gyroid_cad print-check a.stl'
    run = subprocess.run(
        ["bash", "-c", shell, sys.executable], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert run.returncode == 1
    assert run.stderr.endswith("of address space are left (ulimit -v)\n")
