"""How far a loop is from instability: margins of the linearised, sampled loop at home."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.linear import ComplexArray, linear_arm, linearised
from fpid_pin.resources import one_blas_thread
from fpid_pin.text import ReprMixin

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Frequencies per decade. Crossings between them are interpolated, which at 1.2 % apart costs less
#: than 1e-4 of a margin.
DENSITY = 200
#: Lowest frequency that is looked at [rad/s]: ten minutes a period, slower than any arm is moved.
LOWEST = 1e-2
#: Part of the largest residue, of a push in the angles, that a pole must have to dominate.
DOMINANT_PART = 0.1


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
        rows: list[dict[str, object]] = [
            {
                "joint": joint,
                "gain margin": self.gain_margin[j],
                "gain reduction": self.gain_reduction[j],
                "phase margin [deg]": np.degrees(self.phase_margin[j]),
                "delay margin [ms]": 1e3 * self.delay_margin[j],
                "crossover [rad/s]": self.crossover[j],
            }
            for j, joint in enumerate(self.joint_names)
        ]
        together = {
            "joint": "all at once",
            "gain margin": self.common_gain_margin,
            "gain reduction": self.common_gain_reduction,
            "delay margin [ms]": 1e3 * self.common_delay_margin,
        }
        return [*rows, together]

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
        remembers, and what adapts as far as that matters at rest (`linearised` says what does).
        Torque limits and dry friction are left out, and so is a supervisor: it is silent at rest.
    step, horizon
        [s].

    Raises
    ------
    ArgumentError
        What cannot be linearised: see `linearised`.

    Notes
    -----
    Breaking the loop at the torque of joint j, the others closed, leaves
    ``L_j = 1/[(I + L)^-1]_jj - 1`` with L the n-joint loop. A gain or delay common to all joints
    multiplies the eigenvalues of L, so each of those is a loop like one joint's (generalised
    Nyquist criterion: MacFarlane and Postlethwaite, International Journal of Control 25, 1977).
    """
    step = checks.number("step", step, above=0.0)
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
