"""One step of the plants' motion, the torque held: semi-implicit Euler and RK4.

Both advance ``M q'' = tau + d - C q' - G - F_v q' - F_d sgn(q')`` for all runs at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.arms import Arm, CompiledFleet, DryFriction, Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import SimulationError
from fpid_pin.simulation.plant import ResolvedPlant

# RK4 is stable on the negative real axis to -2.785; beyond half of it, it is not accurate either.
_RK4_REACH = 1.4


class Integrator(ABC):
    """Advances states x = [q, q'], (2, runs, n), by one step, in place.

    Parameters
    ----------
    plants
        One a run.
    step
        h [s].
    x
        The array that it advances.

    Attributes
    ----------
    offsets
        Where in the step the disturbance is needed, as parts of it.
    tau : ndarray, (runs, n)
        Torques on the arms at the step's start, friction and disturbance in them: its caller
        writes them.
    """

    offsets: tuple[float, ...]

    def __init__(self, plants: Sequence[ResolvedPlant], step: float, x: FloatArray) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import motion

        self._kernels, self._step, self._x = motion, step, x
        self.tau: FloatArray = np.zeros(x.shape[1:])

    @abstractmethod
    def advance(self, plants: Any, forces: FloatArray, k: int) -> None:
        """Advance x.

        Parameters
        ----------
        plants
            Records of `kernels.motion`, (runs, n).
        forces, k
            Disturbances, (len(offsets), K, groups, n), and their row.
        """

    def retire(self, run: int) -> None:  # noqa: B027 - only friction has a memory
        """Make a diverged run's rows exact zeros."""


class SemiImplicitEuler(Integrator):
    """``v+ = v + h a(q, v)``, ``q+ = q + h v+``; friction implicit in v+.

    Viscous friction: ``(M + h F_v) a = tau - F_v v - C v - G``, which is the forward dynamics of
    arms with h F_v added to their armature. Dry friction: a box problem (`DryFriction`).
    """

    offsets = (0.0,)

    def __init__(self, plants: Sequence[ResolvedPlant], step: float, x: FloatArray) -> None:
        super().__init__(plants, step, x)
        dry = np.array([p.dry_friction for p in plants])
        viscous = np.array([p.viscous_friction for p in plants])
        armature = step * viscous if viscous.any() else None
        fleet = Fleet([p.arm for p in plants], len(plants), armature=armature)
        self._a: FloatArray = np.zeros_like(self.tau)
        self._accelerations = fleet.bind(x[0], x[1], self.tau, self._a)
        self._dry = DryFriction(fleet, dry, step) if dry.any() else None

    def advance(self, plants: Any, forces: FloatArray, k: int) -> None:
        """See `Integrator.advance`."""
        self._accelerations()
        if self._dry is None:
            self._kernels.euler(self._x, self._a, self._step)
        else:
            self._kernels.accelerate_all(self._x, self._a, self._step)
            self._dry.apply(self._x[0], self._x[1])
            self._kernels.coast_all(self._x, self._step)

    def retire(self, run: int) -> None:
        """See `Integrator.retire`."""
        if self._dry is not None:
            self._dry.retire(run)


class CompiledEuler(Integrator):
    """`SemiImplicitEuler` by the compiled rigid-body kernel, each run with a plant of its own."""

    offsets = (0.0,)

    def __init__(self, plants: Sequence[ResolvedPlant], step: float, x: FloatArray) -> None:
        super().__init__(plants, step, x)
        # Imported late: it loads numba.
        from fpid_pin.kernels import flight

        dry, viscous = (
            np.array([getattr(p, name) for p in plants])
            for name in ("dry_friction", "viscous_friction")
        )
        fleet = CompiledFleet([p.arm for p in plants], step * viscous)
        n = x.shape[-1]
        self._steps: Any = flight.steps
        self._alive = np.ones(len(plants), dtype=np.bool_)
        self.a: FloatArray = np.zeros_like(self.tau)
        still = np.zeros(dry.shape, dtype=np.bool_)
        room = np.zeros((3, n)), np.zeros((n, n)), np.zeros((n, n))
        rubbing = bool(dry.any()), dry, still, np.zeros_like(dry), *room
        arms = fleet.model, fleet.bodies, fleet.gravity, fleet.frames, fleet.mass
        self.records = (*arms, *rubbing, step)

    def advance(self, plants: Any, forces: FloatArray, k: int) -> None:
        """See `Integrator.advance`."""
        self._steps(self._alive, *self.records, self._x, self.tau, self.a)

    def retire(self, run: int) -> None:
        """See `Integrator.retire`."""
        self._alive[run] = False


class RungeKutta4(Integrator):
    """The classical fourth-order rule; for smooth plants, and for checking the other.

    Raises
    ------
    SimulationError
        Dry friction (its force jumps, so the order is lost and joints chatter) or viscous
        friction too stiff for an explicit rule at this step.
    """

    offsets = (0.0, 0.5, 1.0)

    def __init__(self, plants: Sequence[ResolvedPlant], step: float, x: FloatArray) -> None:
        for plant in plants:
            _refuse_stiff(plant, step)
        super().__init__(plants, step, x)
        self._fleet = self._dynamics([p.arm for p in plants])
        self._slopes: FloatArray = np.zeros((4, *x.shape))
        self._stage: FloatArray = np.zeros_like(x)
        self._tau: FloatArray = np.zeros_like(self.tau)

    def advance(self, plants: Any, forces: FloatArray, k: int) -> None:
        """See `Integrator.advance`."""
        slopes, stage = self._slopes, self._stage
        self._slope(self._x, self.tau, slopes[0])
        for i, (part, at) in enumerate(((0.5, 1), (0.5, 1), (1.0, 2))):
            self._kernels.stage(
                self._x, slopes[i], self.tau, plants, forces, at, k, part * self._step,
                stage, self._tau,
            )  # fmt: skip
            self._slope(stage, self._tau, slopes[i + 1])
        self._kernels.runge_kutta(self._x, slopes, self._step)

    def _dynamics(self, arms: Sequence[Arm]) -> Fleet | CompiledFleet:
        return Fleet(arms, len(arms))

    def _slope(self, x: FloatArray, tau: FloatArray, out: FloatArray) -> None:
        out[0] = x[1]
        self._fleet.forward_dynamics(x[0], x[1], tau, out[1])


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


class CompiledRungeKutta4(RungeKutta4):
    """`RungeKutta4` by the compiled rigid-body kernel."""

    def _dynamics(self, arms: Sequence[Arm]) -> Fleet | CompiledFleet:
        return CompiledFleet(arms, np.zeros((len(arms), arms[0].n)))


#: The rules by the names of integrator and dynamics that experiments use.
INTEGRATORS = {
    ("semi_implicit_euler", "pinocchio"): SemiImplicitEuler,
    ("rk4", "pinocchio"): RungeKutta4,
    ("semi_implicit_euler", "compiled"): CompiledEuler,
    ("rk4", "compiled"): CompiledRungeKutta4,
}
