"""Adaptive control of an arm with unknown inertial parameters (Slotine and Li)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.bodies import bodies_of, inertial_numbers
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.parameters import check_gains
from fpid_pin.descriptions import described
from fpid_pin.kernels.functions import winds_up
from fpid_pin.kernels.newton_euler import gradient, inverse_dynamics, velocities

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Reference speed below which dry friction counts as smooth, rad/s: a few times what an encoder
#: resolves, so that the estimate's torque does not chatter where v_r crosses zero.
FRICTION_SPEED = 0.05
#: Columns of the law's own array, a row a body: the estimates (ten inertial numbers, F_v, F_d),
#: where they began, how fast they move, the gradient of the ten; what inverse dynamics is asked.
ESTIMATE, START, RATE, GRADIENT = 0, 12, 24, 36
ANGLE, SPEED, REFERENCE_SPEED, REFERENCE_ACCELERATION, SURFACE, TORQUE = range(46, 52)
COLUMNS = 52
#: Which of the twelve numbers are friction's.
VISCOUS, DRY = 10, 11


@described("slotine_li")
@dataclass(frozen=True, eq=False)
class SlotineLi(Controller):
    """``u = Y(q, q', v_r, v'_r) theta - s_j K_D S`` with ``theta' = -Gamma Y^T S``.

    v_r = q'_d + slope e, S = q' - v_r, and Y theta = M v'_r + C v_r + G is linear in the ten
    inertial parameters of each link. S tends to 0 in continuous time whatever the parameters
    (Slotine and Li, International Journal of Robotics Research 6(3), 1987; *Applied Nonlinear
    Control*, 1991, section 9.2). Rotor inertia counts as known. Y itself is never formed: Y theta
    is inverse dynamics with the estimated inertias, Y^T S its derivative by each of them.

    Parameters
    ----------
    slope
        [1/s], scalar or (n,).
    damping
        K_D [N m s/rad] over the scale's unit (so [1/s] with ``"inertia"``), scalar or (n,).
    adaptation_rate
        Gamma is this times the square of each parameter's natural size (mass, times its reach,
        times that squared); 0 leaves the nominal parameters.
    initial
        The estimate at t = 0 as a part of the nominal parameters: 1 trusts the model, 0 knows
        nothing.
    friction
        Whether F_v and F_d of each joint are estimated too, from 0, with the regressors v_r and
        tanh(v_r/0.05 rad/s).
    leakage
        Pull of theta towards its initial value [1/s]; against drift under noise, at the price of
        an error that no longer vanishes (sigma-modification).
    scale, observer, supervisor, name
        See `Controller`; an observer sees what the nominal model lacks, not the estimate.
    """

    slope: ArrayLike
    damping: ArrayLike
    adaptation_rate: float = 1.0
    initial: float = 1.0
    friction: bool = True
    leakage: float = 0.0
    name: str = field(default="Slotine-Li", kw_only=True)

    uses_model = True
    memory = ("s",)
    own_columns = COLUMNS

    @staticmethod
    def torques(joints: Any, own: Any, model: Any) -> None:
        """Write the torque, Y theta - s_j K_D S."""
        q, v, tau = own[:, ANGLE], own[:, SPEED], own[:, TORQUE]
        v_r, a_r = own[:, REFERENCE_SPEED], own[:, REFERENCE_ACCELERATION]
        for j in range(joints.size):
            c = joints[j]
            q[j] = c.q
            v[j] = c.v
            v_r[j] = c.v_ref + c.slope * c.e
            a_r[j] = c.a_ref + c.slope * c.e_dot
            c.s = c.v - v_r[j]
        inverse_dynamics(
            model.bodies, own, model.links, model.motions, model.gravity, q, v, v_r, a_r, tau
        )
        for j in range(joints.size):
            c = joints[j]
            friction = own[j, VISCOUS] * v_r[j] + own[j, DRY] * math.tanh(v_r[j] / FRICTION_SPEED)
            c.u_law = tau[j] + friction - c.scale * c.damping * c.s

    @staticmethod
    def adapts(joints: Any, own: Any, model: Any) -> None:
        """Move the estimates: theta' = -Gamma Y^T S - leakage (theta - theta(0)).

        A joint whose torque was cut tells nothing about the parameters while adapting to it would
        ask for more torque yet.
        """
        s = own[:, SURFACE]
        for j in range(joints.size):
            c = joints[j]
            s[j] = 0.0 if winds_up(c.cut, -c.s) else c.s
        velocities(model.bodies, model.links, s, model.motions[2])
        gradient(model.links, model.motions, own[:, GRADIENT:ANGLE])
        for j in range(joints.size):
            c = joints[j]
            v_r = own[j, REFERENCE_SPEED]
            for k in range(START):
                slope = own[j, GRADIENT + k] if k < VISCOUS else v_r * s[j]
                if k == DRY:
                    slope = math.tanh(v_r / FRICTION_SPEED) * s[j]
                pull = c.leakage * (own[j, k] - own[j, START + k])
                own[j, k] -= c.h * (own[j, RATE + k] * slope + pull)

    def numbers(self, arm: Arm, step: float, horizon: float) -> Mapping[str, ArrayLike]:
        """Return what each joint's record has: see `Controller.numbers`."""
        return {name: getattr(self, name) for name in ("slope", "damping", "leakage")}

    def arrays(self, arm: Arm, step: float, horizon: float) -> FloatArray:
        """Return estimates and rates at the start: see `Controller.arrays`."""
        own: FloatArray = np.zeros((arm.n, COLUMNS))
        own[:, :VISCOUS] = self.initial * inertial_numbers(bodies_of(arm))
        own[:, START:RATE] = own[:, :START]
        own[:, RATE:GRADIENT] = self.adaptation_rate * parameter_size(arm) ** 2
        own[:, RATE + VISCOUS : GRADIENT] *= self.friction
        return own

    def __post_init__(self) -> None:
        self.check_options()
        check_gains(self, "slope", "damping")
        for name in ("adaptation_rate", "initial", "leakage"):
            value = checks.number(name, getattr(self, name), low=0.0)
            object.__setattr__(self, name, value)
        checks.instance("friction", self.friction, bool, "true or false")


def parameter_size(arm: Arm) -> FloatArray:
    """Return the natural size of each estimated number, (n, 12): what "unknown" may mean for it.

    A link of mass m whose matter lies about r from its joint has numbers of the size m, m r and
    m r^2. Friction's size is the arm's own, or at least the torque that turns M_jj at 1 rad/s^2.
    """
    masses, radii = [], []
    for body in list(arm.model.inertias)[1:]:
        spin = float(np.trace(np.asarray(body.inertia))) / 2.0
        lever = float(np.linalg.norm(body.lever))
        radius = np.sqrt(lever**2 + spin / body.mass) if body.mass > 0.0 else 0.0
        masses.append(body.mass)
        radii.append(radius)
    mass, radius = np.array(masses), np.array(radii)
    # A link without mass of its own may still carry something: take the arm's typical one.
    mass = np.where(mass > 0.0, mass, mass.mean())
    radius = np.where(radius > 0.0, radius, radius.mean())
    inertia = np.diag(arm.mass_matrix(arm.home))
    friction = np.maximum(inertia, np.maximum(arm.viscous_friction, arm.dry_friction))
    columns = [mass, *[mass * radius] * 3, *[mass * radius**2] * 6, friction, friction]
    return np.stack(columns, axis=1)
