"""How far a loop is from instability: margins of the linearised, sampled loop at home."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.baselines import Pid
from fpid_pin.control.controller import Controller
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.gains import gain_ceilings
from fpid_pin.control.parameters import joint_scale
from fpid_pin.control.sampled import (
    ComplexArray,
    LinearSystem,
    crossings,
    frequencies,
    joint_law,
    linear_arm,
    operators,
)
from fpid_pin.control.suggested import SuggestedFpid
from fpid_pin.fractional import Design, ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class StabilityReport:
    """Margins of each joint's loop, the others closed, (n,) each.

    Attributes
    ----------
    joint_names
        In the order of the arrays.
    stable
        Whether the whole loop is: every pole inside the unit circle.
    pole_radius
        Largest modulus of its poles in z.
    decay_rate
        That of its slowest motion [1/s]; negative: growth.
    gain_margin, gain_reduction
        Factors by which the joint's torque may be raised, or lowered, before the loop breaks;
        inf and 0 where it never does.
    phase_margin
        [rad]; inf where the loop's gain never passes 1.
    delay_margin
        The further dead time that the joint bears [s].
    crossover
        Where the smallest phase margin is [rad/s]; NaN where there is none.
    kd_ceiling, kd_limit
        Half of the sampled-data bound on Kd, and the bound (see `gain_ceilings`); NaN for laws
        without a Kd of their own.
    method
        How the arm moves between samples.
    """

    joint_names: tuple[str, ...]
    stable: bool
    pole_radius: float
    decay_rate: float
    gain_margin: FloatArray
    gain_reduction: FloatArray
    phase_margin: FloatArray
    delay_margin: FloatArray
    crossover: FloatArray
    kd_ceiling: FloatArray
    kd_limit: FloatArray
    method: str

    def rows(self) -> list[dict[str, object]]:
        """Return one table row a joint, labelled with units."""
        return [
            {
                "joint": joint,
                "gain margin": self.gain_margin[j],
                "gain reduction": self.gain_reduction[j],
                "phase margin [deg]": np.degrees(self.phase_margin[j]),
                "delay margin [ms]": 1e3 * self.delay_margin[j],
                "crossover [rad/s]": self.crossover[j],
                "Kd ceiling": self.kd_ceiling[j],
                "Kd limit": self.kd_limit[j],
            }
            for j, joint in enumerate(self.joint_names)
        ]

    def __str__(self) -> str:
        lines = [f"{'stable' if self.stable else 'UNSTABLE'} at home ({self.method})"]
        for row in self.rows():
            cells = [f"{k} {v:.3g}" for k, v in row.items() if isinstance(v, float)]
            lines.append(f"  {row['joint']}: " + ", ".join(cells))
        return "\n".join(lines)


def stability_report(
    arm: Arm,
    controller: Controller,
    *,
    step: float = 1e-3,
    horizon: float = 3600.0,
    gains: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    method: str = "semi_implicit_euler",
) -> StabilityReport:
    """Linearise the sampled loop at the arm's home and measure its margins.

    Parameters
    ----------
    arm
        The nominal arm, which is also taken for the plant.
    controller
        Adaptive laws count with fixed parameters: adaptation is slow beside the loop. Torque
        limits and dry friction are left out.
    step, horizon
        [s].
    gains
        Kp, Ki, Kd to use in place of an FPID's initial ones, (n,) each: what adaptation has made
        of them, ``(run.kp[-1], run.ki[-1], run.kd[-1])``.
    method
        ``"semi_implicit_euler"``, as simulated, or ``"zero_order_hold"``, a real arm.

    Raises
    ------
    ArgumentError
        A fractional design that keeps the past instead of modes.

    Notes
    -----
    Breaking the loop at the torque of joint j, the others closed, leaves
    ``L_j = 1/[(I + L)^-1]_jj - 1`` with L the n-joint loop.
    """
    step = checks.number("step", step, above=0.0)
    if isinstance(controller, SuggestedFpid):
        controller = controller.on(arm, step=step)
    n = arm.n
    law = _law(arm, controller, step, horizon, gains)
    plant = linear_arm(arm, arm.home, step=step, method=method)
    poles = np.linalg.eigvals(_closed(plant, law))
    radius = float(np.abs(poles).max())

    omega = frequencies(step)
    z = np.exp(1j * omega * step)
    path = np.zeros((len(z), n, 2 * n), dtype=np.complex128)
    for part in law:
        path[:, part.outputs[:, np.newaxis], part.inputs] = part.response(z)
    loop = path @ plant.response(z)
    sensitivity = np.linalg.inv(np.eye(n) + loop)
    margins = [
        _margins(omega, np.asarray(1.0 / sensitivity[:, j, j] - 1.0, np.complex128))
        for j in range(n)
    ]
    gain, reduction, phase, delay, crossover = np.array(margins).T
    ceiling, limit = np.full(n, np.nan), np.full(n, np.nan)
    if isinstance(controller, AdaptiveFpid):
        found = gain_ceilings(arm, controller, step=step, horizon=horizon)
        ceiling, limit = found.kd, found.kd_limit
    return StabilityReport(
        joint_names=arm.joint_names,
        stable=radius < 1.0,
        pole_radius=radius,
        decay_rate=float(-np.log(radius) / step),
        gain_margin=gain,
        gain_reduction=reduction,
        phase_margin=phase,
        delay_margin=delay,
        crossover=crossover,
        kd_ceiling=ceiling,
        kd_limit=limit,
        method=method,
    )


@dataclass(eq=False)
class _Part:
    """A part of a law: the joints whose torque it makes and which of [e, e'] it sees."""

    system: LinearSystem
    outputs: Indices
    inputs: Indices
    # Responses of the terms that several joints share, by identity, and this joint's gains.
    terms: LinearSystem | None = None
    gains: FloatArray | None = None
    shared: dict[int, ComplexArray] = field(default_factory=dict)

    def response(self, z: ComplexArray) -> ComplexArray:
        if self.terms is None or self.gains is None:
            return self.system.response(z)
        key = id(self.terms)
        if key not in self.shared:
            self.shared[key] = self.terms.response(z)
        return np.asarray(np.einsum("t,kti->ki", self.gains, self.shared[key])[:, np.newaxis])


def _law(
    arm: Arm,
    controller: Controller,
    step: float,
    horizon: float,
    gains: tuple[ArrayLike, ArrayLike, ArrayLike] | None,
) -> list[_Part]:
    n = arm.n
    if not isinstance(controller, (AdaptiveFpid, Pid)):
        return [_Part(_static(arm, controller, step), np.arange(n), np.arange(2 * n))]
    chosen = (controller.kp, controller.ki, controller.kd) if gains is None else gains
    if len(chosen) != 3:
        raise checks.ArgumentError("gains", "Kp, Ki and Kd", f"{len(chosen)} of them")
    table = np.array([checks.per_joint(f"gains.{k}", x, n, low=0.0) for k, x in enumerate(chosen)])
    table *= joint_scale(controller.scale, arm)
    orders = np.ones((2, n))
    design: Design = ExponentialSum(modes=24)
    if isinstance(controller, AdaptiveFpid):
        design = controller.design
        orders[0] = checks.per_joint("integral_order", controller.integral_order, n)
        orders[1] = checks.per_joint("derivative_order", controller.derivative_order, n)
    known: dict[tuple[float, float], LinearSystem] = {}
    shared: dict[int, ComplexArray] = {}
    law = []
    for j in range(n):
        pair = (float(orders[0, j]), float(orders[1, j]))
        if pair not in known:
            known[pair] = operators(pair, design, step=step, horizon=horizon)
        terms, column = known[pair], table[:, j]
        sees = np.array([j, n + j])
        law.append(_Part(joint_law(terms, column), np.array([j]), sees, terms, column, shared))
    return law


def _static(arm: Arm, controller: Controller, step: float) -> LinearSystem:
    """Linearise the first tick of a law without memory about home, by central differences."""
    n, width = arm.n, 1e-6
    free = arm.with_limits(effort=np.zeros(n))
    still, home = np.zeros(n), np.asarray(arm.home)
    slope = np.empty((n, 2 * n))
    for column in range(2 * n):
        shift = np.zeros(2 * n)
        shift[column] = width
        ends = []
        for sign in (1.0, -1.0):
            loop = controller.start(free, step=step)
            q, v = home + sign * shift[:n], sign * shift[n:]
            ends.append(loop.torque(q, v, home, still, still))
        slope[:, column] = (ends[0] - ends[1]) / (2.0 * width)
    empty = np.zeros((0, 0))
    # The systems of a law see e and e', which fall as q and q' rise.
    return LinearSystem(empty, np.zeros((0, 2 * n)), np.zeros((n, 0)), -slope)


def _closed(plant: LinearSystem, law: list[_Part]) -> FloatArray:
    """Return the closed loop's state matrix."""
    states = len(plant.a)
    whole = states + sum(len(part.system.a) for part in law)
    matrix = np.zeros((whole, whole))
    matrix[:states, :states] = plant.a
    at = states
    for part in law:
        system = part.system
        pick = np.zeros((len(part.inputs), states))
        pick[np.arange(len(part.inputs)), part.inputs] = -1.0  # e = -q, e' = -q'
        drive = plant.b[:, part.outputs]
        rows = slice(at, at + len(system.a))
        matrix[:states, :states] += drive @ system.d @ pick
        matrix[:states, rows] = drive @ system.c
        matrix[rows, :states] = system.b @ pick
        matrix[rows, rows] = system.a
        at = rows.stop
    return matrix


def _margins(omega: FloatArray, loop: ComplexArray) -> tuple[float, ...]:
    """Return gain margin, gain reduction, phase margin, delay margin and crossover of one loop."""
    up, down = _gain_margins(omega, loop)
    at, values = crossings(omega, loop, lambda x: np.log(np.abs(x) + 1e-300))
    phases = np.angle(-values)  # in (-pi, pi]
    if not len(at):
        return up, down, np.inf, np.inf, np.nan
    least = int(np.argmin(np.abs(phases)))
    # A delay turns the loop clockwise: from a phase margin below 0 it takes most of a turn.
    lag = np.mod(phases, 2.0 * np.pi) / at
    return up, down, float(phases[least]), float(lag.min()), float(at[least])


def _gain_margins(omega: FloatArray, loop: ComplexArray) -> tuple[float, float]:
    _, at = crossings(omega, loop, lambda x: np.asarray(x.imag))
    real = np.append(at.real, loop[-1].real)
    factors = 1.0 / np.abs(real[real < 0.0])
    above, below = factors[factors >= 1.0], factors[factors < 1.0]
    return (
        float(above.min()) if above.size else np.inf,
        float(below.max()) if below.size else 0.0,
    )
