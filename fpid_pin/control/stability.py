"""What the linearised, sampled loop says: its margins, and how fast an observer may be in it."""

import dataclasses
import warnings
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control.law import FASTEST, Controller, observer_gains
from fpid_pin.control.linear import ComplexArray, LinearLaw, linear_arm, linearised
from fpid_pin.control.poses import seeded_poses
from fpid_pin.exceptions import FpidWarning
from fpid_pin.fractional import Design, ExponentialSum
from fpid_pin.fractional.design import modes_of
from fpid_pin.resources import one_blas_thread
from fpid_pin.text import ReprMixin

#: Frequencies per decade. Crossings between them are interpolated, which at 1.2 % apart costs less
#: than 1e-4 of a margin.
DENSITY = 200
#: Lowest frequency that is looked at [rad/s]: ten minutes a period, slower than any arm is moved.
LOWEST = 1e-2
#: Part of the largest residue, of a push in the angles, that a pole must have to dominate.
DOMINANT_PART = 0.1
#: Part of the delay that the law alone bears which the loop with an observer must still bear.
DELAY_PART = 0.5
#: Inertia of the true arm over the model's: a load that nobody told of, and one that is not there.
INERTIA_RATIOS = (0.6, 1.0, 1.8)
#: Operators of few modes, over few seconds, tell whether a loop is stable, and quickly.
DESIGN, HORIZON = ExponentialSum(modes=8), 10.0
#: Poses that are looked at; samples of delay, of which more than the law alone bears are no use;
#: halvings of a bandwidth's interval: to 0.4 % of it.
POSES, LATEST, HALVINGS = 3, 16, 8
#: Samples of a delay: each is a state of every joint.
MOST_LATE = 200
#: How far outside the unit circle rounding may put a pole that is on it.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class StabilityReport(ReprMixin):
    """Margins of a loop: of each joint alone, the others as they are, (n,), and of all at once.

    Attributes
    ----------
    joint_names
        In the order of the arrays.
    stable
        Whether every pole that the torque depends on is inside the unit circle.
    pole_radius
        Largest modulus of those poles in z.
    dominant_pole
        The pole in s [1/s] that is left longest of a push: the slowest of those that make up at
        least a tenth of the largest part of the angles' response to a torque. A fractional law's
        slow modes, down to one over the horizon, weigh far less.
    gain_margin, gain_reduction
        Factors by which the joint's torque may be raised, or lowered, before the loop breaks;
        inf and 0 where it never does.
    phase_margin
        [rad]; inf where the loop's gain never passes 1.
    delay_margin
        The further dead time that the joint bears [s].
    crossover
        Where the smallest phase margin is [rad/s]; NaN where there is none.
    common_gain_margin, common_gain_reduction, common_delay_margin
        The same where all joints' torques are raised, lowered or late together, as by a slow
        computer: less than any one joint bears.
    """

    joint_names: tuple[str, ...]
    stable: bool
    pole_radius: float
    dominant_pole: complex
    gain_margin: FloatArray
    gain_reduction: FloatArray
    phase_margin: FloatArray
    delay_margin: FloatArray
    crossover: FloatArray
    common_gain_margin: float
    common_gain_reduction: float
    common_delay_margin: float

    def rows(self) -> list[dict[str, object]]:
        """Return one table row a joint, labelled with units, and one for all at once."""
        columns: dict[str, Any] = {
            "joint": (*self.joint_names, "all at once"),
            "gain margin": (*self.gain_margin, self.common_gain_margin),
            "gain reduction": (*self.gain_reduction, self.common_gain_reduction),
            "phase margin [deg]": np.degrees(self.phase_margin),
            "delay margin [ms]": (*(1e3 * self.delay_margin), 1e3 * self.common_delay_margin),
            "crossover [rad/s]": self.crossover,
        }
        return [
            {head: column[k] for head, column in columns.items() if k < len(column)}
            for k in range(len(self.joint_names) + 1)
        ]

    def __str__(self) -> str:
        s = self.dominant_pole
        lines = [
            f"{'stable' if self.stable else 'UNSTABLE'} at home, "
            f"dominant pole {s.real:.3g} ± {abs(s.imag):.3g}j 1/s"
        ]
        for row in self.rows():
            cells = [f"{k} {v:.3g}" for k, v in row.items() if isinstance(v, float)]
            lines.append(f"  {row['joint']}: " + ", ".join(cells))
        return "\n".join(lines)


@checked
@one_blas_thread()
def stability_report(
    arm: Arm, controller: Controller, *, step: float = 1e-3, horizon: float = 3600.0
) -> StabilityReport:
    """Linearise the sampled loop at the arm's home and measure its margins.

    Parameters
    ----------
    arm
        The nominal arm, which is also taken for the plant.
    controller
        Any law, in every form, as its `Loop` runs it: with its observer, its integrals, what it
        remembers, and what adapts as far as that matters at rest: estimates of the weight, which
        errors move in proportion, do; gains, which products of errors move, stay. Torque limits and
        dry friction are left out, and so is a supervisor: it is silent at rest.
    step, horizon
        [s].

    Raises
    ------
    ArgumentError
        A fractional design without modes; a torque that jumps, as sgn without a boundary layer
        does; a law in plain Python that keeps a past of its own, such as a `Bank`'s.

    Notes
    -----
    Breaking the loop at the torque of joint j, the others closed, leaves
    ``L_j = 1/[(I + L)^-1]_jj - 1`` with L the n-joint loop. A gain or delay common to all joints
    multiplies the eigenvalues of L, so each of those is a loop like one joint's (generalised
    Nyquist criterion: MacFarlane and Postlethwaite, International Journal of Control 25, 1977).
    """
    step = checks.sampling_step(step)
    omega = frequencies(step)
    z = np.exp(1j * omega * step)
    plant = linear_arm(arm, arm.home, step=step)
    law = linearised(controller, arm, arm.home, step=step, horizon=horizon)
    whole = law.open_loop(plant)
    poles, right = np.linalg.eig(whole.closed(np.eye(arm.n)))
    modulus, left = np.abs(poles), np.linalg.inv(right)
    # What each pole makes of a push, in the angles.
    size = np.linalg.norm(right[: arm.n], axis=0) * np.linalg.norm(left @ whole.b, axis=1)
    seen = (size >= DOMINANT_PART * size.max()) | (modulus >= 1.0)
    pole = np.log(complex(poles[np.argmax(np.where(seen, modulus, 0.0))])) / step
    loop = -law.response(z) @ plant.response(z)
    sensitivity = np.linalg.inv(np.eye(arm.n) + loop)
    own = np.asarray(1.0 / np.diagonal(sensitivity, axis1=1, axis2=2) - 1.0, np.complex128)
    alone = np.array([_margins(omega, locus) for locus in own.T]).T
    together = np.array([_margins(omega, locus) for locus in _loci(loop)]).T
    found: Any = (*alone, *map(float, (together[0].min(), together[1].max(), together[3].min())))
    radius = float(modulus.max())
    return StabilityReport(
        arm.joint_names, radius < 1.0, radius, complex(pole.real, abs(pole.imag)), *found
    )


def _loci(loop: ComplexArray) -> ComplexArray:
    """Return the eigenvalues of a loop as continuous curves, (n, K), from its values, (K, n, n)."""
    from scipy.optimize import linear_sum_assignment

    loci = np.linalg.eigvals(loop)
    for k in range(1, len(loci)):
        # Each curve goes on where it moves least, as a part of its size, all considered together.
        here, last = loci[k], loci[k - 1][:, np.newaxis]
        moved = np.abs(here - last) / (np.abs(here) + np.abs(last) + 1e-300)
        loci[k] = here[linear_sum_assignment(moved)[1]]
    return np.asarray(loci.T)


def _margins(omega: FloatArray, loop: ComplexArray) -> tuple[float, ...]:
    """Return gain margin, gain reduction, phase margin, delay margin and crossover of one loop."""
    factors = critical_gain(loop)
    up = float(factors[factors >= 1.0].min(initial=np.inf))
    down = float(factors[factors < 1.0].max(initial=0.0))
    at, values = crossings(omega, loop, lambda x: np.log(np.abs(x) + 1e-300))
    phases = np.angle(-values)  # in (-pi, pi]
    if not len(at):
        return up, down, np.inf, np.inf, np.nan
    least = int(np.argmin(np.abs(phases)))
    # A delay turns the loop clockwise: from a phase margin below 0 it takes most of a turn.
    lag = np.mod(phases, 2.0 * np.pi) / at
    return up, down, float(phases[least]), float(lag.min()), float(at[least])


def frequencies(step: float, lowest: float = LOWEST) -> FloatArray:
    """Return angular frequencies [rad/s] from `lowest` to Nyquist's, evenly spread over decades."""
    highest = np.pi / step
    return np.geomspace(lowest, highest, int(np.ceil(DENSITY * np.log10(highest / lowest))))


def crossings(
    omega: FloatArray, loop: ComplexArray, level: Callable[[ComplexArray], FloatArray]
) -> tuple[FloatArray, ComplexArray]:
    """Return where ``level(loop)`` changes sign, and the loop there, interpolated."""
    values = level(loop)
    k = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    part = values[k] / (values[k] - values[k + 1])
    at = omega[k] * (omega[k + 1] / omega[k]) ** part
    return at, loop[k] + part * (loop[k + 1] - loop[k])


def critical_gain(loop: ComplexArray) -> FloatArray:
    """Return the factors at which loops along all frequencies, (K,), pass through -1.

    At Nyquist's own frequency, the last, everything is real: no change of sign announces it.
    """
    _, at = crossings(np.arange(1.0, len(loop) + 1.0), loop, lambda x: np.asarray(x.imag))
    real = np.append(at.real, loop[-1].real)
    return np.asarray(1.0 / np.abs(real[real < 0.0]))


def critical_derivative(design: Design, order: float, *, step: float, horizon: float) -> float:
    """Return the Kd at which ``Kd D^mu`` alone makes a joint of inertia 1 unstable.

    The joint moves as the simulation has it. With mu = 1 this is 2/h, reached at Nyquist's
    frequency; a lower order lags, so its loop breaks at a lower frequency, near mu pi/h.
    """
    z = np.exp(1j * frequencies(step, lowest=1e-2 / step) * step)
    operator = modes_of(design, order, step=step, horizon=horizon).recursion().response(1.0 / z)
    speed = step / (z - 1.0)
    loop = speed * (operator[:, 0] * step * z / (z - 1.0) + operator[:, 1])
    found = critical_gain(np.asarray(loop, np.complex128))
    return float(found.min()) if found.size else np.inf


@checked
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
        By how much measurements are late [s], at most 200 steps.
    noise
        Part by which the torque may vary more.

    Raises
    ------
    ArgumentError
        As for `stability_report`; a longer delay.

    Warns
    -----
    FpidWarning
        Where the law alone, on the exact arm at home, does not bear the delay: it is 0 then.

    Notes
    -----
    With a weak law the observer's loop is ``omega^2/(s (s + 2 omega))``, whose delay margin is
    2.74/omega: 27 ms at 100 rad/s. Next to a law of its own bandwidth there is less.
    """
    step = checks.sampling_step(step)
    checks.number("delay", delay, low=0.0)
    delay = checks.number("delay", delay, high=MOST_LATE * step)
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
            stacklevel=4,
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
