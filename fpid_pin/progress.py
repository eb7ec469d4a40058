"""Where a long piece of work stands: what every ``progress=`` is called with."""

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Progress", "ProgressCallback"]


@dataclass(frozen=True)
class Progress:
    """How much of a piece of work is done: `part` of the whole, 0 to 1."""

    part: float


#: What ``progress=`` takes; one of these also fits where a kind of `Progress` says more.
ProgressCallback = Callable[[Progress], None]
