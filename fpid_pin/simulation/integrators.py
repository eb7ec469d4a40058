"""One step of the plants' motion, the torque held: semi-implicit Euler and RK4.

Both advance ``M q'' = tau + d - C q' - G - F_v q' - F_d sgn(q')`` for all runs at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fpid_pin.arms import DryFriction, Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import SimulationError
from fpid_pin.simulation.plant import ResolvedPlant

Indices = NDArray[np.int64]

# RK4 is stable on the negative real axis to -2.785; beyond half of it, it is not accurate either.
_RK4_REACH = 1.4


class Integrator(ABC):
    """Advances (q, v), (runs, n) each, by one step, in place.

    Parameters
    ----------
    plants
        One a run.
    step
        h [s].
    q, v
        The arrays that it advances.

    Attributes
    ----------
    offsets
        Where in the step the disturbance is needed, as parts of it.
    tau : ndarray, (runs, n)
        Torques on the arms that are held over the step: its caller writes them.
    """

    offsets: tuple[float, ...]

    def __init__(
        self, plants: Sequence[ResolvedPlant], step: float, q: FloatArray, v: FloatArray
    ) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import motion

        self._kernels, self._step = motion, step
        self._q, self._v = q, v
        self.tau: FloatArray = np.zeros_like(q)
        # What is held and what varies, together.
        self._total: FloatArray = np.zeros_like(q)
        self._viscous = np.array([p.viscous_friction for p in plants])

    @abstractmethod
    def advance(self, forces: FloatArray | None, group: Indices, k: int) -> None:
        """Advance q and v.

        Parameters
        ----------
        forces
            Disturbances, (len(offsets), K, groups, n); None where no run has any.
        group
            Which of them is a run's, (runs,).
        k
            Their row.
        """

    def retire(self, run: int) -> None:  # noqa: B027 - only friction has a memory
        """Make a diverged run's rows exact zeros."""


class SemiImplicitEuler(Integrator):
    """``v+ = v + h a(q, v)``, ``q+ = q + h v+``; friction implicit in v+.

    Viscous friction: ``(M + h F_v) a = tau - F_v v - C v - G``, which is the forward dynamics of
    arms with h F_v added to their armature. Dry friction: a box problem (`DryFriction`).
    """

    offsets = (0.0,)

    def __init__(
        self, plants: Sequence[ResolvedPlant], step: float, q: FloatArray, v: FloatArray
    ) -> None:
        super().__init__(plants, step, q, v)
        dry = np.array([p.dry_friction for p in plants])
        viscous = step * self._viscous if self._viscous.any() else None
        fleet = Fleet([p.arm for p in plants], len(q), armature=viscous)
        self._a: FloatArray = np.zeros_like(q)
        self._accelerations = fleet.bind(q, v, self.tau, self._a)
        self._disturbed = fleet.bind(q, v, self._total, self._a)
        self._dry = DryFriction(fleet, dry, step) if dry.any() else None

    def advance(self, forces: FloatArray | None, group: Indices, k: int) -> None:
        """See `Integrator.advance`."""
        if forces is None:
            self._accelerations()
        else:
            self._kernels.disturb(self.tau, forces[0], group, k, self._total)
            self._disturbed()
        if self._dry is None:
            self._kernels.euler(self._q, self._v, self._a, self._step)
        else:
            self._kernels.accelerate_all(self._v, self._a, self._step)
            self._dry.apply(self._q, self._v)
            self._kernels.coast_all(self._q, self._v, self._step)

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

    def __init__(
        self, plants: Sequence[ResolvedPlant], step: float, q: FloatArray, v: FloatArray
    ) -> None:
        for plant in plants:
            _refuse_stiff(plant, step)
        super().__init__(plants, step, q, v)
        self._fleet = Fleet([p.arm for p in plants], len(q))
        self._k: FloatArray = np.zeros((2, 4, *q.shape))
        self._stage: FloatArray = np.zeros((2, *q.shape))

    def advance(self, forces: FloatArray | None, group: Indices, k: int) -> None:
        """See `Integrator.advance`."""
        slopes, (q, v) = self._k, self._stage
        q[:], v[:] = self._q, self._v
        for stage, (part, at) in enumerate(((0.5, 0), (0.5, 1), (1.0, 1), (0.0, 2))):
            self._total[:] = self.tau
            if forces is not None:
                self._kernels.disturb(self.tau, forces[at], group, k, self._total)
            # tau brakes by the rate at the step's start; a stage has a rate of its own.
            self._total += self._viscous * (self._v - v)
            slopes[0, stage] = v
            self._fleet.forward_dynamics(q, v, self._total, slopes[1, stage])
            self._kernels.stage(self._q, self._v, slopes, stage, part * self._step, q, v)
        self._kernels.runge_kutta(self._q, self._v, slopes, self._step)


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


#: The rules by the names that experiments use.
INTEGRATORS = {"semi_implicit_euler": SemiImplicitEuler, "rk4": RungeKutta4}
