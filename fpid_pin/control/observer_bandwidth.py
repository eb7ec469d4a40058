"""How fast an observer may be on an arm: what its noise and late measurements leave."""

from __future__ import annotations

import dataclasses
import warnings
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.frozen import gain_table, terms_of
from fpid_pin.control.observed import beside, observer_system
from fpid_pin.control.observer_gains import FASTEST, observer_gains
from fpid_pin.control.poses import seeded_poses
from fpid_pin.control.sampled import LinearSystem, gravity_stiffness
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

    The largest omega for which all of these hold, and at most 1/step:

    - *Noise.* White noise of the measured rates makes the torque vary by at most 1 + `noise` times
      what it does without an observer, at home. Joint j's law answers a sample of noise with
      D_j at once (s Kd at mu = 1), the observer with ``l2 M``, ``l2 = (1 - exp(-omega h))^2/h``, so
      the torque's steps have the size ``sqrt((D_j + l2 M_jj)^2 + D_j^2 + l2^2 sum_k M_jk^2)``, k
      not j, and without it ``sqrt(2) D_j``; both are summed over the joints.
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
    law = _law(arm, controller, step)
    if not _Loop(arm, law, arm.home, 1.0, step, late).stable(0.0):
        warnings.warn(
            f"{arm.name}: the law alone is not stable with measurements {1e3 * delay:g} ms late: "
            "no observer is suggested",
            FpidWarning,
            stacklevel=2,
        )
        return 0.0
    omega = min(_quiet(arm, law, step, noise), FASTEST / step)
    for pose in seeded_poses(arm, _POSES, 0):
        for ratio in INERTIA_RATIOS:
            loop = _with_room(arm, law, pose, ratio, step, late)
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


def _law(arm: Arm, controller: AdaptiveFpid, step: float) -> LinearSystem:
    """Return the law as a system from [e, e'] to its torques, with the states that these see."""
    terms = terms_of(controller, arm.n, step=step, horizon=_HORIZON, design=_DESIGN)
    return terms.weighed(gain_table(arm, controller)).observed()


def _quiet(arm: Arm, law: LinearSystem, step: float, noise: float) -> float:
    """Return the bandwidth at which the torque varies by 1 + `noise` times as much."""
    answer = np.diag(law.d[:, arm.n :])
    felt = arm.mass_matrix(arm.home) + step * np.diag(arm.viscous_friction)
    own = np.diag(felt)
    others = np.sum(felt**2, axis=1) - own**2

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
    arm: Arm, law: LinearSystem, pose: FloatArray, ratio: float, step: float, late: int
) -> _Loop | None:
    """Return the loop with the delay that it must bear; None where the law alone does not."""
    low, high = -1, max(late, _LATEST) + 1  # stable, and not asked for
    while high - low > 1:
        middle = (low + high) // 2
        stable = _Loop(arm, law, pose, ratio, step, middle).stable(0.0)
        low, high = (middle, high) if stable else (low, middle)
    if low < late:
        return None
    return _Loop(arm, law, pose, ratio, step, max(late, int(DELAY_PART * low)))


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
    """The sampled loop at a pose: arm, law, observer, and a line of late measurements."""

    def __init__(
        self, arm: Arm, law: LinearSystem, pose: FloatArray, ratio: float, step: float, late: int
    ) -> None:
        n, size = arm.n, 2 * arm.n * (1 + late)
        self._law = law
        self._beside = arm, pose
        self._step = step
        inertia, viscous = ratio * arm.mass_matrix(pose), np.diag(arm.viscous_friction)
        # q, v, then what they were 1 .. late samples ago; they move by the simulation's rule.
        inverse = step * np.linalg.inv(inertia + step * viscous)
        a = np.eye(size, k=-2 * n)
        a[n : 2 * n, :n] = -inverse @ gravity_stiffness(arm, pose)
        a[n : 2 * n, n : 2 * n] = np.eye(n) - inverse @ viscous
        a[:n, : 2 * n] = np.eye(n, 2 * n) + step * a[n : 2 * n, : 2 * n]
        b = np.zeros((size, n))
        b[: 2 * n] = np.vstack([step * inverse, inverse])
        self._seen = np.eye(size)[-2 * n :]
        self._plant = LinearSystem(a, b, self._seen, np.zeros((2 * n, n)))

    def stable(self, omega: float) -> bool:
        """Return whether what is disturbed comes back."""
        law = self._law
        if omega > 0.0:
            law = beside(law, observer_system(*self._beside, omega, self._step))
        late = LinearSystem(law.a, law.b @ self._seen, law.c, law.d @ self._seen)
        poles = np.linalg.eigvals(self._plant.closed(late))
        return bool(np.abs(poles).max() < 1.0 + 1e-9)
