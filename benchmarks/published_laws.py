"""What do published fractional laws come to when they are run again?

pelican: fractional PD on the Pelican arm, DOI 10.1007/s10846-019-01121-y, with its code in
github.com/phelipe/jirs-paper-code: against its PDs, and PDs tuned equally.

sliding: data-driven fractional-order terminal sliding mode with prescribed performance, DOI
10.1016/j.isatra.2022.05.036, github.com/Babak-Esmaeili/PP-MFA-FO-FTSM-Control: its two-link
example, the fractional sum as its code has it, and as its definition has it.

Parameters are the authors'; laws are written anew from their equations. The paper itself is run
again by orders.py: its orders against integer ones, with its gains and with tuned ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from common import Bench, run
from numpy.typing import ArrayLike
from validation import both, pendulum, rms

import fpid_pin as fp
from fpid_pin.control.law import Derivative
from fpid_pin.references import Quintic
from fpid_pin.tuning import SearchSettings, Space

# ------------------------------------------------------------------ the Pelican arm


@dataclass(frozen=True, eq=False)
class SampledPd(fp.Controller):
    """u = Kp e + Kd D^mu e, D^mu by the Grünwald-Letnikov sum over all samples since t = 0.

    As published: the error alone is known, one zero comes before it, and mu = 1 is its difference.
    """

    kp: ArrayLike
    kd: ArrayLike
    mu: ArrayLike = 1.0

    def begin(self, state: Any) -> None:
        """Start with the zero before the first sample."""
        state.memory["errors"] = [np.zeros(state.n)]

    def control(self, state: Any, q: Any, v: Any, q_ref: Any, v_ref: Any, a_ref: Any) -> Any:
        """Return the torque; the newest error has the weight 1."""
        errors = state.memory["errors"]
        errors.append(q_ref - q)
        past, mu = np.array(errors)[::-1], np.broadcast_to(self.mu, state.n)
        k = np.arange(1, len(past))[:, np.newaxis]
        weights = np.vstack([np.ones(state.n), np.cumprod(1.0 - (mu + 1.0) / k, axis=0)])
        slope = (weights * past).sum(axis=0) / state.step**mu
        return np.asarray(self.kp) * (q_ref - q) + np.asarray(self.kd) * slope


@dataclass(frozen=True, eq=False)
class FractionalPd(fp.Controller):
    """u = Kp e + Kd D^mu e, D^mu by the package's operator of e and e'."""

    kp: ArrayLike
    kd: ArrayLike
    mu: ArrayLike = 1.0
    operators = {"d_e": Derivative("mu")}  # noqa: RUF012

    @staticmethod
    def torque(c: Any) -> Any:
        """Return u."""
        return c.kp * c.e + c.kd * c.d_e


@dataclass(frozen=True)
class TwoTones:
    """The published disturbance, -0.8 (sin 20 t + cos 12 t) N m on both joints."""

    def sample(self, t: np.ndarray) -> np.ndarray:
        """See `fpid_pin.disturbances.Disturbance.sample`."""
        return -0.8 * (np.sin(20.0 * t) + np.cos(12.0 * t))[:, np.newaxis]


PELICAN = {
    "PD": SampledPd((2500.0, 100.0), (180.0, 10.0)),
    "tuned PD": SampledPd((9202.86, 405.272), (161.648, 10.0)),
    "tuned PD of notebook 3": SampledPd((9832.0, 15.0), (189.0, 25.0)),
    "fractional PD": SampledPd((2769.38, 10.0), (3016.76, 58.0633), (0.470696, 0.834637)),
}


def pelican_arm(disturbed: bool) -> fp.Experiment:
    """Return the published experiment: 0 to 0.8 rad in 3 s, a torque every 5 ms."""
    model = pendulum(
        (23.902, 1.285), (0.45, 0.0), (0.091, 0.048), (1.266, 0.093), from_x=True
    )  # fmt: skip
    return fp.Experiment(
        fp.Arm.from_model(model).with_limits(effort=(200.0, 15.0)), Quintic(0.0, 0.8, 3.0),
        step=5e-3, duration=3.0, integrator="rk4",
        plant=fp.Plant(disturbance=TwoTones()) if disturbed else None,
    )  # fmt: skip


def pelican(bench: Bench) -> None:
    """Print the published gains' figures, and those of equally tuned ones."""
    calm, rough = pelican_arm(False), pelican_arm(True)
    settings = SearchSettings(
        population=12 if bench.quick else 60, generations=2 if bench.quick else 60, seeds=(0, 1, 2)
    )
    gains = {"kp": (10.0, 1e4, "log"), "kd": (1.0, 3e3, "log")}
    cost = fp.costs.MetricCost("iae")
    # With e' by an encoder in place of differences: what each law is worth at its best.
    start = FractionalPd((2500.0, 100.0), (180.0, 10.0))
    tuned = {
        "PD, tuned here": fp.tune(rough, start, Space(**gains), cost, settings),
        "fractional PD, tuned here": fp.tune(
            rough, start, Space(**gains, mu=(0.1, 1.0)), cost, settings
        ),
    }
    laws: dict[str, Any] = dict(PELICAN)
    laws |= {name: result.controller for name, result in tuned.items()}
    rows = []
    for name, law in laws.items():
        m, shaken = (fp.simulate(e, law).metrics for e in (calm, rough))
        rows.append((
            name, both(1e3 * m.iae, 2), both(1e3 * m.rms, 2), both(1e3 * m.peak_error),
            both(m.peak_torque), both(1e3 * shaken.iae, 2),
        ))  # fmt: skip
    bench.say("Fractional PD on the Pelican arm:")
    heads = [
        "law, joints 1 / 2", "IAE [mrad s]", "RMS [mrad]", "largest [mrad]", "peak torque [N m]",
        "IAE, disturbed [mrad s]",
    ]  # fmt: skip
    bench.table(heads, rows)
    orders = np.broadcast_to(laws["fractional PD, tuned here"].mu, 2)
    bench.say(
        "Tuned here: gains within the same bounds, the sum of the joints' IAE under the "
        f"disturbance, {settings.population} x {settings.generations}, three seeds; the best "
        f"orders are {', '.join(f'{mu:.3f}' for mu in orders)}."
    )


# ------------------------------------------------------------------ terminal sliding mode

#: Samples before the newest that the fractional sum takes.
PAST = 10
# Columns of a joint's own numbers.
REFERENCE, MEASURED, TORQUE, LAST, BEFORE, CHANGE = range(6)
OUTPUT, REST, REST_BEFORE, BOUND, ERROR, SURFACE, SUM = range(6, 13)
NEWEST, JACOBIAN = 13, 13 + PAST + 1


@dataclass(frozen=True, eq=False)
class TerminalSlidingMode(fp.Controller):
    """Model-free: a local linear model of y is estimated, and u is increased by what it asks for.

    y is the measured rate. With dH = (dy, du, du before) of all joints and Phi its estimate,

        dy = (Phi + m) dH + x2,    x2 what an observer finds to be missing
        tau = 1/2 ln|(rho + e)/(rho - e)|,    rho <- (1 - nu) rho + nu rho_inf
        s <- s + L3 (tau - tau before) + L1 tau + L2 I(sig(tau)^0.6)

    I is a fractional sum over the last eleven samples. ``whole_sum`` gives the newest one its
    weight h^0.8, as the Grünwald-Letnikov sum of order -0.8 has it; the published code gives it 1.
    """

    lambda_1: ArrayLike = (80.0, 80.0)
    lambda_2: ArrayLike = (90.0, 70.0)
    lambda_3: ArrayLike = (2.0, 10.0)
    nu: ArrayLike = (0.003, 0.005)
    whole_sum: float = 0.0
    order: float = -0.8

    def arrays(self, arm: fp.Arm, step: float, horizon: float) -> np.ndarray:
        """Return what is remembered at t = 0.001 s, where the published loop begins."""
        own = np.zeros((2, JACOBIAN + 6))
        own[:, REFERENCE] = 0.5 * np.sin(np.pi / 4 * 1e-3), 0.2 * np.cos(2 * np.pi / 9 * 1e-3)
        own[:, MEASURED], own[:, BOUND] = 0.2, 0.7
        own[0, NEWEST] = -(0.4**0.6)
        own[:, JACOBIAN : JACOBIAN + 2] = 10.0 * np.eye(2)
        own[:, JACOBIAN + 2 : JACOBIAN + 4] = own[:, JACOBIAN + 4 :] = np.eye(2)
        return own

    @staticmethod
    def torques(joints: Any, own: Any, model: Any) -> None:
        """Write each joint's torque; c.v is y, and c.v_ref what y is to be one sample on."""
        n = joints.size
        size = 1.0
        for k in range(n):
            size += own[k, CHANGE] ** 2 + own[k, LAST] ** 2 + own[k, BEFORE] ** 2
        for j in range(n):
            c = joints[j]
            # The estimate, moved along the last change of everything.
            lack = (c.v - own[j, MEASURED]) - own[j, REST_BEFORE] - own[j, LAST]
            for k in range(n):
                lack -= own[j, JACOBIAN + k] * own[k, CHANGE]
                lack -= own[j, JACOBIAN + n + k] * own[k, LAST]
                lack -= own[j, JACOBIAN + 2 * n + k] * own[k, BEFORE]
            for k in range(n):
                own[j, JACOBIAN + k] += lack * own[k, CHANGE] / size
                own[j, JACOBIAN + n + k] += lack * own[k, LAST] / size
                own[j, JACOBIAN + 2 * n + k] += lack * own[k, BEFORE] / size
                # What multiplies the newest du is put back where it changes its sign.
                first = 1.0 if k == j else 0.0
                if first == 0.0 or own[j, JACOBIAN + n + k] <= 0.0:
                    own[j, JACOBIAN + n + k] = first
        for j in range(n):
            c = joints[j]
            change = c.v - own[j, MEASURED]
            e = own[j, REFERENCE] - c.v
            bound = (1.0 - c.nu) * own[j, BOUND] + c.nu * 0.02
            tau = 0.5 * math.log(abs((own[j, BOUND] + e) / (own[j, BOUND] - e)))
            for i in range(PAST):
                own[j, NEWEST + PAST - i] = own[j, NEWEST + PAST - i - 1]
            power = abs(tau) ** 0.6
            own[j, NEWEST] = power if tau > 0.0 else -power
            scale, weight, total = c.h ** (-c.order), 1.0, 0.0
            for i in range(PAST + 1):
                if i > 0:
                    weight *= 1.0 - (c.order + 1.0) / i
                scaled = scale if i > 0 or c.whole_sum > 0.0 else 1.0
                total += scaled * weight * own[j, NEWEST + i]
            s = own[j, SURFACE] + c.lambda_3 * (tau - own[j, ERROR]) + c.lambda_1 * tau
            s += c.lambda_2 * own[j, SUM]
            ratio = math.exp(
                2.0 * (c.lambda_3 * tau - c.lambda_2 * total) / (c.lambda_1 + c.lambda_3)
            )
            asked = c.v_ref - c.v - own[j, REST] - (ratio - 1.0) / (ratio + 1.0) * bound
            for k in range(n):
                asked -= own[j, JACOBIAN + k] * (joints[k].v - own[k, MEASURED])
                asked -= own[j, JACOBIAN + 2 * n + k] * own[k, BEFORE]
            asked += 0.0001 if s > 0.0 else (-0.0001 if s < 0.0 else 0.0)
            own[j, ERROR], own[j, SURFACE], own[j, SUM], own[j, BOUND] = tau, s, total, bound
            own[j, CHANGE] = change
            c.u_law = asked / (own[j, JACOBIAN + n + j] + 1.0)  # du, until all joints have theirs
        for j in range(n):
            c = joints[j]
            own[j, BEFORE], own[j, LAST] = own[j, LAST], c.u_law
            own[j, TORQUE] += c.u_law
        for j in range(n):
            c = joints[j]
            predicted = own[j, OUTPUT] + own[j, REST]
            for k in range(n):
                predicted += own[j, JACOBIAN + k] * own[k, CHANGE]
                predicted += own[j, JACOBIAN + n + k] * own[k, LAST]
                predicted += own[j, JACOBIAN + 2 * n + k] * own[k, BEFORE]
            wrong = c.v - own[j, OUTPUT]
            own[j, REST_BEFORE] = own[j, REST]
            own[j, OUTPUT], own[j, REST] = predicted + 1.5 * wrong, own[j, REST] + 0.2 * wrong
            own[j, MEASURED], own[j, REFERENCE] = c.v, c.v_ref
            c.u_law = own[j, TORQUE]


def acceleration(t: float, q: np.ndarray, v: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return q'' of the published plant, whose masses vary: m1 = m2 = 1 + 0.1 sin t."""
    m, cosine, sine = 1.0 + 0.1 * np.sin(t), np.cos(q[1]), np.sin(q[1])
    corner = m * (1.0 + cosine) + 0.1
    mass = np.array([[m + 2.0 * m * (1.0 + cosine) + 0.2, corner], [corner, m + 0.1]])
    swing = m * sine * np.array([-v[1] * (2.0 * v[0] + v[1]), v[0] ** 2])
    far = m * np.cos(q.sum())
    weight = 9.81 * np.array([2.0 * m * np.cos(q[0]) + far, far])
    return np.linalg.solve(mass, torque - swing - weight)


def sliding_run(law: fp.Controller) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of the rates and their promised bounds, (10000, 2) each."""
    arm = fp.Arm.planar(lengths=(1.0, 1.0), masses=(1.0, 1.0), gravity=9.81)
    arm = arm.with_limits(effort=np.inf)
    loop = law.start(arm, step=1e-3, horizon=11.0)
    q, v, y = np.array([-0.96, 1.95]), np.full(2, 0.2), np.full(2, 0.2)
    wanted = np.array([0.5 * np.sin(np.pi / 4 * 1e-3), 0.2 * np.cos(2 * np.pi / 9 * 1e-3)])
    bound, errors, bounds = np.full(2, 0.7), [], []
    for k in range(1, 10001):
        t = 1e-3 * k
        ahead = np.array([0.5 * np.sin(np.pi / 4 * t), 0.2 * np.cos(np.pi / 3 * t)])
        errors.append(wanted - y)
        bounds.append(bound)
        torque = loop.torque(q, y, q, ahead)
        push = np.array([
            0.1 * np.sin(t) + 0.003 * np.sin(50 * np.pi * t),
            0.1 * np.cos(2 * t) + 0.002 * np.sin(40 * np.pi * t),
        ])  # fmt: skip
        v = v + 1e-3 * acceleration(t, q, v, torque + push)
        q = q + 1e-3 * v
        y, wanted = v + push, ahead
        bound = bound + np.array([0.003, 0.005]) * (0.02 - bound)
    return np.array(errors), np.array(bounds)


def sliding(bench: Bench) -> None:
    """Print the law's figures as it is published, and with its fractional sum put right."""
    rows = []
    for name, whole in (("as published", 0.0), ("newest sample weighed too", 1.0)):
        errors, bounds = sliding_run(TerminalSlidingMode(whole_sum=whole))
        outside = (np.abs(errors) > bounds).mean(axis=0)
        rows.append((
            name, both(1e3 * rms(errors), 3), both(1e3 * rms(errors[2000:]), 3),
            f"{outside[0]:.0%} / {outside[1]:.0%}",
        ))  # fmt: skip
    bench.say("Fractional terminal sliding mode with prescribed performance:")
    heads = [
        "fractional sum, joints 1 / 2", "RMS [mrad/s]", "after 2 s [mrad/s]",
        "samples beyond the promised bound",
    ]  # fmt: skip
    bench.table(heads, rows)


if __name__ == "__main__":
    run(__doc__, pelican, sliding)
