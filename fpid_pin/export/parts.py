"""What a law consists of outside Python: memory, constants, and the kernels of a tick.

Independent of the language: `program` prints it as C, a page runs it as JavaScript.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.control import AdaptiveFpid, ComputedTorque, Controller
from fpid_pin.control.fpid_state import FpidState
from fpid_pin.control.state import KernelState
from fpid_pin.exceptions import ExportError
from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Extent, Kind, Number, Record

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Joints that an export is meant for. Beyond, M and its factor are most of the memory.
MOST_JOINTS = 32
#: What a tick is given: q, v, and q, v, a of the reference, each (n,), one after the other.
INPUTS = 5


@dataclass(frozen=True)
class Part:
    """A piece of a law's memory.

    Attributes
    ----------
    name, element, shape
        How it is called and what it holds; extents may be names of constants.
    values
        At t = 0; None: zeros, room to work in.
    fixed
        Whether no tick changes it.
    """

    name: str
    element: Number | Record
    shape: tuple[Extent, ...]
    values: Any
    fixed: bool

    @property
    def kind(self) -> Kind:
        """For the printer: an array, or a record that is alone."""
        return Array(self.element, self.shape) if self.shape else self.element


@dataclass(frozen=True)
class Call:
    """A kernel that a tick calls.

    Attributes
    ----------
    kernel
        See `kernels.compiled.kernel`.
    arguments
        Names of parts, ``inputs``, ``inputs[k]`` for a row of them, ``torque``, or numbers.
    """

    kernel: Any
    arguments: tuple[str | float, ...]


@dataclass(frozen=True)
class Law:
    """A law as parts and calls.

    Attributes
    ----------
    parts
        In the order in which they lie in memory.
    extents
        Values of the constants that shapes are made of.
    calls
        A tick; the torque is ``torque``, (n,).
    """

    controller: Controller
    n: int
    parts: tuple[Part, ...]
    extents: dict[str, int]
    calls: tuple[Call, ...]

    def part(self, name: str) -> Part:
        """Return a part by name."""
        return next(part for part in self.parts if part.name == name)

    def kind(self, argument: str | float) -> Kind:
        """Return what an argument of a call is."""
        if not isinstance(argument, str):
            return REAL if isinstance(argument, float) else INT
        name, _, row = argument.partition("[")
        if name == "inputs":
            whole = Array(REAL, (INPUTS, 1, "FPID_JOINTS"))
            return Array(REAL, ("FPID_JOINTS",)) if row else whole
        if name == "torque":
            runs = any(part.shape[0] == 1 for part in self.parts if part.name == "joints")
            return Array(REAL, (1, "FPID_JOINTS") if runs else ("FPID_JOINTS",))
        return self.part(name).kind

    def shape(self, part: Part) -> tuple[int, ...]:
        """Return a part's shape in numbers."""
        return tuple(self.extents[e] if isinstance(e, str) else int(e or 1) for e in part.shape)

    def size(self, part: Part) -> int:
        """Return how many elements a part has."""
        return int(np.prod(self.shape(part)))

    def memory(self) -> dict[str, Any]:
        """Return what the kernels run on here, at t = 0, by the names that `Call` has for it."""
        found: dict[str, Any] = {}
        for part in self.parts:
            if part.values is None:
                found[part.name] = np.zeros(self.shape(part), _dtype(part.element))
            else:
                values = np.array(part.values)
                found[part.name] = values if part.shape else values[0]
        inputs = np.zeros((INPUTS, 1, self.n))
        found |= {f"inputs[{k}]": row[0] for k, row in enumerate(inputs)}
        torque = self.kind("torque")
        assert isinstance(torque, Array)
        return found | {
            "inputs": inputs,
            "torque": np.zeros((1,) * (len(torque.shape) - 1) + (self.n,)),
        }


def law_of(controller: Controller, arm: Arm, step: float, horizon: float) -> Law:
    """Return the parts of a controller on an arm.

    Raises
    ------
    ExportError
        More joints than `MOST_JOINTS`, a law without kernel, or computed torque with an integral or
        an observer.
    ArmError
        A law that needs the model, of an arm with other joints than revolute and prismatic ones.
    ArgumentError
        A design without modes.
    """
    checks.instance("controller", controller, Controller, "a controller")
    if arm.n > MOST_JOINTS:
        raise ExportError(f"arm: expected at most {MOST_JOINTS} joints, got {arm.n}")
    if isinstance(controller, AdaptiveFpid):
        return _fpid(controller, arm, step, horizon)
    if type(controller) is ComputedTorque:
        if np.any(controller.ki) or controller.observer:
            raise ExportError(
                "ComputedTorque: expected one without an integral or an observer, got "
                f"ki = {controller.ki}, observer = {controller.observer:g} rad/s: only an "
                "AdaptiveFpid is exported with those"
            )
        return _computed(controller, arm)
    if type(controller).kernel is not None:
        return _own(controller, arm, step, horizon)
    raise ExportError(
        f"{type(controller).__name__}: expected a law that is a kernel, got one in NumPy: what is "
        "missing is its `kernel` (CONTRIBUTING.md, to add a law as a kernel)"
    )


def _dtype(element: Number | Record) -> Any:
    if isinstance(element, Number):
        return {REAL: np.float64, INT: np.int64, BOOL: np.bool_}[element]
    kinds = {REAL: np.float64, INT: np.int64}
    return np.dtype((np.record, [(name, kinds[kind]) for name, kind in element.fields]))


def _record(name: str, values: Any) -> Record:
    return Record.of(name, values.dtype)


def _model(arm: Arm) -> tuple[Part, ...]:
    """Return the arm's constants, and room for its frames and for M."""
    from fpid_pin.arms.bodies import bodies_of
    from fpid_pin.kernels.rigid_body import FRAME

    n = "FPID_JOINTS"
    bodies = bodies_of(arm.model)
    gravity = np.array(arm.model.gravity.linear)
    return (
        Part("bodies", _record("body", bodies), (n,), bodies, True),
        Part("gravity", REAL, (3,), gravity, True),
        Part("frames", Record.of("frame", FRAME), (arm.n + 1,), None, False),
        Part("mass", REAL, (n, n), None, False),
    )


def _fpid(controller: AdaptiveFpid, arm: Arm, step: float, horizon: float) -> Law:
    from fpid_pin.kernels import law, model

    state = controller.start(arm, step=step, horizon=horizon).state
    assert isinstance(state, FpidState)
    robots, joints, ops, poles, modes, table = state.records
    n, count = "FPID_JOINTS", "FPID_MODES"
    parts = [
        Part("alive", BOOL, (1,), np.ones(1, np.bool_), True),
        Part("robots", _record("robot", robots), (1,), robots, False),
        Part("joints", _record("joint", joints), (1, n), joints, False),
        Part("ops", _record("operator", ops), (1, n, 2), ops, False),
        Part("modes", _record("mode", modes), (1, n, 2, count), modes, False),
        Part("poles", _record("pole", poles), (len(poles), count), poles, True),
        Part("table", REAL, (len(table), table.shape[1]), table, True),
    ]
    extents = {n: arm.n, count: modes.shape[-1]}
    names = ("alive", "robots", "joints", "ops", "poles", "modes", "table")
    supervisor = controller.supervisor
    if supervisor is None and not controller.feedforward and not controller.bandwidth:
        call = Call(law.fpids, (*names, "inputs", "torque"))
        return Law(controller, arm.n, tuple(parts), extents, (call,))
    asked = np.zeros(1, model.ASKED)
    asked["feedforward"] = controller.feedforward
    asked["observes"] = controller.bandwidth > 0.0
    asked["compensates"] = controller.observer > 0.0
    if supervisor is not None:
        asked[supervisor.kind] = 1
    parts += [
        Part("asked", _record("assistance", asked), (), asked, True),
        *_model(arm),
        Part("factored", REAL, (n, n), None, False),
        Part("room", REAL, (model.ROWS, 1, n), None, False),
    ]
    more = ("bodies", "gravity", "frames", "mass", "factored", "room", "inputs", "torque")
    call = Call(model.assisted, ("alive", "asked", *names[1:], *more))
    return Law(controller, arm.n, tuple(parts), extents, (call,))


def _computed(controller: ComputedTorque, arm: Arm) -> Law:
    from fpid_pin.kernels import model

    joints = np.zeros(arm.n, model.COMPUTED)
    joints["limit"] = arm.effort_limit
    for name in ("k0", "k1"):
        joints[name] = checks.spread(name, getattr(controller, name), arm.n)
    n = "FPID_JOINTS"
    parts = (
        Part("joints", _record("joint", joints), (n,), joints, False),
        *_model(arm),
        Part("room", REAL, (2, n), None, False),
    )
    names = ("joints", "bodies", "gravity", "frames", "mass", "room", "inputs", "torque")
    call = Call(model.computed_torque, names)
    return Law(controller, arm.n, parts, {n: arm.n}, (call,))


def _own(controller: Controller, arm: Arm, step: float, horizon: float) -> Law:
    """Return the parts of a law of one's own that is a kernel."""
    from fpid_pin.kernels.limits import saturate

    state = controller.start(arm, step=step, horizon=horizon).state
    assert isinstance(state, KernelState)
    joints, n = state.joints[0], "FPID_JOINTS"
    parts = (Part("joints", _record("joint", joints), (n,), joints, False),)
    rows = tuple(f"inputs[{k}]" for k in range(INPUTS))
    calls = (
        Call(type(controller).kernel, ("joints", float(step), *rows, "torque")),
        Call(saturate, ("joints", "torque")),
    )
    return Law(controller, arm.n, parts, {n: arm.n}, calls)
