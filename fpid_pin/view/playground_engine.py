"""The engine of a playground: the flight kernels as JavaScript, and the memory that they run on.

The memory is one array of numbers in which each array and record of `kernels.flight` has its place.
Its contents at t = 0 are those that Python's own states hold for the description; what a slider
sets is written over them by the page.
"""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.arms.bodies import bodies_of
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.fpid_state import NODES, FpidState
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.export.javascript import HELPERS, JavaScript
from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Kind, Record, words
from fpid_pin.export.printer import Program
from fpid_pin.fractional.design import modes_of
from fpid_pin.fractional.step_integrals import integrate_step
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.integrators import CompiledEuler
from fpid_pin.simulation.plant import plant_of
from fpid_pin.simulation.recorders import BLOCK_ROWS
from fpid_pin.simulation.sensors import SensorState
from fpid_pin.simulation.engine import horizon_of

#: Orders between which the page interpolates what depends on them, by a polynomial through all:
#: Chebyshev's points, ends included. With 48 the weights of 24 modes come out within rounding.
POINTS = 48
#: The most samples that measurements can be late in a page.
MOST_DELAY = 63
#: What a record is called where its array is not named after it.
_RECORDS = {"robots": "robot", "joints": "joint", "ops": "operator", "poles": "pole",
            "modes": "mode", "bodies": "body", "nominal": "body", "there": "frame",
            "frames": "frame", "plants": "plant", "sensors": "sensor", "sums": "sum"}  # fmt: skip


def encoded(values: FloatArray) -> str:
    """Return numbers as base64 of their little-endian bits: no digit is lost."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


def kind_of(name: str, values: Any) -> Kind:
    """Return what the printer is told of an array."""
    if values.dtype.names is not None:
        return Array(Record.of(_RECORDS.get(name, name), values.dtype), values.shape)
    return Array({"f": REAL, "i": INT, "b": BOOL}[values.dtype.kind], values.shape)


def state_of(controller: AdaptiveFpid, experiment: Experiment, step: float) -> FpidState:
    """Return the state of the law alone, without what the nominal model would add."""
    alone = dataclasses.replace(controller, supervisor=None, feedforward=False, observer=0.0)
    horizon = horizon_of(experiment.duration)
    return FpidState([alone], experiment.arm, step, horizon)


def require_playable(
    controller: Controller, experiment: Experiment, others: Sequence[AdaptiveFpid] = ()
) -> AdaptiveFpid:
    """Return a controller that a page can hold beside `others`.

    Raises
    ------
    ArgumentError, DesignError
        It cannot; the message says why.
    """
    horizon = horizon_of(experiment.duration)
    controller = controller.on(experiment.arm, step=experiment.step, horizon=horizon)
    if not isinstance(controller, AdaptiveFpid):
        kind = type(controller).__name__
        raise ArgumentError("controller", "an AdaptiveFpid (a page has no other laws)", kind)
    for name in ("feedforward", "observer"):
        if getattr(controller, name):
            raise ArgumentError(name, "none in a page", f"{getattr(controller, name)}")
    modes = modes_of(controller.design, (0.3, 0.7), step=experiment.step, horizon=horizon)
    if not modes.shared_poles:
        kind = type(controller.design).__name__
        raise DesignError(f"design: expected one with shared poles, got {kind}")
    if others and controller.design != others[0].design:
        raise ArgumentError("design", "the same for all controllers of a page", "another")
    return controller


class Engine:
    """The printed flight of one experiment and its controllers, and all that it starts from.

    Parameters
    ----------
    experiment, controllers
        What the page begins with.
    steps
        Steps that the page offers [s].

    Raises
    ------
    ArmError
        A joint that the kernels do not have.
    """

    def __init__(
        self, experiment: Experiment, controllers: list[AdaptiveFpid], steps: list[float]
    ) -> None:
        self._experiment, self._controllers, self._steps = experiment, controllers, steps
        self.arrays: dict[str, Any] = self._arrays()
        self.places: dict[str, int] = {}
        at = 0
        for name, values in self.arrays.items():
            self.places[name] = at
            at += words(values).size
        self.words = at
        self.text = self._print()

    def _arrays(self) -> dict[str, Any]:
        from fpid_pin.kernels import motion
        from fpid_pin.kernels.metrics import SUM

        e, b = self._experiment, BLOCK_ROWS
        n, plant = e.arm.n, plant_of(e)
        law = state_of(self._controllers[0], e, e.step).flight
        assert law is not None
        robots, joints, ops, poles, modes, _ = law
        x = np.zeros((2, 1, n))
        euler = CompiledEuler([plant], e.step, x)
        (
            model, bodies, gravity, frames, mass, _, dry, stuck, force, room, response, matrix, _,
        ) = euler.records  # fmt: skip
        # Without friction's part of the rotor inertias: it depends on step and slider.
        bodies = bodies_of(plant.arm.model)[np.newaxis]
        plants = np.zeros((1, n), motion.PLANT)
        plants["limit"], plants["viscous"] = plant.effort_limit, plant.viscous_friction
        plants["runaway"] = e.runaway_speed
        sensors = SensorState([e.sensors], [e.seed], n, e.step)._joints
        return {
            "alive": np.ones(1, dtype=np.bool_), "robots": robots, "joints": joints, "ops": ops,
            "poles": poles, "modes": modes, "table": np.zeros((3 + modes.shape[-1], NODES)),
            "model": model, "bodies": bodies, "gravity": gravity, "frames": frames, "mass": mass,
            "dry": dry, "stuck": stuck, "force": force, "room": room, "response": response,
            "matrix": matrix, "plants": plants, "x": x,
            "seen": np.zeros((5, 1, n)), "torque": np.zeros((1, n)), "tau": np.zeros((1, n)),
            "a": np.zeros((1, n)), "references": np.zeros((3, b, 1, n)),
            "forces": np.zeros((b, 1, n)), "rows": np.zeros((3, b, 1, n)), "sensors": sensors,
            "history": np.zeros((MOST_DELAY + 1, 2, 1, n)),
            "noise": np.zeros((b, 2, 1, n)), "kept": np.zeros((8, b, 1, n)),
            "values": np.zeros((b, 1)), "ends": np.zeros(1, dtype=np.int64),
            "sums": np.zeros((1, n), SUM), "error": np.zeros((b, 1, n)),
            "valid": np.zeros(1, dtype=np.int64),
            **self._assistance(frames, mass),
        }  # fmt: skip

    def _assistance(self, frames: Any, mass: Any) -> dict[str, Any]:
        """Return what the nominal model's part of a tick needs: see `kernels.model`."""
        from fpid_pin.kernels.model import ASKED, ROWS

        arm = self._experiment.arm
        return {
            "asked": np.zeros(1, ASKED), "nominal": bodies_of(arm.model),
            "pull": np.array(arm.model.gravity.linear), "there": np.zeros_like(frames),
            "nominal_mass": np.zeros_like(mass), "factored": np.zeros_like(mass),
            "assistance": np.zeros((ROWS, 1, arm.n)),
        }  # fmt: skip

    def _print(self) -> str:
        from fpid_pin.kernels.flight import fly, steps
        from fpid_pin.kernels.metrics import tally
        from fpid_pin.kernels.model import assisted
        from fpid_pin.kernels.motion import arrive, drive
        from fpid_pin.kernels.sensors import measure

        scalars: dict[str, Kind] = {"real": REAL, "int": INT, "bool": BOOL}

        def kinds(text: str) -> list[Kind]:
            return [scalars.get(name) or kind_of(name, self.arrays[name]) for name in text.split()]

        program = Program(JavaScript())
        program.add(
            fly,
            kinds(
                "alive robots joints ops poles modes table model bodies gravity frames mass bool "
                "dry stuck force room response matrix real "
                "plants x seen torque tau a references forces rows bool "
                "sensors history noise int bool kept values int int ends"
            ),
        )
        program.add(arrive, kinds("alive plants x references int seen"))
        # Where the model assists, a tick's parts one by one.
        asked = Record.of("asked", self.arrays["asked"].dtype)
        program.add(measure, kinds("alive sensors x int history noise int seen"))
        assist = kinds(
            "alive robots joints ops poles modes table nominal pull there nominal_mass factored "
            "assistance seen torque"
        )
        program.add(assisted, [assist[0], asked, *assist[1:]])
        program.add(drive, kinds("alive plants torque x forces int rows tau"))
        program.add(
            steps,
            kinds(
                "alive model bodies gravity frames mass bool dry stuck force room response matrix "
                "real x tau a"
            ),
        )
        program.add(tally, kinds("sums error error valid int int int real"))
        names = "fly, arrive, tally, measure, assisted, drive, steps"
        return f"{HELPERS}{program.text}return {{{names}}};\n"

    # ------------------------------------------------------------------ for the page

    def table(self) -> dict[str, Any]:
        """Return what the page needs to set the memory up, plain values."""
        e = self._experiment
        starts = []
        for controller in self._controllers:
            law = state_of(controller, e, e.step).flight
            assert law is not None
            robots, joints, ops, *_ = law
            parts = {"robots": robots, "joints": joints, "ops": ops}
            starts.append({name: encoded(words(v)) for name, v in parts.items()})
        return {
            "words": self.words,
            "places": self.places,
            "shapes": {name: list(np.shape(v)) for name, v in self.arrays.items()},
            "fields": {
                name: {f: k for k, f in enumerate(v.dtype.names)}
                for name, v in self.arrays.items()
                if v.dtype.names
            },
            "memory": encoded(np.concatenate([words(v) for v in self.arrays.values()])),
            "starts": starts,
            "points": encoded(self._points),
            "steps": [{"step": h, **self._at_step(h)} for h in self._steps],
            "block": BLOCK_ROWS,
            "nodes": NODES,
            "payload": encoded(self._payload()),
            "generator": self._generator(),
        }

    @property
    def _points(self) -> FloatArray:
        return 0.5 - 0.5 * np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))

    def _at_step(self, h: float) -> dict[str, Any]:
        """Return poles, and what depends on the order at `POINTS` orders, for a step."""
        design, horizon = self._controllers[0].design, horizon_of(self._experiment.duration)
        points = self._points
        points[-1] = 1.0
        modes = modes_of(design, points, step=h, horizon=horizon)
        one = integrate_step(modes.poles.reshape(1, -1), h)
        poles = np.stack(list(one), axis=-1)
        # Shared by several orders: those of the descriptions, to the last bit.
        known = np.unique(np.concatenate([c.orders(self._experiment.arm.n).ravel()
                                          for c in self._controllers]))  # fmt: skip
        exact = modes_of(design, known, step=h, horizon=horizon)
        return {
            "poles": encoded(poles.ravel()),
            "weights": encoded(modes.table().T.ravel()),
            "known": encoded(known),
            "exact": encoded(exact.table().T.ravel()),
        }

    def _payload(self) -> FloatArray:
        """Return what a kilogram at the tool adds to the bodies' records, (n, fields)."""
        arm = plant_of(self._experiment).arm
        more, less = (
            words(bodies_of(a.model)).reshape(arm.n, -1) for a in (arm.with_payload(1.0), arm)
        )
        return np.asarray(more - less).ravel()

    def _generator(self) -> dict[str, str]:
        """Return the state of the sensors' random numbers, two integers of 128 bits."""
        state = np.random.default_rng(self._experiment.seed).bit_generator.state["state"]
        return {name: hex(value) for name, value in state.items()}
