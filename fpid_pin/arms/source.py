"""Where an arm comes from: the part of its description that names its geometry and inertia."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.chain import last_frame
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, ArmError

#: A position limit beyond this [rad] or [m] is a way of saying that there is none.
UNREACHABLE = 1e4


@dataclass
class Parts:
    """What an arm is made of while it is being put together; changes alter these in place.

    `model` is a ``pinocchio.Model`` with one revolute or prismatic joint per degree of freedom.
    `home` may be None (then it is the middle of the limits), and so may `tool` (then it is the last
    frame).
    """

    model: Any
    name: str
    lower: FloatArray
    upper: FloatArray
    effort_limit: FloatArray
    velocity_limit: FloatArray
    viscous_friction: FloatArray
    dry_friction: FloatArray
    home: FloatArray | None = None
    tool: str | None = None

    def settle(self) -> tuple[FloatArray, str]:
        """Fill in what may be left open, write limits and friction into the model; home, tool."""
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = np.zeros(self.model.nv)
        middle[bounded] = 0.5 * (self.lower[bounded] + self.upper[bounded])
        # With one bound only, the admissible value nearest to 0.
        middle = np.clip(middle, self.lower, self.upper)
        home = middle if self.home is None else self.home
        self.home = home = np.where((home >= self.lower) & (home <= self.upper), home, middle)
        self.tool = tool = self.tool or last_frame(self.model)
        model = self.model
        model.lowerPositionLimit, model.upperPositionLimit = _both(self.lower, self.upper)
        model.lowerEffortLimit, model.upperEffortLimit = _both(None, self.effort_limit)
        model.lowerVelocityLimit, model.upperVelocityLimit = _both(None, self.velocity_limit)
        model.lowerDryFrictionLimit, model.upperDryFrictionLimit = _both(None, self.dry_friction)
        model.damping = np.array(self.viscous_friction)
        return home, tool


def _both(lower: FloatArray | None, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return writable copies of two limits, as Pinocchio wants them; None is ``-upper``."""
    return np.array(-upper if lower is None else lower), np.array(upper)


class Source(ABC):
    """A description that builds a Pinocchio model, and again the same one from its table."""

    kind: ClassVar[str]

    @abstractmethod
    def build(self) -> Parts:
        """Build the arm's parts from scratch."""

    @abstractmethod
    def table(self) -> dict[str, Any]:
        """Return the source as a plain table (without its kind)."""

    @abstractmethod
    def visual(self, model: Any) -> tuple[Any, Any]:
        """Return (model, ``pinocchio.GeometryModel``) for a viewer."""

    @property
    def credit(self) -> str:
        """Who made it and under which licence; empty where that is not known."""
        return ""


def gravity_vector(gravity: ArrayLike) -> FloatArray:
    """Return gravity as a (3,) vector in the world frame [m/s^2]; a number points down (-z)."""
    value = checks.floats("gravity", gravity)
    if value.ndim == 0:
        magnitude = checks.number("gravity", gravity, low=0.0)
        return checks.read_only((0.0, 0.0, -magnitude))
    if value.shape != (3,):
        raise ArgumentError("gravity", "a number or shape (3,)", f"shape {value.shape}")
    return value


def gravity_entry(gravity: FloatArray) -> float | list[float]:
    """Write a gravity vector as users do: a number where it points down."""
    if gravity[0] == 0.0 and gravity[1] == 0.0 and gravity[2] <= 0.0:
        return float(abs(gravity[2]))
    return [float(x) for x in gravity]


def limits_of(
    model: Any, lower: ArrayLike | None = None, upper: ArrayLike | None = None
) -> dict[str, FloatArray]:
    """Read limits and friction from a model; what is absent there (0, or an empty range) is inf.

    `lower` and `upper` are its position limits one a joint, (n,); None: they stand so in the model.
    """
    lower = np.array(model.lowerPositionLimit if lower is None else lower, dtype=np.float64)
    upper = np.array(model.upperPositionLimit if upper is None else upper, dtype=np.float64)
    empty = ~(lower < upper)
    lower[empty | (lower < -UNREACHABLE)] = -np.inf
    upper[empty | (upper > UNREACHABLE)] = np.inf
    return {
        "lower": lower,
        "upper": upper,
        "effort_limit": given_or_inf(model.upperEffortLimit),
        "velocity_limit": given_or_inf(model.upperVelocityLimit),
        "viscous_friction": np.array(model.damping, dtype=np.float64),
        "dry_friction": np.array(model.upperDryFrictionLimit, dtype=np.float64),
    }


def given_or_inf(limit: ArrayLike) -> FloatArray:
    """Return a copy of `limit` with inf where it is 0 or absurd: no limit was given."""
    values = np.array(limit, dtype=np.float64)
    values[~((values > 0.0) & (values < 1e300))] = np.inf
    return values


@contextmanager
def one_line(name: str, what: str) -> Iterator[None]:
    """Turn whatever Pinocchio raises into one `ArmError` on one line."""
    try:
        yield
    except (ValueError, RuntimeError, IndexError) as error:
        # Some of its messages begin with where in its source they come from.
        said = str(error).rpartition("\nmessage:")[2]
        reason = " ".join(said.split()) or type(error).__name__
        raise ArmError(f"{name}: {what}: {reason}") from None
