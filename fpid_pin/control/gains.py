"""Gains for an arm that nobody has tuned yet, and how far adaptation may move them."""

import dataclasses
import logging
import warnings
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import Flag, FloatArray, Number, OneOf, checked
from fpid_pin.control.ceilings import (
    SLACK,
    DerivativeBound,
    FrozenLoops,
    damped_box,
    gain_table,
    nearest_gains,
)
from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.law import Controller
from fpid_pin.control.poses import joints_that_fall, seeded_poses
from fpid_pin.control.stability import suggest_observer
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.resources import one_blas_thread
from fpid_pin.text import shown

#: Derivative orders that are tried, from the best damping to the least demand on the step: below
#: 0.6 the derivative hardly damps.
ORDERS = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6)
#: Part of the sampled-data bound that Kd should use up, so that it can rise fourfold, and that it
#: may: a gain margin of 2.5.
START_PART, MOST_PART = 0.25, 0.4
#: Least damping ratio zeta at home, and at the other poses that are looked at: overshoots
#: exp(-pi zeta/sqrt(1 - zeta^2)) of 25 and 53 % (Åström and Murray, *Feedback Systems*, 2008,
#: section 6.3).
HOME_DAMPING, POSE_DAMPING = 0.4, 0.2
#: Of the bandwidth w, Ki over w^3: 15 % of Routh's bound 2 w^3 for s^3 + 2 w s^2 + w^2 s + Ki.
INTEGRAL_PART = 0.3
#: Errors that dry friction and the largest weight torque may cost before the integral answers, at
#: which the proportional term may ask for the whole effort limit [rad]. Chosen so that all arms of
#: the catalogue follow (`benchmarks/results/gains.md`).
FRICTION_ERROR, WEIGHT_ERROR, EFFORT_ERROR = 0.09, 0.5, 0.05
#: Error that adaptation takes for large [rad], and the time in which it then doubles a gain [s]:
#: slow beside any loop of a few rad/s.
LEARNING_ERROR, LEARNING_TIME = 0.05, 5.0
#: Part of what was asked from which on a gain counts as lowered: by a hundredth or so, where the
#: search ends depends on the last bits of a machine's linear algebra.
LOWERED = 0.95
#: How much adaptation may raise a gain, where the sampled loop allows, and lower it.
RAISE, LOWER = 4.0, 0.7

#: In place of a number, of which one is then found.
SUGGESTED = "suggested"

_log = logging.getLogger("fpid_pin")


@dataclass(frozen=True, eq=False)
class GainSuggestion:
    """Suggested gains, and what was lowered to make them stable.

    Attributes
    ----------
    controller
        The law.
    bandwidth
        sqrt(Kp) of each joint, (n,) [rad/s].
    damping_ratio
        The least at home.
    least_damping_ratio
        The least at any pose that was looked at; below 0 the arm is unstable there.
    notes
        What was lowered and why, a line each; none where all is as asked for.
    """

    controller: AdaptiveFpid
    bandwidth: FloatArray
    damping_ratio: float
    least_damping_ratio: float
    notes: tuple[str, ...]

    def __str__(self) -> str:
        w = ", ".join(f"{x:.3g}" for x in self.bandwidth)
        ratios = f"{self.damping_ratio:.2f} at home, {self.least_damping_ratio:.2f} at other poses"
        return "\n".join([f"bandwidths {w} rad/s, damping ratio {ratios}", *self.notes])


@described("suggested_fpid")
@dataclass(frozen=True, eq=False)
class SuggestedFpid(Controller):
    """The adaptive FPID of `suggest_gains`, on whatever arm it is started: for configurations.

    Parameters
    ----------
    bandwidth
        w [rad/s]; ten times the fastest motion that is asked for is a good start.
    integral_order
        lambda.
    derivative_order
        mu. None: the largest of `ORDERS` at which the Kd of the bandwidth uses up at most a quarter
        of the sampled-data bound at every pose, or the least of them. The lower the order, the less
        a derivative of the same weight at w asks of the step.
    adaptive
        False: the same gains, fixed.
    order_learning_rate
        Of both orders, 0: they stay; or ``"suggested"``: rates and bounds of `adapt_orders`.
    feedforward, observer, supervisor
        See `AdaptiveFpid`; the observer may be ``"suggested"``: see `suggest_observer`.
    name
        What tables and figures call it.
    """

    bandwidth: Annotated[float, Number("rad/s", above=0.0)] = 10.0
    integral_order: Annotated[float, Number(low=0.0, high=1.0)] = 0.9
    derivative_order: Annotated[float | None, Number(low=0.0, high=1.0)] = None
    adaptive: Annotated[bool, Flag] = True
    order_learning_rate: Annotated[float | str, OneOf(SUGGESTED), Number(low=0.0)] = 0.0
    observer: Annotated[float | str, OneOf(SUGGESTED), Number("rad/s", low=0.0)] = field(
        default=0.0, kw_only=True
    )  # type: ignore[assignment]
    name: str = field(default="FPID, suggested gains", kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.array_equal(self.scale, "none"):
            expected = 'no scale ("none"): it is found with the gains'
            raise ArgumentError("scale", expected, shown(self.scale))

    def on(self, arm: Arm, *, step: float = 1e-3) -> AdaptiveFpid:
        """Return the controller that this is on `arm`, found once."""
        return _found(self, arm, step)

    @one_blas_thread()
    def explained(self, arm: Arm, step: float, horizon: float) -> GainSuggestion:
        """Return that controller, and why its gains are as they are: see `explain_gains`."""
        w, step = self.bandwidth, checks.sampling_step(step)
        for reason in impossible_joints(arm):
            warnings.warn(reason, FpidWarning, stacklevel=5)
        law, bound = self._wanted(arm, step, horizon)
        scale, mu = law.scale_on(arm), float(np.asarray(law.derivative_order))
        notes = []
        if self.derivative_order is None and mu < ORDERS[0]:
            reason = f"at a step of {1e3 * step:g} ms the loop bears too little Kd otherwise"
            notes.append(f"derivative order {mu:g} instead of {ORDERS[0]:g}: {reason}")
        wanted = scale * gain_table(law, arm.n)
        poses = bound.critical_poses(scale)
        loops = FrozenLoops(arm, law, poses, step=step, horizon=200.0 / w)
        least = np.array([HOME_DAMPING] + [POSE_DAMPING] * (len(poses) - 1))
        gains = nearest_gains(loops, bound, wanted, part=MOST_PART, damping=least)
        found = loops.ratios(gains)
        for joint, ratio in zip(arm.joint_names, (gains / wanted).T, strict=True):
            if ratio.min() < LOWERED:
                names = zip(("Kp", "Ki", "Kd"), ratio, strict=True)
                cut = ", ".join(f"{k} at {100.0 * x:.2g} %" for k, x in names if x < LOWERED)
                notes.append(f"joint {joint}: {cut} of what {w:g} rad/s ask for, to be damped")
        short = float((least - found).max())
        if short > 2.0 * SLACK:
            notes.append(
                f"damping ratios are {short:.2f} less than wanted: nothing better is found"
            )
        if found.min() <= 0.0:
            warnings.warn(
                f"{arm.name}: at a step of {1e3 * step:g} ms no gains are found that are stable at "
                "every pose; a shorter step or less bandwidth may do", FpidWarning, stacklevel=5,
            )  # fmt: skip
        kp, ki, kd = gains / scale
        law = dataclasses.replace(law, kp=kp, ki=ki, kd=kd)
        observer = self.observer
        if observer == SUGGESTED:
            observer = suggest_observer(arm, law, step=step)
        law = dataclasses.replace(
            law, feedforward=self.feedforward, observer=float(observer), supervisor=self.supervisor
        )
        if law.observer:
            notes.append("damping ratios and projection are those of the law without its observer")
        if self.adaptive:
            law, part = _adapting(arm, law, loops, bound, w)
            if part < 1.0:
                way = f"{100.0 * part:.0f} % of the way to {LOWER:g} and {RAISE:g} times"
                notes.append(
                    f"projection goes {way} the gains or to their ceilings, to stay damped"
                )
        if (rate := self.order_learning_rate) == SUGGESTED:
            law = adapt_orders(law, arm)
        else:
            law = dataclasses.replace(law, order_learning_rate=rate)
        for note in notes:
            _log.info("%s: %s", arm.name, note)
        return GainSuggestion(
            controller=law,
            bandwidth=checks.read_only(np.sqrt(kp)),
            damping_ratio=float(found[0]),
            least_damping_ratio=float(found.min()),
            notes=tuple(notes),
        )

    def _wanted(
        self, arm: Arm, step: float, horizon: float
    ) -> tuple[AdaptiveFpid, DerivativeBound]:
        """Return the law of a bandwidth on this arm, not yet lowered, and the bound on its Kd."""
        w, lam, mu = self.bandwidth, self.integral_order, self.derivative_order
        weight = np.abs([arm.gravity_vector(q) for q in seeded_poses(arm, 200, 0)]).max(axis=0)
        inertia = np.diag(arm.mass_matrix(arm.home))
        scale = inertia + arm.viscous_friction / w + arm.dry_friction / (FRICTION_ERROR * w**2)
        scale = scale + weight / (WEIGHT_ERROR * w**2)
        scale = np.minimum(scale, np.maximum(arm.effort_limit / (EFFORT_ERROR * w**2), 1e-9))
        unit = 0.0
        for order in ORDERS if mu is None else (mu,):
            kd = 2.0 * w ** (2.0 - order)
            law = AdaptiveFpid(
                kp=w**2, ki=INTEGRAL_PART * w ** (2.0 + lam), kd=kd, integral_order=lam,
                derivative_order=order, learning_rate=0.0, scale=scale, name=self.name,
            )  # fmt: skip
            bound = DerivativeBound(arm, law, step=step, horizon=horizon)
            # One order for all joints: only the ratio of Kd and what a joint bears differs.
            ratio = kd / bound.critical[0]
            unit = unit or bound.worst(kd * scale)[0] / ratio
            if unit * ratio <= START_PART:
                break
        return law, bound


@lru_cache(maxsize=64)
def _found(asked: SuggestedFpid, arm: Arm, step: float) -> AdaptiveFpid:
    """Return what a suggestion is on an arm, a second's work; a run's length changes no gain."""
    return asked.explained(arm, step, 3600.0).controller


@checked
def suggest_gains(
    arm: Arm, bandwidth: float = 10.0, *, step: float = 1e-3, horizon: float = 3600.0,
    **options: Any,
) -> AdaptiveFpid:  # fmt: skip
    """Return an adaptive FPID that follows slow references on `arm` without any tuning.

    The same as `explain_gains`, arguments and errors too; its notes also go to the logger
    ``fpid_pin``, level INFO.
    """
    return explain_gains(arm, bandwidth, step=step, horizon=horizon, **options).controller


@checked
def explain_gains(
    arm: Arm, bandwidth: float = 10.0, *, step: float = 1e-3, horizon: float = 3600.0,
    **options: Any,
) -> GainSuggestion:  # fmt: skip
    """Return gains with which an arm follows slow references, and why they are as they are.

    Parameters
    ----------
    arm
        The nominal arm.
    bandwidth
        w [rad/s].
    step, horizon
        Of the sampled loop [s].
    **options
        `integral_order`, `derivative_order`, `adaptive`, `feedforward`, `observer`, `name` and what
        else `SuggestedFpid` has.

    Returns
    -------
    GainSuggestion
        With gains over the scale ``s_j = M_jj + F_v/w + F_d/(0.09 rad w^2) + max|G_j|/(0.5 rad
        w^2)`` (never so large that 0.05 rad of error alone ask for the effort limit), Kp = w^2,
        and Kd, Ki that at the frequency w weigh as 2 w and 0.3 w^3 do at orders 1. Gains are
        lowered, no further than needed, until Kd uses up at most 0.4 of what the sampled loop bears
        at the worst pose, and damping ratios are at least 0.4 at home and 0.2 at six other poses.
        Projection keeps adapted gains within 0.7 and four times these, under the ceilings of
        `gain_ceilings`, in a box that is damped at all those poses (docs/gains.md). Learning rates
        make 0.05 rad of error double a gain in about five seconds.

    Raises
    ------
    ArgumentError
        A bandwidth or an option that `SuggestedFpid` refuses.

    Warns
    -----
    FpidWarning
        Joints whose effort limit does not carry the arm at home, or does not overcome their dry
        friction: no gains can make them follow. And poses at which no stable gains were found.
    """
    asked = SuggestedFpid(bandwidth, **{"name": ""} | options)
    return asked.explained(arm, step, horizon)


def impossible_joints(arm: Arm) -> list[str]:
    """Return a line for every joint that its drive cannot move at home, whatever the gains."""
    falling = joints_that_fall(arm, arm.home, arm.effort_limit, "at home")
    return [f"{line}; it cannot hold the arm there" for line in falling] + [
        f"{arm.name}: joint {arm.joint_names[j]}: dry friction of {arm.dry_friction[j]:.3g} {unit} "
        f"is not below its effort limit of {arm.effort_limit[j]:.3g} {unit}; it cannot be moved"
        for j, unit in enumerate(arm.effort_units)
        if arm.effort_limit[j] <= arm.dry_friction[j]
    ]


def _adapting(
    arm: Arm, law: AdaptiveFpid, loops: FrozenLoops, bound: DerivativeBound, w: float
) -> tuple[AdaptiveFpid, float]:
    """Let the gains of a law adapt within a damped box; also return which part of it that is."""
    scale, initial = law.scale_on(arm), gain_table(law, arm.n)
    lowest = dataclasses.replace(law, safeguards=Safeguards(minimum=LOWER * initial))
    ceilings = bound.ceilings(lowest)
    ceiling = np.stack([ceilings.kp, ceilings.ki, ceilings.kd])
    highest = np.maximum(np.minimum(RAISE * initial, ceiling), initial)
    low, high, part = damped_box(loops, LOWER * initial * scale, initial * scale, highest * scale)
    # S phi is about k1 e^2 for Kp; I^lambda e counts like e held for a second; e' like w e.
    k1 = float(np.asarray(law.k1))
    strength = k1 * LEARNING_ERROR**2 * LEARNING_TIME * np.array([[1.0], [1.0], [w**2]])
    # Rounding must not put the initial gains outside their own box.
    guards = Safeguards(
        minimum=np.minimum(low / scale, initial), maximum=np.maximum(high / scale, initial)
    )
    return dataclasses.replace(law, learning_rate=initial / strength, safeguards=guards), part


@checked
def adapt_orders(controller: AdaptiveFpid, arm: Arm, *, speed: float = 1.0) -> AdaptiveFpid:
    """Return a law with orders that adapt, downwards from the largest that it has.

    An error of 0.05 rad moves an order by 1 in 5 s, in which by the learning rates of
    `suggest_gains` it doubles a gain. With S about k1 e, and e' like w e,

        gamma_o = 1/(k1 e^2 T s Ki) for lambda,    1/(k1 e^2 T s Kd w^2) for mu,
        e = 0.05 rad,  T = 5 s,  w^2 = s Kp/M_jj

    M_jj at the arm's home. An order beside a gain, or a surface, of 0 stays. Upper bounds are the
    largest lambda and mu of the law: under a load that stays lambda would else end at 1, and mu
    would follow the noise upwards; both cost more than they gain (`benchmarks/RECORD.md`).

    Parameters
    ----------
    controller, arm
        The law, and the arm that it is for.
    speed
        A factor of the rates.

    Raises
    ------
    ArgumentError
        Orders below the lower bounds of the law.
    """
    speed = checks.number("speed", speed, low=0.0)
    kp, ki, kd = gain_table(controller, arm.n)
    k1, scale = checks.per_joint("k1", controller.k1, arm.n), controller.scale_on(arm)
    square = scale * kp / np.diag(arm.mass_matrix(arm.home))  # w^2 [1/s^2]
    strength = k1 * LEARNING_ERROR**2 * LEARNING_TIME * scale * np.stack([ki, kd * square])
    rate = np.divide(speed, strength, out=np.zeros_like(strength), where=strength > 0.0)
    return dataclasses.replace(
        controller,
        order_learning_rate=rate,
        integral_order_bounds=(
            controller.integral_order_bounds[0],
            np.max(controller.integral_order),
        ),
        derivative_order_bounds=(
            controller.derivative_order_bounds[0],
            np.max(controller.derivative_order),
        ),
    )
