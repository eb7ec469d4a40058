"""An arm and its law about rest as one linear sampled system.

Signals are deviations from rest at a pose, sampled every h. The arm moves by the simulation's rule:
semi-implicit Euler, viscous friction implicit. The law is the engine's own tick, differentiated by
differences, beside which its operators have their exact recursions: their slowest modes decay so
little in a tick that differences would put their poles on the unit circle.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.control.poses import gravity_stiffness
from fpid_pin.fractional import Design
from fpid_pin.fractional.design import modes_of
from fpid_pin.kernels.records import FEEDFORWARD, GIVEN, INTEGRAL

ComplexArray = NDArray[np.complex128]
#: Width of differences [rad, rad/s, and the units of what a law remembers]: small beside any
#: boundary layer, and far above rounding, whose part of a derivative is 1e-10 of the signal.
WIDTH = 1e-6
#: By what part of the largest derivative one-sided differences may differ where a law is smooth.
SMOOTH = 1e-3
#: Over how many ticks a law's numbers may pass on what they hold before a torque shows it.
CHAIN = 4
#: Part of a joint's torque, beside what e and e' make of it, below which a combination of numbers
#: has none. Its square is what estimates of it add to the stiffness.
UNOBSERVABLE = 1e-4


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """``x+ = A x + B u, y = C x``."""

    a: FloatArray
    b: FloatArray
    c: FloatArray

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return C (z I - A)^-1 B at points z, (K,), as (K, outputs, inputs)."""
        inner = z[:, np.newaxis, np.newaxis] * np.eye(len(self.a)) - self.a
        return np.asarray(self.c @ np.linalg.solve(inner, self.b.astype(np.complex128)))

    def closed(self, gain: FloatArray) -> FloatArray:
        """Return the state matrix under the feedback u = `gain` y."""
        return self.a + self.b @ (gain @ self.c)


def linear_arm(
    arm: Arm, q: FloatArray, *, step: float, inertia: float = 1.0, late: int = 0
) -> LinearSystem:
    """Return the arm at rest at `q` as a system from torque to [q, q'], its first 2 n states.

    Gravity's stiffness and viscous friction are included; dry friction, a constant to a joint that
    slides, is not. The mass matrix counts `inertia` times: a load that the model does not know of.
    Measurements are `late` samples old, the older values being further states.
    """
    n = arm.n
    stiffness, viscous = gravity_stiffness(arm, q), np.diag(arm.viscous_friction)
    inverse = step * np.linalg.inv(inertia * arm.mass_matrix(q) + step * viscous)
    speed = np.hstack([-inverse @ stiffness, np.eye(n) - inverse @ viscous])
    size = 2 * n * (1 + late)
    a, b = np.eye(size, k=-2 * n), np.zeros((size, n))
    a[: 2 * n, : 2 * n] = np.vstack([np.eye(n, 2 * n) + step * speed, speed])
    b[: 2 * n] = np.vstack([step * inverse, inverse])
    return LinearSystem(a, b, np.eye(size)[size - 2 * n :])


@dataclass(frozen=True, eq=False)
class LinearLaw:
    """A law about rest, with signals s = [q, q', y, m] and the modes x of its operators.

        u = torque s,    m+ = following s,    y = direct s + out x,    x+ = decay x + drive s

    `torque`, (n, signals), is in N m over the signal's unit; `following`, (memory, signals), what
    the law leaves for its next tick; `direct`, (outputs, signals), what the newest samples make of
    the operators' outputs, of which one may depend on those before it. Each mode belongs to one
    output: `drive` is (modes, signals), `out` (outputs, modes), `decay` a sample's, (modes,).
    """

    torque: FloatArray
    following: FloatArray
    direct: FloatArray
    drive: FloatArray
    out: FloatArray
    decay: FloatArray

    @property
    def measured(self) -> int:
        """How many of the signals are q and q': 2 n."""
        return int(self.torque.shape[1]) - len(self.direct) - len(self.following)

    def open_loop(self, arm: LinearSystem) -> LinearSystem:
        """Return arm and law, the loop cut at the joints: from torque to u; the arm's states first.

        `closed` of it, with a gain of 1, is the closed loop.
        """
        states, outputs, memory = len(arm.a), len(self.direct), len(self.following)
        by_arm, by_output, by_memory = np.split(
            self.direct, [len(arm.c), len(arm.c) + outputs], axis=1
        )
        y = np.hstack([by_arm @ arm.c, by_memory, self.out])
        size = states + memory + len(self.decay)
        signals = np.vstack([
            np.hstack([arm.c, np.zeros((len(arm.c), size - states))]),
            np.linalg.solve(np.eye(outputs) - by_output, y),
            np.eye(memory, size, states),
        ])  # fmt: skip
        a = np.vstack([np.eye(states, size), self.following @ signals, self.drive @ signals])
        a[:states, :states] = arm.a
        a[states + memory :, states + memory :] += np.diag(self.decay)
        b = np.vstack([arm.b, np.zeros((size - states, arm.b.shape[1]))])
        return LinearSystem(a, b, self.torque @ signals)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return what q, q' make of u at points z, (K,), as (K, n, 2 n)."""
        known, at = self.measured, z[:, np.newaxis]
        y = (self.out / (at - self.decay)[:, np.newaxis]) @ self.drive + self.direct
        inner = np.concatenate([y, self.following / at[:, np.newaxis]], axis=1)
        others = np.linalg.solve(np.eye(inner.shape[1]) - inner[:, :, known:], inner[:, :, :known])
        return np.asarray(self.torque[:, :known] + self.torque[:, known:] @ others)

    def remembering(self, rows: FloatArray, basis: FloatArray) -> "LinearLaw":
        """Return the law that remembers r = rows m in place of m = basis r."""
        known = self.torque.shape[1] - len(self.following)

        def by_r(x: FloatArray) -> FloatArray:
            return np.hstack([x[:, :known], x[:, known:] @ basis])

        return dataclasses.replace(
            self, torque=by_r(self.torque), following=rows @ by_r(self.following),
            direct=by_r(self.direct), drive=by_r(self.drive),
        )  # fmt: skip


def linearised(
    controller: Controller, arm: Arm, q: FloatArray, *, step: float, horizon: float,
    design: Design | None = None,
) -> LinearLaw:  # fmt: skip
    """Linearise a law about rest at a pose q, (n,), with its observer: see `stability_report`.

    Gravity counts as held by a constant torque. `design` is for its fractional operators, in place
    of its own.
    """
    who, n = type(controller).__name__, arm.n
    tick = _Tick(controller.on(arm, step=step), arm, q, step, horizon, design)
    slopes, jumps = tick.differences(who)
    law = _with_operators(tick, slopes)
    own = np.append(tick.own, np.zeros(len(law.following) - len(tick.own), dtype=bool))
    outputs, memory = _needed(law)
    # What counts: torques, what is remembered, and what goes into operators.
    jumps[n : n + len(tick.own)] &= memory[: len(tick.own), np.newaxis]
    if jumps.any():
        raise checks.ArgumentError("controller", "a law that is smooth at rest", f"a jump in {who}")
    columns = np.concatenate([np.ones(law.measured, dtype=bool), outputs, memory])
    modes, own = law.out[outputs].any(axis=0), own[memory]
    law = LinearLaw(
        law.torque[:, columns], law.following[memory][:, columns], law.direct[outputs][:, columns],
        law.drive[modes][:, columns], law.out[outputs][:, modes], law.decay[modes],
    )  # fmt: skip
    # What remembers the same becomes one; adding 0 makes -0 to 0.
    _, first, group = np.unique(
        law.following + 0.0, axis=0, return_index=True, return_inverse=True
    )  # fmt: skip
    rows = np.eye(len(own))[first]
    law = law.remembering(rows, np.eye(len(first))[group.reshape(-1)])
    return _without_unobservable(law, own[first])


class _Tick:
    """One tick of a law on an arm that rests at a pose, as a function that can be differenced.

    Into it go the measured q and q', the outputs y of the law's fractional operators, and the
    memory ``m``, which is what the tick before left in the law's numbers. Out of it come the
    torque, what it leaves, and what the operators are given, which themselves are left out. `own`
    says which of m are not among the numbers that every law is given.
    """

    def __init__(
        self, law: Controller, arm: Arm, q: FloatArray, step: float, horizon: float,
        design: Design | None,
    ) -> None:  # fmt: skip
        # Imported late: it loads numba.
        from fpid_pin.control import state as engine

        # A feedforward is constant at rest.
        law = dataclasses.replace(law, supervisor=None, feedforward=False)
        free = arm.with_limits(effort=np.zeros(arm.n))
        self._engine: Any = engine
        state = engine.State(law, free, step=step, horizon=horizon, design=design)
        self.state, self.pose, self.n, self._held = (
            state,
            np.asarray(q, dtype=float),
            arm.n,
            np.zeros(arm.n),
        )
        self.ops, robot = state.c.ops, state.c.robot
        # Operators of given signals come first, before the law's surface.
        self._early = np.arange(self.ops.shape[1]) < robot["first_operators"][0]
        robot["first_operators"], robot["ticks"] = 0, 1
        state.c = state.c._replace(ops=self.ops[:, :0].copy())
        self._robot, self._rest = robot.copy(), self._left()
        self._memory = np.zeros(0, dtype=np.int64)
        # Some ticks in a row show which numbers a tick changes.
        rng, rest, changed = np.random.default_rng(0), self._rest, set[int]()
        for _ in range(CHAIN):
            self(0.1 * rng.normal(size=self._size))
            self._rest = self._left()
            changed |= set(np.flatnonzero(self._rest != rest).tolist())
        self._rest, self._memory = rest, np.array(sorted(changed), dtype=np.int64)
        numbers = state.c.numbers
        column = np.where(self._memory < numbers.size, self._memory % numbers.shape[1], 1 << 30)
        self.own: BoolArray = column >= len(GIVEN.names)  # type: ignore[arg-type]
        if law.observer:
            # Its model's acceleration must be 0 at rest, or dM/dq would count.
            self._held = arm.gravity_vector(self.pose) - self(np.zeros(self._size))[: arm.n]

    @property
    def _size(self) -> int:
        return int(2 * self.n + self.ops.size + len(self._memory))

    def _left(self) -> FloatArray:
        """Return all numbers as they are now."""
        c = self.state.c
        return np.concatenate([c.numbers.reshape(-1), c.own.reshape(-1)])

    def __call__(self, shift: FloatArray) -> FloatArray:
        """Return [u, m, inputs of operators, their rates] of a tick off rest by [q, q', y, m].

        Outputs of operators and what they are given come operator by operator, all joints of one.
        """
        parts, state, n, c, ops = self._engine, self.state, self.n, self.state.c, self.ops[0]
        q, v, outputs, memory = np.split(shift, [n, 2 * n, 2 * n + self.ops.size])
        before, y = self._rest.copy(), outputs.reshape(-1, n).T
        before[self._memory] += memory
        c.robot[...] = self._robot
        c.numbers[...] = before[: c.numbers.size].reshape(c.numbers.shape)
        c.own[...] = before[c.numbers.size :].reshape(c.own.shape)
        c.numbers[:, ops["output"][self._early]] = y[:, self._early]
        state.inputs[:3] = self.pose + q, v, self.pose
        state.make(parts.SIGNALS | parts.MODEL)
        sources = c.numbers[:, ops["source"]].T
        rates = np.where(ops["rate"] >= 0, c.numbers[:, ops["rate"]], 0.0).T
        c.numbers[:, ops["output"][~self._early]] = y[:, ~self._early]
        if state.in_python:
            state.ask_python()
        c.robot["feedforward"], c.terms[FEEDFORWARD] = 1, self._held
        state.make(parts.TORQUES)
        torque = state.torque.copy()
        state.make(parts.ADAPT)
        left = self._left()[self._memory]
        return np.concatenate([torque, left, sources.reshape(-1), rates.reshape(-1)])

    def differences(self, who: str) -> tuple[FloatArray, BoolArray]:
        """Return the derivatives of results by inputs, (results, inputs), and where are none."""
        still = np.zeros(self._size)
        rest = self(still)
        widths = np.array([WIDTH, -WIDTH, 0.5 * WIDTH, -0.5 * WIDTH])
        ends = np.array([[self(w * row) for w in widths] for row in np.eye(self._size)])
        if not np.array_equal(self(still)[: self.n], rest[: self.n]):
            got = f"{who}, whose torque depends on a past of its own, such as a Bank's"
            raise checks.ArgumentError("controller", "a law that declares its operators", got)
        most = np.maximum(np.abs(rest), np.abs(ends).max(axis=(0, 1)))[:, np.newaxis]
        noise = 4.0 * np.finfo(float).eps * most / WIDTH
        slopes = (ends[:, 0] - ends[:, 1]).T / (2.0 * WIDTH)
        slopes[np.abs(slopes) < noise] = 0.0  # rounding must tie nothing together
        # Beside rounding, what curves by its own size a radian may differ by some widths of it.
        largest = np.abs(slopes).max(axis=1)[:, np.newaxis]
        allowed = SMOOTH * largest + 4.0 * noise + 10.0 * WIDTH * most
        spread = np.ptp((ends - rest) / widths[:, np.newaxis], axis=1).T
        return slopes, (spread > allowed) | np.isnan(spread)


def _with_operators(tick: _Tick, slopes: FloatArray) -> LinearLaw:
    """Return the law with its operators' recursions, and their last inputs as further memory."""
    n, ops, state = tick.n, tick.ops, tick.state
    outputs, inputs = ops.size, slopes.shape[1]
    signals = inputs + 2 * outputs
    rows = np.hstack([slopes, np.zeros((len(slopes), 2 * outputs))])
    torque, remembered, sources, rates = np.split(
        rows, np.cumsum([n, len(tick.own), outputs])
    )  # fmt: skip
    last, direct = np.zeros((2 * outputs, signals)), np.zeros((outputs, signals))
    drive, decay, out = [np.zeros((0, signals))], [np.zeros(0)], [np.zeros((0, outputs))]
    for k, (i, j) in enumerate(np.ndindex(ops.shape[::-1])):
        now, before = np.stack([sources[k], rates[k]]), np.eye(2, signals, inputs + 2 * k)
        if ops["kind"][j, i] == INTEGRAL:
            # total = total_ + h/2 (f + f_), whose rate is f.
            total = before[0] + 0.5 * state.step * (sources[k] + before[1])
            now = np.stack([total, sources[k]])
        elif ops["rate"][j, i] < 0:
            # Not measured: taken to be constant over the step.
            now[1] = before[1] = (sources[k] - before[0]) / state.step
        last[2 * k : 2 * k + 2] = now
        order = state.orders[j, i]
        modes = modes_of(state.design, order, step=state.step, horizon=state.horizon)
        rule = modes.recursion()
        direct[k] = rule.now @ now + rule.before @ before
        drive.append(rule.drive_now @ now + rule.drive_before @ before)
        decay.append(rule.decay)
        out.append(np.outer(rule.weights, np.arange(outputs) == k))
    return LinearLaw(
        torque, np.vstack([remembered, last]), direct, np.concatenate(drive),
        np.concatenate(out).T, np.concatenate(decay),
    )  # fmt: skip


def _needed(law: LinearLaw) -> tuple[BoolArray, BoolArray]:
    """Return which outputs and which of the memory something moves, and the torque depends on."""
    known, outputs = law.measured, len(law.direct)
    by_output = (law.direct != 0.0) | ((law.out != 0.0) @ (law.drive != 0.0))
    rows = np.vstack([np.zeros((known, law.torque.shape[1])), by_output, law.following]) != 0.0
    # Which signals each depends on, directly or through others.
    depends = np.linalg.matrix_power(rows | np.eye(len(rows), dtype=bool), len(rows))
    needed = (law.torque != 0.0).any(axis=0) @ depends & depends[:, :known].any(axis=1)
    return needed[known : known + outputs], needed[known + outputs :]


def _without_unobservable(law: LinearLaw, own: BoolArray) -> LinearLaw:
    """Leave out combinations of a law's own numbers, `own` of its memory, that no torque shows.

    At rest a weight shows, most of the estimates of inertia do not. What is shown is spanned by the
    rows of C, C A, C A^2, ..., A and C of these numbers alone.
    """
    memory = len(law.following)
    signals = np.vstack([law.torque, law.direct, law.drive, law.following[~own]])
    columns = signals.shape[1] - memory + np.flatnonzero(own)
    sizes = np.maximum(np.linalg.norm(signals, axis=1), np.finfo(float).tiny)
    shown = [signals[:, columns] / sizes[:, np.newaxis]]
    for _ in range(CHAIN):
        shown.append(shown[-1] @ law.following[np.ix_(own, columns)])
    _, values, vectors = np.linalg.svd(np.vstack(shown), full_matrices=False)
    basis = vectors[values > UNOBSERVABLE].T
    whole = np.zeros((memory, memory - len(columns) + basis.shape[1]))
    whole[~own, : memory - len(columns)] = np.eye(memory - len(columns))
    whole[own, memory - len(columns) :] = basis
    return law.remembering(whole.T, whole)


def linear_terms(
    controller: AdaptiveFpid, arm: Arm, *, step: float, horizon: float,
    design: Design | None = None, used: FloatArray | float = 1.0,
) -> LinearLaw:  # fmt: skip
    """Return an FPID about rest at home with its terms, (3 n), in the place of torques.

    The terms are e of all joints, then I^lambda e, then D^mu e; those that `used` has at 0, (3, n),
    are left out. `feedback` of gains closes the loop.
    """
    n = arm.n
    kp, ki, kd = used = np.broadcast_to(used, (3, n))
    # Neither scale nor observer are any term's.
    unit = dataclasses.replace(
        controller, kp=kp, ki=ki, kd=kd, learning_rate=0.0, order_learning_rate=0.0,
        safeguards=None, scale="none", observer=0.0, supervisor=None,
    )  # fmt: skip
    law = linearised(unit, arm, arm.home, step=step, horizon=horizon, design=design)
    terms = np.zeros((3 * n, law.torque.shape[1]))
    terms[:n, :n] = -np.eye(n)
    outputs = n + np.flatnonzero(used[1:])
    terms[outputs, 2 * n + np.arange(len(outputs))] = 1.0
    return dataclasses.replace(law, torque=terms)


def feedback(gains: FloatArray) -> FloatArray:
    """Return the matrix of (10) from all joints' terms to torques, (n, 3 n), of gains (3, n)."""
    return np.tile(np.eye(gains.shape[1]), 3) * gains.reshape(-1)
