"""How fast an observer may be on an arm: what its noise and late measurements leave."""

from __future__ import annotations

import dataclasses
import itertools
import warnings
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.disturbance import FASTEST, observer_gains
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.sampled import LinearSystem, gravity_stiffness, joint_law, operators
from fpid_pin.exceptions import FpidWarning
from fpid_pin.fractional import ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

SUGGESTED = "suggested"
#: Part of the delay that the law alone bears which the loop with an observer must still bear.
DELAY_PART = 0.5
#: Inertia of the true arm over the model's: a load that nobody told of, and one that is not there.
INERTIA_RATIOS = (0.6, 1.0, 1.8)
#: Operators of few modes are good enough to tell whether a loop is stable, and quickly.
_DESIGN, _HORIZON = ExponentialSum(modes=8), 10.0
_POSES, _HALVINGS, _LATEST = 3, 8, 16


def suggest_observer(
    arm: Arm,
    controller: AdaptiveFpid,
    *,
    step: float = 1e-3,
    delay: float = 0.0,
    noise: float = 0.25,
) -> float:
    """Return the bandwidth of a disturbance observer beside `controller` on `arm` [rad/s].

    The largest omega for which all of these hold, and at most 2/step:

    - *Noise.* White noise of the measured rates makes the torque vary by at most 1 + `noise` times
      what it does without an observer, at home. Joint j's law answers a sample of noise with
      D_j at once (s Kd at mu = 1), the observer with ``l2 M``, ``l2 = (1 - exp(-omega h))^2/h``,
      so the torque's steps have the size ``sqrt((D_j + l2 M_jj)^2 + D_j^2 + l2^2 sum_k M_jk^2)``, k not
      j, and without it ``sqrt(2) D_j``; both are summed over the joints.
    - *Delay and load.* At home and two more poses, with an arm of 0.6, 1 and 1.8 times the model's
      inertia, the sampled loop of arm, law at its present gains, and observer is stable with
      measurements as late as `delay`, and half as late as the law alone bears (of which no more
      than 16 samples count). Where the law alone does not bear `delay`, nothing is asked.

    Parameters
    ----------
    arm, controller
        The nominal arm, and the law that the observer is to stand beside; an observer of its own
        is not looked at.
    step
        Sampling period [s].
    delay
        By how much measurements are late [s].
    noise
        Part by which the torque may vary more.

    Returns
    -------
    float
        0 where the law alone, on the exact arm at home, does not bear the delay.

    Warns
    -----
    FpidWarning
        It is 0.

    Notes
    -----
    With a weak law the observer's loop is ``omega^2/(s (s + 2 omega))``, whose delay margin is
    2.74/omega: 27 ms at 100 rad/s. Next to a law of its own bandwidth there is less.
    """
    checks.instance("controller", controller, AdaptiveFpid, "an AdaptiveFpid")
    step = checks.number("step", step, above=0.0)
    delay = checks.number("delay", delay, low=0.0)
    noise = checks.number("noise", noise, low=0.0)
    late = int(np.ceil(delay / step - 1e-9))
    laws = _laws(arm, controller, step)
    if not _Loop(arm, laws, arm.home, 1.0, step, late).stable(0.0):
        warnings.warn(
            f"{arm.name}: the law alone is not stable with measurements {1e3 * delay:g} ms late: "
            "no observer is suggested",
            FpidWarning,
            stacklevel=2,
        )
        return 0.0
    omega = min(_quiet(arm, laws, step, noise), FASTEST / step)
    for pose in _poses(arm):
        for ratio in INERTIA_RATIOS:
            loop = _with_room(arm, laws, pose, ratio, step, late)
            omega = omega if loop is None else _largest(loop, omega)
    return omega


def with_model(
    controller: AdaptiveFpid,
    arm: Arm,
    *,
    feedforward: bool,
    observer: float | str,
    step: float = 1e-3,
    delay: float = 0.0,
) -> AdaptiveFpid:
    """Return `controller` with the model's feedforward and an observer, ``"suggested"`` or given.

    Parameters
    ----------
    controller, arm, step, delay
        See `suggest_observer`.
    feedforward, observer
        See `AdaptiveFpid`; `observer` may be ``"suggested"``.
    """
    check_observer(observer)
    if observer == SUGGESTED:
        observer = suggest_observer(arm, controller, step=step, delay=delay)
    return dataclasses.replace(controller, feedforward=feedforward, observer=float(observer))


def check_observer(observer: float | str) -> float | str:
    """Check a bandwidth that may be ``"suggested"``."""
    if isinstance(observer, str):
        return checks.choice("observer", observer, (SUGGESTED,))
    return checks.number("observer", observer, low=0.0)


def _poses(arm: Arm) -> FloatArray:
    rng = np.random.default_rng(0)
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    return np.vstack([arm.home, rng.uniform(low, high, (_POSES - 1, arm.n))])


def _laws(arm: Arm, controller: AdaptiveFpid, step: float) -> list[LinearSystem]:
    """Return the law of each joint as a system from (e, e') to its torque."""
    names = ("kp", "ki", "kd", "integral_order", "derivative_order")
    kp, ki, kd, lam, mu = (
        checks.per_joint(name, getattr(controller, name), arm.n) for name in names
    )
    gains = controller.scale_on(arm)[:, np.newaxis] * np.stack([kp, ki, kd], axis=1)
    found = []
    for row, orders in zip(gains, zip(lam, mu, strict=True), strict=True):
        terms = operators(orders, _DESIGN, step=step, horizon=_HORIZON)
        found.append(_seen(joint_law(terms, row)))
    return found


def _seen(law: LinearSystem) -> LinearSystem:
    """Drop the states that no output ever sees: an integral of gain 0 is no pole of the loop."""
    seen = (law.c != 0.0).any(axis=0)
    while True:
        wider = seen | (law.a[seen] != 0.0).any(axis=0)
        if (wider == seen).all():
            return LinearSystem(law.a[np.ix_(seen, seen)], law.b[seen], law.c[:, seen], law.d)
        seen = wider


def _quiet(arm: Arm, laws: list[LinearSystem], step: float, noise: float) -> float:
    """Return the bandwidth at which the torque varies by 1 + `noise` times as much."""
    answer = np.array([law.d[0, 1] for law in laws])
    inertia = arm.mass_matrix(arm.home)
    own = np.diag(inertia)
    others = np.sum(inertia**2, axis=1) - own**2

    def size(omega: float) -> float:
        gain = observer_gains(omega, step)[1]
        return float(np.sqrt((answer + gain * own) ** 2 + answer**2 + gain**2 * others).sum())

    low, high = 0.0, FASTEST / step
    allowed = (1.0 + noise) * size(0.0)
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if size(middle) > allowed else (middle, high)
    return low


def _with_room(
    arm: Arm, laws: list[LinearSystem], pose: FloatArray, ratio: float, step: float, late: int
) -> _Loop | None:
    """Return the loop with the delay that it must bear; None where the law alone does not."""
    low, high = -1, max(late, _LATEST) + 1  # stable, and not asked for
    while high - low > 1:
        middle = (low + high) // 2
        stable = _Loop(arm, laws, pose, ratio, step, middle).stable(0.0)
        low, high = (middle, high) if stable else (low, middle)
    if low < late:
        return None
    return _Loop(arm, laws, pose, ratio, step, max(late, int(DELAY_PART * low)))


def _largest(loop: _Loop, omega: float) -> float:
    """Return the largest bandwidth up to `omega` at which a loop is stable."""
    if loop.stable(omega):
        return omega
    low, high = 0.0, omega
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if loop.stable(middle) else (low, middle)
    return low


class _Loop:
    """The sampled loop at a pose: arm, laws, observer, and a line of late measurements."""

    def __init__(
        self, arm: Arm, laws: list[LinearSystem], pose: FloatArray, ratio: float,
        step: float, late: int,
    ) -> None:  # fmt: skip
        n = arm.n
        self._step, self._n = step, n
        inertia, viscous = arm.mass_matrix(pose), np.diag(arm.viscous_friction)
        stiffness, eye = gravity_stiffness(arm, pose), np.eye(n)
        self._inertia, self._stiffness, self._viscous = inertia, stiffness, viscous
        states = sum(len(law.a) for law in laws)
        # q, v, then what was measured 1 .. late samples ago, the laws, v^- and xi.
        at = np.cumsum([0, n, n, 2 * n * late, states, n, n])
        q, v, line, law, guess, xi = (slice(*ends) for ends in itertools.pairwise(at))
        row = np.eye(int(at[-1]))
        self._row, self._parts = row, (law, guess, xi)
        seen = row[: 2 * n] if late == 0 else row[line][-2 * n :]
        self._seen, self._rates = seen[:n], seen[n:]
        # The arm, by the simulation's rule; the torque comes in by `drive`.
        inverse = step * np.linalg.inv(ratio * inertia + step * viscous)
        speed = (eye - inverse @ viscous) @ row[v] - inverse @ stiffness @ row[q]
        shifted = np.vstack([row[: 2 * n], row[line]])[: 2 * n * late]
        self._fixed = np.vstack([row[q] + step * speed, speed, shifted])
        self._drive = np.vstack([step * inverse, inverse])
        # The laws see e = -q and e' = -q'.
        feedback, moves, k = np.zeros((n, len(row))), [], law.start
        for j, one in enumerate(laws):
            own = row[k : k + len(one.a)]
            error = -np.stack([self._seen[j], self._rates[j]])
            feedback[j] = (one.c @ own + one.d @ error)[0]
            moves.append(one.a @ own + one.b @ error)
            k += len(one.a)
        self._feedback, self._moves = feedback, np.vstack(moves)

    def matrix(self, omega: float) -> FloatArray:
        """Return what takes the loop from one sample to the next."""
        _, guess, xi = self._parts
        first, second = observer_gains(omega, self._step)
        miss = self._rates - self._row[guess]
        v_hat = self._row[guess] + first * miss
        lost = self._row[xi] + second * miss
        if omega == 0.0:
            v_hat, lost = self._rates, np.zeros_like(lost)
        torque = self._feedback - self._inertia @ lost
        load = self._feedback - self._viscous @ v_hat - self._stiffness @ self._seen
        ahead = v_hat + self._step * np.linalg.solve(self._inertia, load)
        plant = self._fixed.copy()
        plant[: 2 * self._n] += self._drive @ torque
        return np.vstack([plant, self._moves, ahead, lost])

    def stable(self, omega: float) -> bool:
        """Return whether what is disturbed comes back."""
        poles = np.linalg.eigvals(self.matrix(omega))
        return bool(np.abs(poles).max() < 1.0 + 1e-9)
