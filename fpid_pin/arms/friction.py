"""Dry friction as a box problem, solved exactly at every step: F_d after eq. (6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError

#: Relative slack of the conditions on friction and speed, well above rounding.
_SLACK = 1e-12
#: Rounds in which every joint at fault changes sides; then one joint a round, which cannot cycle.
_BLOCK_ROUNDS = 8

BoolArray = NDArray[np.bool_]


class DryFriction:
    """Coulomb friction of all runs, implicit in the velocity.

    Given the velocity that the step would end with if there were no dry friction, finds v+ and
    the friction torque l with

        v+ = v_free - h M^-1 l,   |l_j| <= F_d,j,   l_j = F_d,j sgn(v+_j) where v+_j != 0,

    the optimality conditions of a strictly convex quadratic programme in a box, so there is one
    solution, and friction never does positive work on the arm (l_j v+_j >= 0). A joint that sticks
    has v+ = 0 exactly.

    Parameters
    ----------
    fleet
        The plants; its M includes the armature that it was given (viscous friction).
    dry
        F_d, N m, (n,) or (runs, n).
    step
        h, s.

    Attributes
    ----------
    force : ndarray, (runs, n)
        l of the last step, N m; it opposes the motion, so the joint feels -l.

    Notes
    -----
    First every joint is taken to slide on as it does: one recursion for all runs, and mostly that
    is the answer. Runs in which some joint would turn round get M^-1 and block principal
    pivoting (Júdice and Pires, Computers & Operations Research 21, 1994): a guess of which joints
    stick, from the last step; solve; exchange those at fault; repeat. Two or three rounds are
    usual. Runs do not see each other: each has its own guess and drops out when it is done.

    A smooth tanh instead of sgn is no substitute: on light joints (1e-4 kg m^2 at 1 ms) it either
    chatters or creeps.
    """

    def __init__(self, fleet: Fleet, dry: ArrayLike, step: float) -> None:
        shape = (fleet.runs, fleet.n)
        values = checks.floats("dry friction", dry, low=0.0)
        if values.shape not in ((fleet.n,), shape):
            expected = f"shape ({fleet.n},) or {shape}"
            raise ArgumentError("dry friction", expected, f"shape {values.shape}")
        self._fleet = fleet
        self._step = checks.number("step", step, above=0.0)
        self._dry = np.array(np.broadcast_to(values, shape))
        self._free = self._dry == 0.0
        self._stuck: BoolArray = np.zeros(shape, dtype=np.bool_)
        self._speed = np.empty(shape)
        self._sign = np.empty(shape)
        self._hold = np.empty(shape)
        self._identity = np.eye(fleet.n)
        self._slides: BoolArray = np.empty(shape, dtype=np.bool_)
        self.force: FloatArray = np.zeros(shape)

    def apply(self, q: FloatArray, v_free: FloatArray) -> FloatArray:
        """Turn `v_free` into v+ in place, (runs, n) rad/s, and return it; `force` is then l."""
        sign, speed, force, slides = self._sign, self._speed, self.force, self._slides
        np.sign(v_free, out=sign)
        np.multiply(self._dry, sign, out=force)
        self._fleet.inverse_mass_times(q, force, speed)
        speed *= -self._step
        speed += v_free
        # As assumed: every joint with friction still moves the way that its friction opposes.
        np.multiply(sign, speed, out=sign)
        np.greater(sign, 0.0, out=slides)
        slides |= self._free
        if slides.all():
            self._stuck[:] = False
        else:
            done = slides.all(axis=1)
            rested: BoolArray = np.asarray(self._stuck.all(axis=1))
            self._stuck[done] = False
            open_ = np.logical_and(~done, np.isfinite(v_free).all(axis=1))
            if rested.any():
                open_ &= ~self._rest(open_ & rested, q, v_free)
            runs = np.flatnonzero(open_)
            if runs.size:
                self._solve(runs, q, v_free)
        v_free[:] = speed
        return v_free

    def retire(self, run: int) -> None:
        """Make a diverged run's rows zero: no friction, no work."""
        self._dry[run] = 0.0
        self._free[run] = True
        self._stuck[run] = False
        self.force[run] = 0.0

    def _rest(self, asked: BoolArray, q: FloatArray, v_free: FloatArray) -> BoolArray:
        """Settle those runs, of the ones `asked`, in which all joints stay where they stick.

        Friction then takes up the whole momentum, l = M v_free / h: one recursion for all runs.
        """
        hold = self._hold
        self._fleet.mass_times(q, v_free, hold)
        hold /= self._step
        settled = asked & (np.abs(hold) <= self._dry).all(axis=1)
        self.force[settled] = hold[settled]
        self._speed[settled] = 0.0
        return np.asarray(settled)

    def _solve(self, runs: NDArray[np.int64], q: FloatArray, v_free: FloatArray) -> None:
        """Find v+ and l of `runs` by block principal pivoting."""
        n = self._fleet.n
        response = np.empty((runs.size, n, n))
        self._fleet.inverse_mass_matrix(q, response, rows=runs)
        response *= self._step
        dry, free = self._dry[runs], v_free[runs]
        rubs = dry > 0.0
        # Speeds below this are zero: a rounding of what the joint's own friction would do to it.
        still = -_SLACK * dry * np.diagonal(response, axis1=1, axis2=2)
        side = np.sign(free)
        stuck = (self._stuck[runs] | ~self._slides[runs]) & rubs
        last = _BLOCK_ROUNDS + 20 * n
        for rounds in range(last + 1):
            slip = np.where(stuck, 0.0, side * dry)
            goal = np.where(stuck, free - _product(response, slip), slip)
            both = stuck[:, :, None] & stuck[:, None, :]
            matrix = np.where(both, response, self._identity)
            force = np.linalg.solve(matrix, goal[:, :, None])[:, :, 0]
            ends = np.where(stuck, 0.0, free - _product(response, force))
            breaks = stuck & (np.abs(force) > dry * (1.0 + _SLACK))
            stops = rubs & (side * ends < still)
            fault = breaks | stops
            if rounds >= _BLOCK_ROUNDS:
                # Only the last joint at fault: Murty's rule, which ends for every such matrix.
                fault &= np.cumsum(fault[:, ::-1], axis=1)[:, ::-1] == 1
            finished = ~fault.any(axis=1) if rounds < last else np.ones(runs.size, dtype=np.bool_)
            if finished.any():
                where = runs[finished]
                backwards = rubs & (side * ends < 0.0)
                self._speed[where] = np.where(backwards, 0.0, ends)[finished]
                self.force[where] = np.clip(force, -dry, dry)[finished]
                self._stuck[where] = stuck[finished]
                if finished.all():
                    return
            side = np.where(breaks & fault, np.sign(force), side)
            stuck = stuck ^ fault
            if finished.any():
                left = ~finished
                runs, response, dry, free = runs[left], response[left], dry[left], free[left]
                rubs, still, side, stuck = rubs[left], still[left], side[left], stuck[left]


def _product(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return matrix @ vector of each run, without BLAS: its bits depend on the batch."""
    return np.asarray(np.einsum("kij,kj->ki", matrix, vector))
