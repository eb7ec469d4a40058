"""The supervisory torque that keeps the error inside a set: eqs. (14)-(20)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


def lyapunov_matrix(k0: float, k1: float, weight: ArrayLike | None = None) -> FloatArray:
    """Solve (15), ``A^T P + P A = -Q``, for ``A = [[0, 1], [-k0, -k1]]``.

    Parameters
    ----------
    k0, k1
        Coefficients of ``s^2 + k1 s + k0``, [1/s^2] and [1/s]; both positive, so that A is stable.
    weight
        Q, (2, 2), symmetric and positive definite; the identity if None.

    Returns
    -------
    ndarray
        P, (2, 2). For k0 = 0.5, k1 = 1 and Q = I it is the paper's [[1.75, 1], [1, 1.5]].

    Raises
    ------
    ArgumentError
        Roots not in the open left half plane, or Q not symmetric positive definite.
    """
    # Imported here: scipy.linalg is a third of the package's import time otherwise.
    from scipy.linalg import solve_continuous_lyapunov

    k0 = checks.number("supervisor.k0", k0, above=0.0)
    k1 = checks.number("supervisor.k1", k1, above=0.0)
    q = checks.floats("supervisor.weight", np.eye(2) if weight is None else weight)
    if q.shape != (2, 2):
        raise checks.ArgumentError("supervisor.weight", "shape (2, 2)", f"shape {q.shape}")
    if not np.array_equal(q, q.T) or np.linalg.eigvalsh(q)[0] <= 0.0:
        raise checks.ArgumentError(
            "supervisor.weight", "a symmetric positive definite matrix", q.tolist()
        )
    a = np.array([[0.0, 1.0], [-k0, -k1]])
    p: FloatArray = solve_continuous_lyapunov(a.T, -q)
    return (p + p.T) / 2.0


@described("supervisor")
@dataclass(frozen=True, eq=False)
class Supervisor:
    """Supervisory control: silent while V < V_M, decisive beyond (20).

    Guarantees ``V' <= -1/2 sum_j E_j^T Q E_j`` while it acts, in continuous time, on the exact
    model, with unsaturated torque, where the bounds on G and D hold and V(0) < V_M. While it acts,
    adaptation and integrals are held: otherwise S is large and the gains run away.

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
        G_u, scalar or (n,) [N m]; None uses ``|G(q)|`` of the nominal model.
    k0, k1
        The supervisor's own error dynamics, eq. (39); not those of the sliding surface.
    weight
        Q in (15), (2, 2); the identity if None.
    boundary_layer
        Width (of w = M^-1 B^T P E) over which sgn becomes a ramp; 0 keeps sgn, which chatters in
        a sampled loop. With a layer the bound on V' holds outside it only.
    """

    m_x: float
    reference_bound: float
    disturbance_bound: ArrayLike = 0.0
    gravity_bound: ArrayLike | None = None
    k0: float = 0.5
    k1: float = 1.0
    weight: ArrayLike | None = None
    boundary_layer: float = 0.0

    def __post_init__(self) -> None:
        bound = checks.number("supervisor.reference_bound", self.reference_bound, low=0.0)
        object.__setattr__(self, "reference_bound", bound)
        m_x = checks.number("supervisor.m_x", self.m_x)
        if m_x <= bound:
            raise checks.ArgumentError(
                "supervisor.m_x", f"more than reference_bound ({bound:g})", f"{m_x:g}"
            )
        object.__setattr__(self, "m_x", m_x)
        for name in ("disturbance_bound", "gravity_bound"):
            value = getattr(self, name)
            if value is not None:
                array = checks.floats(f"supervisor.{name}", value, low=0.0, max_ndim=1)
                object.__setattr__(self, name, array)
        layer = checks.number("supervisor.boundary_layer", self.boundary_layer, low=0.0)
        object.__setattr__(self, "boundary_layer", layer)
        if self.weight is not None:
            object.__setattr__(self, "weight", checks.floats("supervisor.weight", self.weight))
        object.__setattr__(self, "k0", checks.number("supervisor.k0", self.k0, above=0.0))
        object.__setattr__(self, "k1", checks.number("supervisor.k1", self.k1, above=0.0))
        lyapunov_matrix(self.k0, self.k1, self.weight)

    @property
    def p(self) -> FloatArray:
        """P of (15), (2, 2)."""
        return lyapunov_matrix(self.k0, self.k1, self.weight)

    @property
    def threshold(self) -> float:
        """V_M of (16), ``1/2 lambda_min(P) (M_x - sup ||Q_d||)^2``."""
        smallest = float(np.linalg.eigvalsh(self.p)[0])
        return 0.5 * smallest * (self.m_x - self.reference_bound) ** 2

    def bound(self, n: int) -> FloatArray:
        """Return d_u + G_u of an arm with n joints, (n,) [N m]; d_u where G_u is the model's."""
        total = checks.per_joint("supervisor.disturbance_bound", self.disturbance_bound, n)
        if self.gravity_bound is not None:
            total = total + checks.per_joint("supervisor.gravity_bound", self.gravity_bound, n)
        return total

    def record(self) -> dict[str, float]:
        """Return the constants of `kernels.supervisor`, by name."""
        p, factor = self.p, np.linalg.cholesky(self.p)
        return {
            "l11": factor[0, 0],
            "l21": factor[1, 0],
            "l22": factor[1, 1],
            "p12": p[0, 1],
            "p22": p[1, 1],
            "k0": self.k0,
            "k1": self.k1,
            "threshold": self.threshold,
            "layer": self.boundary_layer,
            "own_gravity": self.gravity_bound is None,
        }


class Supervision:
    """The model's terms of u_s (20), for the ticks in which the supervisor of some run acts.

    Parameters
    ----------
    arm
        The nominal arm, whose M, C and G the law uses.
    runs
        Number of runs.
    """

    def __init__(self, arm: Arm, runs: int) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import supervisor

        self._kernels: Any = supervisor
        self._fleet = Fleet([arm], runs)
        self._demand, self._b, *self._terms = np.zeros((7, runs, arm.n))

    def act(self, alive: BoolArray, robots: Any, joints: Any, inputs: FloatArray,
            torque: FloatArray) -> None:  # fmt: skip
        """Add u_s to the torque of every run whose supervisor acts; see `kernels.supervisor`."""
        q, v, a_ref = inputs[0], inputs[1], inputs[4]
        gravity, coriolis, demand, feedforward, w = self._terms
        self._kernels.weigh(alive, robots, joints, self._demand, self._b)
        self._fleet.gravity(q, gravity)
        self._fleet.coriolis(q, v, coriolis)
        self._fleet.mass_times(q, self._demand, demand)
        self._fleet.mass_times(q, a_ref, feedforward)
        self._fleet.inverse_mass_times(q, self._b, w)
        self._kernels.supervise(alive, robots, joints, *self._terms, torque)
