"""Origin of the kernel that is loaded."""

from __future__ import annotations

import OCP

__all__ = ["kernel_origin"]


def kernel_origin() -> str:
    """The version that the kernel itself says it has, and the file it was loaded from."""
    return f"OCP {OCP.__version__}, {OCP.__file__}"
