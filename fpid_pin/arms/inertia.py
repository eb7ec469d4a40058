"""A link's inertia as ten numbers, and links whose inertia is not what the model says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.checks import FloatArray


def inertia_of(row: FloatArray) -> Any:
    """Build a ``pinocchio.Inertia`` from its ten numbers (see `fpid_pin.arms.change.Inertias`)."""
    mass, cx, cy, cz, xx, xy, yy, xz, yz, zz = (float(x) for x in row)
    matrix = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    return pin.Inertia(mass, np.array((cx, cy, cz)), matrix)


def row_of(inertia: Any) -> list[float]:
    """Return the ten numbers of a ``pinocchio.Inertia`` (see `fpid_pin.arms.change.Inertias`)."""
    matrix, lever = np.array(inertia.inertia), np.array(inertia.lever)
    about = matrix[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
    return [float(x) for x in (inertia.mass, *lever, *about)]


def scaled_rows(model: Any, mass: FloatArray, inertia: FloatArray) -> FloatArray:
    """Return the links' ten numbers with masses, and rotational inertias again, times (n,)."""
    rows = np.array([row_of(body) for body in list(model.inertias)[1:]])
    rows[:, 0] *= mass
    rows[:, 4:] *= np.multiply(mass, inertia)[:, None]
    return rows


def perturbed_rows(
    model: Any, rng: np.random.Generator, mass: float, com: float, inertia: float
) -> FloatArray:
    """Draw other inertias for every link, physically consistent by construction.

    The mass is multiplied by a number from U(1 - mass, 1 + mass), the rotational inertia about the
    centre of mass by the same number (the density changes, not the shape) and by one from
    U(1 - inertia, 1 + inertia), and the centre of mass moves by U(-com, com) [m] along each axis.
    Scaling and moving keep principal moments positive and within the triangle inequality.
    """
    n = len(model.inertias) - 1
    scale = rng.uniform(1.0 - mass, 1.0 + mass, n)
    shift = rng.uniform(-com, com, (n, 3))
    size = rng.uniform(1.0 - inertia, 1.0 + inertia, n)
    rows = scaled_rows(model, scale, size)
    rows[:, 1:4] += shift
    return rows
