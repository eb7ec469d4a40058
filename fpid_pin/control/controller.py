"""What a controller is: a frozen description, and the law that its `torque` writes down."""

from __future__ import annotations

import dataclasses
from abc import ABC
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

from fpid_pin.checks import FloatArray
from fpid_pin.control.loop import Loop
from fpid_pin.control.parameters import is_number
from fpid_pin.control.state import KernelState, LawState, State

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


class Controller(ABC):  # noqa: B024 - a law has either of two methods
    """A control law and its parameters for one robot.

    Subclasses are frozen dataclasses (``eq=False``); what changes while a law runs is its `State`.
    A law of one's own has fields and either `torque`, in NumPy, or a `kernel`:

        @dataclass(frozen=True, eq=False)
        class Damped(fp.Controller):
            kp: ArrayLike
            kd: ArrayLike

            def torque(self, state, q, v, q_ref, v_ref, a_ref):
                return self.kp * (q_ref - q) - self.kd * v + state.gravity(q)

    Fields that are numbers, scalar or (n,), are those of all robots, (runs, n), while it runs; a
    field ``scale`` is the factor of `parameters.joint_scale`. Other fields are shared: robots that
    differ in them are simulated apart. Effort limits, stacking and ends of runs are not the law's.

    Attributes
    ----------
    kernel
        One tick of one robot, compiled (`kernels.compiled.kernel`), in place of `torque`:
        ``kernel(joints, h, q, v, q_ref, v_ref, a_ref, torque)`` with arrays (n,). A row of `joints`
        has the number fields by name, those of `memory`, ``cut`` (by how much the torque was cut
        by the effort limit) and ``ticks``.
    memory
        Names of the numbers that a kernel keeps from tick to tick, one a joint, 0 at first.
    """

    kernel: ClassVar[Callable[..., None] | None] = None
    memory: ClassVar[tuple[str, ...]] = ()

    def begin(self, state: LawState) -> None:  # noqa: B027 - most laws have nothing to prepare
        """Prepare what the law remembers, before the first tick: see `LawState.memory`."""

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """Return the torque for this tick, (runs, n) [N m]; `state` clips it afterwards.

        Parameters
        ----------
        state
            The arm's model (`LawState.gravity` and its kin), the step, int e, and memory.
        q, v
            Measured joint angles [rad] and rates [rad/s], (runs, n).
        q_ref, v_ref, a_ref
            Reference angles, rates and accelerations, (runs, n).
        """
        raise NotImplementedError(f"{type(self).__name__} has neither torque nor kernel")

    def on(self, arm: Arm, *, step: float = 1e-3, horizon: float = 3600.0) -> Controller:
        """Return the law that this is on an arm: itself, unless its gains depend on the arm."""
        return self

    def start(self, arm: Arm, *, step: float, horizon: float = 3600.0) -> Loop:
        """Start the law for one robot: a tick at a time, for any simulator or a real arm.

        Parameters
        ----------
        arm
            The nominal arm: its number of joints, model and effort limits.
        step
            Sampling period [s].
        horizon
            Longest time that the loop will run [s]; fractional memories are fitted for it.

        Returns
        -------
        Loop
        """
        restart = partial(self.start_many, [self], arm, step=step, horizon=horizon)
        return Loop(restart(), restart, self)

    @classmethod
    def start_many(
        cls, controllers: Sequence[Any], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start one state that advances all `controllers` in lockstep, run i with controller i."""
        state = LawState if cls.kernel is None else KernelState
        return state(controllers, arm, step)

    def lockstep_key(self) -> Hashable:
        """Return what two controllers must share to be advanced by one state."""
        shared: list[Hashable] = []
        fields: Any = dataclasses.fields(self) if dataclasses.is_dataclass(self) else ()
        for field in fields:
            value = getattr(self, field.name)
            if field.name not in ("name", "scale") and not is_number(value):
                shared.append(value if isinstance(value, Hashable) else id(value))
        return (type(self), *shared)
