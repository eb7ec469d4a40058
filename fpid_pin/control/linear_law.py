"""Any law as a linear sampled system about rest: its tick differentiated, its operators exact.

Operators are not differenced: their slowest modes decay so little in a tick that differences would
put their poles on the unit circle.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.control.linear import ComplexArray, LinearSystem, linear_arm
from fpid_pin.fractional import Design

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Part of a joint's torque, beside what e and e' make of it, below which a combination of numbers
#: has none. Its square is what estimates of it add to the stiffness.
UNOBSERVABLE = 1e-4
#: Over how many ticks a law's own numbers may pass on what they hold before a torque shows it.
CHAIN = 4


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

    def open_loop(self, arm: LinearSystem) -> LinearSystem:
        """Return arm and law, the loop cut at the joints: from torque to the signals s."""
        states, outputs, memory = len(arm.a), len(self.direct), len(self.following)
        by_arm, by_output, by_memory = np.split(
            self.direct, [len(arm.c), len(arm.c) + outputs], axis=1
        )
        y = np.hstack([by_arm @ arm.c, by_memory, self.out])
        size = states + memory + len(self.decay)
        c = np.vstack([
            np.hstack([arm.c, np.zeros((len(arm.c), size - states))]),
            np.linalg.solve(np.eye(outputs) - by_output, y),
            np.eye(memory, size, states),
        ])  # fmt: skip
        a = np.vstack([np.eye(states, size), self.following @ c, self.drive @ c])
        a[:states, :states] = arm.a
        a[states + memory :, states + memory :] += np.diag(self.decay)
        return LinearSystem(a, np.vstack([arm.b, np.zeros((size - states, arm.b.shape[1]))]), c)

    def closed_loop(self, arm: LinearSystem) -> FloatArray:
        """Return the state matrix of the closed loop; the arm's states come first."""
        return self.open_loop(arm).closed(self.torque)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return what q, q' make of the signals s at points z, (K,), as (K, signals, 2 n)."""
        known, at = 2 * len(self.torque), z[:, np.newaxis]
        y = (self.out / (at - self.decay)[:, np.newaxis]) @ self.drive + self.direct
        inner = np.concatenate([y, self.following / at[:, np.newaxis]], axis=1)
        others = np.linalg.solve(np.eye(inner.shape[1]) - inner[:, :, known:], inner[:, :, :known])
        measured = np.broadcast_to(np.eye(known), (len(z), known, known))
        return np.concatenate([measured, others], axis=1)


def linearised(
    controller: Controller, arm: Arm, q: FloatArray, *, step: float, horizon: float,
    design: Design | None = None,
) -> LinearLaw:  # fmt: skip
    """Linearise a law about rest at a pose q, (n,), as the engine runs it, with its observer.

    Gravity counts as held by a constant torque. What adapts counts as far as it matters at rest:
    estimates of the weight, which errors move in proportion, do; gains, which products of errors
    move, stay. Torque limits and the supervisor, which is silent at rest, are left out. `design`
    is for its fractional operators, in place of its own.

    Raises
    ------
    ArgumentError
        A fractional design without modes; a torque that jumps, as sgn without a boundary layer
        does; a law in plain Python that keeps a past of its own, such as a `Bank`'s.
    """
    # Imported late: it loads numba.
    from fpid_pin.control.tick_at_rest import TickAtRest

    who = type(controller).__name__
    law = controller.on(arm, step=step)
    tick = TickAtRest(law, arm, q, step=step, horizon=horizon, design=design)
    slopes, jumps = tick.differences()
    if law.control is not None and tick.keeps_a_past():
        got = f"{who}, whose torque depends on a past of its own, such as a Bank's"
        raise checks.ArgumentError("controller", "a law that declares its operators", got)
    found, kept = _minimal(_with_operators(tick, slopes))
    # Torques, what is remembered, and what goes into operators.
    rows = np.ones(len(slopes), dtype=bool)
    rows[arm.n : arm.n + len(tick.memory)] = np.isin(np.arange(len(tick.memory)), kept)
    if jumps[rows].any():
        raise checks.ArgumentError("controller", "a law that is smooth at rest", f"a jump in {who}")
    return _without_unobservable(found, np.isin(kept, np.flatnonzero(tick.own)))


def _with_operators(tick: Any, slopes: FloatArray) -> LinearLaw:
    """Return the law with its operators' recursions, and their last inputs as further memory."""
    n, outputs, inputs = tick.n, tick.ops.size, tick.size
    signals = inputs + 2 * outputs
    rows = np.hstack([slopes, np.zeros((len(slopes), 2 * outputs))])
    ends = np.cumsum([n, len(tick.memory), outputs])
    torque, remembered, sources, rates = np.split(rows, ends)
    last, direct = np.zeros((2 * outputs, signals)), np.zeros((outputs, signals))
    drive, weights, decay = [np.zeros((0, signals))], [], [np.zeros(0)]
    for k, (i, j) in enumerate(np.ndindex(tick.ops.shape[::-1])):
        now, before = np.stack([sources[k], rates[k]]), np.eye(2, signals, inputs + 2 * k)
        if tick.summed[j, i]:
            # total = total_ + h/2 (f + f_), whose rate is f.
            total = before[0] + 0.5 * tick.step * (sources[k] + before[1])
            now = np.stack([total, sources[k]])
        elif tick.ops["rate"][j, i] < 0:
            # Not measured: taken to be constant over the step.
            now[1] = before[1] = (sources[k] - before[0]) / tick.step
        last[2 * k : 2 * k + 2] = now
        rule = tick.recursion(j, i)
        direct[k] = rule.now @ now + rule.before @ before
        drive.append(rule.drive_now @ now + rule.drive_before @ before)
        weights.append(rule.weights)
        decay.append(rule.decay)
    owner = np.repeat(np.arange(outputs), [len(w) for w in weights])
    out = np.zeros((outputs, len(owner)))
    out[owner, np.arange(len(owner))] = np.concatenate([np.zeros(0), *weights])
    following = np.vstack([remembered, last])
    return LinearLaw(torque, following, direct, np.concatenate(drive), out, np.concatenate(decay))


def _minimal(law: LinearLaw) -> tuple[LinearLaw, NDArray[np.int64]]:
    """Leave out what the torque does not depend on, and what nothing moves.

    What remembers the same becomes one. Also returns which places of the memory are left.
    """
    known, outputs = 2 * len(law.torque), len(law.direct)
    by_output = (law.direct != 0.0) | ((law.out != 0.0) @ (law.drive != 0.0))
    depends = np.vstack([np.zeros((known, law.torque.shape[1])), by_output, law.following]) != 0.0
    observable = (law.torque != 0.0).any(axis=0)
    reachable = np.arange(len(depends)) < known
    for _ in depends:
        observable = observable | depends[observable].any(axis=0)
        reachable = reachable | depends[:, reachable].any(axis=1)
    _, y, m = np.split(observable & reachable, [known, known + outputs])
    columns = np.concatenate([np.arange(known), known + np.flatnonzero(np.append(y, m))])
    modes, places = law.out[y].any(axis=0), np.flatnonzero(m)
    law = LinearLaw(
        law.torque[:, columns], law.following[m][:, columns], law.direct[y][:, columns],
        law.drive[modes][:, columns], law.out[y][:, modes], law.decay[modes],
    )  # fmt: skip
    while True:
        rows = law.following + 0.0  # which makes -0 to 0
        _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        if len(first) == len(rows):
            return law, places
        order = np.sort(first)
        places = places[order]
        basis = np.equal.outer(first[group.reshape(-1)], order).astype(float)
        law = _with_memory(law, np.eye(len(rows))[order], basis)


def _without_unobservable(law: LinearLaw, own: NDArray[np.bool_]) -> LinearLaw:
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
    if basis.shape[1] == len(columns):
        return law
    kept = memory - len(columns)
    whole = np.zeros((memory, kept + basis.shape[1]))
    whole[np.flatnonzero(~own), np.arange(kept)] = 1.0
    whole[own, kept:] = basis
    return _with_memory(law, whole.T, whole)


def _with_memory(law: LinearLaw, rows: FloatArray, basis: FloatArray) -> LinearLaw:
    """Return the law that remembers r = rows m in place of m = basis r."""
    known = law.torque.shape[1] - len(law.following)

    def changed(x: FloatArray) -> FloatArray:
        return np.hstack([x[:, :known], x[:, known:] @ basis])

    return dataclasses.replace(
        law, torque=changed(law.torque), following=rows @ changed(law.following),
        direct=changed(law.direct), drive=changed(law.drive),
    )  # fmt: skip


def linear_terms(
    controller: AdaptiveFpid, arm: Arm, *, step: float, horizon: float,
    design: Design | None = None, used: FloatArray | float = 1.0,
) -> tuple[LinearLaw, FloatArray]:  # fmt: skip
    """Return an FPID about rest at home, and which of its signals are its terms, (3 n, signals).

    The terms are e of all joints, then I^lambda e, then D^mu e; those that `used` has at 0, (3, n),
    are left out. Gains are, too: `feedback` closes the loop. For the rest see `linearised`.
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
    return law, terms


def terms_of(
    controller: AdaptiveFpid, arm: Arm, poses: FloatArray, *, step: float, horizon: float,
    design: Design | None = None, used: FloatArray | float = 1.0,
) -> list[LinearSystem]:  # fmt: skip
    """Return the arm at rest at poses, (poses, n), from the FPID's torque to `linear_terms`."""
    law, terms = linear_terms(
        controller, arm, step=step, horizon=horizon, design=design, used=used
    )  # fmt: skip
    wholes = [law.open_loop(linear_arm(arm, q, step=step)) for q in poses]
    return [LinearSystem(x.a, x.b, terms @ x.c) for x in wholes]


def feedback(gains: FloatArray) -> FloatArray:
    """Return the matrix of (10) from all joints' terms to torques, (n, 3 n), of gains (3, n)."""
    return np.tile(np.eye(gains.shape[1]), 3) * gains.reshape(-1)
