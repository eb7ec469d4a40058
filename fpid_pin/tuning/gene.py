"""Bounds of one parameter that a search may change, and the ways of writing them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown

GENE_SCALES = ("linear", "log")


@dataclasses.dataclass(frozen=True, eq=False)
class Gene:
    """Bounds of one parameter.

    Parameters
    ----------
    low, high
        Scalars, or (n,) for bounds of each joint's own.
    scale
        ``"linear"`` or ``"log"``: where a value lies between its bounds, and so how the first
        population is spread and how far a mutation reaches.
    shared
        One value for all joints; otherwise each joint has its own.
    """

    low: ArrayLike
    high: ArrayLike
    scale: str = "linear"
    shared: bool = False


def gene_of(name: str, given: Gene | Sequence[Any] | Mapping[str, Any]) -> Gene:
    """Return the gene that was meant, checked; see `Space`."""
    path = f"space.{name}"
    if isinstance(given, Mapping):
        fields = [f.name for f in dataclasses.fields(Gene)]
        for key in given:
            checks.choice(f"{path}.{key}", key, fields)
        for key in ("low", "high"):
            if key not in given:
                raise ArgumentError(f"{path}.{key}", "a number", "none")
        gene = Gene(**given)
    elif isinstance(given, Gene):
        gene = given
    else:
        gene = _from_sequence(path, given)
    checks.choice(f"{path}.scale", gene.scale, GENE_SCALES)
    if not isinstance(gene.shared, bool):
        raise ArgumentError(f"{path}.shared", "true or false", shown(gene.shared))
    low = checks.floats(f"{path}.low", gene.low, max_ndim=1)
    high = checks.floats(f"{path}.high", gene.high, max_ndim=1)
    if low.ndim and high.ndim and low.shape != high.shape:
        raise ArgumentError(path, "bounds of one length", f"shapes {low.shape} and {high.shape}")
    if gene.scale == "log":
        checks.floats(f"{path}.low", low, above=0.0)
    if not np.all(low < high):
        raise ArgumentError(path, "low < high", f"({plain(low)}, {plain(high)})")
    return Gene(low, high, gene.scale, gene.shared)


def _from_sequence(path: str, given: Sequence[Any]) -> Gene:
    expected = 'bounds (low, high), then "log" or "shared" as needed'
    if isinstance(given, str) or not isinstance(given, Sequence) or not 2 <= len(given) <= 4:
        raise ArgumentError(path, expected, shown(given))
    words = list(given[2:])
    for word in words:
        checks.choice(path, word, ("linear", "log", "shared"))
    if len(set(words)) < len(words) or {"linear", "log"} <= set(words):
        raise ArgumentError(path, expected, shown(given))
    return Gene(given[0], given[1], "log" if "log" in words else "linear", "shared" in words)


def plain(value: ArrayLike) -> str:
    """Write a bound for an error or a repr."""
    array = np.asarray(value)
    return (
        f"{float(array):g}" if array.ndim == 0 else "[" + ", ".join(f"{x:g}" for x in array) + "]"
    )
