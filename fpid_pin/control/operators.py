"""What a law declares of its fractional operators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fpid_pin import checks
from fpid_pin.kernels.records import GIVEN

#: What a law may take its signals to have been before t = 0: see `fpid_pin.fractional.Bank`.
INITIALISATIONS = ("caputo", "grunwald_letnikov")


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


def check_declared(operators: Any, memory: Any, numbers: Sequence[str]) -> None:
    """Check what a law declares, `numbers` being the names of its numbers.

    Refused are names that are taken, operators that are none, a memory that is one name, and an
    order that is to adapt and is in no field.
    """
    checks.instance("memory", memory, (tuple, list), "a tuple of names")
    for name in numbers:
        if name in GIVEN.names:  # type: ignore[operator]
            raise checks.ArgumentError(name, "another name", f"{name}, which every law is given")
    given = {*GIVEN.names, *numbers, *memory}  # type: ignore[misc]
    checks.instance("operators", operators, Mapping, "a dictionary of operators")
    for output, operator in operators.items():
        name = f"operators.{output}"
        checks.instance(name, operator, Operator, "a Derivative or an Integral")
        if output in given:
            raise checks.ArgumentError(name, "a name of its own", f"{output}, which is taken")
        if operator.sign not in (1, -1):
            raise checks.ArgumentError(f"{name}.sign", "1 or -1", operator.sign)
        if operator.adapts and not isinstance(operator.order, str):
            raise checks.ArgumentError(name, "an order in a field, to adapt it", operator.order)
