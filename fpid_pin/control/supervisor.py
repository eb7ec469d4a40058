"""The supervisory torque that keeps the error inside a set: eqs. (14)-(20)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


def lyapunov_matrix(k0: float, k1: float, weight: ArrayLike | None = None) -> FloatArray:
    """Solve (15), ``A^T P + P A = -Q``, for ``A = [[0, 1], [-k0, -k1]]``.

    Parameters
    ----------
    k0, k1
        Coefficients of ``s^2 + k1 s + k0``, 1/s^2 and 1/s; both positive, so that A is stable.
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
        d_u, friction included, scalar or (n,), N m.
    gravity_bound
        G_u, scalar or (n,), N m; None uses ``|G(q)|`` of the nominal model.
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


class Supervision:
    """The state of the supervisors of all runs: V, who acts, and u_s.

    Parameters
    ----------
    supervisors
        One a run.
    arm
        The nominal arm, whose M, C and G the law uses.
    """

    def __init__(self, supervisors: Sequence[Supervisor], arm: Arm) -> None:
        runs, n = len(supervisors), arm.n
        shape = (runs, n)
        self._fleet = Fleet([arm], runs)
        # V = 1/2 sum_j |L^T E_j|^2 with P = L L^T: sums of squares cannot go negative.
        factors = np.array([np.linalg.cholesky(s.p) for s in supervisors])
        p = np.array([s.p for s in supervisors])

        def spread(values: FloatArray) -> FloatArray:
            return np.ascontiguousarray(np.broadcast_to(values[:, np.newaxis], shape))

        self._l11, self._l21, self._l22 = (
            spread(factors[:, i, j]) for i, j in ((0, 0), (1, 0), (1, 1))
        )
        self._p12, self._p22 = spread(p[:, 0, 1]), spread(p[:, 1, 1])
        self._k0 = spread(np.array([s.k0 for s in supervisors]))
        self._k1 = spread(np.array([s.k1 for s in supervisors]))
        self._threshold = np.array([s.threshold for s in supervisors])
        self._layer = spread(np.array([s.boundary_layer for s in supervisors]))
        self._bound = np.empty(shape)
        self._own_gravity = np.zeros(runs, dtype=bool)
        for run, s in enumerate(supervisors):
            self._bound[run] = checks.per_joint(
                "supervisor.disturbance_bound", s.disturbance_bound, n
            )
            if s.gravity_bound is None:
                self._own_gravity[run] = True
            else:
                self._bound[run] += checks.per_joint("supervisor.gravity_bound", s.gravity_bound, n)
        self.torque = np.zeros(shape)
        self.value = np.zeros(runs)
        self.acting = np.zeros(runs, dtype=bool)
        self.any_acting = False
        self._left, self._right, self._x, self._w = (np.empty(shape) for _ in range(4))

    def measure(self, e: FloatArray, e_dot: FloatArray) -> bool:
        """Evaluate V (14) and return whether the supervisor of any run acts this tick."""
        left, right = self._left, self._right
        np.multiply(self._l11, e, out=left)
        np.multiply(self._l21, e_dot, out=right)
        left += right
        np.multiply(self._l22, e_dot, out=right)
        left *= left
        right *= right
        left += right
        np.add.reduce(left, axis=1, out=self.value)
        self.value *= 0.5
        np.greater_equal(self.value, self._threshold, out=self.acting)
        acts = bool(self.acting.any())
        if self.any_acting and not acts:
            self.torque[:] = 0.0
        self.any_acting = acts
        return acts

    def act(
        self,
        q: FloatArray,
        v: FloatArray,
        a_ref: FloatArray,
        e: FloatArray,
        e_dot: FloatArray,
        u_fpid: FloatArray,
    ) -> None:
        """Evaluate u_s (20) into `torque`; only called in ticks where some run acts."""
        total, x, w = self._left, self._x, self._w
        np.abs(u_fpid, out=total)
        total += self._bound
        if self._own_gravity.any():
            self._fleet.gravity(q, x)
            np.abs(x, out=x)
            x *= self._own_gravity[:, np.newaxis]
            total += x
        self._fleet.coriolis(q, v, x)
        total += np.abs(x, out=x)
        np.multiply(self._k0, e, out=w)
        w += self._k1 * e_dot
        self._fleet.mass_times(q, w, x)
        total += np.abs(x, out=x)
        w[:] = a_ref
        self._fleet.mass_times(q, w, x)
        total += np.abs(x, out=x)
        np.multiply(self._p12, e, out=x)
        x += self._p22 * e_dot
        self._fleet.inverse_mass_times(q, x, w)
        with np.errstate(divide="ignore", invalid="ignore"):
            ramp = np.clip(w / self._layer, -1.0, 1.0)
        total *= np.where(self._layer > 0.0, ramp, np.sign(w))
        np.copyto(self.torque, 0.0)
        np.copyto(self.torque, total, where=self.acting[:, np.newaxis])

    def retire(self, run: int) -> None:
        """Silence a run's supervisor for good."""
        self._threshold[run] = np.inf
        self.torque[run] = 0.0
        self.value[run] = 0.0
