"""The engine of a playground: `kernels.rollout` as JavaScript, and the memory that it runs on.

The memory is one array of numbers in which each array of a robot (`kernels.records`) has its place.
Its contents at t = 0 are those that Python's own robots start from; what a slider sets is written
over them by the page. What a field of a law moves is found by trying: it is a slider where the
law's numbers go with it in proportion.
"""

import base64
import contextlib
import dataclasses
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.functions import plain_function
from fpid_pin.control.law import Controller, Integral, is_number
from fpid_pin.control.state import NODES, State
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.costs import BLOCK_ROWS
from fpid_pin.exceptions import ArgumentError, DesignError, FpidError, FpidWarning
from fpid_pin.export.javascript import HELPERS, JavaScript
from fpid_pin.export.kinds import INT, Array, Kind, bundle, real, words
from fpid_pin.export.law import INPUTS, by_name, start
from fpid_pin.export.printer import Program
from fpid_pin.fractional.design import integrate_step, modes_of
from fpid_pin.kernels.records import Rows, Sensing
from fpid_pin.kernels.rollout import rollout
from fpid_pin.simulation.engine import Robot, SensorState, horizon_of
from fpid_pin.simulation.experiment import Experiment, Payload, Sensors

#: Signals that a page can plot: the law's own, as many as this, and what every law has.
OWN_SIGNALS, SIGNALS = 6, ("u_law", "u_model", "u_s")
#: Orders between which the page interpolates what depends on them, by a polynomial through all:
#: Chebyshev's points, ends included. With 48 the weights of 24 modes come out within rounding.
POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(48) / 47)
POINTS[-1] = 1.0
#: The most samples that measurements can be late in a page.
MOST_DELAY = 63
#: What a page never changes of a controller and of an arm's bodies.
_CONSTANT = {
    "robot": (
        "first_operators", "uses_model", "inertia", "estimates", "surface", "torque", "adapt",
        "feedforward", "compensates",
    ),
    "bodies": ("slides",),
}  # fmt: skip
#: Arrays that the page fills from the step and the orders.
_BY_STEP = ("c.robot", "c.poles", "c.modes", "c.table")


def supervisor_of(e: Experiment, controller: Controller) -> Supervisor:
    """Return a law's supervisor; where it has none, the quiet one of a page's switch."""
    if controller.supervisor is not None:
        return controller.supervisor
    q, v, _ = e.motion(np.linspace(0.0, e.duration, 2001))
    bound = float(f"{1.01 * float(np.hypot(q, v).max()):.3g}")
    own = {"observer": controller.observer} if controller.observer else {}
    return Supervisor.quiet(m_x=float(f"{2.0 * bound + 1.0:.3g}"), reference_bound=bound, **own)


def one_number(name: str, value: Any) -> float:
    """Return what is the same for all joints: the page has one slider for it."""
    if np.ptp(value) > 0.0:
        raise ArgumentError(name, "one number for a page's slider", np.asarray(value).tolist())
    return float(np.max(value))


class Law:
    """A controller as a page plays it, beside `others`; FpidError where it cannot hold it.

    `state` is that at t = 0, with room for orders that come to move where its orders can;
    `supervisor` its own or the one of the page's switch; `settings` the fields that sliders can
    move, one number or one for each joint, and `moves` for each of them the numbers that it moves:
    column, and number over setting, (n,).
    """

    def __init__(
        self, controller: Controller, experiment: Experiment, others: Sequence["Law"] = ()
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
        self.supervisor = supervisor_of(experiment, law)
        changes: dict[str, Any] = {"supervisor": self.supervisor}
        if isinstance(law, AdaptiveFpid):
            # Orders may come to move.
            changes["order_learning_rate"] = np.maximum(law.order_learning_rate, 1e-300)
        with warnings.catch_warnings(action="ignore", category=FpidWarning):
            # What a description has to say it said where it was made.
            self.state = start(replace(law, **changes), arm, self._step, self._horizon)
        #: Fields that are orders of the law's operators.
        self.orders = [x.order for x in law.operators.values() if isinstance(x.order, str)]
        self.settings: dict[str, Any] = {}
        self.moves: dict[str, list[Any]] = {}
        if isinstance(law, AdaptiveFpid):
            self._of_fpid(law)
        else:
            self._of_fields(law)

    @property
    def is_fpid(self) -> bool:
        """Whether it is an adaptive FPID."""
        return isinstance(self.controller, AdaptiveFpid)

    @property
    def has_model(self) -> bool:
        """Whether it is an adaptive FPID beside feedforward and observer."""
        return self.is_fpid and self.controller.feedforward and self.controller.observer > 0.0

    @property
    def functions(self) -> tuple[Any, ...]:
        """The law's functions, by which its rollout is printed."""
        names = ("surface", "torque", "adapt", "torques", "adapts")
        return tuple(plain_function(getattr(self.state.controller, name)) for name in names)

    @property
    def signals(self) -> list[str]:
        """Names of the numbers that a page can plot of it."""
        shown = self.state.controller.shown.values()
        own = [name for name in shown if name not in (*SIGNALS, "lyapunov")]
        return [*own[:OWN_SIGNALS], *SIGNALS]

    def follows_steps(self, steps: Collection[float]) -> bool:
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

    def _of_fpid(self, law: AdaptiveFpid) -> None:
        """Note the settings of the adaptive FPID."""
        n, plain = self._arm.n, ("integral_order", "derivative_order", "kp", "ki", "kd", "k0", "k1")
        rates, guard = np.asarray(law.order_learning_rate), law.safeguards or Safeguards()
        for name in plain:
            self._note(name, np.zeros(n) + getattr(law, name), {name: 1.0})
        # A factor of the described rates.
        gammas = zip(("gamma_p", "gamma_i", "gamma_d"), law.rates(n), strict=False)
        self._note("learning_rate", 1.0, dict(gammas))
        orders = dict.fromkeys(("integral_order_rate", "derivative_order_rate"), 1.0)
        self._note("order_learning_rate", one_number("order_learning_rate", rates), orders)
        self._note("sigma", guard.sigma, {"sigma": 1.0})
        self._note("dead_zone", guard.dead_zone, {"dead_zone": 1.0})

    def _of_fields(self, law: Controller) -> None:
        """Find the fields of a law that move its numbers in proportion."""
        options = {field.name for field in dataclasses.fields(Controller)}
        for field in dataclasses.fields(law):
            value = getattr(law, field.name)
            if field.name in options or not is_number(value):
                continue
            one = float(np.ravel(value)[0])
            each = [] if field.type in (float, "float") else [np.zeros(self._arm.n) + value]
            for chosen in (*each, one):
                # One number for all joints, or such as are not tried here.
                with contextlib.suppress(FpidError, ValueError, TypeError):
                    slopes = self._proportions(field.name, np.shape(chosen))
                    if slopes is not None:
                        self._note(field.name, chosen, slopes)
                    break
        moved = [column for name in self.moves for column, _ in self.moves[name]]
        if len(set(moved)) < len(moved):
            # Fields that move the same numbers: a page would set them as if there were one.
            self.settings, self.moves = {}, {}

    def _proportions(self, name: str, shape: tuple[int, ...]) -> dict[str, Any] | None:
        """Return the numbers that a field moves, over the field; None: not in proportion."""
        x = np.random.default_rng(0).uniform(0.3, 0.7, shape)
        tried: list[dict[str, Any]] = [{name: np.full(shape, 0.5)[()]}, {name: x[()]}]
        half, found = (self._numbers(replace(self.controller, **y), self._step) for y in tried)
        moved = [key for key in half if not np.array_equal(half[key], found[key])]
        slopes = {key: 2.0 * half[key] for key in moved}
        follows = (key and np.allclose(found[key], x * slopes[key], rtol=1e-12) for key in moved)
        return slopes if all(follows) else None

    def _note(self, name: str, value: Any, slopes: Mapping[str, Any]) -> None:
        columns = self.state.record.names.index
        self.settings[name] = np.asarray(value).tolist()
        self.moves[name] = [
            [columns(key), (np.zeros(self._arm.n) + slope).tolist()]
            for key, slope in slopes.items()
        ]

    def robot(self, h: float, supervised: bool) -> Any:
        """Return the robot's record at a step [s], without addresses: they are others each time."""
        law, guard = self.controller, self.supervisor
        # An observer is not faster than its sampling.
        ahead = None if guard.lookahead is None else max(guard.lookahead, h)
        guard = replace(guard, observer=min(guard.observer, 1.0 / h), lookahead=ahead)
        guarded = guard if supervised else None
        law = replace(law, observer=min(law.observer, 1.0 / h), supervisor=guarded)
        with warnings.catch_warnings(action="ignore", category=FpidWarning):
            robot = State(law, self._arm, step=h, horizon=self._horizon).c.robot
        robot[["surface", "torque", "adapt"]] = 0
        return robot

    def table(self) -> dict[str, Any]:
        """Return what the page needs of it."""
        law, guard = self.controller, self.supervisor
        names = list(self.state.record.names)
        operators = [
            {"order": names.index(x.order) if isinstance(x.order, str) else -1,
             "integral": isinstance(x, Integral), "adapts": x.adapts}
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
            "supervisor": {"m_x": guard.m_x, "reference_bound": guard.reference_bound},
        }


def encoded(values: Any) -> str:
    """Return numbers as base64 of their little-endian bits: no digit is lost."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


def engine(e: Experiment, laws: Sequence[Law], steps: Sequence[float]) -> tuple[str, Any]:
    """Return the printed rollouts of an experiment and its laws, and all that they start from.

    The first is JavaScript that returns the rollouts, one for each law; the second what the page
    needs to set the memory up for any of the `steps` that it offers.
    """
    program, names, table = Program(JavaScript()), list[str](), list[dict[str, Any]]()
    common = _arrays(e, laws[0].state)
    functions = [law.functions for law in laws]
    for law in laws:
        arrays = common | {
            f"c.{name}": values
            for name, values in law.state.c._replace(joints=law.state.joints)._asdict().items()
        }
        places = _places(arrays)
        # Laws of the same functions and arrays run on the same rollout.
        kinds = _kinds(f"c{functions.index(law.functions)}", arrays, places)
        program.instead = by_name(law.state.controller)
        kinds += [real(INPUTS, e.arm.n), real(e.arm.n), Array(INT, (5,))]
        names.append(program.add(rollout, kinds).name)
        first = {
            name: encoded(words(values))
            for name, values in arrays.items()
            if name not in (*_BY_STEP, "c.numbers") and words(values).any()
        }
        robots = [[encoded(words(law.robot(h, on))) for on in (False, True)] for h in steps]
        table.append(law.table() | {"places": places, "start": first, "robots": robots})
    # What a kilogram adds to the bodies' records, (n, fields): where the described payload is, else
    # at the tool.
    arm, held = e.resolved.arm, {} if e.plant is None else vars(e.plant.payload or Payload(0.0))
    more, less = (words(a.bodies) for a in (arm.with_payload(**(held | {"mass": 1.0})), arm))
    # The state of the sensors' random numbers, two integers of 128 bits.
    state = np.random.default_rng(e.seed).bit_generator.state["state"]
    design = next((law.design for law in laws if law.design is not None), None)
    return f"{HELPERS}{program.text}return [{', '.join(names)}];\n", {
        "n": e.arm.n, "modes": max(law.state.c.modes.shape[2] for law in laws),
        "words": max(one["places"]["end"] for one in table), "laws": table,
        "fields": {
            name: {field: k for k, field in enumerate(values.dtype.names)}
            for name, values in arrays.items() if values.dtype.names
        },
        "block": BLOCK_ROWS, "nodes": NODES, "points": encoded(POINTS),
        "steps": [{"step": h} | _at_step(design, h, horizon_of(e.duration)) for h in steps],
        "payload": encoded(more - less),
        "generator": {name: hex(value) for name, value in state.items()},
    }  # fmt: skip


def _arrays(e: Experiment, state: State) -> dict[str, Any]:
    """Return the arrays that all laws share, by the names of `kernels.rollout.rollout`."""
    n, kept = e.arm.n, OWN_SIGNALS + len(SIGNALS)
    robot = Robot(e, state, dynamics="compiled", limit=np.full(n, np.inf))
    sensors = SensorState(e.sensors or Sensors(), e.seed, n, e.step).records(0, 0).joints
    bundles: dict[str, Any] = {
        # Without friction's part of the rotor inertias: it depends on step and slider.
        "plant": robot.arrays._replace(bodies=robot.plant.arm.bodies),
        "sensing": Sensing(
            sensors, np.zeros((MOST_DELAY + 1, 2, n)), np.zeros((BLOCK_ROWS, 2, n))
        ),
        "rows": Rows(
            reference=np.zeros((3, BLOCK_ROWS, n)), forces=np.zeros((1, BLOCK_ROWS, n)),
            motion=np.zeros((3, BLOCK_ROWS, n)), columns=np.zeros(kept, dtype=np.int64),
            kept=np.zeros((kept, BLOCK_ROWS, n)), sums=robot.sums,
        ),
    }  # fmt: skip
    found = {
        f"{name}.{member}": values
        for name, arrays in bundles.items()
        for member, values in arrays._asdict().items()
    }
    counts = np.zeros(5, dtype=np.int64)
    return found | {"inputs": state.inputs, "torque": state.torque, "counts": counts}


def _kinds(label: str, arrays: dict[str, Any], places: dict[str, int]) -> list[Kind]:
    """Return what the printer has to know of the arrays of a rollout, whose law has a `label`."""
    kinds = list[Kind]()
    for head in ("c", "plant", "sensing", "rows"):
        names = {name.partition(".")[2]: name for name in arrays if name.startswith(f"{head}.")}
        members = {member: arrays[name] for member, name in names.items()}
        at = {member: str(places[name]) for member, name in names.items()}
        kinds.append(bundle(label if head == "c" else head, members, at, constants=_CONSTANT))
    return kinds


def _at_step(design: Any, h: float, horizon: float) -> dict[str, Any]:
    """Return poles, and what depends on the order at `POINTS`, for a step."""
    if design is None:
        return {"poles": "", "weights": ""}
    modes = modes_of(design, POINTS, step=h, horizon=horizon)
    poles = words(integrate_step(modes.poles, h))
    return {"poles": encoded(poles), "weights": encoded(modes.table().T.ravel())}


def _places(arrays: dict[str, Any]) -> dict[str, int]:
    """Return where in the memory each array begins, and where the last one ends."""
    places, at = dict[str, int](), 0
    for name, values in arrays.items():
        # A joint's records and its numbers are the same memory.
        again = name == "c.numbers"
        places[name] = places["c.joints"] if again else at
        at += 0 if again else words(values).size
    return places | {"end": at}
