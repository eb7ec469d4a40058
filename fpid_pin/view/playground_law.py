"""A controller as a playground plays it: its start, and which numbers its settings move.

What a field of a law moves is found by trying: it is a slider where the law's numbers go with it
in proportion.
"""

from __future__ import annotations

import contextlib
import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.functions import plain_function
from fpid_pin.control.law import Controller, Integral, is_number
from fpid_pin.control.state import State
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.exceptions import ArgumentError, DesignError, FpidError, FpidWarning
from fpid_pin.export.law import start
from fpid_pin.fractional.design import modes_of
from fpid_pin.simulation.engine import horizon_of
from fpid_pin.simulation.experiment import Experiment

#: Signals that a page can plot: the law's own, as many as this, and what every law has.
OWN_SIGNALS, SIGNALS = 6, ("u_law", "u_model", "u_s")


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
