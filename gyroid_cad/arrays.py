"""Arrays inside frozen descriptions are read-only too."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

__all__ = ["freeze_arrays"]


def freeze_arrays(instance: Any) -> None:
    """Replace every array of a frozen dataclass by a C-ordered copy that cannot be written to.

    Parameters
    ----------
    instance : dataclass instance
        Called from its ``__post_init__``.
    """
    for field in fields(instance):
        value = getattr(instance, field.name)
        if isinstance(value, np.ndarray):
            stored = np.array(value, order="C")
            stored.setflags(write=False)
            object.__setattr__(instance, field.name, stored)
