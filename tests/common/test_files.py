"""Files appear whole or not at all."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from gyroid_cad.common.files import replacing, require_writable
from gyroid_cad.errors import ExportError, GyroidError, KernelError, ParameterError


def write_half(path: Path, problem: BaseException) -> None:
    with replacing(path) as temporary:
        temporary.write_text("half of it")
        raise problem


def test_what_is_written_appears_under_the_name_asked_for_and_nothing_else_does(tmp_path: Path) -> None:
    path = tmp_path / "part.step"
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
        assert temporary.parent == tmp_path
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_an_older_file_is_readable_until_the_moment_it_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "part.step"
    path.write_text("older")
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "older"
    assert path.read_text() == "new"


@pytest.mark.parametrize("problem", [ValueError("no"), KernelError("no"), KeyboardInterrupt(), SystemExit(3)])
@pytest.mark.parametrize("older", ["older", None])
def test_any_failure_keeps_the_older_file_and_leaves_no_partial_one(
    tmp_path: Path, problem: BaseException, older: str | None
) -> None:
    path = tmp_path / "part.step"
    if older is not None:
        path.write_text(older)
    with pytest.raises(type(problem)):
        write_half(path, problem)
    assert [(p, p.read_text()) for p in tmp_path.iterdir()] == ([(path, older)] if older is not None else [])


def test_a_failure_of_the_system_becomes_an_export_error_with_its_reason_and_the_path(tmp_path: Path) -> None:
    path = tmp_path / "part.step"
    with pytest.raises(ExportError, match="No space left on device") as caught:
        write_half(path, OSError(28, "No space left on device"))
    assert str(path) in str(caught.value)
    assert isinstance(caught.value, GyroidError)
    assert isinstance(caught.value, OSError)
    assert not list(tmp_path.iterdir())


def test_an_export_error_passes_through_with_its_own_words(tmp_path: Path) -> None:
    mine = ExportError("the writer failed")
    with pytest.raises(ExportError) as caught, replacing(tmp_path / "part.step"):
        raise mine
    assert caught.value is mine


def test_a_writer_that_wrote_nothing_is_a_failure(tmp_path: Path) -> None:
    path = tmp_path / "part.step"
    path.write_text("older")
    with pytest.raises(ExportError), replacing(path):
        pass
    assert path.read_text() == "older"


def test_through_a_link_the_file_it_points_to_is_replaced_and_the_link_stays(tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    target, link = folder / "part.step", tmp_path / "link.step"
    target.write_text("older")
    link.symlink_to(target)
    with replacing(link) as temporary:
        temporary.write_text("new")
        assert temporary.parent == folder
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert not target.is_symlink()


def test_a_path_relative_to_the_folder_one_stands_in_is_followed_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "below").mkdir()
    with replacing("part.step") as temporary:
        monkeypatch.chdir(tmp_path / "below")
        temporary.write_text("new")
    assert (tmp_path / "part.step").read_text() == "new"


def test_two_files_can_be_written_at_once_beside_each_other(tmp_path: Path) -> None:
    with replacing(tmp_path / "a.step") as first, replacing(tmp_path / "a.stl") as second:
        first.write_text("first")
        second.write_text("second")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.step": "first", "a.stl": "second"}


@pytest.mark.parametrize("existing", [True, False])
def test_a_name_in_a_folder_that_may_be_written_to_is_accepted_and_not_touched(tmp_path: Path, existing: bool) -> None:
    path = tmp_path / "part.step"
    if existing:
        path.write_text("older")
    assert require_writable(str(path)) == path
    assert path.exists() == existing


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "part.step"
    with pytest.raises(ParameterError, match="a file in an existing folder") as caught:
        require_writable(path)
    assert str(path.parent) in caught.value.accepted
    assert caught.value.value == str(path)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="a file, not a folder"):
        require_writable(tmp_path)


def test_a_file_where_a_folder_should_be_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "part.step").write_text("older")
    with pytest.raises(ParameterError, match="a file in an existing folder"):
        require_writable(tmp_path / "part.step" / "part.step")


@pytest.mark.parametrize("forbidden", ["folder", "file"])
def test_a_folder_or_file_that_may_not_be_written_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forbidden: str
) -> None:
    path = tmp_path / "part.step"
    path.write_text("older")
    refused = tmp_path if forbidden == "folder" else path
    # The system is asked, for permission bits mean nothing to a privileged user.
    monkeypatch.setattr(os, "access", lambda requested, mode: Path(requested) != refused)
    with pytest.raises(ParameterError, match="may be written") as caught:
        require_writable(path)
    assert str(tmp_path) in caught.value.accepted


@pytest.mark.parametrize("protected", ["folder", "file"])
def test_permission_bits_are_respected(tmp_path: Path, protected: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    path = folder / "part.step"
    path.write_text("older")
    locked, mode = (folder, 0o500) if protected == "folder" else (path, 0o400)
    locked.chmod(mode)
    try:
        if os.access(locked, os.W_OK):
            pytest.skip("this user may write everywhere")
        with pytest.raises(ParameterError, match="may be written"):
            require_writable(path)
    finally:
        locked.chmod(0o700)


def test_a_parameter_error_is_one_line_however_long_the_value(tmp_path: Path) -> None:
    long_name = tmp_path / ("x" * 200) / "part.step"
    with pytest.raises(ParameterError) as caught:
        require_writable(long_name)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("output = '")


@pytest.mark.parametrize("length", [241, 250, 254, 255])
def test_a_name_as_long_as_the_system_takes_is_written(tmp_path: Path, length: int) -> None:
    path = require_writable(tmp_path / ("x" * (length - 4) + ".stl"))
    with replacing(path) as temporary:
        temporary.write_text("new")
        temporary.with_name(f"{temporary.name}.raw").write_text("what a kernel wrote")
        temporary.with_name(f"{temporary.name}.raw").unlink()
    assert path.read_text() == "new"


@pytest.mark.parametrize("name", ["x" * 252 + ".stl", "é" * 127 + ".stl", "/".join(["y" * 200] * 25) + ".stl"])
def test_a_name_that_the_system_does_not_take_is_refused_and_said_to_be_too_long(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParameterError, match=r"^output = .*: expected a shorter file name"):
        require_writable(tmp_path / name)


def test_links_that_lead_round_in_a_circle_are_refused(tmp_path: Path) -> None:
    first, second = tmp_path / "a.stl", tmp_path / "b.stl"
    first.symlink_to(second)
    second.symlink_to(first)
    for path in (first, first / "part.stl"):
        with pytest.raises(ParameterError, match="its links lead round in a circle"):
            require_writable(path)


def test_a_link_to_a_file_that_is_not_there_yet_is_followed(tmp_path: Path) -> None:
    link = tmp_path / "link.stl"
    link.symlink_to(tmp_path / "part.stl")
    with replacing(require_writable(link)) as temporary:
        temporary.write_text("new")
    assert (tmp_path / "part.stl").read_text() == "new"
    assert link.is_symlink()


def test_threads_that_write_one_name_at_once_all_write_it_whole(tmp_path: Path) -> None:
    path, together, problems = tmp_path / "part.stl", threading.Barrier(4), []

    def write(text: str) -> None:
        try:
            with replacing(path) as temporary:
                temporary.write_text(text[:5])
                together.wait(10)
                temporary.write_text(text)
                together.wait(10)
        except BaseException as problem:
            problems.append(problem)

    texts = [letter * 10 for letter in "abcd"]
    threads = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not problems
    assert path.read_text() in texts
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems know no names that are not text")
def test_a_folder_whose_name_is_not_text_is_reached_by_one_that_is(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9"))
    folder.mkdir()
    with replacing(folder / "part.step") as temporary:
        assert str(temporary).encode()
        temporary.write_text("new")
    assert [(path.name, path.read_text()) for path in folder.iterdir()] == [("part.step", "new")]


SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


@pytest.mark.skipif(os.name != "posix", reason="Windows ends a program without a word to it")
@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_that_ends_the_program_leaves_no_temporary_file_and_no_folder(
    tmp_path: Path, number: signal.Signals
) -> None:
    program = f"""
import os, signal, sys
from gyroid_cad.common.files import replacing, temporary_folder
with temporary_folder() as folder, replacing("part.stl") as outer, replacing("part.3mf") as inner:
    for path in (folder / "file", outer, inner):
        path.write_text("half of it")
    print(folder, flush=True)
    os.kill(os.getpid(), {int(number)})
    signal.pause()
"""
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert run.returncode == 128 + number
    assert run.stderr == ""
    assert not Path(run.stdout.strip()).exists()
    assert not list(tmp_path.iterdir())


def test_whoever_answers_a_signal_themselves_keeps_their_answer(tmp_path: Path) -> None:
    heard: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: heard.append(number))
    try:
        with replacing(tmp_path / "part.stl") as temporary:
            temporary.write_text("new")
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert heard == [signal.SIGTERM]
    assert (tmp_path / "part.stl").read_text() == "new"


def test_once_a_file_is_written_signals_are_answered_as_before(tmp_path: Path) -> None:
    before = [signal.getsignal(number) for number in SIGNALS]
    with replacing(tmp_path / "part.stl") as temporary:
        temporary.write_text("new")
    assert [signal.getsignal(number) for number in SIGNALS] == before
