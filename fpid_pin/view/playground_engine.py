"""The engine of a playground: `kernels.rollout` as JavaScript, and the memory that it runs on.

The memory is one array of numbers in which each array of a robot (`kernels.records`) has its place,
the same one whatever the law. Its contents at t = 0 are those that Python's own robots start from;
what a slider sets is written over them by the page.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.arms.bodies import bodies_of
from fpid_pin.control.order_changes import NODES
from fpid_pin.export.javascript import HELPERS, JavaScript
from fpid_pin.export.kinds import INT, Array, bundle, real, words
from fpid_pin.export.law import INPUTS, stand_ins
from fpid_pin.export.printer import Program
from fpid_pin.fractional.design import integrate_step, modes_of
from fpid_pin.kernels.records import GIVEN, Rows, Sensing
from fpid_pin.kernels.rollout import rollout
from fpid_pin.simulation.blocks import BLOCK_ROWS
from fpid_pin.simulation.engine import Robot, horizon_of
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.simulation.sensors import Sensors, SensorState
from fpid_pin.view.playground_law import OWN_SIGNALS, SIGNALS, Law

#: Orders between which the page interpolates what depends on them, by a polynomial through all:
#: Chebyshev's points, ends included. With 48 the weights of 24 modes come out within rounding.
POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(48) / 47)
POINTS[-1] = 1.0
#: The most samples that measurements can be late in a page.
MOST_DELAY = 63
#: What a page never changes of a controller and of an arm's bodies.
_CONSTANT = {
    "robot": (
        "first_operators", "declares", "inertia", "estimates", "surface", "torque", "adapt",
        "feedforward", "compensates",
    ),
    "bodies": ("slides",),
}  # fmt: skip
#: Arrays of a controller that differ from law to law at t = 0.
_OF_LAW = ("robot", "law", "own", "ops")


def encoded(values: Any) -> str:
    """Return numbers as base64 of their little-endian bits: no digit is lost."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


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
        poles = words(integrate_step(modes.poles, h))
        return {"poles": encoded(poles), "weights": encoded(modes.table().T.ravel())}

    def _payload(self) -> Any:
        """Return what a kilogram at the tool adds to the bodies' records, (n, fields)."""
        arm = plant_of(self._experiment).arm
        more, less = (words(bodies_of(a)).reshape(arm.n, -1) for a in (arm.with_payload(1.0), arm))
        return (more - less).ravel()

    def _generator(self) -> dict[str, str]:
        """Return the state of the sensors' random numbers, two integers of 128 bits."""
        state = np.random.default_rng(self._experiment.seed).bit_generator.state["state"]
        return {name: hex(value) for name, value in state.items()}
