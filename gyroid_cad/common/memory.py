"""Memory that cells take, against what is free and what this process may have."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path

import psutil

from gyroid_cad.errors import GyroidError, ParameterError

__all__ = ["Room", "cgroup_rooms", "memory_rooms", "require_libraries", "require_memory", "require_room"]

# What imports and one cell take.
_BASE_BYTES = 400_000_000
# What loading the kernel adds to a process's address space, and to its data.
_KERNEL_ADDRESSES, _KERNEL_DATA = 650_000_000, 150_000_000
# And what the numerical libraries beside it add: nearest neighbours, labels, VTK.
_NUMERICS_ADDRESSES, _NUMERICS_DATA = 350_000_000, 50_000_000
# Of a limit of the process something is taken before the first cell.
_PROCESS_BYTES = 50_000_000
# A control group's limit, what it uses, and in memory.stat how much of that the system drops when it has to.
_CGROUP_FILES = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)


@dataclass(frozen=True, slots=True)
class Room:
    """Memory that may still be taken, in bytes.

    Attributes
    ----------
    free : int
    base : int
        What is taken of it before anything that a user asks for.
    where : str
        The end of a sentence that begins with how much it is.
    """

    free: int
    base: int
    where: str

    @property
    def left(self) -> int:
        """Memory that a user may have, in bytes."""
        return max(0, self.free - self.base)


def require_memory(
    cells: tuple[int, int, int], bytes_per_cell: int, control_points: int = 10, kernel: bool = True
) -> None:
    """Refuse cells that would take more memory than is free, or than this process may have.

    Parameters
    ----------
    cells : tuple of int
    bytes_per_cell : int
        At the peak, as ``benchmarks/memory.py`` measures it, with 10 control points along each side of a patch.
    control_points : int
    kernel : bool
        Whether the CAD kernel is needed for it.

    Raises
    ------
    ParameterError
    """
    each = int(bytes_per_cell * max(1.0, (control_points / 10) ** 2))
    require_room("cells", cells, prod(cells) * each, lambda left: f"at most about {left // each} cells in all", kernel)


def require_room(
    parameter: str,
    value: object,
    needed: int,
    accepted: Callable[[int], str],
    kernel: bool = True,
    base: int = _BASE_BYTES,
    subject: str = "these",
) -> None:
    """Refuse a value with which more memory would be taken than is free, or than this process may have.

    Parameters
    ----------
    parameter : str
    value : object
    needed : int
        In bytes.
    accepted : callable
        Says, for the bytes that there are, which value would be accepted.
    kernel : bool
        Whether the CAD kernel is needed for it.
    base : int
        What the program itself takes, in bytes.
    subject : str
        What takes so much.

    Raises
    ------
    ParameterError
    """
    room = min(memory_rooms(kernel, base), key=lambda room: room.left)
    if needed > room.left:
        raise ParameterError(
            parameter,
            value,
            f"{accepted(room.left)}: {subject} take about {(room.base + needed) / 1e9:.3g} GB of memory "
            f"and {room.free / 1e9:.3g} GB {room.where}",
        )


def memory_rooms(kernel: bool = True, base: int = _BASE_BYTES) -> Iterator[Room]:
    """Yield the machine's free memory, and what each limit of the process or its control groups leaves of it.

    Parameters
    ----------
    kernel : bool
        Whether the CAD kernel is to be loaded, if it is not yet.
    base : int
        What the program itself takes, in bytes.
    """

    yield Room(psutil.virtual_memory().available, base, "are free")
    yield from cgroup_rooms(base)
    yield from _process_rooms(kernel)


def cgroup_rooms(
    base: int = _BASE_BYTES, groups: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")
) -> Iterator[Room]:
    """Yield what the control groups of this process leave it (Linux; containers are limited by them).

    A group is looked for where its name says, and in all that it is part of: in a container its name may be that
    which it has outside.

    Parameters
    ----------
    base : int
    groups : path
        The process's groups, one a line: number, controllers and name (cgroups(7)); of version 2 none is named.
    root : path
        Where the groups are mounted.
    """
    for line in _text(groups).splitlines():
        _, controllers, name = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        top = root / ("memory" if controllers else "")
        group = top / name.strip("/")
        for folder in (group, *group.parents):
            for names in _CGROUP_FILES:
                limit, used = (_text(folder / file).strip() for file in names[:2])
                if limit.isdigit() and used.isdigit():
                    kept = int(used) - _statistic(_text(folder / "memory.stat"), names[2])
                    yield Room(max(0, int(limit) - kept), base, "are left by the limit of its container")
            if folder == top:
                break


def require_libraries(kernel: bool = True) -> None:
    """Refuse to load libraries into a process whose limits leave no room for them.

    Some end it with a signal then, and others, OpenBLAS for one, wait for ever.

    Parameters
    ----------
    kernel : bool
        Whether the CAD kernel is needed.

    Raises
    ------
    GyroidError
    """
    for room in _process_rooms(kernel, numerics=True):
        if not room.left:
            raise GyroidError(
                f"what this loads takes about {room.base / 1e9:.2g} GB, and {room.free / 1e9:.2g} GB {room.where}"
            )


def _process_rooms(kernel: bool, numerics: bool = False) -> Iterator[Room]:
    """Yield what this process's own limits leave it (``ulimit -v``, ``ulimit -d``), whatever it is yet to load."""
    try:
        import resource
    except ImportError:  # there are none on Windows
        return

    addresses = (_KERNEL_ADDRESSES, _NUMERICS_ADDRESSES), "of address space are left (ulimit -v)"
    data = (_KERNEL_DATA, _NUMERICS_DATA), "of data are left (ulimit -d)"
    limits = [(resource.RLIMIT_AS, "vms", *addresses), (resource.RLIMIT_DATA, "data", *data)]
    loads = kernel and "OCP" not in sys.modules, numerics and "scipy.spatial" not in sys.modules
    for number, name, sizes, where in limits:
        limit = resource.getrlimit(number)[0]
        if limit != resource.RLIM_INFINITY:
            used = getattr(psutil.Process().memory_info(), name, 0)
            yet = sum(size for size, loaded in zip(sizes, loads, strict=True) if loaded)
            yield Room(max(0, limit - used), _PROCESS_BYTES + yet, where)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii")
    except (OSError, ValueError):
        return ""


def _statistic(text: str, name: str) -> int:
    return next((int(line.split()[1]) for line in text.splitlines() if line.split()[:1] == [name]), 0)
