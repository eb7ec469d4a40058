"""Laws started on robots, many at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.control.operators import INITIALISATIONS
from fpid_pin.control.state import State
from fpid_pin.fractional.design import modes_of

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.law import Controller


def start_all(
    controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
) -> list[State]:
    """Start laws on robots of one arm, each in a state of its own.

    The modes of laws with the same operators are fitted together, which costs hardly more than
    one.
    """
    # A suggestion takes a second, and most populations have one description many times. It is not
    # fitted to a horizon: a run's gains must not depend on how long it lasts.
    known = {id(c): c for c in controllers}
    laws = {key: law.on(arm, step=step) for key, law in known.items()}
    each = [laws[id(c)] for c in controllers]
    states = [State(law, arm, step=step, horizon=horizon) for law in each]
    groups: dict[Any, list[State]] = {}
    for state in states:
        if state.orders.size:
            law = state.controller
            key = (law.fractional_design, getattr(law, "initialisation", "caputo"))
            groups.setdefault((*key, state.orders.shape), []).append(state)
    for (design, initialisation, _), members in groups.items():
        checks.choice("initialisation", initialisation, INITIALISATIONS)
        grid = {"step": step, "horizon": horizon}
        modes = modes_of(design, np.array([state.orders for state in members]), **grid)
        if modes.shared_poles:
            ops, poles, values = modes.records(initialisation)
            for state, own, value in zip(members, ops, values, strict=True):
                state.use_modes(own, poles, value)
        else:
            for state in members:
                alone = modes_of(design, state.orders, **grid)
                state.use_modes(*alone.records(initialisation))
    return states
