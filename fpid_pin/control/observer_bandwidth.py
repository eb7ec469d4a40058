"""How fast an observer may be on an arm: what its noise and late measurements leave."""

from __future__ import annotations

import dataclasses
import warnings
from bisect import bisect_left
from functools import cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.control.law import FASTEST, Controller, observer_gains
from fpid_pin.control.linear import LinearLaw, linear_arm, linearised
from fpid_pin.control.poses import seeded_poses
from fpid_pin.exceptions import FpidWarning
from fpid_pin.fractional import ExponentialSum
from fpid_pin.resources import one_blas_thread

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Part of the delay that the law alone bears which the loop with an observer must still bear.
DELAY_PART = 0.5
#: Inertia of the true arm over the model's: a load that nobody told of, and one that is not there.
INERTIA_RATIOS = (0.6, 1.0, 1.8)
#: Operators of few modes, over few seconds, tell whether a loop is stable, and quickly.
DESIGN, HORIZON = ExponentialSum(modes=8), 10.0
#: Poses that are looked at; samples of delay, of which more than the law alone bears are no use;
#: halvings of a bandwidth's interval: to 0.4 % of it.
POSES, LATEST, HALVINGS = 3, 16, 8
#: How far outside the unit circle rounding may put a pole that is on it.
ROUNDING = 1e-9


@one_blas_thread()
def suggest_observer(
    arm: Arm,
    controller: Controller,
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

    Warns
    -----
    FpidWarning
        Where the law alone, on the exact arm at home, does not bear the delay: it is 0 then.

    Notes
    -----
    With a weak law the observer's loop is ``omega^2/(s (s + 2 omega))``, whose delay margin is
    2.74/omega: 27 ms at 100 rad/s. Next to a law of its own bandwidth there is less.
    """
    checks.instance("controller", controller, Controller, "a control law")
    step = checks.number("step", step, above=0.0)
    delay = checks.number("delay", delay, low=0.0)
    noise = checks.number("noise", noise, low=0.0)
    late = int(np.ceil(delay / step - 1e-9))
    poses = seeded_poses(arm, POSES, 0)
    alone = dataclasses.replace(controller.on(arm, step=step), supervisor=None)

    @cache
    def law(pose: int, omega: float) -> LinearLaw:
        observed = dataclasses.replace(alone, observer=omega)
        return linearised(observed, arm, poses[pose], step=step, horizon=HORIZON, design=DESIGN)

    def stable(pose: int, ratio: float, samples: int, omega: float = 0.0) -> bool:
        plant = linear_arm(arm, poses[pose], step=step, inertia=ratio, late=samples)
        poles = np.linalg.eigvals(law(pose, omega).open_loop(plant).closed(np.eye(arm.n)))
        return bool(np.abs(poles).max() < 1.0 + ROUNDING)

    if not stable(0, 1.0, late):
        warnings.warn(
            f"{arm.name}: the law alone is not stable with measurements {1e3 * delay:g} ms late: "
            "no observer is suggested",
            FpidWarning,
            stacklevel=2,
        )
        return 0.0
    omega = min(_quiet(arm, law(0, 0.0), step, noise), FASTEST / step)
    for pose, ratio in product(range(POSES), INERTIA_RATIOS):
        # What the law alone bears, from -1 samples, at which everything is stable.
        samples = range(max(late, LATEST) + 1)
        borne = bisect_left(samples, True, key=lambda k: not stable(pose, ratio, k)) - 1
        asked = max(late, int(DELAY_PART * borne))
        if borne >= late and not stable(pose, ratio, asked, omega):
            slow, fast = 0.0, omega
            for _ in range(HALVINGS):
                half = 0.5 * (slow + fast)
                slow, fast = (half, fast) if stable(pose, ratio, asked, half) else (slow, half)
            omega = slow
    return omega


def _quiet(arm: Arm, law: LinearLaw, step: float, noise: float) -> float:
    """Return the bandwidth at which the torque varies by 1 + `noise` times as much."""
    from scipy.optimize import brentq

    # What is answered at once is what q' adds to the torque directly.
    whole = law.open_loop(linear_arm(arm, arm.home, step=step))
    answer = whole.c[:, arm.n : 2 * arm.n]
    inertia = arm.mass_matrix(arm.home) + step * np.diag(arm.viscous_friction)

    def size(omega: float) -> float:
        both = observer_gains(omega, step)[1] * inertia - answer
        return float(np.sqrt((both**2 + answer**2).sum(axis=1)).sum())

    allowed, fastest = (1.0 + noise) * size(0.0), FASTEST / step
    if size(fastest) <= allowed:
        return fastest
    return float(brentq(lambda omega: size(omega) - allowed, 0.0, fastest, xtol=1e-12 * fastest))
