"""Orders that change while a law runs: through a table, or by hand."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.operators import Integral
from fpid_pin.exceptions import DesignError
from fpid_pin.fractional import Design
from fpid_pin.fractional.design import modes_of

if TYPE_CHECKING:
    from fpid_pin.control.law import Controller

#: Orders at which the table is laid out that orders which vary are interpolated in: a cubic on this
#: grid is within 1e-7 of the operator, as the operator of 24 modes is of the exact one.
NODES = 201


@lru_cache(maxsize=8)
def order_table(design: Design, step: float, horizon: float) -> FloatArray:
    """Return the table of `kernels.operator.variable_order_derivative`."""
    nodes = np.linspace(0.0, 1.0, NODES)
    return np.ascontiguousarray(modes_of(design, nodes, step=step, horizon=horizon).table())


class OrdersByHand:
    """What a `State` has for orders that change; its attributes are those of the state."""

    controller: Controller
    step: float
    horizon: float
    c: Any
    joints: Any
    orders: FloatArray
    _operators: list[tuple[str, Any]]
    _ramp: tuple[FloatArray, FloatArray, int, int] | None

    def _table(self) -> FloatArray:
        return order_table(self.controller.fractional_design, self.step, self.horizon)

    def _need_shared_poles(self, poles: Any) -> None:
        if len(poles) > 1:
            kind = type(self.controller.fractional_design).__name__
            raise DesignError(f"orders: expected a design with shared poles, got {kind}")

    def set_orders(
        self,
        integral_order: ArrayLike | None = None,
        derivative_order: ArrayLike | None = None,
        *,
        ramp: float = 0.0,
    ) -> None:
        """Change the orders of integrals and derivatives while running, (n,); None: as they are.

        From now on (or, with a `ramp` [s], from its end) the terms are those of a law that had the
        new orders from the start. Orders that adapt go on from there.

        Raises
        ------
        DesignError
            A design whose poles depend on the order: its modes mean nothing to another one.
        """
        self.orders = self.c.ops["order"].copy()
        new = self.orders.copy()
        for i, (_, operator) in enumerate(self._operators):
            integral = isinstance(operator, Integral)
            given = integral_order if integral else derivative_order
            name = "integral_order" if integral else "derivative_order"
            if given is not None:
                order = checks.floats(name, given, low=0.0, high=1.0)
                new[:, i] = 1.0 - order if integral else order
        self._need_shared_poles(self.c.poles)
        steps = round(checks.number("ramp", ramp, low=0.0) / self.step)
        if steps:
            self._ramp = (self.orders, new, 0, steps)
            self.c = self.c._replace(table=self._table())
            self.c.ops["variable"] = 1
        else:
            self._use_orders(new)

    def _follow_ramp(self) -> None:
        """Move the orders by one step of their ramp, through the table of variable orders."""
        assert self._ramp is not None
        first, last, done, steps = self._ramp
        fraction = (done + 1) / steps
        if fraction >= 1.0:
            self._use_orders(last)
        else:
            self._write_orders(first + fraction * (last - first))
            self._ramp = (first, last, done + 1, steps)

    def _use_orders(self, orders: FloatArray) -> None:
        self._ramp = None
        design = self.controller.fractional_design
        modes = modes_of(design, orders, step=self.step, horizon=self.horizon)
        for name, value in modes.operator().items():
            self.c.ops[name] = value
        self.c.modes["weight"] = np.moveaxis(modes.weights, 0, -1)
        self.c.ops["variable"] = self.c.ops["order_column"] >= 0
        self._write_orders(orders)

    def _write_orders(self, orders: FloatArray) -> None:
        self.orders = orders
        self.c.ops["order"] = orders
        for i, (_, operator) in enumerate(self._operators):
            if isinstance(operator.order, str):
                order = orders[:, i]
                self.joints[operator.order] = (
                    1.0 - order if isinstance(operator, Integral) else order
                )
