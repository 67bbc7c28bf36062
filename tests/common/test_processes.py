"""Work in a process of its own: forked where that can be, of a new Python elsewhere, and the same to those who wait."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from pathlib import Path

import errands
import pytest

from gyroid_cad.common.processes import beside, can_fork, processors, slowed, started
from gyroid_cad.errors import KernelError, ParameterError

PATIENCE = 60.0
Captured = pytest.CaptureFixture[str]


@pytest.fixture(params=["linux", "another system"], autouse=True)
def system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes are forked on Linux alone."""
    if request.param == "linux" != sys.platform:
        pytest.skip("not Linux")
    monkeypatch.setattr(sys, "platform", request.param)
    assert can_fork() == (request.param == "linux")


def test_it_is_done_in_another_process_that_prints_nothing(tmp_path: Path, capfd: Captured) -> None:
    work = started(errands.shout, str(tmp_path / "a"), "two words")
    assert work.wait(PATIENCE) == 0
    number, words = (tmp_path / "a").read_text().split(" ", 1)
    assert int(number) != os.getpid()
    assert words == "two words"
    assert capfd.readouterr() == ("", "")


def test_a_crash_and_an_error_are_a_status(capfd: Captured) -> None:
    assert started(errands.crash).wait(PATIENCE) == -signal.SIGABRT
    assert started(errands.fail).wait(PATIENCE) == 1
    assert capfd.readouterr() == ("", "")


def test_one_that_does_not_end_is_waited_for_as_long_as_one_likes_and_ended() -> None:
    work = started(errands.sleep)
    assert work.wait(0.01) is None
    work.kill()
    assert work.wait(PATIENCE) == -signal.SIGKILL


def test_work_beside_runs_in_another_process_and_its_result_and_errors_come_back() -> None:
    def refuses() -> int:
        raise ParameterError("cells", 0, "at least 1")

    with beside(os.getpid, "tells its number") as number:
        assert (number() != os.getpid()) == (can_fork() and processors() > 1)
    with beside(refuses, "refuses") as result, pytest.raises(ParameterError, match="cells"):
        result()


def test_work_beside_that_ends_its_process_is_an_error() -> None:
    if not can_fork() or processors() < 2:
        pytest.skip("all is done in this process, which it would end")
    with beside(lambda: os._exit(3), "ends itself") as result, pytest.raises(KernelError, match="ends itself"):
        result()


def test_work_beside_whose_result_nobody_waits_for_is_ended() -> None:
    with beside(signal.pause, "sleeps"):
        pass
    assert not multiprocessing.active_children()


@pytest.mark.parametrize(("load", "times"), [(0.0, 1.0), (1.0, 1.0), (3.0, 3.0), (100.0, 5.0)])
def test_work_takes_longer_where_more_of_it_wants_the_processors_than_there_are(
    monkeypatch: pytest.MonkeyPatch, load: float, times: float
) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (load * (os.cpu_count() or 1), 0.0, 0.0), raising=False)
    assert slowed() == pytest.approx(times)
