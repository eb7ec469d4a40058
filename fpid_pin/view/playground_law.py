"""A controller as a playground plays it: its start, and which numbers its settings move.

What a setting moves is found by trying: a field of a law is a slider where the law's numbers go
with it in proportion.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.functions import plain_function
from fpid_pin.control.law import Controller, Integral
from fpid_pin.control.parameters import is_number
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.exceptions import ArgumentError, DesignError, FpidError
from fpid_pin.export.law import start
from fpid_pin.fractional.design import modes_of
from fpid_pin.simulation.engine import horizon_of
from fpid_pin.simulation.experiment import Experiment

#: Signals that a page can plot: the law's own, as many as this, and what every law has.
OWN_SIGNALS, SIGNALS = 5, ("u_law", "u_model", "u_s")
#: What a setting changes of a law's fields.
_Change = Callable[[Any], dict[str, Any]]


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
    def operators(self) -> Mapping[str, Any]:
        """The law's operators, by their outputs."""
        return self.state.controller.operators

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
        constants = dataclasses.replace(s, lookahead=None).constants(self._step)
        constants = {name: float(x) for name, x in constants.items() if np.isfinite(x)}
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
                "kind": s.kind, "m_x": s.m_x, "reference_bound": s.reference_bound,
                "lookahead": s.lookahead or 0.0, "observer": s.observer,
                "bound": s.bound(e.arm.n).tolist(), "constants": constants,
            },
        }  # fmt: skip


def _field(name: str) -> _Change:
    return lambda x: {name: x}
