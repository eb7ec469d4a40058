"""What is simulated: one robot, one job, one clock; the true plant, its sensors; how it ended.

Below: the paper's experiment, section 5.1, and its controllers.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import Array, FloatArray, Number, OneOf, PerJoint, Text, Whole, checked
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.poses import joints_that_fall
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.costs import Cost, QuadraticCost, TrackingCost
from fpid_pin.descriptions import Description, described
from fpid_pin.disturbances import Cosine, Disturbance
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Motion, Reference, Sinusoid
from fpid_pin.text import shown, unit_for

DYNAMICS = ("pinocchio", "compiled")


@described("payload")
@dataclass(frozen=True, eq=False)
class Payload(Description):
    """A load of the plant that no controller knows; a number instead of a table is its mass.

    Parameters
    ----------
    mass
        Its mass [kg].
    com
        Its centre of mass, in `frame` [m].
    frame
        The frame that it is fixed to; None: the tool's.
    """

    _short = "mass"

    mass: Annotated[float, Number("kg", low=0.0)]
    com: Annotated[ArrayLike, Array("m", shape=(3,))] = (0.0, 0.0, 0.0)
    frame: Annotated[str | None, Text] = None


@described("plant")
@dataclass(frozen=True, eq=False)
class Plant(Description):
    """What is simulated, (6): ``M q'' + C q' + G + F_v q' + F_d sgn(q') = U + d(t)``.

    Parameters
    ----------
    arm
        The true arm; None: the nominal one, which the controllers know.
    viscous_friction, dry_friction
        F_v [N m s/rad] and F_d [N m], scalar or (n,); None: the arm's own.
    disturbance
        The external torques d(t).
    effort_limit
        Limit of the drives [N m], scalar or (n,); None: the arm's own; inf: none.
    payload
        A load that no controller knows: its mass at the tool [kg], or a table of mass [kg],
        com [m] and frame.
    """

    _path = "plant"

    arm: Arm | None = None
    viscous_friction: Annotated[ArrayLike | None, PerJoint("N m s/rad", low=0.0)] = None
    dry_friction: Annotated[ArrayLike | None, PerJoint("N m", low=0.0)] = None
    disturbance: Disturbance | None = None
    effort_limit: Annotated[ArrayLike | None, PerJoint("N m", above=0.0, finite=False)] = None
    payload: Payload | float | dict[str, Any] | None = None

    def resolve(self, nominal: Arm) -> "ResolvedPlant":
        """Fill what is left open from `nominal` and check every length against it."""
        arm = nominal if self.arm is None else self.arm
        if arm.n != nominal.n:
            raise ArgumentError(
                "plant.arm", f"{nominal.n} joints, as the nominal arm", f"{arm.n} joints"
            )
        if isinstance(self.payload, Payload):
            try:
                arm = arm.with_payload(**vars(self.payload))
            except ArgumentError as error:
                name = f"plant.payload.{error.name}"
                raise ArgumentError(name, error.expected, error.got) from None

        def own(name: str) -> FloatArray:
            value = getattr(self, name)
            value = getattr(arm, name) if value is None else value
            return checks.per_joint(f"plant.{name}", value, arm.n, finite=False)

        return ResolvedPlant(
            arm, own("viscous_friction"), own("dry_friction"), own("effort_limit"), self.disturbance
        )


@dataclass(frozen=True, eq=False)
class ResolvedPlant:
    """A plant with nothing left open, arrays (n,)."""

    arm: Arm
    viscous_friction: FloatArray
    dry_friction: FloatArray
    effort_limit: FloatArray
    disturbance: Disturbance | None


@described("sensors")
@dataclass(frozen=True, eq=False)
class Sensors(Description):
    """Imperfect measurements, applied in this order: delay, noise, bias, quantisation.

    Parameters
    ----------
    position_resolution
        Encoder step [rad], scalar or (n,); 0: not quantised.
    position_noise, velocity_noise
        Standard deviation of white noise on each sample [rad], [rad/s].
    velocity_bias
        Constant error of the velocity sensors [rad/s], scalar or (n,).
    velocity
        ``"measured"``: by its own sensor; ``"differentiated"``: from the measured position
        by a first-order filtered difference.
    velocity_cutoff
        Cutoff of that filter [rad/s].
    delay
        Delay of all measurements [samples], a whole number.
    """

    _path = "sensors"

    position_resolution: Annotated[ArrayLike, PerJoint("rad", low=0.0)] = 0.0
    position_noise: Annotated[ArrayLike, PerJoint("rad", low=0.0)] = 0.0
    velocity_noise: Annotated[ArrayLike, PerJoint("rad/s", low=0.0)] = 0.0
    velocity_bias: Annotated[ArrayLike, PerJoint("rad/s")] = 0.0
    velocity: Annotated[str, OneOf("measured", "differentiated")] = "measured"
    velocity_cutoff: Annotated[float, Number("rad/s", above=0.0)] = 500.0
    delay: Annotated[int, Whole(low=0, high=1_000_000)] = 0


@described("experiment")
@dataclass(frozen=True, eq=False)
class Experiment(Description):
    """One robot and what it is asked to do; a difference between runs is another Experiment.

    Parameters
    ----------
    arm
        The nominal arm: what the controller believes in.
    reference
        The trajectory to follow.
    q0, v0
        State at t = 0 [rad], [rad/s], scalar or (n,); q0 None: the reference's start; v0 None: at
        rest.
    plant
        The true robot; None: the nominal arm, undisturbed.
    sensors
        None: angles and rates are measured exactly.
    step
        Sampling period and integration step [s], from 1 ns to 10 s.
    duration
        Length of a run [s]; it has ``round(duration/step) + 1`` rows.
    integrator
        ``"semi_implicit_euler"`` or ``"rk4"``; the torque is held over the step in both.
    dynamics
        ``"pinocchio"``: Pinocchio's own functions, one robot and one call at a time; or
        ``"compiled"``: the package's rigid-body kernels, whole stretches of a run in one call.
        None: Pinocchio's where runs are recorded (`simulate`), compiled where thousands are
        compared (`evaluate`, `tune`, campaigns). The two agree within rounding, not to the bit.
    seed
        Seed of the sensors' noise.
    runaway_speed
        A joint faster than this [rad/s] ends the run.
    """

    arm: Arm
    reference: Reference
    q0: Annotated[ArrayLike | None, Array("rad", max_ndim=1)] = None
    v0: Annotated[ArrayLike | None, Array("rad/s", max_ndim=1)] = None
    plant: Plant | None = None
    sensors: Sensors | None = None
    step: Annotated[float, Number("s", above=0.0)] = 1e-3
    duration: Annotated[float, Number("s", above=0.0)] = 20.0
    integrator: Annotated[str, OneOf("semi_implicit_euler", "rk4")] = "semi_implicit_euler"
    dynamics: Annotated[str | None, OneOf(*DYNAMICS)] = None
    seed: Annotated[int, Whole(low=0)] = 0
    runaway_speed: Annotated[float, Number("rad/s", above=0.0)] = 1e3

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.sample_count(self.duration, self.step)
        n = self.arm.n
        start = self.motion(np.zeros(1))[0][0]
        v0 = checks.per_joint("v0", 0.0 if self.v0 is None else self.v0, n)
        if (np.abs(v0) > self.runaway_speed).any():
            unit = unit_for("rad/s", self.arm.units)
            expected = f"at most runaway_speed ({self.runaway_speed:g} {unit})"
            raise ArgumentError("v0", expected, v0)
        self._set(q0=checks.per_joint("q0", start if self.q0 is None else self.q0, n), v0=v0)
        if self.resolved.disturbance is not None:
            self.disturbance(np.zeros(1))

    @cached_property
    def resolved(self) -> ResolvedPlant:
        """The plant with nothing left open."""
        return (Plant() if self.plant is None else self.plant).resolve(self.arm)

    @property
    def rows(self) -> int:
        """Number of samples of a run, both ends included."""
        return checks.sample_count(self.duration, self.step)

    @property
    def torque_limit(self) -> FloatArray:
        """What neither the law nor the drives go beyond [N m], (n,)."""
        limit: FloatArray = np.minimum(self.arm.effort_limit, self.resolved.effort_limit)
        return limit

    def joints_that_fall(self, *, by_hand: bool = True) -> list[str]:
        """Return a line for each joint that no drive can hold where the run starts.

        Not `by_hand`, the limits are those of the two arms: one that the plant was given by hand
        (``Plant.effort_limit``) may well be meant.
        """
        arm = self.resolved.arm
        limit = (
            self.torque_limit if by_hand else np.minimum(arm.effort_limit, self.arm.effort_limit)
        )
        return joints_that_fall(arm, np.asarray(self.q0), limit, "at the start")

    def with_dynamics(self, dynamics: str) -> "Experiment":
        """Return the experiment with its dynamics written out: these where it does not say."""
        return self if self.dynamics is not None else replace(self, dynamics=dynamics)

    def motion(self, t: FloatArray) -> Motion:
        """Sample the reference at `t`, (K,), as three (K, n) arrays, checked."""
        sampled = self.reference.sample(t)
        given = [*sampled] if isinstance(sampled, (tuple, list, np.ndarray)) else []
        if len(given) != 3:
            got = f"{len(given)}" if given else shown(sampled)
            raise ArgumentError("reference", "three arrays (angles, rates, accelerations)", got)
        out = []
        for name, values in zip(("q", "v", "a"), given, strict=True):
            array = self._rows(f"reference {name}", values, len(t))
            if not np.isfinite(array).all():
                at = t[int(np.argwhere(~np.isfinite(array))[0, 0])]
                raise ArgumentError(
                    f"reference {name}", "finite values", f"NaN or inf at t = {at:g} s"
                )
            out.append(array)
        return out[0], out[1], out[2]

    def disturbance(self, t: FloatArray) -> FloatArray:
        """Sample the plant's disturbance at `t`, (K,), as (K, n) [N m], checked."""
        found: Any = self.resolved.disturbance
        return self._rows("plant.disturbance", found.sample(t), len(t))

    def _rows(self, name: str, values: Any, rows: int) -> FloatArray:
        """Check what is to be numbers for all joints, (rows, n), or for any, (rows, 1)."""
        n, got = self.arm.n, ""
        with suppress(ValueError):  # rows of several lengths
            array = np.asarray(values)
            if array.dtype.kind in "fiu":
                if array.shape in ((rows, n), (rows, 1)):
                    return np.broadcast_to(array.astype(np.float64), (rows, n))
                got = f"shape {array.shape}"
        expected = f"shape ({rows}, {n}) (the arm has {n} joints)"
        raise ArgumentError(name, expected, got or shown(values))


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Parameters
    ----------
    completed
        Whether it reached its duration.
    time
        When it ended [s].
    joint, cause
        Which joint ended it (none where it was the law itself), and why; empty where it completed.
    """

    completed: bool
    time: float
    joint: str = ""
    cause: str = ""

    def __str__(self) -> str:
        if self.completed:
            return f"completed at {self.time:g} s"
        if not self.joint:
            return f"ended at {self.time:g} s: {self.cause}"
        return f"diverged at {self.time:g} s, {self.joint}: {self.cause}"


# ---------------------------------------------------------------------- section 5.1 of the paper

# (lambda, mu) per joint. "symbol": as the letters say; "sign": taking the minus sign of the printed
# mu as that of an integral, which swaps the two.
PUBLISHED_ORDERS = {
    "symbol": ((0.901, 0.931), (0.921, 0.932)),
    "sign": ((0.921, 0.932), (0.901, 0.931)),
    "integer": ((1.0, 1.0), (1.0, 1.0)),
}
# Those with the least int |e|^2 among fixed orders, the paper's gains given: benchmarks/orders.py
# finds them, with w2 = 0, and says what else they do.
TUNED_ORDERS = ((0.353, 0.0), (0.564, 0.723))
_NAMES = {
    "symbol": "FPID, published orders",
    "sign": "FPID, orders read by sign",
    "integer": "integer PID",
}


_own_arm = cache(Arm.two_link)


def of_paper(arm: Arm) -> bool:
    """Return whether an arm is the paper's: its orders mean something on no other."""
    return arm == _own_arm()


def default_cost(arms: Iterable[Arm]) -> Cost:
    """Return (33) on the paper's arm, tracking on all others: there (33) is nearly all energy."""
    return QuadraticCost() if all(map(of_paper, arms)) else TrackingCost()


@checked
def paper_experiment(*, duration: float = 20.0, step: float = 1e-3) -> Experiment:
    """Return section 5.1 of the paper: two links, eqs. (34)-(38).

    Parameters
    ----------
    duration, step
        [s]; the paper gives neither.
    """
    return Experiment(
        arm=Arm.two_link(),
        reference=Sinusoid(amplitude=(1.0, 1.0)),
        q0=(0.0, 0.35),
        v0=(-0.2, 0.5),
        plant=Plant(disturbance=Cosine(amplitude=(0.4, 0.6), frequency=5.0 * np.pi)),
        step=step,
        duration=duration,
    )


@checked
def paper_controller(orders: str = "symbol", *, supervised: bool = True) -> AdaptiveFpid:
    """Return the adaptive FPID of section 5.1 with its primary setting.

    Parameters
    ----------
    orders
        ``"symbol"``: lambda = (0.901, 0.931), mu = (0.921, 0.932), our reading; ``"sign"``: the
        two swapped; ``"integer"``: 1, the paper's adaptive integer PID.
    supervised
        Whether the supervisor stands by, with M_x = 5, G_u = (27.44, 7.84), d_u = (0.4, 0.6). In
        the paper's experiment it never acts.
    """
    integral, derivative = PUBLISHED_ORDERS[checks.choice("orders", orders, PUBLISHED_ORDERS)]
    supervisor = Supervisor(
        m_x=5.0,
        kind="paper",
        reference_bound=1.0,  # sup ||[sin t, cos t]||
        disturbance_bound=(0.4, 0.6),  # N m, (37)
        # N m, the arm stretched out: g (m1 l1 + m2 (l1 + l2)), g m2 l2
        gravity_bound=(27.44, 7.84),
    )
    return AdaptiveFpid(
        kp=(10.0, 12.0),
        ki=(25.0, 20.0),
        kd=(20.0, 15.0),
        integral_order=integral,
        derivative_order=derivative,
        learning_rate=25.0,
        k0=1.0,
        k1=2.0,
        supervisor=supervisor if supervised else None,
        name=_NAMES[orders],
    )
