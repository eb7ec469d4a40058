"""A law on a real robot: its own order of joints, angles only, ticks that come late or never."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.encoder import EncoderRate
from fpid_pin.control.loop import INPUTS, ROWS, Loop, Record
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import listed

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: A tick counts as late from this part of a step on.
LATE = 0.1


@dataclass
class Ticks:
    """How a robot's ticks came.

    Attributes
    ----------
    on_time, late
        Ticks of the law by a call, within a tenth of a step of their time or up to half a step off.
    missed
        Ticks that no call came for.
    early
        Second calls for a tick, which got the torque that was there.
    latest
        The most that a call was behind its tick [s].
    """

    on_time: int = 0
    late: int = 0
    missed: int = 0
    early: int = 0
    latest: float = 0.0

    def __str__(self) -> str:
        return (
            f"{self.on_time} ticks on time, {self.late} late (by {1e3 * self.latest:.3g} ms at "
            f"most), {self.missed} missed, {self.early} early"
        )


class JointOrder:
    """Which number of a robot's is which joint of an arm.

    Parameters
    ----------
    arm_names
        The arm's n joints, in its order (`Arm.joint_names`).
    robot_names
        The robot's m joints in its order, all of the arm's among them; others, a gripper's say, get
        no torque.

    Raises
    ------
    ArgumentError
        A joint of the arm that the robot has not, or has twice.
    """

    def __init__(self, arm_names: Sequence[str], robot_names: Sequence[str]) -> None:
        self.arm_names, self.robot_names = tuple(arm_names), tuple(robot_names)
        for name in dict.fromkeys([*self.robot_names, *self.arm_names]):
            count = self.robot_names.count(name)
            if count != 1:
                expected = f"each of {listed(self.arm_names)} once"
                raise ArgumentError("joint_names", expected, f"{name} {count} times")
        self._places = np.array([self.robot_names.index(name) for name in self.arm_names])
        self._shape = (len(self.robot_names),)

    def to_arm(self, name: str, values: Any) -> FloatArray:
        """Return the arm's numbers, (n,), of the robot's, (m,) or a table by name.

        Raises
        ------
        ArgumentError
            Naming `name`: another length, a joint that is missing, no numbers.
        """
        # The checks of a well-made array take longer than all else; they are for the others.
        if type(values) is np.ndarray and values.shape == self._shape and values.dtype == float:
            return values.take(self._places)
        if isinstance(values, Mapping):
            names = self.arm_names
            missing = [joint for joint in names if joint not in values]
            if missing:
                raise ArgumentError(name, f"a number for {missing[0]}", listed(values))
            return checks.vector(name, [values[joint] for joint in names], len(names))
        array = checks.floats(name, values)
        if array.shape != self._shape:
            expected = f"shape {self._shape} (the robot's joints)"
            raise ArgumentError(name, expected, f"shape {array.shape}")
        return array.take(self._places)

    def to_robot(self, values: FloatArray) -> FloatArray:
        """Return the robot's numbers, (m,), of the arm's, (n,); 0 for joints that it has not."""
        found: FloatArray = np.zeros(self._shape)
        found[self._places] = values
        return found


class RobotLoop:
    """A `Loop` with what hardware needs around it; all numbers are in the robot's order.

    The law keeps the time of the robot's clock. Its k-th tick is due k steps after the first; a
    call belongs to the tick that is nearest. Where none came for some ticks the law makes them up
    before it goes on, with measurements and references on a straight line between the two calls, so
    that integrals, fractional memories and gains have seen all of the time; meanwhile the drives
    have held the last torque. A second call for a tick changes nothing and gets the torque again.

    Where an encoder begins again (`EncoderRate.turn`) the law, and the record, see angles that go
    on. The first measured angle is taken to the turn nearest its reference; from then on each
    angle, and each reference, to the turn nearest its own last one. So neither may move by more
    than half a turn from one call to the next, missed ticks included, nor the first error be more
    than half a turn: such a move cannot be told from one the other way.

    Parameters
    ----------
    loop
        By ``controller.start``; its step is the period.
    joint_names
        The robot's joints in its order, as in `JointOrder`; None: the arm's own.
    rate
        Makes rates of angles, where a call brings none; None: every call brings them. Its `turn`,
        if one number, is for revolute joints alone; (n,) is in the arm's order.
    soft_start
        Time over which the torque goes from `hold` to the law's [s]; 0: at once.
    hold
        What the drives give before the first tick [N m], a number or (n,) in the arm's order: 0, or
        their own gravity compensation.
    most_missed
        Ticks that are made up at most.

    Attributes
    ----------
    ticks
        How the ticks came since the start or the last `reset`.

    Raises
    ------
    ArgumentError
        Names that are not the arm's, negative times, a `turn` for another number of joints.
    """

    def __init__(
        self,
        loop: Loop,
        *,
        joint_names: Sequence[str] | None = None,
        rate: EncoderRate | None = None,
        soft_start: float = 0.0,
        hold: ArrayLike = 0.0,
        most_missed: int = 10,
    ) -> None:
        checks.instance("loop", loop, Loop, "a Loop (controller.start)")
        arm = loop.state.arm
        self.loop, self.step = loop, loop.state.step
        self.order = JointOrder(arm.joint_names, joint_names or arm.joint_names)
        self._rate = None if rate is None else _by_joint(rate, arm).start(self.step)
        self._soft_start = checks.number("soft_start", soft_start, low=0.0)
        self._hold = checks.per_joint("hold", hold, arm.n)
        self._most_missed = checks.integer("most_missed", most_missed, low=0)
        self._before: FloatArray = np.zeros((5, arm.n))
        self._record: Record | None = None
        self._begin()

    def _begin(self) -> None:
        self._first, self._tick = 0.0, -1
        self._torque: FloatArray = self._hold.copy()
        self.ticks = Ticks()

    def torque(
        self,
        q: ArrayLike | Mapping[str, float],
        q_ref: ArrayLike | Mapping[str, float],
        v_ref: ArrayLike | Mapping[str, float],
        a_ref: ArrayLike | Mapping[str, float] | None = None,
        *,
        v: ArrayLike | Mapping[str, float] | None = None,
        now: float | None = None,
    ) -> Any:
        """Return the torque to give until the next call.

        Parameters
        ----------
        q, v
            Measured angles [rad] and rates [rad/s], (m,) in the robot's order, or tables by joint;
            no `v` means those of the `EncoderRate`.
        q_ref, v_ref, a_ref
            Reference, likewise; no `a_ref` means zero acceleration.
        now
            Time of the measurement by any clock [s]; None: it came when it was due.

        Returns
        -------
        ndarray or dict
            (m,) [N m]; by joint where `q` is a table.

        Raises
        ------
        ArgumentError
            As in `Loop.torque`; a time that goes back; more ticks missed than are made up, after
            which only `reset` helps. The law is then as before the call.
        """
        tick, late = self._due(now)
        if tick == self._tick:
            self.ticks.early += 1
            return self._given(q)
        missed = tick - self._tick - 1
        if missed > self._most_missed:
            raise ArgumentError(
                "now", f"at most {self._most_missed} ticks missed", f"{missed} (reset starts anew)"
            )
        x: FloatArray = np.zeros_like(self._before)
        for row, name, value in zip(x, INPUTS, (q, v, q_ref, v_ref, a_ref), strict=True):
            if value is not None:
                row[:] = self.order.to_arm(name, value)
        if not np.isfinite(x).all():
            j = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise ArgumentError(INPUTS[j], "finite numbers", "NaN or inf")
        if self._rate is not None:
            self._unwrap(x, self._rate.encoder)
            made = self._rate.rate(x[0], missed + 1)
            if v is None:
                x[1] = made
        elif v is None:
            raise ArgumentError("v", "rates, or RobotLoop(rate=EncoderRate())", "none")
        for k in range(1, missed + 1):
            self._advance(self._before + k / (missed + 1) * (x - self._before), self._torque)
        self._torque = self._advance(x, None, tick)
        self._before, self._tick = x, tick
        if abs(late) > LATE * self.step:
            self.ticks.late += 1
        else:
            self.ticks.on_time += 1
        self.ticks.missed += missed
        self.ticks.latest = max(self.ticks.latest, late)
        return self._given(q)

    def _due(self, now: float | None) -> tuple[int, float]:
        """Return which tick a call is for, and by how much it is off [s]."""
        if now is None:
            return self._tick + 1, 0.0
        if type(now) is not float or not math.isfinite(now):
            now = checks.number("now", now)
        if self._tick < 0:
            self._first = now
        tick = round((now - self._first) / self.step)
        if tick < self._tick:
            raise ArgumentError("now", "a time that does not go back", f"{now:g} s")
        return tick, now - self._first - tick * self.step

    def _unwrap(self, x: FloatArray, encoder: EncoderRate) -> None:
        """Take angles and their references to the turn where they go on."""
        if self._tick < 0:
            x[0] = encoder.nearest(x[0], x[2])
            return
        for row in (0, 2):
            x[row] = encoder.nearest(x[row], self._before[row])

    def _advance(self, x: FloatArray, held: FloatArray | None, tick: int = 0) -> FloatArray:
        """Make a tick of the law and return what the drives get; None `held`: the law's torque."""
        torque = self.loop.torque(*x)
        if held is None:
            part = tick * self.step / self._soft_start if self._soft_start else 1.0
            held = torque if part >= 1.0 else self._hold + part * (torque - self._hold)
        if self._record is not None:
            self._record.take(x, held)
        return held

    def _given(self, q: Any) -> Any:
        torque = self.order.to_robot(self._torque)
        if isinstance(q, Mapping):
            return dict(zip(self.order.robot_names, torque.tolist(), strict=True))
        return torque

    def record(self, rows: int = ROWS) -> Record:
        """Keep every tick from now on, as `Loop.record` does: what was given, made-up ticks too."""
        self._record = self.loop.new_record(rows)
        return self._record

    def reset(self) -> None:
        """Be as at the start: see `Loop.reset`; the torque goes from `hold` to the law's again."""
        self.loop.reset()
        if self._rate is not None:
            self._rate.reset()
        self._record = None
        self._begin()


def _by_joint(rate: EncoderRate, arm: Arm) -> EncoderRate:
    """Return `rate` with a turn for each joint; one number is for revolute joints alone."""
    if rate.turn is None:
        return rate
    turn = rate.turn
    if np.ndim(turn) == 0:
        turn = np.where(np.array(arm.joint_kinds) == "revolute", turn, np.inf)
    return replace(rate, turn=checks.per_joint("rate.turn", turn, arm.n, finite=False))
