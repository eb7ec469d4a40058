"""The adaptive FPID with suggested gains, as a description that fits any arm."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.control.adaptive_orders import adapt_orders
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.gains import suggest_gains
from fpid_pin.control.law import Controller
from fpid_pin.control.observer_bandwidth import SUGGESTED, check_observer
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@described("suggested_fpid")
@dataclass(frozen=True, eq=False)
class SuggestedFpid(Controller):
    """The adaptive FPID of `suggest_gains`, on whatever arm it is started: for configurations.

    Parameters
    ----------
    bandwidth, integral_order, derivative_order, adaptive, feedforward, observer
        See `suggest_gains`.
    order_learning_rate
        Of both orders, 0: they stay; or ``"suggested"``: rates and bounds of `adapt_orders`.
    name
        What tables and figures call it.
    """

    bandwidth: float = 10.0
    integral_order: float = 0.9
    derivative_order: float | None = None
    adaptive: bool = True
    order_learning_rate: float | str = 0.0
    observer: float | str = field(default=0.0, kw_only=True)  # type: ignore[assignment]
    name: str = field(default="FPID, suggested gains", kw_only=True)

    def __post_init__(self) -> None:
        value = checks.number("bandwidth", self.bandwidth, above=0.0)
        object.__setattr__(self, "bandwidth", value)
        for name in ("integral_order", "derivative_order"):
            order = getattr(self, name)
            if order is not None or name == "integral_order":
                object.__setattr__(self, name, checks.number(name, order, low=0.0, high=1.0))
        for name in ("adaptive", "feedforward"):
            checks.instance(name, getattr(self, name), bool, "true or false")
        object.__setattr__(self, "observer", check_observer(self.observer))
        rate = self.order_learning_rate
        if isinstance(rate, str):
            checks.choice("order_learning_rate", rate, (SUGGESTED,))
        else:
            rate = checks.number("order_learning_rate", rate, low=0.0)
            object.__setattr__(self, "order_learning_rate", rate)

    def on(self, arm: Arm, *, step: float = 1e-3, horizon: float = 3600.0) -> AdaptiveFpid:
        """Return the controller that this is on `arm`."""
        law = suggest_gains(
            arm, self.bandwidth, integral_order=self.integral_order,
            derivative_order=self.derivative_order, adaptive=self.adaptive,
            feedforward=self.feedforward, observer=self.observer, step=step, horizon=horizon,
            name=self.name,
        )  # fmt: skip
        if self.order_learning_rate == SUGGESTED:
            return adapt_orders(law, arm)
        return dataclasses.replace(law, order_learning_rate=self.order_learning_rate)
