"""A law on a real robot: its own order of joints, angles only, ticks that come late or never."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray, Number, PerJoint, checked
from fpid_pin.control.loop import INPUTS, ROWS, Loop, Record
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import listed

#: A tick counts as late from this part of a step on.
LATE = 0.1
#: Numbers of a robot's joints in its order, (m,), or by joint.
Joints = ArrayLike | Mapping[str, float]


@dataclass(frozen=True)
class EncoderRate(Description):
    """Joint rates of a robot that measures angles only.

    The difference of two angles over the time between them, smoothed by a first-order low pass:

        v_k = v_(k-1) + h/(tau + h) ((q_k - q_(k-1))/h - v_(k-1))

    A joint that moves by more than half a turn from one angle to the next cannot be told from one
    that moves the other way.

    Parameters
    ----------
    tau
        Time constant [s]; 0 is the difference alone.
    turn
        After which angle an encoder begins again [rad], 2 pi say; (n,) where joints differ, inf for
        those that do not; None: none does.

    Raises
    ------
    ArgumentError
        A `tau` below 0, or a `turn` that is not above 0.
    """

    tau: Annotated[float, Number("s", low=0.0)] = 0.005
    turn: Annotated[ArrayLike | None, PerJoint("rad", above=0.0, finite=False)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.turn is not None:  # as what is hashed and compared
            turn = np.asarray(self.turn)
            self._set(turn=tuple(turn.tolist()) if turn.ndim else float(turn))

    def delay(self, step: float) -> float:
        """Return by how much slow motions are late, ``tau + h/2`` [s]; compare delay_margin.

        Half a step is the difference's own: it is the rate in the middle of the step.
        """
        return self.tau + 0.5 * step

    def noise(self, resolution: float, step: float) -> float:
        """Return the rate's standard deviation [rad/s] for angles in steps of `resolution` [rad].

        Rounding counts as white noise of ``resolution/sqrt(12)``, as it is while the joint moves by
        more than a step of it a tick.
        """
        a = step / (self.tau + step)
        return float(resolution / np.sqrt(12.0) * a / step * np.sqrt(2.0 / (2.0 - a)))

    def nearest(self, angle: FloatArray, to: FloatArray) -> FloatArray:
        """Return `angle` moved by whole turns, to within half a turn of `to` [rad].

        With `to` the angle before, a motion goes on where the encoder begins again.
        """
        if self.turn is None:
            return angle
        turn = np.asarray(self.turn)
        finite = np.where(np.isinf(turn), 0.0, turn)
        return np.asarray(angle - finite * np.round((angle - to) / turn))

    def by_joint(self, arm: Arm) -> "EncoderRate":
        """Return it with a turn for each joint; one number is for revolute joints alone."""
        if self.turn is None:
            return self
        turn = self.turn
        if np.ndim(turn) == 0:
            turn = np.where(np.array(arm.joint_kinds) == "revolute", turn, np.inf)
        return replace(self, turn=checks.per_joint("rate.turn", turn, arm.n, finite=False))

    def start(self, step: float) -> "EncoderRateState":
        """Start it at a sampling period `step` [s]."""
        return EncoderRateState(self, checks.sampling_step(step))


class EncoderRateState:
    """What an `EncoderRate` remembers of any number of joints."""

    def __init__(self, encoder: EncoderRate, step: float) -> None:
        self.encoder, self._step = encoder, step
        self._kept = encoder.tau / (encoder.tau + step)
        self.reset()

    def reset(self) -> None:
        """Forget all angles."""
        self._q: FloatArray | None = None
        self._v: FloatArray = np.zeros(())

    def rate(self, q: FloatArray, ticks: int = 1) -> FloatArray:
        """Return the rates [rad/s] for angles `q` [rad], `ticks` after the last; 0 at the first."""
        if self._q is None:
            self._v = np.zeros_like(q)
        else:
            moved = self.encoder.nearest(q, self._q) - self._q
            # As if the joint had moved evenly through the ticks that were missed.
            kept = self._kept**ticks
            self._v = kept * self._v + (1.0 - kept) * moved / (ticks * self._step)
        self._q = q.copy()
        return self._v.copy()


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
        The robot's m joints in its order, all of the arm's among them; others, a gripper's say, get
        no torque. None: the arm's own.
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
        A joint of the arm that the robot has not, or has twice; negative times; a `turn` for
        another number of joints.
    """

    @checked
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
        arm = loop.state.arm
        self.loop, self.step = loop, loop.state.step
        self._names, self._arm_names = tuple(joint_names or arm.joint_names), arm.joint_names
        for name in dict.fromkeys([*self._names, *self._arm_names]):
            count = self._names.count(name)
            if count != 1:
                expected = f"each of {listed(self._arm_names)} once"
                raise ArgumentError("joint_names", expected, f"{name} {count} times")
        self._places = np.array([self._names.index(name) for name in self._arm_names])
        self._rate = None if rate is None else rate.by_joint(arm).start(self.step)
        self._soft_start = checks.number("soft_start", soft_start, low=0.0)
        self._hold = checks.per_joint("hold", hold, arm.n)
        self._most_missed = checks.integer("most_missed", most_missed, low=0)
        self._begin()

    def _begin(self) -> None:
        self._first, self._tick = 0.0, -1
        self._before: FloatArray = np.zeros((5, len(self._hold)))
        self._torque: FloatArray = self._hold.copy()
        self._record: Record | None = None
        self.ticks = Ticks()

    def torque(
        self,
        q: Joints,
        q_ref: Joints,
        v_ref: Joints,
        a_ref: Joints | None = None,
        *,
        v: Joints | None = None,
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
                row[:] = self._to_arm(name, value)
        if not np.isfinite(x).all():
            j = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise ArgumentError(INPUTS[j], "finite numbers", "NaN or inf")
        if self._rate is not None:
            # Angles and references to the turn where they go on.
            nearest = self._rate.encoder.nearest
            x[0] = nearest(x[0], x[2] if self._tick < 0 else self._before[0])
            if self._tick >= 0:
                x[2] = nearest(x[2], self._before[2])
            made = self._rate.rate(x[0], missed + 1)
            if v is None:
                x[1] = made
        elif v is None:
            raise ArgumentError("v", "rates, or RobotLoop(rate=EncoderRate())", "none")
        for k in range(1, missed + 1):
            part = k / (missed + 1)
            self._advance(self._before + part * (x - self._before), held=self._torque)
        self._torque = self._advance(x, tick)
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

    def _to_arm(self, name: str, values: Any) -> FloatArray:
        """Return the arm's numbers, (n,), of the robot's, (m,) or a table by name."""
        if isinstance(values, Mapping):
            missing = [joint for joint in self._arm_names if joint not in values]
            if missing:
                raise ArgumentError(name, f"a number for {missing[0]}", listed(values))
            values = [values[joint] for joint in self._arm_names]
            return checks.vector(name, values, len(values))
        # The checks of a well-made array take longer than all else; they are for the others.
        if type(values) is not np.ndarray or values.dtype != float:
            values = checks.floats(name, values)
        if values.shape != (len(self._names),):
            expected = f"shape {(len(self._names),)} (the robot's joints)"
            raise ArgumentError(name, expected, f"shape {values.shape}")
        return values.take(self._places)  # type: ignore[no-any-return]

    def _advance(
        self, x: FloatArray, tick: int = 0, held: FloatArray | None = None
    ) -> FloatArray:  # fmt: skip
        """Make a tick of the law and return what the drives get; None `held`: the law's torque."""
        torque = self.loop.torque(*x)
        if held is None:
            part = tick * self.step / self._soft_start if self._soft_start else 1.0
            held = torque if part >= 1.0 else self._hold + part * (torque - self._hold)
        if self._record is not None:
            self._record.take(x, held)
        return held

    def _given(self, q: Any) -> Any:
        """Return the robot's torques, 0 for joints that the arm has not, in the form of `q`."""
        torque: FloatArray = np.zeros(len(self._names))
        torque[self._places] = self._torque
        if isinstance(q, Mapping):
            return dict(zip(self._names, torque.tolist(), strict=True))
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
        self._begin()
