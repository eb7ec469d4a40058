"""Laws that adapt nothing: PID, PD control beside the weight, computed torque, the weight alone."""

from dataclasses import dataclass, field
from typing import Annotated, Any

from numpy.typing import ArrayLike

from fpid_pin.checks import PerJoint
from fpid_pin.control.law import Controller
from fpid_pin.descriptions import described


@described("pid")
@dataclass(frozen=True, eq=False)
class Pid(Controller):
    """``u = s (Kp e + Ki int e + Kd e')``, joint by joint, without a model.

    The integral is held while a joint's torque is cut and integrating on would ask for more
    (conditional integration: Åström and Hägglund, *Advanced PID Control*, 2006, section 3.5).

    Parameters
    ----------
    kp, ki, kd
        Scalar or (n,) [N m/rad], [N m/(rad s)], [N m s/rad], over the scale's unit if any.
    scale, feedforward, observer, supervisor, name
        See `Controller`.
    """

    kp: Annotated[ArrayLike, PerJoint("N m/rad", low=0.0)]
    ki: Annotated[ArrayLike, PerJoint("N m/(rad s)", low=0.0)]
    kd: Annotated[ArrayLike, PerJoint("N m s/rad", low=0.0)]
    name: str = field(default="PID", kw_only=True)

    @staticmethod
    def torque(c: Any) -> Any:
        """Return u over the scale."""
        return c.kp * c.e + c.ki * c.int_e + c.kd * c.e_dot


@described("pd_gravity")
@dataclass(frozen=True, eq=False)
class PdGravity(Controller):
    """``u = s (Kp e + Kd e' + Ki int e) + G(q)``, G of the nominal model at the measured pose.

    Globally asymptotically stable for set points on the exact model (Takegaki and Arimoto, ASME
    Journal of Dynamic Systems, Measurement, and Control 103, 1981; Siciliano et al., *Robotics*,
    2009, section 8.5.1). A wrong model leaves an offset, unless the integral removes it or an
    observer does.

    Parameters
    ----------
    kp, kd
        Scalar or (n,) [N m/rad], [N m s/rad], over the scale's unit if any.
    ki
        Of the integral [N m/(rad s)], likewise, held where the torque is cut; 0: none.
    scale, observer, supervisor, name
        See `Controller`.
    """

    kp: Annotated[ArrayLike, PerJoint("N m/rad", low=0.0)]
    kd: Annotated[ArrayLike, PerJoint("N m s/rad", low=0.0)]
    ki: Annotated[ArrayLike, PerJoint("N m/(rad s)", low=0.0)] = 0.0
    name: str = field(default="PD + gravity", kw_only=True)

    # At rest, w = 0 and a = 0, the model's part is G alone.
    uses_model = True

    @staticmethod
    def torque(c: Any) -> Any:
        """Return the torque beside gravity's, over the scale."""
        return c.kp * c.e + c.kd * c.e_dot + c.ki * c.int_e


@described("computed_torque")
@dataclass(frozen=True, eq=False)
class ComputedTorque(Controller):
    """u* of (8) with what is known of the arm: ``C q' + G + M (q''_d + k1 e' + k0 e)``.

    The unknown D is left out. On the exact model ``e'' + k1 e' + k0 e = 0``. As people use it on
    arms that they know less well, with ``ki int e`` inside the bracket or an observer of D.

    Parameters
    ----------
    k0, k1
        [1/s^2] and [1/s], scalar or (n,).
    ki
        Of the integral [1/s^3], scalar or (n,), held where the torque is cut; 0: none.
    observer, supervisor, name
        See `Controller`.
    """

    k0: Annotated[ArrayLike, PerJoint("1/s^2", low=0.0)] = 1.0
    k1: Annotated[ArrayLike, PerJoint("1/s", low=0.0)] = 2.0
    ki: Annotated[ArrayLike, PerJoint("1/s^3", low=0.0)] = 0.0
    name: str = field(default="computed torque", kw_only=True)

    uses_model = True

    @staticmethod
    def surface(c: Any) -> None:
        """Write what the model is asked about: M a + C(q, q') q' + G."""
        c.a = c.a_ref + c.k1 * c.e_dot + c.k0 * c.e + c.ki * c.int_e
        c.w = c.v


@described("none")
@dataclass(frozen=True, eq=False)
class GravityOnly(Controller):
    """``u = G(q)`` of the nominal model: no control but the weight, "none" in tables.

    Parameters
    ----------
    name
        What tables and figures call it.
    """

    name: str = field(default="none (gravity only)", kw_only=True)

    uses_model = True

    @staticmethod
    def torque(c: Any) -> Any:
        """Return nothing beside gravity."""
        return 0.0
