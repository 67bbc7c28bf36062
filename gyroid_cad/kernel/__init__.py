"""The CAD kernel (OpenCascade, through OCP): surfaces, solids, checks, booleans, reading and writing."""

import os

from OCP.OSD import OSD_ThreadPool


class _Threads:
    """The kernel's pool of threads, ended before a process is forked and allowed again in both.

    A forked process has none of its parent's threads, and the kernel would wait for them for ever.
    """

    def __init__(self) -> None:
        self._count = 1

    def end(self) -> None:
        self._count = OSD_ThreadPool.DefaultPool_s().NbThreads()
        OSD_ThreadPool.DefaultPool_s().Init(1)

    def allow(self) -> None:
        # None is started before there is work for it.
        OSD_ThreadPool.DefaultPool_s().Init(self._count)


if hasattr(os, "register_at_fork"):
    _threads = _Threads()
    os.register_at_fork(before=_threads.end, after_in_parent=_threads.allow, after_in_child=_threads.allow)
