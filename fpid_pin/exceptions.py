"""The errors a user of the package can act on, and its warning.

Every message is one line: what, what was expected, what came.
"""

from __future__ import annotations

__all__ = [
    "ArgumentError",
    "ArmError",
    "ConfigError",
    "DesignError",
    "ExportError",
    "FileFormatError",
    "FpidError",
    "FpidWarning",
    "SimulationError",
    "TuningError",
]


class FpidError(Exception):
    """Base of every error that the package raises on purpose."""


class ArgumentError(FpidError, ValueError):
    """An argument has the wrong shape, type or range.

    Parameters
    ----------
    name
        The argument, or the key path in a configuration (``controller.kp.1``).
    expected, got
        What would have been right, and what came.
    """

    def __init__(self, name: str, expected: str, got: object) -> None:
        self.name = name
        self.expected = expected
        self.got = got
        super().__init__(f"{name}: expected {expected}, got {got}")

    def __reduce__(self) -> tuple[type, tuple[str, str, object]]:
        # Exceptions pickle by their args; ours are three (workers send errors back).
        return (type(self), (self.name, self.expected, self.got))


class ArmError(FpidError):
    """A robot description cannot be used: missing, broken, or not a fixed-base revolute chain."""


class DesignError(FpidError):
    """A fractional operator cannot be designed as asked for."""


class ExportError(FpidError):
    """A controller cannot leave Python: what is missing, or which line cannot be printed."""


class FileFormatError(FpidError):
    """A file is cut short, altered, of an unknown format, or not one of ours."""


class ConfigError(FpidError):
    """A configuration file is wrong; the message lists every fault with its key path."""


class SimulationError(FpidError):
    """A simulation cannot be carried out as described."""


class TuningError(FpidError):
    """A search cannot start, or cannot go on."""


class FpidWarning(UserWarning):
    """Something works, but not as the user may think."""
