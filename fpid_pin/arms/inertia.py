"""A link's inertia as ten numbers, and whether a body could have it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError
from fpid_pin.text import named

#: Of a row: xx, xy, xz, xy, yy, ... of the symmetric matrix.
_ENTRIES = [4, 5, 7, 5, 6, 8, 7, 8, 9]
#: Part of the largest principal moment by which the others may fall short: files are rounded, some
#: to three digits.
_ROUNDING = 1e-2
#: A radius of gyration that is nothing [m].
_NEGLIGIBLE = 1e-6


def inertia_of(row: Sequence[float] | FloatArray) -> Any:
    """Build a ``pinocchio.Inertia`` from its ten numbers (see `fpid_pin.arms.chain.Joint`)."""
    numbers = np.asarray(row, dtype=np.float64)
    inertia = pin.Inertia(float(numbers[0]), np.array(numbers[1:4]), np.eye(3))
    # Afterwards, and so without a check: what is asked for may be no body's.
    inertia.inertia = numbers[_ENTRIES].reshape(3, 3)
    return inertia


def row_of(inertia: Any) -> tuple[float, ...]:
    """Return the ten numbers of a ``pinocchio.Inertia``."""
    matrix, lever = np.array(inertia.inertia), np.array(inertia.lever)
    about = matrix[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
    return tuple(float(x) for x in (inertia.mass, *lever, *about))


def moved(row: Sequence[float], place: Any) -> tuple[float, ...]:
    """Return the row in another frame, in which its own is at `place`, a ``pinocchio.SE3``."""
    if not any(row) or place.isIdentity(0.0):
        return tuple(row)
    numbers, turn = np.asarray(row), np.array(place.rotation)
    com = turn @ numbers[1:4] + np.array(place.translation)
    about = turn @ numbers[_ENTRIES].reshape(3, 3) @ turn.T
    return (*row[:1], *com.tolist(), *about[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)].tolist())


def summed(rows: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Return the row of several bodies together; of one alone, to the last bit, its own."""
    heavy = [row for row in rows if any(row)]
    if len(heavy) < 2:
        return tuple((heavy or [(0.0,) * 10])[0])
    total = inertia_of(heavy[0])
    for row in heavy[1:]:
        total = total + inertia_of(row)
    return row_of(total)


def require_physical(names: Sequence[str], rows: FloatArray, label: str) -> None:
    """Refuse masses and inertias, (L, 10), of links that no body has.

    A mass is not negative. Neither are the principal moments of inertia, and none is larger than
    the sum of the other two: Ixx + Iyy - Izz is twice an integral of z^2. The `ArmError` names the
    first link at fault.
    """
    bad = ~np.isfinite(rows).all(axis=1) | (rows[:, 0] < 0.0)
    bad[~bad] = impossible(rows[~bad])
    if not bad.any():
        return
    k = int(np.argmax(bad))
    if not np.isfinite(rows[k]).all():
        said = "a finite mass and inertia, got NaN or inf"
    elif rows[k, 0] < 0.0:
        said = f"a mass >= 0 [kg], got {rows[k, 0]:g}"
    else:
        got = ", ".join(f"{moment:.4g}" for moment in _moments(rows[k])[0])
        said = (
            "principal moments of inertia >= 0 [kg m^2] with none above the sum of the others, got "
            f'{got} (inertia = "nearest" takes the closest that a body can have, "accept" these)'
        )
    raise ArmError(f"{label}: link {named(names[k])}: expected {said}")


def impossible(rows: FloatArray, rounding: float = _ROUNDING) -> NDArray[np.bool_]:
    """Return which rows, (L, 10), have a rotational inertia that no body has, (L,)."""
    matrices = rows[:, _ENTRIES].reshape(-1, 3, 3)
    # To one scale: the largest doubles would overflow on the way to their eigenvalues.
    sizes = np.abs(matrices).max(axis=(1, 2))
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    low, middle, high = np.linalg.eigvalsh(matrices / sizes[:, None, None]).T
    least = np.minimum(low, low + middle - high)
    negative = np.diagonal(matrices, axis1=1, axis2=2).min(axis=1)
    negligible = _NEGLIGIBLE**2 * np.maximum(rows[:, 0], 0.0)
    # Rounding makes no sign.
    bad = (least < -rounding * high - negligible / sizes) | (negative < -negligible)
    return np.asarray(bad)


def nearest_possible(row: Sequence[float]) -> tuple[tuple[float, ...], float]:
    """Return the row with the closest rotational inertia that a body can have, and how far it is.

    With second moments s_k >= 0 about the centre of mass, the principal moments are
    s_2 + s_3, s_1 + s_3, s_1 + s_2. Closest is in Frobenius' norm, which leaves the principal axes
    as they are; the distance is relative to the norm of the given inertia.
    """
    from scipy.optimize import nnls

    moments, axes = _moments(row)
    to_moments = 1.0 - np.eye(3)
    second, distance = nnls(to_moments, moments)
    matrix = axes @ np.diag(to_moments @ second) @ axes.T
    about = matrix[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)].tolist()
    return (*row[:4], *about), float(distance / np.linalg.norm(moments))


def _moments(row: Any) -> tuple[FloatArray, FloatArray]:
    values, axes = np.linalg.eigh(np.asarray(row)[_ENTRIES].reshape(3, 3))
    return values, axes
