"""Processes that work for this one, and end when it ends."""

from __future__ import annotations

import os
import signal
import sys

__all__ = ["end_with_parent"]

# Of prctl(2): the signal that a process gets when the one that started it ends.
_SET_SIGNAL_AT_PARENTS_END = 1


def end_with_parent(parent: int) -> None:
    """Let the system end this process at once when its parent ends, however that ends (Linux; elsewhere nothing).

    Parameters
    ----------
    parent : int
        Its number, as ``os.getpid`` gives it there: it may have ended already.
    """
    if sys.platform != "linux":
        return
    import ctypes  # not needed by those who never start a process

    ctypes.CDLL(None).prctl(_SET_SIGNAL_AT_PARENTS_END, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
