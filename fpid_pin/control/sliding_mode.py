"""Laws on a sliding surface S = q' - v_r: sliding mode, and the adaptive one of Slotine and Li."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.arms import Arm
from fpid_pin.arms.rigid_body import inertial_numbers
from fpid_pin.checks import Flag, FloatArray, Number, PerJoint
from fpid_pin.control.law import Controller
from fpid_pin.descriptions import described
from fpid_pin.kernels.functions import winds_up
from fpid_pin.kernels.records import ESTIMATES

#: Reference speed below which dry friction counts as smooth, rad/s: a few times what an encoder
#: resolves, so that the estimate's torque does not chatter where v_r crosses zero.
FRICTION_SPEED = 0.05


def reach_surface(c: Any) -> None:
    """Write v_r = q'_d + slope e, its rate, and S: the model's part is M v'_r + C v_r + G."""
    c.w = c.v_ref + c.slope * c.e
    c.a = c.a_ref + c.slope * c.e_dot
    c.s = c.v - c.w


@described("sliding_mode")
@dataclass(frozen=True, eq=False)
class SlidingMode(Controller):
    """``u = M v'_r + C v_r + G - s_j K sat(S/layer)`` on the surface S = q' - v_r.

    v_r = q'_d + slope e is the reference velocity; M, C and G are the nominal model's. With
    1/2 S^T M S as the Lyapunov function, S reaches the layer in finite time wherever the torque
    s_j K exceeds what the model leaves out; inside it the error is of the layer's width over the
    slope (Slotine and Sastry, International Journal of Control 38, 1983; Slotine and Li, *Applied
    Nonlinear Control*, 1991, sections 7.2 and 9.2).

    Parameters
    ----------
    slope
        [1/s], scalar or (n,).
    gain
        K [N m] over the scale's unit (so [1/s^2] with ``"inertia"``), scalar or (n,).
    boundary_layer
        [rad/s], scalar or (n,); 0 switches, and chatters in a sampled loop.
    scale, observer, supervisor, name
        See `Controller`.
    """

    slope: Annotated[ArrayLike, PerJoint("1/s", low=0.0)]
    gain: Annotated[ArrayLike, PerJoint("N m", low=0.0)]
    boundary_layer: Annotated[ArrayLike, PerJoint("rad/s", low=0.0)] = 0.1
    name: str = field(default="sliding mode", kw_only=True)

    uses_model = True
    shown: ClassVar = {"s": "s"}

    surface = staticmethod(reach_surface)

    @staticmethod
    def torque(c: Any) -> Any:
        """Return the switching torque over the scale."""
        # Without a layer the ramp is so steep that only its ends are left.
        ramp = c.s / max(c.boundary_layer, 1e-300)
        return -c.gain * min(max(ramp, -1.0), 1.0)


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

    slope: Annotated[ArrayLike, PerJoint("1/s", low=0.0)]
    damping: Annotated[ArrayLike, PerJoint("N m s/rad", low=0.0)]
    adaptation_rate: Annotated[float, Number(low=0.0)] = 1.0
    initial: Annotated[float, Number(low=0.0)] = 1.0
    friction: Annotated[bool, Flag] = True
    leakage: Annotated[float, Number("1/s", low=0.0)] = 0.0
    name: str = field(default="Slotine-Li", kw_only=True)

    uses_model = True
    estimates_model = True
    memory = ("viscous_hat", "dry_hat")
    shown: ClassVar = {"s": "s"}

    surface = staticmethod(reach_surface)

    @staticmethod
    def torque(c: Any) -> Any:
        """Return the friction that is estimated, and the damping, over the scale."""
        friction = c.viscous_hat * c.w + c.dry_hat * math.tanh(c.w / FRICTION_SPEED)
        return friction / c.scale - c.damping * c.s

    @staticmethod
    def adapt(c: Any) -> None:
        """Move the estimates: theta' = -Gamma Y^T S - leakage (theta - theta(0)).

        A joint whose torque was cut tells nothing about the parameters while adapting to it would
        ask for more torque yet.
        """
        s = 0.0 if winds_up(c.cut, -c.s) else c.s
        moment, inertia = c.m_rate * c.reach * c.reach, c.m_rate * c.reach**4
        c.m_hat = moved(c, c.m_hat, c.m, c.m_rate * c.by_m)
        c.h0_hat = moved(c, c.h0_hat, c.h0, moment * c.by_h0)
        c.h1_hat = moved(c, c.h1_hat, c.h1, moment * c.by_h1)
        c.h2_hat = moved(c, c.h2_hat, c.h2, moment * c.by_h2)
        c.j00_hat = moved(c, c.j00_hat, c.j00, inertia * c.by_j00)
        c.j01_hat = moved(c, c.j01_hat, c.j01, inertia * c.by_j01)
        c.j02_hat = moved(c, c.j02_hat, c.j02, inertia * c.by_j02)
        c.j11_hat = moved(c, c.j11_hat, c.j11, inertia * c.by_j11)
        c.j12_hat = moved(c, c.j12_hat, c.j12, inertia * c.by_j12)
        c.j22_hat = moved(c, c.j22_hat, c.j22, inertia * c.by_j22)
        c.viscous_hat = moved(c, c.viscous_hat, 0.0, c.friction_rate * c.w * s)
        smooth = math.tanh(c.w / FRICTION_SPEED)
        c.dry_hat = moved(c, c.dry_hat, 0.0, c.friction_rate * smooth * s)

    def numbers(self, arm: Arm, step: float, horizon: float) -> Mapping[str, ArrayLike]:
        """Return estimates, rates and gains on an arm: see `Controller.numbers`."""
        mass, reach, friction = natural_sizes(arm)
        known = self.initial * inertial_numbers(arm.bodies)
        return dict(zip(ESTIMATES, known.T, strict=True)) | {
            "slope": self.slope, "damping": self.damping, "leakage": self.leakage,
            "initial": self.initial, "reach": reach, "m_rate": self.adaptation_rate * mass**2,
            "friction_rate": self.friction * self.adaptation_rate * friction**2,
        }  # fmt: skip


def moved(c: Any, value: float, nominal: float, rate: float) -> Any:
    """Return an estimate one step later, pulled towards where it began."""
    return value - c.h * (rate + c.leakage * (value - c.initial * nominal))


def natural_sizes(arm: Arm) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mass, reach and friction of each link, (n,): what "unknown" may mean for them.

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
    return mass, radius, friction
