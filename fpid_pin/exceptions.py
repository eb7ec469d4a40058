"""The errors a user of the package can act on, and its warning.

Every message is one line: what, what was expected, what came. Whatever it quotes, from a file say,
is visible, and cut where it would be too long for a line.
"""

from collections.abc import Iterable
from typing import Self

from fpid_pin.text import MOST, cut, visible

__all__ = [
    "ArgumentError", "ArmError", "ConfigError", "DesignError", "ExportError", "FileFormatError",
    "FpidError", "FpidWarning", "SimulationError", "TuningError", "WorkersDied",
]  # fmt: skip

#: A message's key and value give way, down to these, for the line to have `MOST` characters; what
#: was expected is our own text and stays whole.
_NAME, _VALUE = 80, 80
#: No message is longer, whatever it is made of.
_LONGEST = 5 * MOST


class FpidError(Exception):
    """Base of every error that the package raises on purpose."""

    def __init__(self, message: object = "") -> None:
        super().__init__(cut(visible(str(message)), _LONGEST))


class ArgumentError(FpidError, ValueError):
    """An argument, or the key of this path in a file (``controller.kp.1``), is not as expected."""

    def __init__(self, name: str, expected: str, got: object) -> None:
        self.name = name
        self.expected = expected
        self.got = got
        head = f"{cut(visible(str(name)), _NAME)}: expected {cut(visible(expected))}, got "
        super().__init__(head + cut(visible(str(got)), max(MOST - len(head), _VALUE)))

    def __reduce__(self) -> tuple[type, tuple[str, str, object]]:
        # Exceptions pickle by their args; ours are three (workers send errors back).
        return (type(self), (self.name, self.expected, self.got))


class ArmError(FpidError):
    """A robot description cannot be used: missing, broken, or not a fixed-base chain."""


class DesignError(FpidError):
    """A fractional operator cannot be designed as asked for."""


class ExportError(FpidError):
    """A controller cannot leave Python: what is missing, or which line cannot be printed."""


class FileFormatError(FpidError):
    """A file is cut short, altered, of an unknown format, or not one of ours."""


class ConfigError(FpidError):
    """A configuration file is wrong; the message has a line for every fault, with its key path."""

    def __init__(self, message: object = "") -> None:
        lines = str(message).split("\n")
        # Each on its own, past the base's one line.
        Exception.__init__(self, "\n".join(cut(visible(line), _LONGEST) for line in lines))

    @classmethod
    def of(cls, path: object, faults: Iterable[object]) -> Self:
        """Return the error of a file: a line for every fault, also where a name has a line end."""
        return cls("\n".join(visible(f"{path}: {fault}") for fault in faults))


class SimulationError(FpidError):
    """A simulation cannot be carried out as described."""


class TuningError(FpidError):
    """A search cannot start, or cannot go on."""


class WorkersDied(TuningError):
    """Worker processes died over the task of this number, each time that it was tried."""

    def __init__(self, message: object = "", task: int = 0) -> None:
        super().__init__(message)
        self.task = task


class FpidWarning(UserWarning):
    """Something works, but not as the user may think."""

    def __init__(self, message: object = "") -> None:
        super().__init__(cut(visible(str(message)), _LONGEST))
