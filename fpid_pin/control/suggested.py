"""The adaptive FPID with suggested gains, as a description that fits any arm."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.control.adaptive_orders import adapt_orders
from fpid_pin.control.controller import Controller
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.gains import suggest_gains
from fpid_pin.control.observer_bandwidth import SUGGESTED, check_observer
from fpid_pin.control.state import State
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
    feedforward: bool = False
    observer: float | str = 0.0
    order_learning_rate: float | str = 0.0
    name: str = "FPID, suggested gains"

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

    def lockstep_key(self) -> Hashable:
        """See `Controller.lockstep_key`: the model's part and orders that move are other ticks."""
        moves = bool(self.order_learning_rate)
        return (type(self), self.feedforward, bool(self.observer), moves)

    @classmethod
    def start_many(
        cls, controllers: Sequence[SuggestedFpid], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        # Fitted to no particular horizon: a run's gains do not depend on how long it lasts. Most
        # populations have one description many times, and a suggestion takes a second.
        known = {id(c): c for c in controllers}
        laws = {key: controller.on(arm, step=step) for key, controller in known.items()}
        each = [laws[id(c)] for c in controllers]
        return AdaptiveFpid.start_many(each, arm, step=step, horizon=horizon)
