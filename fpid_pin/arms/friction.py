"""Dry friction as a box problem, solved exactly at every step: F_d after eq. (6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.exceptions import ArgumentError


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
        F_d [N m], (n,) or (runs, n).
    step
        h [s].

    Attributes
    ----------
    force : ndarray, (runs, n)
        l of the last step [N m]; it opposes the motion, so the joint feels -l.

    Notes
    -----
    First every joint is taken to slide on as it does: one recursion for all runs, and mostly that
    is the answer. Runs in which some joint would turn round get M^-1 and `kernels.friction`, each
    for itself, with a guess from the last step.

    A smooth tanh instead of sgn is no substitute: on light joints (1e-4 kg m^2 at 1 ms) it either
    chatters or creeps.
    """

    def __init__(self, fleet: Fleet, dry: ArrayLike, step: float) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import friction

        shape = (fleet.runs, fleet.n)
        values = checks.floats("dry friction", dry, low=0.0)
        if values.shape not in ((fleet.n,), shape):
            expected = f"shape ({fleet.n},) or {shape}"
            raise ArgumentError("dry friction", expected, f"shape {values.shape}")
        self._kernels, self._fleet = friction, fleet
        self._step = checks.number("step", step, above=0.0)
        self._dry = np.array(np.broadcast_to(values, shape))
        self._alive: BoolArray = np.ones(fleet.runs, dtype=np.bool_)
        self._turns: BoolArray = np.zeros(fleet.runs, dtype=np.bool_)
        self._stuck: BoolArray = np.zeros(shape, dtype=np.bool_)
        self._fault = np.zeros(fleet.n)
        self._speed, self._hold = np.zeros(shape), np.zeros(shape)
        self._side = np.zeros(fleet.n)
        self._matrix = np.zeros((fleet.n, fleet.n))
        self.force: FloatArray = np.zeros(shape)

    def apply(self, q: FloatArray, v_free: FloatArray) -> FloatArray:
        """Turn `v_free` into v+ in place, (runs, n) [rad/s], and return it; `force` is then l."""
        kernels, h, turns = self._kernels, self._step, self._turns
        dry, stuck, force, speed = self._dry, self._stuck, self.force, self._speed
        kernels.slide(self._alive, dry, v_free, force)
        self._fleet.inverse_mass_times(q, force, speed)
        if kernels.keeps_sliding(dry, v_free, speed, stuck, h, turns):
            self._fleet.mass_times(q, v_free, self._hold)
            if kernels.rests(dry, self._hold, stuck, force, speed, turns, h):
                runs = np.flatnonzero(turns & np.isfinite(v_free).all(axis=1))
                response = np.empty((runs.size, *self._matrix.shape))
                self._fleet.inverse_mass_matrix(q, response, rows=runs)
                response *= h
                for run, own in zip(runs, response, strict=True):
                    kernels.stick_slip(
                        own, dry[run], v_free[run], stuck[run], force[run], speed[run],
                        self._side, self._fault, self._matrix,
                    )  # fmt: skip
        v_free[:] = speed
        return v_free

    def retire(self, run: int) -> None:
        """Make a diverged run's rows zero: no friction, no work."""
        self._alive[run] = False
        self._dry[run] = 0.0
        self._stuck[run] = False
        self.force[run] = 0.0
