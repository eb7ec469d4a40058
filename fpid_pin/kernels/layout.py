"""Records: what a kernel reads and writes by name."""

from __future__ import annotations

from typing import Any

import numpy as np


def layout(numbers: str, integers: str = "") -> Any:
    """Return the type of a record of numbers and of integers (counts and flags), by their names."""
    taken = [name for name in (numbers + " " + integers).split() if hasattr(np.record, name)]
    if taken:
        raise ValueError(f"{taken}: without compilation these would be methods of a record")
    fields = [(name, np.float64) for name in numbers.split()]
    return np.dtype((np.record, fields + [(name, np.int64) for name in integers.split()]))
