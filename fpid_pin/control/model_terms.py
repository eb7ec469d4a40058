"""What the nominal model adds to a tick of the FPID: feedforward, observer, supervisor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import BoolArray, FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.fpid import AdaptiveFpid


class ModelTerms:
    """Pinocchio's part of a tick, for runs that all ask for the same of it.

    A tick costs a recursion for the feedforward, two for an observer, one for a sampled supervisor
    that stands by and at most three more while it acts; the paper's supervisor five while it acts,
    none while it stands by.

    Parameters
    ----------
    controllers
        One a run.
    arm
        The nominal arm.
    robots, joints
        Records of `kernels.law`.

    Warns
    -----
    FpidWarning
        See `Supervisor.warn`.
    """

    def __init__(
        self, controllers: Sequence[AdaptiveFpid], arm: Arm, robots: Any, joints: Any
    ) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import observer, supervisor

        first, h = controllers[0], float(robots["h"][0])
        for guard in {id(c.supervisor): c.supervisor for c in controllers}.values():
            if guard is not None and first.bandwidth == 0.0:
                guard.warn(arm, h)
        self._observe: Any = observer
        self._supervise: Any = supervisor
        self._robots, self._joints = robots, joints
        self._feedforward = first.feedforward
        # A suggested observer may be none for some.
        self._compensates = any(c.observer > 0.0 for c in controllers)
        self._observes = any(c.bandwidth > 0.0 for c in controllers)
        self._kind = None if first.supervisor is None else first.supervisor.kind
        runs, n = joints.shape
        self._fleet = Fleet([arm], runs)
        self._viscous = arm.viscous_friction
        self._v_hat, self._xi, self._forward, self._lost, self._tau, self._a = np.zeros(
            (6, runs, n)
        )
        self._change, self._reserve, self._u_s, self._before = np.zeros((4, runs, n))
        self._demand, self._b, *self._paper = np.zeros((7, runs, n))
        self._reserves = bool(joints["bound"].any())
        self._inputs: FloatArray | None = None
        self._model: Callable[[], None] = lambda: None
        #: Whether it adds to the law's torque, supervisor apart.
        self.compensates = self._feedforward or self._compensates
        self._models = self._feedforward or self._observes or self._kind == "sampled"

    def add(self, alive: BoolArray, inputs: FloatArray, acts: bool, torque: FloatArray) -> None:
        """Add the model's torques to `torque`, (runs, n), saturated; `acts`: (20) does somewhere.

        Parameters
        ----------
        alive
            Which runs go on, (runs,).
        inputs
            See `State.tick`.
        """
        if self._models:
            self._compensate(alive, inputs, torque)
        if self._kind == "sampled":
            self._project(alive, inputs, torque)
        elif acts and self._kind == "paper":
            self._paper_torque(alive, inputs, torque)
        if self._observes:
            if self._kind != "sampled":
                self._accelerations(inputs, torque)
            self._observe.predict(self._robots, self._joints, self._a, self._change)

    def _compensate(self, alive: BoolArray, inputs: FloatArray, torque: FloatArray) -> None:
        """Add feedforward, and what cancels the acceleration that the model lacks."""
        q, v, q_ref, v_ref, a_ref = inputs
        self._observe.correct(alive, self._robots, self._joints, v, self._v_hat, self._xi)
        if self._feedforward:
            self._fleet.inverse_dynamics(q_ref, v_ref, a_ref, self._forward)
            self._forward += self._viscous * v_ref
        if self._compensates:
            self._fleet.mass_times(q, self._xi, self._lost)
        if self._feedforward or self._compensates:
            self._observe.compensate(alive, self._joints, self._forward, self._lost, torque)

    def _accelerations(self, inputs: FloatArray, torque: FloatArray) -> None:
        """Evaluate what the model makes of a torque, at the speeds of the observer."""
        self._observe.brake(self._joints, torque, self._v_hat, self._tau)
        if inputs is not self._inputs:
            # They are the same buffer in every tick: checked once.
            self._inputs = inputs
            self._model = self._fleet.bind(inputs[0], self._v_hat, self._tau, self._a)
        self._model()

    def _project(self, alive: BoolArray, inputs: FloatArray, torque: FloatArray) -> None:
        """Add u_s of the sampled supervisor."""
        kernels, robots, joints, change = self._supervise, self._robots, self._joints, self._change
        self._accelerations(inputs, torque)
        if not kernels.project(alive, robots, joints, inputs, self._a, change):
            return
        if self._reserves:
            self._fleet.inverse_mass_times(inputs[0], change, self._reserve)
        if not kernels.shorten(alive, robots, joints, self._reserve, change):
            return
        self._before[:] = torque
        self._fleet.mass_times(inputs[0], change, self._u_s)
        kernels.push(alive, robots, joints, self._u_s, torque)
        if self._observes and joints["cut"].any():
            # Saturation left less of it. Where it did not, the change stays what it is: M^-1 M
            # would round it, in company of a run that is cut and not alone.
            np.subtract(torque, self._before, out=self._u_s)
            self._fleet.inverse_mass_times(inputs[0], self._u_s, self._reserve)
            cut = joints["cut"].any(axis=1)
            change[cut] = self._reserve[cut]

    def _paper_torque(self, alive: BoolArray, inputs: FloatArray, torque: FloatArray) -> None:
        """Add u_s of (20)."""
        q, v, a_ref = inputs[0], inputs[1], inputs[4]
        gravity, coriolis, demand, feedforward, w = self._paper
        self._supervise.weigh(alive, self._robots, self._joints, self._demand, self._b)
        self._fleet.gravity(q, gravity)
        self._fleet.coriolis(q, v, coriolis)
        self._fleet.mass_times(q, self._demand, demand)
        self._fleet.mass_times(q, a_ref, feedforward)
        self._fleet.inverse_mass_times(q, self._b, w)
        self._supervise.supervise(alive, self._robots, self._joints, *self._paper, torque)
