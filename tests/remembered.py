"""Fills that several doors ask for are made once."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from gyroid_cad.filling.part import part_of
from gyroid_cad.surface.fit import FitSettings


def filled_once(fill: Callable[..., Any]) -> Callable[..., Any]:
    """Fill a part, or give what a part of that size was filled with before, by the very same settings."""
    known: dict[Any, Any] = {}
    signature = inspect.signature(fill)

    def remembered(*given: Any, **named: Any) -> Any:
        bound = signature.bind(*given, **named)
        bound.apply_defaults()
        settings = {name: plain(value) for name, value in bound.arguments.items() if name not in ("part", "progress")}
        settings["fit"] = settings["fit"] or FitSettings()
        part = part_of(bound.arguments["part"])
        size = *part.low.round(6).tolist(), *part.high.round(6).tolist(), round(part.volume, 6)
        key = size, tuple(settings.items())
        if key not in known:
            known[key] = fill(*given, **named)
        return known[key]

    return remembered


def plain(value: Any) -> Any:
    """One spelling of a setting, whichever door it came through."""
    if isinstance(value, list | tuple):
        return tuple(map(plain, value))
    try:
        return float(value)
    except (TypeError, ValueError):
        return value
