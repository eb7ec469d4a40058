"""What a supervisor is: the torque that keeps the error inside a set, eqs. (14)-(20)."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import Array, FloatArray, Number, OneOf, PerJoint
from fpid_pin.control.poses import seeded_poses
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import FpidWarning

#: At how many poses, home and seeded ones, M^-1 is looked at for `Supervisor.warn`.
POSES = 32


@described("supervisor")
@dataclass(frozen=True, eq=False)
class Supervisor(Description):
    """Supervisory control: a torque to keep V = 1/2 sum_j E_j^T P E_j, and the error, in a set.

    ``"sampled"`` acts one step ahead. Over a step in which e'' is constant V is a quadratic in
    e'', so {V <= V_T} is a ball in it, and u_s makes the least change to e'' that ends there: with
    T the look-ahead, sums over joints, z and r as in `kernels.supervisor.find_correction`, and
    M_h = M + h F_v what a torque meets over a step (viscous friction is implicit),

        u_s = M_h z/|z| clip(|z| + sum_j |M_h^-1 z/|z||_j d_u,j - r, 0, |z|)   where V >= V_on

    Where accelerations of unknown cause are reserved for and at most `tolerance`, the torque is
    unsaturated, V_on = 0 and V(0) <= V_T, V_(k+1) <= (1 - h/T) V_k + (h/T) V_T: the set is kept at
    every sample. docs/supervisor.md has the proof, and what d_u costs that reserves for torques
    along z only. `quiet` is a setting that estimates what the model lacks, in place of reserving
    for the worst; it has no such guarantee. Gains and integrals go on while it acts.

    ``"paper"`` is (20). Its guarantee, V' <= -1/2 sum E^T Q E, is one of continuous time: **in a
    sampled loop sgn is held a step too long, and it can make V worse than without** (2.9 V_M at
    1 ms against the push of benchmarks/supervisor.py, 1.9 without any). While it acts, adaptation
    and integrals are held.

    Parameters
    ----------
    m_x
        Radius M_x of the set that no joint's [q_j, q'_j] may leave; larger than
        `reference_bound`.
    reference_bound
        sup ``||[q_d,j, q'_d,j]||`` over time and joints.
    disturbance_bound
        d_u, friction included, scalar or (n,) [N m].
    gravity_bound
        G_u of (20), scalar or (n,) [N m]; None uses ``|G(q)|`` of the nominal model.
    k0, k1
        The supervisor's own error dynamics, eq. (39); not those of the sliding surface.
    weight
        Q in (15), (2, 2); the identity if None.
    boundary_layer
        Of (20): width (of w = M^-1 B^T P E) over which sgn becomes a ramp; 0 keeps sgn.
    kind
        ``"sampled"`` or ``"paper"``; ``variant`` in files, whose ``kind`` is the description's.
    lookahead
        T [s], at least the step; None: the step. Longer is gentler, and tolerates less.
    observer
        Bandwidth [rad/s] of an estimate of what the model lacks, at most 1/step; 0: none. It is
        the law's own where that has one (`AdaptiveFpid.observer`).
    target, trigger
        V_T and V_on over V_M. Noise wants a lower V_T: see docs/supervisor.md.
    """

    _path = "supervisor"

    m_x: Annotated[float, Number()]
    reference_bound: Annotated[float, Number(low=0.0)]
    disturbance_bound: Annotated[ArrayLike, PerJoint("N m", low=0.0)] = 0.0
    gravity_bound: Annotated[ArrayLike | None, PerJoint("N m", low=0.0)] = None
    k0: Annotated[float, Number("1/s^2", above=0.0)] = 0.5
    k1: Annotated[float, Number("1/s", above=0.0)] = 1.0
    weight: Annotated[ArrayLike | None, Array(shape=(2, 2))] = None
    boundary_layer: Annotated[float, Number(low=0.0)] = 0.0
    kind: Annotated[str, OneOf("sampled", "paper")] = "sampled"
    lookahead: Annotated[float | None, Number("s", above=0.0)] = None
    observer: Annotated[float, Number("rad/s", low=0.0)] = 0.0
    target: Annotated[float, Number(above=0.0)] = 1.0
    trigger: Annotated[float, Number(low=0.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.m_x <= self.reference_bound:
            expected = f"more than reference_bound ({self.reference_bound:g})"
            raise checks.ArgumentError("supervisor.m_x", expected, f"{self.m_x:g}")
        _ = self.p  # refuses a weight that is none

    @classmethod
    def quiet(cls, m_x: float, reference_bound: float, **others: Any) -> Self:
        """Return the setting that hardly shows: it looks 10 ms ahead and learns what to expect.

        Nothing is reserved for a worst case (d_u = 0): an observer of 100 rad/s estimates what
        the model lacks. The set is aimed at 2 % within, from 0.9 V_M on. `others` are further
        arguments, also in place of these four.

        It keeps the set against what its observer can follow: loads and pushes that change slowly
        beside 100 rad/s. **A jump, or a push as fast as the observer, leaves the set**: against
        (300, 120) cos 100 t N m V reaches 2.2 V_M, and 3.4 without (docs/supervisor.md). For those
        reserve d_u = `disturbance_bound`, or take a faster observer.
        """
        setting = {"lookahead": 0.01, "observer": 100.0, "target": 0.98, "trigger": 0.9}
        return cls(m_x, reference_bound, **(setting | others))

    @cached_property
    def p(self) -> FloatArray:
        """P of (15), ``A^T P + P A = -Q`` with ``A = [[0, 1], [-k0, -k1]]``, (2, 2)."""
        # Imported here: scipy.linalg is a third of the package's import time otherwise.
        from scipy.linalg import solve_continuous_lyapunov

        q = np.eye(2) if self.weight is None else np.asarray(self.weight)
        if not np.array_equal(q, q.T) or np.linalg.eigvalsh(q)[0] <= 0.0:
            expected = "a symmetric positive definite matrix"
            raise checks.ArgumentError("supervisor.weight", expected, q.tolist())
        a = np.array([[0.0, 1.0], [-self.k0, -self.k1]])
        p = solve_continuous_lyapunov(a.T, -q)
        return checks.read_only((p + p.T) / 2.0)

    @property
    def threshold(self) -> float:
        """V_M of (16), ``1/2 lambda_min(P) (M_x - sup ||Q_d||)^2``."""
        smallest = float(np.linalg.eigvalsh(self.p)[0])
        return 0.5 * smallest * (self.m_x - self.reference_bound) ** 2

    def bound(self, n: int) -> FloatArray:
        """Return what the law reserves for a joint, (n,) [N m]: d_u, in (20) with G_u."""
        total = checks.per_joint("supervisor.disturbance_bound", self.disturbance_bound, n)
        if self.kind == "paper" and self.gravity_bound is not None:
            total = total + checks.per_joint("supervisor.gravity_bound", self.gravity_bound, n)
        return total

    def tolerance(self, step: float) -> float:
        """Return r_min [rad/s^2], the largest acceleration of unknown cause with a guarantee.

        ``r_min = (1/Pi) sqrt(2 V_T (2 p12 - (T - h) p11)/T)`` with
        ``Pi = p22 + h p12 + h^2 p11/4``; 0 for a look-ahead so long that nothing is tolerated. It
        is the smallest radius of the ball of `kernels.supervisor.find_correction` while V <= V_T.
        docs/supervisor.md says what holds up to it, and what beyond. Of the sampled kind only, and
        with V_on = 0: where it waits for V >= V_on, no step that starts below is looked after.
        """
        p, ahead = self.p, step if self.lookahead is None else self.lookahead
        room = 2.0 * p[0, 1] - (ahead - step) * p[0, 0]
        size = p[1, 1] + step * p[0, 1] + step**2 * p[0, 0] / 4.0
        return float(np.sqrt(max(2.0 * self.target * self.threshold * room / ahead, 0.0)) / size)

    def warn(self, arm: Arm, step: float) -> None:
        """Warn where d_u can accelerate the errors by more than `tolerance`, at some pose.

        Compared is ``|(M + h F_v)^-1| d_u``, which no ``|D| <= d_u`` exceeds. One of the other
        kind, with an observer (which estimates what it does not know) or without d_u says nothing.
        """
        bound = self.bound(arm.n)
        if self.kind != "sampled" or self.observer > 0.0 or not bound.any():
            return
        implicit = step * np.diag(arm.viscous_friction)
        inverses = np.abs(
            np.linalg.inv([arm.mass_matrix(q) + implicit for q in seeded_poses(arm, POSES, 0)])
        )
        largest, r_min = float(np.linalg.norm(inverses @ bound, axis=1).max()), self.tolerance(step)
        if largest > r_min:
            warnings.warn(
                "supervisor.disturbance_bound: expected |M_h^-1| d_u of at most r_min = "
                f"{r_min:.4g} rad/s^2 at a step of {step:g} s, got {largest:.4g} rad/s^2: beyond, "
                "the set is kept but for the excess in docs/supervisor.md",
                FpidWarning,
                stacklevel=2,
            )

    def constants(self, step: float) -> dict[str, float]:
        """Return the constants of `kernels.records.ROBOT`; a look-ahead is at least the step."""
        p, v_m = self.p, self.threshold
        found = {"p11": p[0, 0], "p12": p[0, 1], "p22": p[1, 1], "k0": self.k0, "k1": self.k1}
        if self.kind == "paper":
            own = self.gravity_bound is None
            return found | {"threshold": v_m, "layer": self.boundary_layer, "own_gravity": own}
        ahead = step if self.lookahead is None else self.lookahead
        if ahead < step * (1.0 - 1e-12):
            raise checks.ArgumentError(
                "supervisor.lookahead", f"at least the step ({step:g} s)", f"{ahead:g} s"
            )
        found |= {"lookahead": ahead, "threshold": np.inf}
        return found | {"target": self.target * v_m, "trigger": self.trigger * v_m}
