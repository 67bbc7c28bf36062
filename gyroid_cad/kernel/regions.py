"""A part and the faces of a lattice split where they cross, region by region, in processes.

Nearly all the time of ``split`` goes into the curves where a face of the lattice meets one of the part; and those of
one region know nothing of another. So each process cuts the faces of a region against the part, and sends back what
is left of them in the part. Edges and vertices that faces of two regions share are then made one again; and the part's
boundary is split along all the section edges at once, which takes no time to speak of, as no surfaces are intersected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from OCP.Standard import Standard_OutOfMemory
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.common.processes import results_of
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.region_merge import Joining
from gyroid_cad.kernel.region_split import Found, RegionSplit, Task
from gyroid_cad.kernel.split import Pieces, split

__all__ = ["split_by_region"]

# With fewer faces, starting processes is not worth it.
_FEW = 64


def split_by_region(
    part: Part,
    faces: Sequence[TopoDS_Shape],
    processes: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Pieces:
    """Split a part's boundary and faces where they cross, as ``split`` does, in several processes.

    The result does not depend on how many there are: where there is one processor, or processes cannot be forked, one
    region is split after the other. Only few faces are split all at once.

    Parameters
    ----------
    part : Part
    faces : sequence of TopoDS_Shape
        Faces that share their edges.
    processes : int, optional
        As many as there are processors to run on, if left out; with 1, what ``split`` gives.
    progress : callable, optional
        Called now and then with (faces done, faces in all).

    Raises
    ------
    KernelError
        If the kernel fails, or a process.
    """
    if len(faces) < _FEW or processes == 1:
        pieces = split(part, faces)
        if progress is not None:
            progress(len(faces), len(faces))
        return pieces
    task, done = Task(part, faces), 0

    def found_in(number: int) -> Found:
        with _kernel_errors():
            return RegionSplit(task, task.regions[number]).found()

    def told(number: int) -> None:
        nonlocal done
        done += len(task.regions[number])
        if progress is not None:
            progress(done, len(faces))

    found = results_of(found_in, len(task.regions), "split the part against the lattice", processes, told)
    with _kernel_errors():
        return Joining(task, found).pieces()


@contextmanager
def _kernel_errors() -> Iterator[None]:
    """Errors of the kernel as ours: they have no class in common, and cannot be sent from one process to another."""
    try:
        yield
    except (KernelError, MemoryError):
        raise
    except Standard_OutOfMemory as failed:
        raise MemoryError(str(failed)) from failed
    except Exception as failed:
        raise KernelError(f"the kernel could not split the part against the lattice: {failed}") from failed
