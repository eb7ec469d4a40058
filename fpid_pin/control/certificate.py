"""A box within which gains may move at any speed: what makes an adapting loop stable."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.ceilings import DerivativeBound, gain_table
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.linear_law import terms_of
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.small_gain import MovingGains, least_size

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: What of the proved reach is used: rounding must not decide.
PART = 0.999


@dataclass(frozen=True, eq=False)
class GainCertificate:
    """A box of gains that may move in it as they like; see `certify_gains`.

    Attributes
    ----------
    controller
        The law, its projection put to the box.
    reach
        How far, as a part of the initial gains times `spread`, each may move either way: the least
        of `reaches`. 0 where the initial gains themselves are unstable at a pose.
    low, high
        The box: least and largest Kp, Ki, Kd, (3, n), in the law's own units.
    poses, reaches
        The poses looked at, (poses, n) [rad], and the reach at each, (poses,).
    """

    controller: AdaptiveFpid
    reach: float
    low: FloatArray
    high: FloatArray
    poses: FloatArray
    reaches: FloatArray

    def __str__(self) -> str:
        return (
            f"gains may move within {100.0 * self.reach:.0f} % of the initial ones, times their "
            f"spread, at any speed; at each of {len(self.poses)} poses: "
            + ", ".join(f"{100.0 * reach:.0f} %" for reach in self.reaches)
        )


def certify_gains(
    arm: Arm, controller: AdaptiveFpid, *, spread: ArrayLike = 1.0, step: float = 1e-3,
    horizon: float = 3600.0, poses: ArrayLike | None = None,
) -> GainCertificate:  # fmt: skip
    """Return the widest box around a law's gains in which a proof allows any adaptation.

    Parameters
    ----------
    arm, controller
        The nominal arm, and a law stable on it.
    spread
        Proportions of the box: gains stay within ``K(0) (1 +- reach spread)``; a scalar, (n,) or
        (3, n). 0 for a gain that does not move.
    step, horizon
        Of the sampled loop [s].
    poses
        Where the arm is linearised, (poses, n) [rad]. None: home, where it is heaviest, lightest
        and most toppling, and three random ones.

    Returns
    -------
    GainCertificate
        Proved, for each pose and to rounding: the sampled loop of the arm linearised at rest there
        and of the law with all its modes is exponentially stable for every sequence of gains in the
        box, however fast. So it is whatever the learning rates. An observer changes nothing: on the
        exact model no torque excites it, and what it is wrong by at first dies away by itself. Not
        covered: motion between poses, torque limits, dry friction, a wrong model.

    Raises
    ------
    ArgumentError
        A fractional design that keeps the past instead of modes, orders that adapt, or no gain that
        may move.

    Notes
    -----
    Scaled small gain with a constant D (`MovingGains`), bounded between frequencies. Sufficient,
    not necessary: a wider box may be stable, too.
    """
    checks.instance("controller", controller, AdaptiveFpid, "an AdaptiveFpid")
    if np.any(controller.order_learning_rate):
        raise checks.ArgumentError("controller", "orders that stay", "an order_learning_rate")
    step = checks.number("step", step, above=0.0)
    n, scale = arm.n, controller.scale_on(arm)
    initial = gain_table(controller, n)
    width = np.broadcast_to(checks.floats("spread", spread, low=0, max_ndim=2), (3, n)) * initial
    if not width.any():
        raise checks.ArgumentError("spread", "a gain above 0 that may move", "none")
    if poses is None:
        bound = DerivativeBound(arm, controller, step=step, horizon=horizon)
        where = bound.critical_poses(scale)
    else:
        where = np.atleast_2d(checks.floats("poses", poses, max_ndim=2))
        if where.shape[1:] != (n,):
            raise checks.ArgumentError("poses", f"shape (poses, {n})", f"shape {where.shape}")
    reaches = np.zeros(len(where))
    for k, terms in enumerate(terms_of(controller, arm, where, step=step, horizon=horizon)):
        loop = MovingGains(terms, initial * scale, width * scale, step=step)
        if loop.stable:
            reaches[k] = PART / least_size(loop)
    reach = float(reaches.min())
    low, high = np.maximum(initial - reach * width, 0.0), initial + reach * width
    guards = controller.safeguards or Safeguards()
    guards = dataclasses.replace(guards, minimum=low, maximum=high)
    return GainCertificate(
        controller=dataclasses.replace(controller, safeguards=guards),
        reach=reach,
        low=checks.read_only(low),
        high=checks.read_only(high),
        poses=checks.read_only(where),
        reaches=checks.read_only(reaches),
    )
