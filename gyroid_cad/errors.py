"""What can go wrong, in words a user can act on: the parameter, its value, what is accepted."""

from __future__ import annotations

__all__ = ["ExportError", "FitError", "GyroidError", "KernelError", "ParameterError"]


class GyroidError(Exception):
    """Base of every error this package raises on purpose."""


class ParameterError(GyroidError, ValueError):
    """A value that cannot be used.

    Parameters
    ----------
    parameter : str
        Name of the parameter, as the caller wrote it.
    value : object
        What was given.
    accepted : str
        What would have been accepted.
    """

    def __init__(self, parameter: str, value: object, accepted: str) -> None:
        shown = " ".join(repr(value).split())
        if len(shown) > 120:
            shown = shown[:117] + "..."
        super().__init__(f"{parameter} = {shown}: expected {accepted}")
        self.parameter = parameter
        self.value = value
        self.accepted = accepted

    def __reduce__(self) -> tuple[type[ParameterError], tuple[str, object, str]]:
        return type(self), (self.parameter, self.value, self.accepted)


class FitError(GyroidError):
    """A fit that cannot serve the purpose it was asked for."""


class KernelError(GyroidError, RuntimeError):
    """The CAD kernel returned something that is not the closed, valid solid that was asked for."""


class ExportError(GyroidError, OSError):
    """A file that could not be written; nothing was left behind and nothing older was touched."""
