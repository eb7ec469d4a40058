"""A law for the printer: its functions in the place of calls by address.

Independent of the language: `c_source` prints it as C, a page runs it as JavaScript.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from fpid_pin import checks
from fpid_pin.control import Controller
from fpid_pin.exceptions import ExportError

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.state import State

#: Joints that an export is meant for. Beyond, M and its factors are most of the memory.
MOST_JOINTS = 32
#: What a tick is given: q, v, and q, v, a of the reference, each (n,), one after the other.
INPUTS = 5


def start(controller: Controller, arm: Arm, step: float, horizon: float) -> State:
    """Return the state at t = 0 of a controller that can be printed.

    Raises
    ------
    ExportError
        More joints than `MOST_JOINTS`, or a law in plain Python.
    """
    from fpid_pin.control.state import start_all

    checks.instance("controller", controller, Controller, "a controller")
    if arm.n > MOST_JOINTS:
        raise ExportError(f"arm: expected at most {MOST_JOINTS} joints, got {arm.n}")
    state = start_all([controller], arm, step=step, horizon=horizon)[0]
    if state.in_python:
        raise ExportError(
            f"{type(state.controller).__name__}: expected a law by its functions surface, torque, "
            "adapt, got one in plain Python (CONTRIBUTING.md has both)"
        )
    return state


def stand_ins(controller: Controller, joints: str = "joints") -> Mapping[Any, Any]:
    """Return what stands in the place of calls of a law's functions by address, for `Program`.

    `joints` is the array of the controller that has the joints' whole records.
    """
    from fpid_pin.control.functions import plain_function
    from fpid_pin.kernels.compiled import call_law

    def in_place(arguments: Sequence[ast.expr]) -> tuple[Any, Sequence[ast.expr]]:
        address, numbers, own = arguments[:3]
        assert isinstance(address, ast.Attribute)
        assert isinstance(numbers, ast.Attribute)
        each = ast.copy_location(ast.Attribute(numbers.value, joints), numbers)
        if controller.torques is not None:
            # A law of the whole robot; its model is arrays of the controller.
            function = getattr(controller, {"torque": "torques", "adapt": "adapts"}[address.attr])
            return plain_function(function), [each, own, numbers.value]
        function = plain_function(getattr(controller, address.attr))
        if address.attr == "torque":
            return _torque_of_each(function), [each]
        return _call_each(function, f"{address.attr}_of_each"), [each]

    return {call_law: in_place}


def _torque_of_each(law_function: Any) -> Any:
    def torque_of_each(joints):  # type: ignore[no-untyped-def]
        """Write the law's own torque of each joint."""
        for j in range(joints.size):
            c = joints[j]
            c.u_law = c.scale * law_function(c)

    return torque_of_each


def _call_each(law_function: Any, name: str) -> Any:
    def call_each(joints):  # type: ignore[no-untyped-def]
        """Call the law's function for each joint."""
        for j in range(joints.size):
            law_function(joints[j])

    call_each.__name__ = name
    return call_each
