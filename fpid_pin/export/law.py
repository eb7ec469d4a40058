"""A law for the printer: its functions in the place of calls by address, its arrays by name.

Independent of the language: `c_source` prints it as C, a page runs it as JavaScript.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from types import FunctionType
from typing import TYPE_CHECKING, Any

from fpid_pin import checks
from fpid_pin.control import Controller
from fpid_pin.exceptions import ExportError
from fpid_pin.export.kinds import REAL, Array, Bundle, Record, array_kind

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.state import State

#: Joints that an export is meant for. Beyond, M and its factors are most of the memory.
MOST_JOINTS = 32
#: Integers of a controller that kernels write to.
MOVING = frozenset({"ticks", "acting", "pushing"})
#: What a tick is given: q, v, and q, v, a of the reference, each (n,), one after the other.
INPUTS = 5


def start(controller: Controller, arm: Arm, step: float, horizon: float) -> State:
    """Return the state at t = 0 of a controller that can be printed.

    Raises
    ------
    ExportError
        More joints than `MOST_JOINTS`, or a law in plain Python.
    """
    from fpid_pin.control.start import start_all

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


def bundle(
    name: str, arrays: Any, texts: Mapping[str, str], *, record: Any = None,
    constants: Mapping[str, Sequence[str]] | None = None,
) -> Bundle:  # fmt: skip
    """Return what the printer is told of a NamedTuple of `kernels.records`.

    Parameters
    ----------
    name
        Of the argument's type.
    arrays
        At t = 0.
    texts
        How each array is written, see `kinds.Bundle`.
    record
        Of a controller: the type of a joint's record, which its `joints` and `numbers` both are.
    constants
        Integer fields that never change, by array; None: all but `MOVING`.
    """
    members = []
    for field, values in arrays._asdict().items():
        if record is not None and field == "joints":
            kind = Array(Record.of("joint", record), values.shape)
        else:
            own: Any = () if constants is None else constants.get(field, ())
            if constants is None and values.dtype.names is not None:
                own = [name for name in values.dtype.names if name not in MOVING]
            kind = array_kind(_RECORDS.get(field, field), values, own)
        members.append((field, kind, texts[field]))
    return Bundle(name, tuple(members))


#: What a record is called whose array is not.
_RECORDS = {"ops": "operator", "poles": "pole", "modes": "mode", "bodies": "body",
            "links": "link", "frames": "frame"}  # fmt: skip


def real(*shape: int) -> Array:
    """Return the kind of an array of numbers."""
    return Array(REAL, shape)


def stand_ins(controller: Controller) -> Mapping[Any, Any]:
    """Return what stands in the place of calls of a law's functions by address, for `Program`."""
    from fpid_pin.control.functions import plain_function
    from fpid_pin.kernels.call import call_law

    def in_place(arguments: Sequence[ast.expr]) -> tuple[Any, Sequence[ast.expr]]:
        address, numbers, own = arguments[:3]
        assert isinstance(address, ast.Attribute)
        assert isinstance(numbers, ast.Attribute)
        joints = ast.copy_location(ast.Attribute(numbers.value, "joints"), numbers)
        if controller.torques is not None:
            # A law of the whole robot; its model is arrays of the controller.
            function = getattr(controller, {"torque": "torques", "adapt": "adapts"}[address.attr])
            return plain_function(function), [joints, own, numbers.value]
        function = plain_function(getattr(controller, address.attr))
        each = torque_of_each if address.attr == "torque" else call_each
        return _around(each, f"{address.attr}_of_each", function), [joints]

    return {call_law: in_place}


def _around(template: Callable[..., None], name: str, function: Any) -> FunctionType:
    made = FunctionType(template.__code__, {"law_function": function, "__name__": __name__}, name)
    made.__doc__ = template.__doc__
    return made


#: What stands in these functions for one of a law's.
law_function: Any = None


def torque_of_each(joints: Any) -> None:
    """Write the law's own torque of each joint."""
    for j in range(joints.size):
        c = joints[j]
        c.u_law = c.scale * law_function(c)


def call_each(joints: Any) -> None:
    """Call the law's function for each joint."""
    for j in range(joints.size):
        law_function(joints[j])
