"""Record types: what a kernel reads and writes by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def record_type(
    numbers: Mapping[str, str], integers: Mapping[str, str] | None = None
) -> np.dtype[Any]:
    """Return the type of a record.

    Parameters
    ----------
    numbers, integers
        Names of the fields, real ones and whole ones (counts and flags), and what each is.

    Raises
    ------
    ValueError
        A name that would hide a method of NumPy's records, so that it could not be read by name.
    """
    fields: list[tuple[str, Any]] = [(name, np.float64) for name in numbers]
    fields += [(name, np.int64) for name in integers or ()]
    taken = [name for name, _ in fields if hasattr(np.record, name)]
    if taken:
        raise ValueError(f"{taken}: without compilation these would be methods of a record")
    return np.dtype((np.record, fields))
