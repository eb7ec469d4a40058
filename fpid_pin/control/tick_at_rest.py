"""One tick of the engine about rest, as a function that can be differentiated.

Into it go the measured q and q', the outputs y of the law's fractional operators, and the memory
``m``, which is what the tick before left in the law's numbers. Out of it come the torque, what it
leaves, and what the operators are given. The operators themselves are left out.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.state import ADAPT, MODEL, SIGNALS, TORQUES, State
from fpid_pin.fractional import Design
from fpid_pin.fractional.design import Recursion, modes_of
from fpid_pin.kernels.records import FEEDFORWARD, GIVEN, INTEGRAL

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Width of differences [rad, rad/s, and the units of what a law remembers]: small beside any
#: boundary layer, and far above rounding, whose part of a derivative is 1e-10 of the signal.
WIDTH = 1e-6
#: By what part of the largest derivative one-sided differences may differ where a law is smooth.
SMOOTH = 1e-3
#: Ticks in a row that show what a tick changes: numbers that follow others do so within as many.
PROBES = 4


class TickAtRest:
    """One tick of a law on an arm that rests at a pose.

    `ops`, (n, operators), are its operators' records, `summed` says which sum their signal up
    themselves. `memory` are the places of m in all numbers of the law, its own arrays after them;
    `own` says which of m are not among those that every law is given.
    """

    def __init__(
        self, law: Controller, arm: Arm, q: FloatArray, *, step: float, horizon: float,
        design: Design | None,
    ) -> None:  # fmt: skip
        free = arm.with_limits(effort=np.zeros(arm.n))
        # A feedforward is constant at rest.
        law = dataclasses.replace(law, supervisor=None, feedforward=False)
        self._state = state = State(law, free, step=step, horizon=horizon)
        self._pose, self.n, self.step = np.asarray(q, dtype=float), arm.n, step
        self._design = law.fractional_design if design is None else design
        if state.orders.size:
            modes = modes_of(self._design, state.orders, step=step, horizon=horizon)
            state.use_modes(*modes.records())
        self.ops, robot = state.c.ops, state.c.robot
        self.summed = self.ops["kind"] == INTEGRAL
        # Operators of given signals come first, before the law's surface.
        self._early = np.arange(self.ops.shape[1]) < robot["first_operators"][0]
        robot["first_operators"], robot["ticks"] = 0, 1
        state.c = state.c._replace(ops=self.ops[:, :0].copy())
        self._robot, self._rest, self._held = robot.copy(), self._left(), np.zeros(arm.n)
        self.memory = np.zeros(0, dtype=np.int64)
        rng, rest = np.random.default_rng(0), self._rest
        changed = np.zeros(len(rest), dtype=bool)
        for _ in range(PROBES):
            self(0.1 * rng.normal(size=self.size))
            self._rest = self._left()
            changed |= self._rest != rest
        self._rest, self.memory = rest, np.flatnonzero(changed)
        numbers = state.c.numbers
        self.own = (self.memory >= numbers.size) | (
            self.memory % numbers.shape[1] >= len(GIVEN.names)  # type: ignore[arg-type]
        )
        if law.observer:
            # Its model's acceleration must be 0 at rest, or dM/dq would count.
            self._held = arm.gravity_vector(self._pose) - self(np.zeros(self.size))[: arm.n]

    @property
    def size(self) -> int:
        """How many numbers go in."""
        return int(2 * self.n + self.ops.size + len(self.memory))

    def recursion(self, joint: int, operator: int) -> Recursion:
        """Return the difference equation of an operator, by its place in `ops`."""
        order, state = self._state.orders[joint, operator], self._state
        modes = modes_of(self._design, order, step=state.step, horizon=state.horizon)
        return modes.recursion()

    def _left(self) -> FloatArray:
        """Return all numbers as they are now."""
        c = self._state.c
        return np.concatenate([c.numbers.reshape(-1), c.own.reshape(-1)])

    def __call__(self, shift: FloatArray) -> FloatArray:
        """Return [u, m, inputs of operators, their rates] of a tick off rest by [q, q', y, m].

        Outputs of operators and what they are given come operator by operator, all joints of one.
        """
        state, n = self._state, self.n
        c, ops = state.c, self.ops[0]
        q, v, outputs, memory = np.split(shift, [n, 2 * n, 2 * n + self.ops.size])
        before, y = self._rest.copy(), outputs.reshape(-1, n).T
        before[self.memory] += memory
        c.robot[...] = self._robot
        c.numbers[...] = before[: c.numbers.size].reshape(c.numbers.shape)
        c.own[...] = before[c.numbers.size :].reshape(c.own.shape)
        c.numbers[:, ops["output"][self._early]] = y[:, self._early]
        state.inputs[:3] = self._pose + q, v, self._pose
        state.make(SIGNALS | MODEL)
        sources = c.numbers[:, ops["source"]].T
        rates = np.where(ops["rate"] >= 0, c.numbers[:, ops["rate"]], 0.0).T
        c.numbers[:, ops["output"][~self._early]] = y[:, ~self._early]
        if state.in_python:
            state._control()
        c.robot["feedforward"], c.terms[FEEDFORWARD] = 1, self._held
        state.make(TORQUES)
        torque = state.torque.copy()
        state.make(ADAPT)
        left = self._left()[self.memory]
        return np.concatenate([torque, left, sources.reshape(-1), rates.reshape(-1)])

    def keeps_a_past(self) -> bool:
        """Whether the torque at rest depends on earlier ticks beyond the numbers put back here."""
        rng, rest = np.random.default_rng(1), np.zeros(self.size)
        first = self(rest)
        for _ in range(PROBES):
            self(0.01 * rng.normal(size=self.size))
        return not np.array_equal(first[: self.n], self(rest)[: self.n])

    def differences(self) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of results by inputs, (results, inputs), and where are none."""
        rest = self(np.zeros(self.size))
        widths = (WIDTH, -WIDTH, 0.5 * WIDTH, -0.5 * WIDTH)
        ends = np.array([[self(w * row) for w in widths] for row in np.eye(self.size)])
        most = np.maximum(np.abs(rest), np.abs(ends).max(axis=(0, 1)))
        noise = 4.0 * np.finfo(float).eps * most[:, np.newaxis] / WIDTH
        slopes = (ends[:, 0] - ends[:, 1]).T / (2.0 * WIDTH)
        slopes[np.abs(slopes) < noise] = 0.0  # rounding must tie nothing together
        one_sided = (ends - rest) / np.array(widths)[:, np.newaxis]
        largest = np.abs(slopes).max(axis=1)[:, np.newaxis]
        # Beside rounding, what curves by its own size a radian may differ by some widths of it.
        allowed = SMOOTH * largest + 4.0 * noise + 10.0 * WIDTH * most[:, np.newaxis]
        spread = np.ptp(one_sided, axis=1).T
        return slopes, (spread > allowed) | np.isnan(spread)
