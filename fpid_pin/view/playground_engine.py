"""The engine of a playground: `kernels.rollout` as JavaScript, and the memory that it runs on.

The memory is one array of numbers in which each array of a robot (`kernels.records`) has its place.
Its contents at t = 0 are those that Python's own robots start from; what a slider sets is written
over them by the page.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.control.state import NODES
from fpid_pin.costs.cost import BLOCK_ROWS
from fpid_pin.export.javascript import HELPERS, JavaScript
from fpid_pin.export.kinds import INT, Array, Kind, bundle, real, words
from fpid_pin.export.law import INPUTS, by_name
from fpid_pin.export.printer import Program
from fpid_pin.fractional.design import integrate_step, modes_of
from fpid_pin.kernels.records import Rows, Sensing
from fpid_pin.kernels.rollout import rollout
from fpid_pin.simulation.engine import Robot, SensorState, horizon_of
from fpid_pin.simulation.experiment import Experiment, Sensors, plant_of
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
        "first_operators", "uses_model", "inertia", "estimates", "surface", "torque", "adapt",
        "feedforward", "compensates",
    ),
    "bodies": ("slides",),
}  # fmt: skip
#: Arrays that the page fills from the step and the orders.
_BY_STEP = ("c.robot", "c.poles", "c.modes", "c.table")


def encoded(values: Any) -> str:
    """Return numbers as base64 of their little-endian bits: no digit is lost."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


class Engine:
    """The printed rollouts of an experiment and its laws, and all that they start from.

    `text` is JavaScript that returns the rollouts, one for each law; `table` what the page needs
    to set the memory up for any of the `steps` that it offers.
    """

    def __init__(self, experiment: Experiment, laws: Sequence[Law], steps: list[float]) -> None:
        self._experiment, program, names, table = experiment, Program(JavaScript()), [], []
        common = self._arrays(laws[0])
        functions = [law.functions for law in laws]
        for law in laws:
            arrays = common | {
                f"c.{name}": values
                for name, values in law.state.c._replace(joints=law.state.joints)._asdict().items()
            }
            places = _places(arrays)
            # Laws of the same functions and arrays run on the same rollout.
            label = f"c{functions.index(law.functions)}"
            names.append(self._print(program, law, label, arrays, places))
            start = {
                name: encoded(words(values))
                for name, values in arrays.items()
                if name not in (*_BY_STEP, "c.numbers") and words(values).any()
            }
            robots = [[encoded(words(law.robot(h, on))) for on in (False, True)] for h in steps]
            table.append(law.table() | {"places": places, "start": start, "robots": robots})
        self.text = f"{HELPERS}{program.text}return [{', '.join(names)}];\n"
        # What a kilogram at the tool adds to the bodies' records, (n, fields).
        arm = plant_of(experiment).arm
        more, less = (words(a.bodies) for a in (arm.with_payload(1.0), arm))
        # The state of the sensors' random numbers, two integers of 128 bits.
        state = np.random.default_rng(experiment.seed).bit_generator.state["state"]
        generator = {name: hex(value) for name, value in state.items()}
        design = next((law.design for law in laws if law.design is not None), None)
        self.table = {
            "n": experiment.arm.n, "modes": max(law.state.c.modes.shape[2] for law in laws),
            "words": max(one["places"]["end"] for one in table), "laws": table,
            "fields": {
                name: {field: k for k, field in enumerate(values.dtype.names)}
                for name, values in arrays.items() if values.dtype.names
            },
            "block": BLOCK_ROWS, "nodes": NODES, "points": encoded(POINTS),
            "steps": [{"step": h} | self._at_step(design, h) for h in steps],
            "payload": encoded(more - less), "generator": generator,
        }  # fmt: skip

    def _arrays(self, law: Law) -> dict[str, Any]:
        """Return the arrays that all laws share, by the names of `kernels.rollout.rollout`."""
        e, n, state = self._experiment, self._experiment.arm.n, law.state
        robot = Robot(e, state, dynamics="compiled", limit=np.full(n, np.inf))
        sensors = SensorState(e.sensors or Sensors(), e.seed, n, e.step).records(0, 0).joints
        kept = OWN_SIGNALS + len(SIGNALS)
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

    def _print(
        self, program: Program, law: Law, label: str, arrays: dict[str, Any], places: dict[str, int]
    ) -> str:
        """Print a law's rollout and return its name."""
        n, kinds = self._experiment.arm.n, list[Kind]()
        for head in ("c", "plant", "sensing", "rows"):
            names = [name for name in arrays if name.startswith(f"{head}.")]
            members = {name.removeprefix(f"{head}."): arrays[name] for name in names}
            at = {name.removeprefix(f"{head}."): str(places[name]) for name in names}
            name = label if head == "c" else head
            kinds.append(bundle(name, members, at, constants=_CONSTANT))
        program.instead = by_name(law.state.controller)
        kinds += [real(INPUTS, n), real(n), Array(INT, (5,))]
        return program.add(rollout, kinds).name

    def _at_step(self, design: Any, h: float) -> dict[str, Any]:
        """Return poles, and what depends on the order at `POINTS`, for a step."""
        if design is None:
            return {"poles": "", "weights": ""}
        horizon = horizon_of(self._experiment.duration)
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
