"""What a law declares of its fractional operators."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Operator:
    """A fractional operator of one signal of a law, one for each joint.

    Parameters
    ----------
    order
        The law's field that holds the order, in [0, 1], or the order itself.
    of
        The signal: ``e``, another given number, or a number that the law remembers.
    sign
        1 or -1: whether the signal pushes the torque upwards or downwards where it is positive.
        An integral is held while the torque is cut and it would push further.
    adapts
        Whether the law changes the order while it runs, by its field's name; next to the output
        ``name`` it then has ``name_by_order``, the derivative of the output by the order, one
        sample old.
    """

    order: str | float
    of: str = "e"
    sign: int = 1
    adapts: bool = False


class Derivative(Operator):
    """D^mu of a signal, eq. (4) with a measured rate where the signal has one."""


class Integral(Operator):
    """I^lambda of a signal, that is D^(1 - lambda) of its integral."""
