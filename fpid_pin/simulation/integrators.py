"""One step of the plants' motion, the torque held: semi-implicit Euler and RK4.

Both advance ``M q'' = tau + d - C q' - G - F_v q' - F_d sgn(q')`` for all runs at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from fpid_pin.arms import DryFriction, Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import SimulationError
from fpid_pin.simulation.plant import ResolvedPlant

# RK4 is stable on the negative real axis to -2.785; beyond half of it, it is not accurate either.
_RK4_REACH = 1.4


class Integrator(ABC):
    """Advances (q, v) by one step.

    Attributes
    ----------
    offsets
        Where in the step the disturbance is needed, as parts of it.
    """

    offsets: tuple[float, ...]

    @abstractmethod
    def advance(
        self,
        q: FloatArray,
        v: FloatArray,
        torque: FloatArray,
        disturbance: FloatArray | None,
        q_next: FloatArray,
        v_next: FloatArray,
    ) -> None:
        """Write the state after the step into `q_next`, `v_next`; all arrays (runs, n).

        `disturbance` is (len(offsets), runs, n), or None where no run has any.
        """

    def retire(self, run: int) -> None:  # noqa: B027 - only friction has a memory
        """Make a diverged run's rows exact zeros."""


class SemiImplicitEuler(Integrator):
    """``v+ = v + h a(q, v)``, ``q+ = q + h v+``; friction implicit in v+.

    Viscous friction: ``(M + h F_v) a = tau - F_v v - C v - G``, which is the forward dynamics of
    arms with h F_v added to their armature. Dry friction: a box problem (`DryFriction`).
    """

    offsets = (0.0,)

    def __init__(self, plants: Sequence[ResolvedPlant], step: float) -> None:
        runs, n = len(plants), plants[0].arm.n
        viscous = np.array([p.viscous_friction for p in plants])
        dry = np.array([p.dry_friction for p in plants])
        self._viscous = viscous if viscous.any() else None
        self._fleet = Fleet(
            [p.arm for p in plants],
            runs,
            armature=None if self._viscous is None else step * viscous,
        )
        self._dry = DryFriction(self._fleet, dry, step) if dry.any() else None
        self._step = step
        self._a, self._tau = np.zeros((runs, n)), np.zeros((runs, n))

    def advance(
        self,
        q: FloatArray,
        v: FloatArray,
        torque: FloatArray,
        disturbance: FloatArray | None,
        q_next: FloatArray,
        v_next: FloatArray,
    ) -> None:
        """See `Integrator.advance`."""
        a = self._a
        if disturbance is not None:
            torque = np.add(torque, disturbance[0], out=self._tau)
        if self._viscous is not None:
            torque = np.subtract(torque, np.multiply(self._viscous, v, out=a), out=self._tau)
        self._fleet.forward_dynamics(q, v, torque, a)
        np.multiply(a, self._step, out=a)
        np.add(v, a, out=v_next)
        if self._dry is not None:
            self._dry.apply(q, v_next)
        np.multiply(v_next, self._step, out=a)
        np.add(q, a, out=q_next)

    def retire(self, run: int) -> None:
        """See `Integrator.retire`."""
        if self._dry is not None:
            self._dry.retire(run)


class RungeKutta4(Integrator):
    """The classical fourth-order rule; for smooth plants, and for checking the other.

    Raises
    ------
    SimulationError
        Dry friction (its force jumps, so the order is lost and joints chatter) or viscous
        friction too stiff for an explicit rule at this step.
    """

    offsets = (0.0, 0.5, 1.0)

    def __init__(self, plants: Sequence[ResolvedPlant], step: float) -> None:
        for plant in plants:
            _refuse_stiff(plant, step)
        runs, n = len(plants), plants[0].arm.n
        viscous = np.array([p.viscous_friction for p in plants])
        self._viscous = viscous if viscous.any() else None
        self._fleet = Fleet([p.arm for p in plants], runs)
        self._step = step
        shape = (runs, n)
        self._k_q, self._k_v = np.zeros((4, *shape)), np.zeros((4, *shape))
        self._q, self._v, self._tau = np.zeros(shape), np.zeros(shape), np.zeros(shape)

    def _slope(
        self, stage: int, q: FloatArray, v: FloatArray, torque: FloatArray, d: FloatArray | None
    ) -> None:
        self._k_q[stage] = v
        if d is not None:
            torque = np.add(torque, d, out=self._tau)
        if self._viscous is not None:
            torque = np.subtract(torque, self._viscous * v, out=self._tau)
        self._fleet.forward_dynamics(q, v, torque, self._k_v[stage])

    def advance(
        self,
        q: FloatArray,
        v: FloatArray,
        torque: FloatArray,
        disturbance: FloatArray | None,
        q_next: FloatArray,
        v_next: FloatArray,
    ) -> None:
        """See `Integrator.advance`."""
        h = self._step
        d = (None, None, None) if disturbance is None else tuple(disturbance)
        self._slope(0, q, v, torque, d[0])
        for stage, part, at in ((1, 0.5, d[1]), (2, 0.5, d[1]), (3, 1.0, d[2])):
            np.add(q, part * h * self._k_q[stage - 1], out=self._q)
            np.add(v, part * h * self._k_v[stage - 1], out=self._v)
            self._slope(stage, self._q, self._v, torque, at)
        for x, k, x_next in ((q, self._k_q, q_next), (v, self._k_v, v_next)):
            np.add(x, h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3]), out=x_next)


def _refuse_stiff(plant: ResolvedPlant, step: float) -> None:
    arm = plant.arm
    if plant.dry_friction.any():
        joint = arm.joint_names[int(np.argmax(plant.dry_friction > 0.0))]
        raise SimulationError(
            f"rk4: dry friction on joint {joint} jumps with the sign of its speed, which no smooth "
            "rule follows; use semi_implicit_euler, which treats it implicitly"
        )
    if plant.viscous_friction.any():
        rates = np.linalg.eigvals(
            np.linalg.solve(arm.mass_matrix(arm.home), np.diag(plant.viscous_friction))
        )
        fastest = float(np.abs(rates).max())
        if step * fastest > _RK4_REACH:
            raise SimulationError(
                f"rk4: viscous friction decays at {fastest:.3g} 1/s, too stiff for a step of "
                f"{step:g} s (at most {_RK4_REACH / fastest:.2g} s); use semi_implicit_euler, "
                "which treats it implicitly"
            )


def integrator(name: str, plants: Sequence[ResolvedPlant], step: float) -> Integrator:
    """Build the integrator of that name for the plants of all runs."""
    rule = {"semi_implicit_euler": SemiImplicitEuler, "rk4": RungeKutta4}[name]
    return rule(plants, step)
