"""All that changes while a law runs, for one robot or many in lockstep."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.control.disturbance import DisturbanceObserver
from fpid_pin.control.parameters import number_fields, stack
from fpid_pin.exceptions import SimulationError

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


class State(ABC):
    """What `runs` robots under one kind of law remember.

    Attributes
    ----------
    torque : ndarray, (runs, n)
        Of the last tick, saturated [N m]; always this buffer.
    alive : ndarray of bool, (runs,)
        Runs that have not ended.
    """

    def __init__(self, runs: int, arm: Arm, step: float) -> None:
        self.runs, self.n, self.arm = runs, arm.n, arm
        self.step = checks.number("step", step, above=0.0)
        self.torque: FloatArray = np.zeros((runs, arm.n))
        self.alive: BoolArray = np.ones(runs, dtype=np.bool_)

    @abstractmethod
    def tick(self, inputs: FloatArray) -> None:
        """Advance by one tick and write `torque`.

        Parameters
        ----------
        inputs
            Measured q, v, and the reference's q, v, a, (5, runs, n).
        """

    def signals(self) -> Mapping[str, FloatArray]:
        """Return live views of what a record should hold beside the torque."""
        return {}

    def retire(self, run: int) -> None:
        """End a run: it costs nothing from now on, and its torque is zero."""
        self.alive[run] = False
        self.torque[run] = 0.0


class LawState(State):
    """A law written in NumPy, for all runs at once.

    Attributes
    ----------
    law
        The description, with the number fields of all runs, (runs, n).
    memory : dict
        What `Controller.begin` puts here is the law's to change; in arrays the rows (first axis)
        of runs that end become zeros.
    shown : dict of ndarray
        Signals for the record, (runs, n), likewise.
    cut : ndarray, (runs, n)
        By how much the last torque was cut by the effort limit [N m].
    int_e : ndarray, (runs, n)
        What `integral` has come to [rad s].
    observer : DisturbanceObserver or None
        See `observe`.
    known : ndarray or None
        What `disturbance` is to answer, whatever an observer makes of it: to linearise laws by.
    """

    def __init__(self, controllers: Sequence[Any], arm: Arm, step: float) -> None:
        super().__init__(len(controllers), arm, step)
        shape = self.torque.shape
        self.law = stack(controllers, arm)
        self.memory: dict[str, Any] = {}
        self.shown: dict[str, FloatArray] = {}
        self.cut: FloatArray = np.zeros(shape)
        self._limit = np.broadcast_to(arm.effort_limit, shape)
        self._fleet = Fleet([arm], self.runs)
        self._last: tuple[FloatArray, FloatArray] | None = None
        self.int_e: FloatArray = np.zeros(shape)
        self.observer: DisturbanceObserver | None = None
        self.known: FloatArray | None = None
        self.law.begin(self)

    def tick(self, inputs: FloatArray) -> None:
        """See `State.tick`; what a law does wrong is told as a `SimulationError`."""
        try:
            asked = np.asarray(self.law.torque(self, *inputs), dtype=np.float64)
        except Exception as error:
            name = type(error).__name__
            raise SimulationError(f"the law raised {name}: {error}") from error
        shape = self.torque.shape
        if asked.shape != shape:
            raise SimulationError(
                f"the law's torque: expected shape {shape} (runs, joints), got {asked.shape}"
            )
        if not self.alive.all():
            asked = np.where(self.alive[:, np.newaxis], asked, 0.0)
        np.clip(asked, -self._limit, self._limit, out=self.torque)
        # As `kernels.limits.clip` has it: an overflow must not look like a torque at its limit.
        np.copyto(self.torque, asked, where=np.isinf(asked))
        np.subtract(asked, self.torque, out=self.cut)

    def signals(self) -> Mapping[str, FloatArray]:
        """See `State.signals`."""
        return self.shown

    def retire(self, run: int) -> None:
        """See `State.retire`."""
        super().retire(run)
        for array in (*self.memory.values(), *self.shown.values(), self.int_e):
            if isinstance(array, np.ndarray):
                array[run] = 0.0
        if self.observer is not None:
            self.observer.retire(run)

    # ------------------------------------------------------------------ for the law

    def winds_up(self, push: FloatArray) -> BoolArray:
        """Return where `push` would drive a torque that was cut further beyond its limit."""
        mask: BoolArray = self.cut * push > 0.0
        return mask

    def integral(self, e: FloatArray, e_dot: FloatArray) -> FloatArray:
        """Return int e, once a tick; held where the effort limit would wind it up.

        Both e and its rate are known: ``int e += h (e + e_)/2 + h^2 (e'_ - e')/12``.
        """
        h = self.step
        if self._last is not None:
            e_, e_dot_ = self._last
            growth = 0.5 * h * (e + e_) + h * h / 12.0 * (e_dot_ - e_dot)
            growth[self.winds_up(e)] = 0.0
            self.int_e += growth
        self._last = (e.copy(), e_dot.copy())
        return self.int_e

    def observe(self, bandwidth: FloatArray) -> None:
        """Ask, in `Controller.begin`, for the disturbance observer that `AdaptiveFpid` has.

        Parameters
        ----------
        bandwidth
            [rad/s], (runs, n), one for all joints of a run; 0: none.

        Raises
        ------
        ArgumentError
            An observer faster than the sampling allows.
        """
        if bandwidth.any():
            self.observer = DisturbanceObserver(self.arm, bandwidth[:, 0], self.step)

    def disturbance(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the torque that acts and that the nominal model knows nothing of, once a tick.

        (runs, n) [N m], as observed; 0 where `observe` was not asked for.
        """
        if self.known is not None:
            return self.known
        if self.observer is None:
            return np.zeros_like(q)
        return self.observer.observe(self.alive, q, v, self.torque)

    def gravity(self, q: FloatArray) -> FloatArray:
        """Return G(q) of the nominal model, (runs, n) [N m]."""
        self._fleet.gravity(q, out := np.empty_like(q))
        return out

    def coriolis(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return C(q, v) v of the nominal model, (runs, n) [N m]."""
        self._fleet.coriolis(q, v, out := np.empty_like(q))
        return out

    def inverse_dynamics(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return M a + C v + G of the nominal model, (runs, n) [N m]."""
        self._fleet.inverse_dynamics(q, v, np.ascontiguousarray(a), out := np.empty_like(q))
        return out


class KernelState(State):
    """A law written as a kernel of one robot; its numbers are records, one a joint."""

    def __init__(self, controllers: Sequence[Any], arm: Arm, step: float) -> None:
        super().__init__(len(controllers), arm, step)
        law = stack(controllers, arm)
        names = [*number_fields(law), *law.memory, "limit", "cut", "ticks"]
        dtype = np.dtype((np.record, [(name, np.float64) for name in dict.fromkeys(names)]))
        self.joints = np.zeros(self.torque.shape, dtype)
        for name in number_fields(law):
            self.joints[name] = getattr(law, name)
        self.joints["limit"] = arm.effort_limit
        self._memory = law.memory
        self._runs = _over_runs(type(law).kernel)
        # A tick of nobody: what cannot be compiled is known before anything moves.
        try:
            inputs = np.zeros((5, *self.torque.shape))
            self._runs(np.zeros_like(self.alive), self.joints, self.step, inputs, self.torque)
        except Exception as error:
            reason = str(error).strip().splitlines()[-1]
            raise SimulationError(f"the law's kernel cannot be compiled: {reason}") from error

    def tick(self, inputs: FloatArray) -> None:
        """See `State.tick`."""
        self._runs(self.alive, self.joints, self.step, inputs, self.torque)

    def signals(self) -> Mapping[str, FloatArray]:
        """Return a view of each number that the kernel keeps, (runs, n)."""
        return {name: self.joints[name] for name in self._memory}


@cache
def _over_runs(one: Callable[..., None]) -> Callable[..., None]:
    """Return a kernel that ticks all runs that are alive by a kernel of one robot."""
    import numba

    from fpid_pin.kernels.limits import saturate

    @numba.njit(error_model="numpy")
    def ticks(alive, joints, h, inputs, torque):  # type: ignore[no-untyped-def]
        for r in range(alive.size):
            if alive[r]:
                q, v, q_ref = inputs[0, r], inputs[1, r], inputs[2, r]
                one(joints[r], h, q, v, q_ref, inputs[3, r], inputs[4, r], torque[r])
                saturate(joints[r], torque[r])

    return ticks
