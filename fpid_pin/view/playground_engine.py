"""The engine of a playground: `kernels.rollout` as JavaScript, and the memory that it runs on.

The memory is one array of numbers in which each array of a robot (`kernels.records`) has its place,
the same one whatever the law. Its contents at t = 0 are those that Python's own robots start from;
what a slider sets is written over them by the page.
"""

from __future__ import annotations

import base64
import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpid_pin.arms.bodies import bodies_of
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.functions import plain_function
from fpid_pin.control.law import Controller, Integral
from fpid_pin.control.order_changes import NODES
from fpid_pin.control.parameters import is_number
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.exceptions import ArgumentError, DesignError, FpidError
from fpid_pin.export.javascript import HELPERS, JavaScript
from fpid_pin.export.kinds import INT, Array, bundle, real, words
from fpid_pin.export.law import INPUTS, stand_ins, start
from fpid_pin.export.printer import Program
from fpid_pin.fractional.design import modes_of
from fpid_pin.fractional.step_integrals import integrate_step
from fpid_pin.kernels.records import GIVEN, Rows, Sensing
from fpid_pin.kernels.rollout import rollout
from fpid_pin.simulation.blocks import BLOCK_ROWS
from fpid_pin.simulation.engine import Robot, horizon_of
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.plant import plant_of
from fpid_pin.simulation.sensors import Sensors, SensorState

#: Orders between which the page interpolates what depends on them, by a polynomial through all:
#: Chebyshev's points, ends included. With 48 the weights of 24 modes come out within rounding.
POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(48) / 47)
POINTS[-1] = 1.0
#: The most samples that measurements can be late in a page.
MOST_DELAY = 63
#: Signals that a page can plot: the law's own, as many as this, and what every law has.
OWN_SIGNALS, SIGNALS = 5, ("u_law", "u_model", "u_s")
#: What a page never changes of a controller and of a tree of bodies.
_CONSTANT = {
    "robot": (
        "first_operators", "declares", "inertia", "estimates", "surface", "torque", "adapt",
        "feedforward", "compensates",
    ),
    "bodies": ("parent", "slides"),
}  # fmt: skip
#: Arrays of a controller that differ from law to law at t = 0.
_OF_LAW = ("robot", "law", "own", "ops")


#: What a setting changes of a law's fields.
_Change = Callable[[Any], dict[str, Any]]


def encoded(values: Any) -> str:
    """Return numbers as base64 of their little-endian bits: no digit is lost."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


def supervisor_of(e: Experiment, controller: Controller) -> Supervisor:
    """Return a law's supervisor; where it has none, the quiet one of a page's switch."""
    if controller.supervisor is not None:
        return controller.supervisor
    q, v, _ = e.motion(np.linspace(0.0, e.duration, 2001))
    bound = float(f"{1.01 * float(np.hypot(q, v).max()):.3g}")
    own = {"observer": controller.observer} if controller.observer else {}
    return Supervisor.quiet(m_x=float(f"{2.0 * bound + 1.0:.3g}"), reference_bound=bound, **own)


class Law:
    """A controller as a page plays it.

    Parameters
    ----------
    controller, experiment
        What it is, and where.
    others
        Laws that are on the page already.

    Attributes
    ----------
    controller
        On the experiment's arm.
    state
        At t = 0, with room for orders that come to move where its orders can.
    settings : dict
        Fields that sliders can move, by name: one number, or one for each joint.
    moves : dict
        For each of them the numbers that it moves: column, change per unit, value at 0, (n,) each.

    Raises
    ------
    FpidError
        A page cannot hold it: a law in plain Python, or operators of another design than those
        of `others`, or of one without shared poles.
    """

    def __init__(
        self, controller: Controller, experiment: Experiment, others: Sequence[Law] = ()
    ) -> None:
        arm, self._step = experiment.arm, experiment.step
        self._arm, self._horizon = arm, horizon_of(experiment.duration)
        law = self.controller = controller.on(arm, step=self._step)
        self.design = law.fractional_design if law.operators else None
        if self.design is not None:
            modes = modes_of(self.design, (0.3, 0.7), step=self._step, horizon=self._horizon)
            if not modes.shared_poles:
                kind = type(self.design).__name__
                raise DesignError(f"design: expected one with shared poles, got {kind}")
            if any(other.design not in (None, self.design) for other in others):
                raise ArgumentError("design", "the same for all controllers of a page", "another")
        changes: dict[str, Any] = {"supervisor": None}
        if isinstance(law, AdaptiveFpid):
            # Orders may come to move.
            changes["order_learning_rate"] = np.maximum(law.order_learning_rate, 1e-300)
        self.state = start(dataclasses.replace(law, **changes), arm, self._step, self._horizon)
        self.settings: dict[str, Any] = {}
        self.moves: dict[str, list[Any]] = {}
        self._find_settings()

    @property
    def functions(self) -> tuple[Any, ...]:
        """The law's functions, by which its rollout is printed."""
        names = ("surface", "torque", "adapt", "torques", "adapts")
        return tuple(plain_function(getattr(self.state.controller, name)) for name in names)

    @property
    def signals(self) -> list[str]:
        """Names of the numbers that a page can plot of it."""
        own = [
            name for name in self.state.controller.shown.values() if name in self.state.record.names
        ]
        if isinstance(self.controller, AdaptiveFpid):
            own = ["kp", "ki", "kd", "integral_order", "derivative_order"]
        own = [name for name in own if name not in (*SIGNALS, "lyapunov")]
        return [*own[:OWN_SIGNALS], *SIGNALS]

    def follows_steps(self, steps: Sequence[float]) -> bool:
        """Return whether its numbers are the same at other steps."""
        here = self._numbers(self.controller, self._step)
        return all(
            np.array_equal(here[name], value)
            for h in steps
            for name, value in self._numbers(self.controller, h).items()
        )

    def _numbers(self, law: Controller, step: float) -> dict[str, Any]:
        """Return a law's numbers at the start, (n,) each, and its arrays."""
        given = law.numbers(self._arm, step, self._horizon)
        found = {name: np.zeros(self._arm.n) + np.asarray(value) for name, value in given.items()}
        return found | {"": np.asarray(law.arrays(self._arm, step, self._horizon))}

    def _changes(self) -> tuple[Controller, dict[str, tuple[Any, _Change]]]:
        """Return a law to try settings on; by setting, its value and what it changes of the law.

        A value with an axis is one for each joint.
        """
        law, n = self.controller, self._arm.n
        if not isinstance(law, AdaptiveFpid):
            options = {field.name for field in dataclasses.fields(Controller)}
            found = {}
            for field in dataclasses.fields(law):
                value = getattr(law, field.name)
                if field.name not in options and is_number(value):
                    one = field.type in (float, "float")
                    found[field.name] = (value if one else np.zeros(n) + value, _field(field.name))
            return law, found
        names = ["integral_order", "derivative_order", "kp", "ki", "kd", "k0", "k1"]
        found = {
            name: (np.zeros(n) + np.asarray(getattr(law, name)), _field(name)) for name in names
        }
        rates, guard = np.asarray(law.order_learning_rate), law.safeguards or Safeguards()
        if np.ptp(rates) > 0.0:
            raise ArgumentError(
                "order_learning_rate", "one number for a page's slider", rates.tolist()
            )
        found |= {
            # A factor of the described rates.
            "learning_rate": (1.0, lambda x: {"learning_rate": x * np.asarray(law.learning_rate)}),
            "order_learning_rate": (float(rates.max()), _field("order_learning_rate")),
            "sigma": (guard.sigma, lambda x: {"safeguards": Safeguards(sigma=x)}),
            "dead_zone": (guard.dead_zone, lambda x: {"safeguards": Safeguards(dead_zone=x)}),
        }
        free = dataclasses.replace(
            law, safeguards=None, order_learning_rate=0.5, integral_order_bounds=(0.0, 1.0),
            derivative_order_bounds=(0.0, 1.0),
        )  # fmt: skip
        return free, found

    def _find_settings(self) -> None:
        """Find the fields that move numbers in proportion, each by itself."""
        law, changes = self._changes()
        columns, rng = list(self.state.record.names), np.random.default_rng(0)

        def numbers(some: dict[str, Any]) -> dict[str, Any]:
            return self._numbers(dataclasses.replace(law, **some), self._step)

        def learn(name: str, value: Any) -> None:
            change = changes[name][1]
            low, high = (numbers(change(np.full(np.shape(value), x)[()])) for x in (0.25, 0.5))
            with np.errstate(invalid="ignore"):  # numbers may be infinite
                slopes = {
                    key: np.where(high[key] == low[key], 0.0, (high[key] - low[key]) / 0.25)
                    for key in low
                }
            x = rng.uniform(0.3, 0.7, np.shape(value))
            found = numbers(change(x[()]))
            if slopes.pop("").any() or not all(
                np.allclose(found[key], low[key] + slope * (x - 0.25), rtol=1e-12)
                for key, slope in slopes.items()
            ):
                return
            self.moves[name] = [
                [columns.index(key), slope.tolist(), (low[key] - 0.25 * slope).tolist()]
                for key, slope in slopes.items()
                if slope.any()
            ]
            self.settings[name] = np.asarray(value).tolist()

        for name, (value, _) in changes.items():
            try:
                learn(name, value)
            except (FpidError, ValueError, TypeError):
                # One number for all joints, or such as are not tried here.
                with contextlib.suppress(FpidError, ValueError, TypeError):
                    learn(name, float(np.ravel(value)[0]))
        moved = [column for name in self.moves for column, _, _ in self.moves[name]]
        if len(set(moved)) < len(moved):
            # Fields that move the same numbers: a page would set them as if there were one.
            self.settings, self.moves = {}, {}

    def table(self, e: Experiment) -> dict[str, Any]:
        """Return what the page needs of it."""
        law, s = self.controller, supervisor_of(e, self.controller)
        names = list(self.state.record.names)
        operators = [
            {
                "order": names.index(x.order) if isinstance(x.order, str) else -1,
                "integral": isinstance(x, Integral), "adapts": x.adapts,
            }
            for _, x in self.state._operators
        ]  # fmt: skip
        return {
            "fields": {name: k for k, name in enumerate(names)},
            "moves": self.moves,
            "operators": operators,
            "kept": self.signals,
            "columns": [names.index(name) for name in self.signals],
            "guarded": getattr(law, "safeguards", None) is not None,
            "kick": getattr(law, "initialisation", "") == "grunwald_letnikov",
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


def _field(name: str) -> _Change:
    return lambda x: {name: x}


def _padded(values: Any, names: Sequence[str], width: int) -> Any:
    """Return rows of numbers as records of these fields, and further ones up to a width."""
    wide = np.zeros((len(values), width))
    wide[:, : values.shape[1]] = values
    fields = [*names, *(f"unused_{k}" for k in range(len(names), width))]
    return wide.view([(name, np.float64) for name in fields])[:, 0]


class Engine:
    """The printed rollouts of one experiment and its laws, and all that they start from.

    Parameters
    ----------
    experiment, laws
        What the page begins with.
    steps
        Steps that the page offers [s].

    Attributes
    ----------
    text
        JavaScript that returns the rollouts, one for each law.

    Raises
    ------
    FpidError
        A joint that the kernels do not have, or a law with a line that cannot be printed.
    """

    def __init__(self, experiment: Experiment, laws: Sequence[Law], steps: list[float]) -> None:
        self._experiment, self._laws, self._steps = experiment, laws, steps
        self._width = max(len(law.state.record.names) for law in laws)
        self._common = self._arrays()
        self._own = [self._controller(law) for law in laws]
        # The place of each array, with room for the largest of any law.
        self._places: dict[str, int] = {}
        at = 0
        for name in [*self._common, *(f"c.{name}" for name in self._own[0])]:
            kept = name in self._common
            each = [self._common[name]] if kept else [own[name[2:]] for own in self._own]
            # A joint's records and its numbers are the same memory.
            again = name in ("c.numbers", "c.law")
            self._places[name] = self._places["c.joints"] if again else at
            at += 0 if again else max(words(values).size for values in each)
        self._words = at
        self.text = self._print()

    def _arrays(self) -> dict[str, Any]:
        """Return the arrays that all laws share, by the names of `kernels.rollout.rollout`."""
        e, n, state = self._experiment, self._experiment.arm.n, self._laws[0].state
        robot = Robot(e, state, dynamics="compiled", limit=np.full(n, np.inf))
        sensors = SensorState(e.sensors or Sensors(), e.seed, n, e.step).records(0, 0).joints
        block, kept = np.zeros((BLOCK_ROWS, n)), OWN_SIGNALS + len(SIGNALS)
        bundles: dict[str, Any] = {
            # Without friction's part of the rotor inertias: it depends on step and slider.
            "plant": robot._arrays._replace(bodies=bodies_of(robot.plant.arm)),
            "sensing": Sensing(
                sensors, np.zeros((MOST_DELAY + 1, 2, n)), np.zeros((BLOCK_ROWS, 2, n))
            ),
            "rows": Rows(
                np.stack([block] * 3), block[np.newaxis], np.stack([block] * 3),
                np.zeros(kept, dtype=np.int64), np.stack([block] * kept), robot.sums,
            ),
        }  # fmt: skip
        found = {
            f"{name}.{member}": values
            for name, arrays in bundles.items()
            for member, values in arrays._asdict().items()
        }
        counts = np.zeros(5, dtype=np.int64)
        return found | {"inputs": state.inputs, "torque": state.torque, "counts": counts}

    def _controller(self, law: Law) -> dict[str, Any]:
        """Return the arrays of a law's controller; `law` has the joints' whole records."""
        state, numbers = law.state, law.state.c.numbers
        wide = _padded(numbers, GIVEN.names, self._width)  # type: ignore[arg-type]
        own = _padded(numbers, state.record.names, self._width)
        flat = np.stack([wide[name] for name in wide.dtype.names], axis=1)
        return {**state.c._asdict(), "joints": wide, "numbers": flat, "law": own}

    def _print(self) -> str:
        program, n = Program(JavaScript()), self._experiment.arm.n
        functions = [law.functions for law in self._laws]

        def bundled(name: str, head: str, arrays: dict[str, Any]) -> Any:
            texts = {member: str(self._places[f"{head}.{member}"]) for member in arrays}
            return bundle(name, arrays, texts, constants=_CONSTANT)

        shared = [
            bundled(name, name, {
                key.partition(".")[2]: values
                for key, values in self._common.items() if key.startswith(f"{name}.")
            })
            for name in ("plant", "sensing", "rows")
        ]  # fmt: skip
        names = []
        for law, own in zip(self._laws, self._own, strict=True):
            program.stand_ins = stand_ins(law.state.controller, "law")
            # Laws of the same functions and arrays run on the same rollout.
            c = bundled(f"c{functions.index(law.functions)}", "c", own)
            kinds = [c, *shared, real(INPUTS, n), real(n), Array(INT, (5,))]
            names.append(program.add(rollout, kinds).name)
        return f"{HELPERS}{program.text}return [{', '.join(names)}];\n"

    # ------------------------------------------------------------------ for the page

    def table(self) -> dict[str, Any]:
        """Return what the page needs to set the memory up, plain values."""
        arrays = self._common | {f"c.{name}": values for name, values in self._own[0].items()}
        fields = {
            name: {field: k for k, field in enumerate(values.dtype.names)}
            for name, values in arrays.items()
            if values.dtype.names and name != "c.law"
        }
        start = {
            name: encoded(words(values))
            for name, values in arrays.items()
            # The others are 0 at t = 0, and those of a law come with it.
            if name[2:] not in (*_OF_LAW, "joints", "numbers", "poles", "modes", "table")
            and words(values).any()
        }
        design = next((law.design for law in self._laws if law.design is not None), None)
        modes = max(own["modes"].shape[2] for own in self._own)
        laws = [
            law.table(self._experiment)
            | {"start": {f"c.{name}": encoded(words(own[name])) for name in _OF_LAW}}
            for law, own in zip(self._laws, self._own, strict=True)
        ]
        return {
            "n": self._experiment.arm.n, "modes": modes, "width": self._width,
            "words": self._words, "places": self._places, "fields": fields, "start": start,
            "laws": laws, "block": BLOCK_ROWS, "nodes": NODES, "points": encoded(POINTS),
            "steps": [{"step": h} | self._at_step(design, h) for h in self._steps],
            "payload": encoded(self._payload()), "generator": self._generator(),
        }  # fmt: skip

    def _at_step(self, design: Any, h: float) -> dict[str, Any]:
        """Return poles, and what depends on the order at `POINTS`, for a step."""
        if design is None:
            return {"poles": "", "weights": ""}
        horizon = horizon_of(self._experiment.duration)
        modes = modes_of(design, POINTS, step=h, horizon=horizon)
        poles = np.stack(list(integrate_step(modes.poles.reshape(1, -1), h)), axis=-1)
        return {"poles": encoded(poles.ravel()), "weights": encoded(modes.table().T.ravel())}

    def _payload(self) -> Any:
        """Return what a kilogram at the tool adds to the bodies' records, (n, fields)."""
        arm = plant_of(self._experiment).arm
        more, less = (words(bodies_of(a)).reshape(arm.n, -1) for a in (arm.with_payload(1.0), arm))
        return (more - less).ravel()

    def _generator(self) -> dict[str, str]:
        """Return the state of the sensors' random numbers, two integers of 128 bits."""
        state = np.random.default_rng(self._experiment.seed).bit_generator.state["state"]
        return {name: hex(value) for name, value in state.items()}
