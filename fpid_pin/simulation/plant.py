"""The true robot: it need not be the one that the controller believes in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.disturbances import Disturbance
from fpid_pin.exceptions import SimulationError

# RK4 is stable on the negative real axis to -2.785; beyond half of it, it is not accurate either.
_RK4_REACH = 1.4


@described("plant")
@dataclass(frozen=True, eq=False)
class Plant(Description):
    """What is simulated, (6): ``M q'' + C q' + G + F_v q' + F_d sgn(q') = U + d(t)``.

    Parameters
    ----------
    arm
        The true inertias, payload and gravity; None: those of the nominal arm.
    viscous_friction, dry_friction
        F_v [N m s/rad] and F_d [N m], scalar or (n,); None: the arm's own.
    disturbance
        d(t).
    effort_limit
        Where the drives clip [N m], scalar or (n,); None: the arm's own; inf: nowhere.
    """

    _path = "plant"

    arm: Arm | None = None
    viscous_friction: Annotated[ArrayLike | None, PerJoint("N m s/rad", low=0.0)] = None
    dry_friction: Annotated[ArrayLike | None, PerJoint("N m", low=0.0)] = None
    disturbance: Disturbance | None = None
    effort_limit: Annotated[ArrayLike | None, PerJoint("N m", above=0.0, finite=False)] = None

    def resolve(self, nominal: Arm) -> ResolvedPlant:
        """Fill what is left open from `nominal` and check every length against it."""
        arm = nominal if self.arm is None else self.arm
        if arm.n != nominal.n:
            raise checks.ArgumentError(
                "plant.arm", f"{nominal.n} joints, as the nominal arm", f"{arm.n} joints"
            )

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


def refuse_stiff(plant: ResolvedPlant, step: float) -> None:
    """Refuse a plant that Runge-Kutta's rule cannot follow.

    Raises
    ------
    SimulationError
        Dry friction (its force jumps, so the order is lost and joints chatter) or viscous friction
        too stiff for an explicit rule at this step.
    """
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
