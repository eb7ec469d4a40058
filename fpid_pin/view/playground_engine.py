"""The engine of a playground: `kernels.rollout` as JavaScript, and the memory that it runs on.

The memory is one array of numbers in which each array of a robot (`kernels.records`) has its place.
Its contents at t = 0 are those that Python's own robots start from; what a slider sets is written
over them by the page.
"""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.arms.bodies import bodies_of
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.control.order_changes import NODES
from fpid_pin.control.start import start_all
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.export.javascript import HELPERS, JavaScript
from fpid_pin.export.kinds import INT, Array, words
from fpid_pin.export.law import INPUTS, bundle, real, stand_ins
from fpid_pin.export.printer import Program
from fpid_pin.fractional.design import modes_of
from fpid_pin.fractional.step_integrals import integrate_step
from fpid_pin.kernels.records import Rows, Sensing
from fpid_pin.kernels.rollout import rollout
from fpid_pin.simulation.blocks import BLOCK_ROWS
from fpid_pin.simulation.engine import Robot, horizon_of
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.simulation.sensors import Sensors, SensorState

#: Orders between which the page interpolates what depends on them, by a polynomial through all:
#: Chebyshev's points, ends included. With 48 the weights of 24 modes come out within rounding.
POINTS = 48
#: The most samples that measurements can be late in a page.
MOST_DELAY = 63
#: Signals of a joint that the page plots.
KEPT = ("kp", "ki", "kd", "integral_order", "derivative_order")
#: What a page never changes of a controller and of a tree of bodies.
_CONSTANT = {
    "robot": ("first_operators", "declares", "inertia", "estimates", "surface", "torque", "adapt"),
    "bodies": ("parent", "slides"),
}


def encoded(values: Any) -> str:
    """Return numbers as base64 of their little-endian bits: no digit is lost."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


def require_playable(
    controller: Controller, experiment: Experiment, others: Sequence[AdaptiveFpid] = ()
) -> AdaptiveFpid:
    """Return a controller that a page can hold beside `others`.

    Raises
    ------
    ArgumentError, DesignError
        It cannot; the message says why.
    """
    controller = controller.on(experiment.arm, step=experiment.step)
    if not isinstance(controller, AdaptiveFpid):
        kind = type(controller).__name__
        raise ArgumentError("controller", "an AdaptiveFpid (a page has no other laws)", kind)
    horizon = horizon_of(experiment.duration)
    modes = modes_of(controller.design, (0.3, 0.7), step=experiment.step, horizon=horizon)
    if not modes.shared_poles:
        kind = type(controller.design).__name__
        raise DesignError(f"design: expected one with shared poles, got {kind}")
    if others and controller.design != others[0].design:
        raise ArgumentError("design", "the same for all controllers of a page", "another")
    return controller


def supervisor_of(e: Experiment, controller: AdaptiveFpid) -> Supervisor:
    """Return a law's supervisor; where it has none, the quiet one of a page's switch."""
    if controller.supervisor is not None:
        return controller.supervisor
    q, v, _ = e.motion(np.linspace(0.0, e.duration, 2001))
    bound = float(f"{1.01 * float(np.hypot(q, v).max()):.3g}")
    own = {"observer": controller.observer} if controller.observer else {}
    return Supervisor.quiet(m_x=float(f"{2.0 * bound + 1.0:.3g}"), reference_bound=bound, **own)


class Engine:
    """The printed rollout of one experiment and its controllers, and all that it starts from.

    Parameters
    ----------
    experiment, controllers
        What the page begins with.
    steps
        Steps that the page offers [s].

    Attributes
    ----------
    text
        JavaScript that returns ``{rollout}``.

    Raises
    ------
    ArmError
        A joint that the kernels do not have.
    """

    def __init__(
        self, experiment: Experiment, controllers: list[AdaptiveFpid], steps: list[float]
    ) -> None:
        self._experiment, self._controllers, self._steps = experiment, controllers, steps
        self._horizon = horizon_of(experiment.duration)
        # Orders may come to move: the records of laws whose orders do have room for that. What the
        # model adds for a supervisor is set in the page.
        moving = [
            dataclasses.replace(
                c, supervisor=None, order_learning_rate=np.maximum(c.order_learning_rate, 1e-300)
            )
            for c in controllers
        ]
        self._states = start_all(
            moving, experiment.arm, step=experiment.step, horizon=self._horizon
        )
        self._arrays = self._bundles()
        self._places: dict[str, int] = {}
        at = 0
        for name, values in self._named():
            # A joint's record and its numbers are the same memory.
            self._places[name] = self._places["c.joints"] if name == "c.numbers" else at
            at += 0 if name == "c.numbers" else words(values).size
        self._words = at
        self.text = self._print()

    def _bundles(self) -> dict[str, Any]:
        """Return the arrays of the robot, as `kernels.rollout.rollout` takes them."""
        e, n, state = self._experiment, self._experiment.arm.n, self._states[0]
        robot = Robot(e, state, dynamics="compiled", limit=np.full(n, np.inf))
        sensors = SensorState(e.sensors or Sensors(), e.seed, n, e.step).records(0, 0).joints
        block = np.zeros((BLOCK_ROWS, n))
        # Without friction's part of the rotor inertias: it depends on step and slider.
        return {
            "c": state.c,
            "plant": robot._arrays._replace(bodies=bodies_of(robot.plant.arm)),
            "sensing": Sensing(
                sensors, np.zeros((MOST_DELAY + 1, 2, n)), np.zeros((BLOCK_ROWS, 2, n))
            ),
            "rows": Rows(
                np.stack([block] * 3), block[np.newaxis], np.stack([block] * 3),
                self._columns(KEPT), np.stack([block] * len(KEPT)), robot.sums,
            ),
            "inputs": state.inputs, "torque": state.torque, "counts": np.zeros(5, dtype=np.int64),
        }  # fmt: skip

    def _columns(self, names: Sequence[str]) -> Any:
        return np.array([self._states[0].record.names.index(name) for name in names])

    def _named(self) -> list[tuple[str, Any]]:
        """Return the arrays by the names that the page has for them."""
        found: list[tuple[str, Any]] = []
        for name, arrays in self._arrays.items():
            members = arrays._asdict().items() if hasattr(arrays, "_asdict") else [("", arrays)]
            found += [(f"{name}.{member}".rstrip("."), values) for member, values in members]
        state = self._states[0]
        return [(name, state.joints if name == "c.joints" else v) for name, v in found]

    def _print(self) -> str:
        alike = [
            name
            for name in ("feedforward", "compensates")
            if len({int(state.c.robot[name][0]) for state in self._states}) == 1
        ]
        constants = _CONSTANT | {"robot": (*_CONSTANT["robot"], *alike)}
        bundles = [
            bundle(
                name, self._arrays[name], {
                    place.removeprefix(f"{name}."): str(at) for place, at in self._places.items()
                },
                record=self._states[0].record if name == "c" else None, constants=constants,
            )
            for name in ("c", "plant", "sensing", "rows")
        ]  # fmt: skip
        program = Program(JavaScript(), stand_ins(self._states[0].controller))
        n = self._experiment.arm.n
        run = program.add(rollout, [*bundles, real(INPUTS, n), real(n), Array(INT, (5,))])
        return f"{HELPERS}{program.text}return {{rollout: {run.name}}};\n"

    # ------------------------------------------------------------------ for the page

    def table(self) -> dict[str, Any]:
        """Return what the page needs to set the memory up, plain values."""
        named = dict(self._named())
        memory = {name: words(values) for name, values in named.items() if name != "c.numbers"}
        order = ("integral_order", "derivative_order")
        return {
            "words": self._words,
            "places": self._places,
            "shapes": {name: list(np.shape(v)) for name, v in named.items()},
            "fields": {
                name: {field: k for k, field in enumerate(v.dtype.names)}
                for name, v in named.items()
                if v.dtype.names
            },
            # The others are 0 at t = 0.
            "memory": {name: encoded(values) for name, values in memory.items() if values.any()},
            "orderColumns": self._columns(order).tolist(),
            "laws": [self._law(k) for k in range(len(self._controllers))],
            "points": encoded(self._points),
            "steps": [{"step": h, **self._at_step(h)} for h in self._steps],
            "block": BLOCK_ROWS,
            "nodes": NODES,
            "kept": list(KEPT),
            "payload": encoded(self._payload()),
            "generator": self._generator(),
        }

    def _law(self, index: int) -> dict[str, Any]:
        """Return what a controller starts from, and what its supervisor is made from."""
        e, law, state = self._experiment, self._controllers[index], self._states[index]
        s = supervisor_of(e, law)
        parts = {"c.robot": state.c.robot, "c.joints": state.joints, "c.ops": state.c.ops}
        return {
            "start": {name: encoded(words(values)) for name, values in parts.items()},
            "guarded": law.safeguards is not None,
            "kick": law.initialisation == "grunwald_letnikov",
            "observer": law.observer,
            "supervisor": {
                "kind": s.kind, "p11": s.p[0, 0], "p12": s.p[0, 1], "p22": s.p[1, 1],
                "k0": s.k0, "k1": s.k1, "reference_bound": s.reference_bound,
                "half_smallest": 0.5 * float(np.linalg.eigvalsh(s.p)[0]),
                "layer": s.boundary_layer, "own_gravity": int(s.gravity_bound is None),
                "lookahead": s.lookahead or 0.0, "target": s.target, "trigger": s.trigger,
                "observer": s.observer, "bound": s.bound(e.arm.n).tolist(),
            },
        }  # fmt: skip

    @property
    def _points(self) -> FloatArray:
        points = 0.5 - 0.5 * np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
        points[-1] = 1.0
        return points

    def _at_step(self, h: float) -> dict[str, Any]:
        """Return poles, and what depends on the order at `POINTS` orders, for a step."""
        design = self._controllers[0].design
        modes = modes_of(design, self._points, step=h, horizon=self._horizon)
        poles = np.stack(list(integrate_step(modes.poles.reshape(1, -1), h)), axis=-1)
        # Shared by several orders: those of the descriptions, to the last bit.
        orders = np.array([c.orders(self._experiment.arm.n) for c in self._controllers])
        known = np.unique([1.0 - orders[:, 0], orders[:, 1]])
        exact = modes_of(design, known, step=h, horizon=self._horizon)
        return {
            "poles": encoded(poles.ravel()),
            "weights": encoded(modes.table().T.ravel()),
            "known": encoded(known),
            "exact": encoded(exact.table().T.ravel()),
        }

    def _payload(self) -> FloatArray:
        """Return what a kilogram at the tool adds to the bodies' records, (n, fields)."""
        arm = plant_of(self._experiment).arm
        more, less = (words(bodies_of(a)).reshape(arm.n, -1) for a in (arm.with_payload(1.0), arm))
        return np.asarray(more - less).ravel()

    def _generator(self) -> dict[str, str]:
        """Return the state of the sensors' random numbers, two integers of 128 bits."""
        state = np.random.default_rng(self._experiment.seed).bit_generator.state["state"]
        return {name: hex(value) for name, value in state.items()}
