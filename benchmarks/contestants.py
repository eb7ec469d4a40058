"""The laws that `baselines.py` compares, the spaces they are searched in, and who contains whom.

All share the joints' proportions (the scale of `suggest_gains`) or the model's own, so that each
has a handful of numbers. What a law may do without can be found to be worth nothing: integrals,
learning rates and observers reach 0, orders reach 1. So where one family contains another, its
best must not be worse; if a search says otherwise, the search failed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import fpid_pin as fp
from fpid_pin.control import Controller, PdGravity, Pid, Safeguards, SlidingMode, SlotineLi

#: Error at which adaptation at rate 1 doubles a gain within `LEARNING_TIME`, rad and s.
LEARNING_ERROR, LEARNING_TIME = 0.05, 5.0
#: Where Ki and Kd are what they would be at orders 1 [rad/s]: I^lambda and D^mu have the sizes
#: w^-lambda and w^mu, so that a search moves orders without moving the loop's bandwidth.
AT = 50.0
#: lambda and mu that one search of a fractional family starts from.
MIDDLE = (0.95, 0.5)
#: How far adapted gains may go from where they start.
LOWER, RAISE = 0.5, 4.0
Genes = Mapping[str, float]


@dataclass(frozen=True)
class Range:
    """Where a parameter is looked for, as a function of a number in [0, 1].

    ``"log"``; ``"linear"``; or ``"zero"``: from 0, linear below `low` and logarithmic above.
    """

    low: float
    high: float
    kind: str = "log"

    def value(self, x: float) -> float:
        """Return the parameter at `x`."""
        x = min(max(float(x), 0.0), 1.0)
        if self.kind == "linear":
            return self.low + (self.high - self.low) * x
        if self.kind == "zero":
            return self.low * ((1.0 + self.high / self.low) ** x - 1.0)
        return self.low * (self.high / self.low) ** x

    def place(self, value: float) -> float:
        """Return the x of a parameter."""
        if self.kind == "linear":
            return (value - self.low) / (self.high - self.low)
        if self.kind == "zero":
            return float(np.log1p(value / self.low) / np.log1p(self.high / self.low))
        return float(np.log(value / self.low) / np.log(self.high / self.low))


GAINS = {
    "kp": Range(5.0, 10000.0), "ki": Range(10.0, 200000.0, "zero"), "kd": Range(2.0, 1000.0),
}  # fmt: skip
RATE = {"rate": Range(0.01, 30.0, "zero")}
ORDERS = {"lambda": Range(0.0, 1.0, "linear"), "mu": Range(0.3, 1.0, "linear")}
OBSERVER = {"observer": Range(5.0, 500.0, "zero")}
#: What a family that lacks a parameter has in its place.
ABSENT = {"rate": 0.0, "lambda": 1.0, "mu": 1.0, "observer": 0.0}


@dataclass(frozen=True)
class Family:
    """A kind of controller: how it is built from arm, joints' proportions and parameters.

    `space` is where each parameter is looked for; laws of the families that it `contains` are
    among these.
    """

    build: Callable[[fp.Arm, np.ndarray, Genes], Controller]
    space: Mapping[str, Range]
    contains: tuple[str, ...] = ()

    def genes(self, point: np.ndarray) -> dict[str, float]:
        """Turn a point of the unit cube into parameters."""
        pairs = zip(self.space.items(), point, strict=True)
        return {name: where.value(x) for (name, where), x in pairs}

    def point(self, genes: Genes) -> np.ndarray:
        """Return the point at which this family has the parameters of one that it contains."""
        known = ABSENT | dict(genes)
        places = [where.place(known[name]) for name, where in self.space.items()]
        return np.clip(places, 0.0, 1.0)

    def with_orders(self, point: np.ndarray, lam: float, mu: float) -> np.ndarray:
        """Return a point with other orders."""
        known = dict(zip(self.space, point, strict=True))
        known["lambda"] = self.space["lambda"].place(lam)
        known["mu"] = self.space["mu"].place(mu)
        return np.array([known[name] for name in self.space])


def fpid(_: fp.Arm, scale: np.ndarray, g: Genes, *, model: bool = False) -> Controller:
    """Build an FPID; with `model` its feedforward and observer."""
    known = ABSENT | dict(g)
    ki = g["ki"] * AT ** (known["lambda"] - 1.0)
    kd = g["kd"] * AT ** (1.0 - known["mu"])
    start = np.outer([g["kp"], ki, kd], np.ones(len(scale)))
    # S phi is about k1 e^2 for Kp and Ki, and Kp times that for Kd.
    strength = 2.0 * LEARNING_ERROR**2 * LEARNING_TIME * np.array([[1.0], [1.0], [g["kp"]]])
    guard = Safeguards(minimum=LOWER * start, maximum=RAISE * start) if known["rate"] else None
    return fp.AdaptiveFpid(
        kp=start[0], ki=start[1], kd=start[2], scale=scale, safeguards=guard,
        integral_order=known["lambda"], derivative_order=known["mu"],
        learning_rate=known["rate"] * start / strength,
        feedforward=model, observer=known["observer"],
    )  # fmt: skip


def fpid_and_model(arm: fp.Arm, scale: np.ndarray, g: Genes) -> Controller:
    """Build an FPID with the model's feedforward, and its observer."""
    return fpid(arm, scale, g, model=True)


#: By name, in an order in which every family comes after those that it contains.
FAMILIES = {
    "PID": Family(lambda arm, scale, g: Pid(g["kp"], g["ki"], g["kd"], scale=scale), GAINS),
    "FPID": Family(fpid, GAINS | ORDERS, ("PID",)),
    "adaptive PID": Family(fpid, GAINS | RATE, ("PID",)),
    "adaptive FPID": Family(fpid, GAINS | RATE | ORDERS, ("FPID", "adaptive PID")),
    "PID + G + observer": Family(
        lambda arm, scale, g: PdGravity(
            g["kp"], g["kd"], scale=scale, ki=g["ki"], observer=g["observer"]
        ),
        GAINS | OBSERVER,
    ),
    "computed torque + I + observer": Family(
        lambda arm, scale, g: fp.ComputedTorque(
            g["kp"], g["kd"], ki=g["ki"], observer=g["observer"]
        ),
        GAINS | OBSERVER,
    ),
    "sliding mode + observer": Family(
        lambda arm, scale, g: SlidingMode(
            g["slope"], g["gain"], g["layer"], scale=scale, observer=g["observer"]
        ),
        {"slope": Range(0.5, 200.0), "gain": Range(1.0, 2000.0), "layer": Range(0.02, 10.0)}
        | OBSERVER,
    ),
    "Slotine-Li": Family(
        lambda arm, scale, g: SlotineLi(g["slope"], g["damping"], g["adaptation"], scale=scale),
        {"slope": Range(0.5, 200.0), "damping": Range(1.0, 300.0),
         "adaptation": Range(1e-4, 100.0, "zero")},
    ),
    "PID + model": Family(fpid_and_model, GAINS | OBSERVER),
    "FPID + model": Family(fpid_and_model, GAINS | OBSERVER | ORDERS, ("PID + model",)),
    "adaptive PID + model": Family(fpid_and_model, GAINS | OBSERVER | RATE, ("PID + model",)),
    "adaptive FPID + model": Family(
        fpid_and_model, GAINS | OBSERVER | RATE | ORDERS, ("FPID + model", "adaptive PID + model"),
    ),
}  # fmt: skip
