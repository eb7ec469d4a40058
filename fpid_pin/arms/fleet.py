"""Many arms in lockstep: forward and inverse dynamics of (runs, n) arrays in few calls."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.arms.arm import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError

#: Degrees of freedom of a forest. Larger ones save calls, but Pinocchio's Data grows with their
#: cube, and so do its misses of the cache.
FOREST_SIZE = 20


class _Segment:
    """Consecutive runs that one call of Pinocchio serves, its columns forests of equal size."""

    def __init__(self, start: int, stop: int, model: Any) -> None:
        self._rows = slice(start, stop)
        self.heavy = pin.ModelPool(model, 1)
        self._model = model

    def views(self, *arrays: FloatArray) -> list[FloatArray]:
        """Return the rows of these runs as Pinocchio wants them, (nv, columns)."""
        return [array[self._rows].reshape(-1, self._model.nv).T for array in arrays]

    @cached_property
    def weightless(self) -> Any:
        """The same without gravity; made on first use, as a pool's memory is not small."""
        model = self._model.copy()
        model.gravity.linear = np.zeros(3)
        return pin.ModelPool(model, 1)


class Fleet:
    """`runs` arms advanced together.

    Parameters
    ----------
    arms
        One arm for all runs, or one a run; all with the same number of joints.
    runs
        Number of runs.
    armature
        Inertia added to the joints' own rotor inertia [kg m^2], (n,) or (runs, n): with
        ``step * viscous_friction`` here and ``- viscous_friction * v`` in the torque, viscous
        friction is integrated implicitly. The arms themselves are not touched.

    Raises
    ------
    ArgumentError
        Neither 1 nor `runs` arms, arms of different n, or a wrong shape.

    Notes
    -----
    Every method takes C-contiguous float64 arrays (runs, n) and writes into `out`, which may be
    one of them. Shapes are checked (Pinocchio does not, and reads beyond the end); dtype and order
    are the caller's word.

    Plants are rooted in one model, a *forest*, as independent trees; consecutive runs of one plant
    are also the columns of one call. Both give the bits that the run would have alone:
    nothing in the recursions joins trees or columns, and bodies are copied into a forest unaltered
    (``appendBodyToJoint`` would round them). So a population may be cut anywhere.

    M x and C q' are one recursion each, on a model without gravity.
    """

    def __init__(
        self, arms: Sequence[Arm], runs: int, *, armature: ArrayLike | None = None
    ) -> None:
        runs = checks.integer("runs", runs, low=1)
        arms = [arms] if isinstance(arms, Arm) else list(arms)
        if len(arms) not in (1, runs):
            raise ArgumentError("arms", f"1 or {runs} (one a run)", len(arms))
        for arm in arms:
            checks.instance("arms", arm, Arm, "arms")
        sizes = sorted({arm.n for arm in arms})
        if len(sizes) > 1:
            raise ArgumentError("arms", "the same number of joints in all runs", sizes)
        self.runs = runs
        self.n = sizes[0]
        self._shape = (runs, self.n)
        self._zeros = np.zeros(self._shape)
        extra = self._extra(armature)
        models: list[Any] = []
        plants: dict[tuple[bytes, bytes], int] = {}
        # For each run, the index of its private model.
        self._plant: NDArray[np.int64] = np.empty(runs, dtype=np.int64)
        for run in range(runs):
            arm = arms[run if len(arms) > 1 else 0]
            key = (arm.dynamics_key(), extra[run].tobytes())
            if key not in plants:
                plants[key] = len(models)
                model = arm.model.copy()
                model.armature = np.array(model.armature) + extra[run]
                models.append(model)
            self._plant[run] = plants[key]
        self._models = models
        self._minverse_data: dict[int, Any] = {}
        self._segments = self._cut()

    # ------------------------------------------------------------------ dynamics

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, out: FloatArray
    ) -> None:
        """Set `out` to q'' = M^-1 (tau - C q' - G) [rad/s^2]."""
        self._call(pin.abaInParallel, True, q, v, tau, out)

    def inverse_dynamics(
        self, q: FloatArray, v: FloatArray, a: FloatArray, out: FloatArray
    ) -> None:
        """Set `out` to M q'' + C q' + G [N m]."""
        self._call(pin.rneaInParallel, True, q, v, a, out)

    def gravity(self, q: FloatArray, out: FloatArray) -> None:
        """Set `out` to G(q) [N m]."""
        self._call(pin.rneaInParallel, True, q, self._zeros, self._zeros, out)

    def coriolis(self, q: FloatArray, v: FloatArray, out: FloatArray) -> None:
        """Set `out` to C(q, q') q' [N m]."""
        self._call(pin.rneaInParallel, False, q, v, self._zeros, out)

    def mass_times(self, q: FloatArray, x: FloatArray, out: FloatArray) -> None:
        """Set `out` to M(q) x."""
        self._call(pin.rneaInParallel, False, q, self._zeros, x, out)

    def inverse_mass_times(self, q: FloatArray, b: FloatArray, out: FloatArray) -> None:
        """Set `out` to M(q)^-1 b."""
        self._call(pin.abaInParallel, False, q, self._zeros, b, out)

    def inverse_mass_matrix(
        self, q: FloatArray, out: FloatArray, rows: NDArray[np.int64] | None = None
    ) -> None:
        """Write M^-1, symmetric, into `out`, (runs, n, n); or (len(rows), n, n) of some runs only.

        `q` is (runs, n) in both cases. One call of Pinocchio a run: use `inverse_mass_times`
        where a product is enough.
        """
        chosen = range(self.runs) if rows is None else rows.tolist()
        if q.shape != self._shape or out.shape != (len(chosen), self.n, self.n):
            expected = f"shapes {self._shape} and {(len(chosen), self.n, self.n)}"
            raise ArgumentError("q, out", expected, f"{q.shape} and {out.shape}")
        for k, run in enumerate(chosen):
            plant = int(self._plant[run])
            data = self._minverse_data.get(plant)
            if data is None:
                data = self._minverse_data[plant] = self._models[plant].createData()
            out[k] = pin.computeMinverse(self._models[plant], data, q[run])

    def bind(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, out: FloatArray
    ) -> Callable[[], None]:
        """Return `forward_dynamics` of these very arrays, checked once: for a loop."""
        self.forward_dynamics(q, v, tau, out)
        calls = [
            partial(pin.abaInParallel, 1, segment.heavy, *segment.views(q, v, tau, out))
            for segment in self._segments
        ]
        if len(calls) == 1:
            return calls[0]

        def every() -> None:
            for call in calls:
                call()

        return every

    # ------------------------------------------------------------------ inside

    def _extra(self, armature: ArrayLike | None) -> FloatArray:
        if armature is None:
            return np.zeros(self._shape)
        extra = checks.floats("armature", armature, low=0.0)
        if extra.shape not in ((self.n,), self._shape):
            raise ArgumentError(
                "armature", f"shape {(self.n,)} or {self._shape}", f"shape {extra.shape}"
            )
        return np.ascontiguousarray(np.broadcast_to(extra, self._shape))

    def _cut(self) -> list[_Segment]:
        """Cut the runs into column segments and forests."""
        size = max(1, FOREST_SIZE // self.n)
        edges = [0, *(np.flatnonzero(np.diff(self._plant)) + 1).tolist(), self.runs]
        segments: list[_Segment] = []
        first = 0  # of the runs that wait for a forest

        def plant_forests(stop: int) -> None:
            nonlocal first
            while first < stop:
                last = first + 1
                while last < min(first + size, stop) and self._same_gravity(first, last):
                    last += 1
                members = [self._models[plant] for plant in self._plant[first:last]]
                segments.append(_Segment(first, last, _forest(members)))
                first = last

        for start, stop in itertools.pairwise(edges):
            if stop - start < size and self.runs > stop - start:
                continue
            plant_forests(start)
            # A call costs less a tree than a column: as many equal trees as divide the runs.
            trees = max(k for k in range(1, size + 1) if (stop - start) % k == 0)
            forest = _forest([self._models[self._plant[start]]] * trees)
            segments.append(_Segment(start, stop, forest))
            first = stop
        plant_forests(self.runs)
        return segments

    def _same_gravity(self, one: int, other: int) -> bool:
        """Whether two runs may share a model, which has one gravity."""
        pair = (self._models[self._plant[run]].gravity.vector for run in (one, other))
        return np.array_equal(*pair)

    def _call(
        self,
        recursion: Any,
        heavy: bool,
        q: FloatArray,
        v: FloatArray,
        x: FloatArray,
        out: FloatArray,
    ) -> None:
        shape = self._shape
        if q.shape != shape or v.shape != shape or x.shape != shape or out.shape != shape:
            got = ", ".join(str(array.shape) for array in (q, v, x, out))
            raise ArgumentError("arrays of a fleet", f"shape {shape}", got)
        if not out.flags.c_contiguous or out.dtype != np.float64:
            # The result would land in a copy, unseen.
            raise ArgumentError("out", "a C-contiguous float64 array", f"{out.dtype} array")
        for segment in self._segments:
            pool = segment.heavy if heavy else segment.weightless
            recursion(1, pool, *segment.views(q, v, x, out))


def _forest(models: Sequence[Any]) -> Any:
    """Root copies of `models` in one model, each hanging from the world."""
    if len(models) == 1:
        return models[0]
    forest = pin.Model()
    forest.gravity = models[0].gravity
    for tree, model in enumerate(models):
        joint = 0
        for k in range(1, model.njoints):
            name = f"{tree}/{k}"
            joint = forest.addJoint(joint, model.joints[k], model.jointPlacements[k], name)
            forest.inertias[joint] = model.inertias[k]
    forest.armature = np.concatenate([np.array(model.armature) for model in models])
    return forest
