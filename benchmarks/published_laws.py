"""What do published fractional laws come to when they are run again?

pelican: fractional PD on the Pelican arm, DOI 10.1007/s10846-019-01121-y, with its code in
github.com/phelipe/jirs-paper-code: against its PDs, and PDs tuned equally.

sliding: data-driven fractional-order terminal sliding mode with prescribed performance, DOI
10.1016/j.isatra.2022.05.036, github.com/Babak-Esmaeili/PP-MFA-FO-FTSM-Control: its two-link
example, the fractional sum as its code has it, and as its definition has it.

Parameters are the authors'; laws are written anew from their equations. The paper itself is run
again by orders.py: its orders against integer ones, with its gains and with tuned ones.
"""

from dataclasses import dataclass
from types import SimpleNamespace
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
    links = (23.902, 1.285), (0.45, 0.0), (0.091, 0.048), (1.266, 0.093)
    model = pendulum(*links, from_x=True)
    return fp.Experiment(
        fp.Arm.from_model(model).with_limits(effort=(200.0, 15.0)), Quintic(0.0, 0.8, 3.0),
        step=5e-3, duration=3.0, integrator="rk4",
        plant=fp.Plant(disturbance=TwoTones()) if disturbed else None,
    )  # fmt: skip


def pelican(bench: Bench) -> None:
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

PAST = 10  # samples before the newest that the fractional sum takes


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
    whole_sum: bool = False
    order: float = -0.8

    def begin(self, state: Any) -> None:
        """Start as the published loop does, at t = 0.001 s."""
        wanted = [0.5 * np.sin(np.pi / 4 * 1e-3), 0.2 * np.cos(2 * np.pi / 9 * 1e-3)]
        powers = np.zeros((PAST + 1, 2))
        powers[0, 0] = -(0.4**0.6)
        names = "torque change last before predicted rest rest_before tau s total"
        state.memory["own"] = SimpleNamespace(
            **{name: np.zeros(2) for name in names.split()}, wanted=np.array(wanted),
            y=np.full(2, 0.2), rho=np.full(2, 0.7), powers=powers,
            phi=np.hstack([10.0 * np.eye(2), np.eye(2), np.eye(2)]),
        )  # fmt: skip

    def control(self, state: Any, q: Any, y: Any, q_ref: Any, ahead: Any, a_ref: Any) -> Any:
        """Return the torque; `ahead` is what y is to be one sample on."""
        m = state.memory["own"]
        # The estimate, moved along the last change of everything.
        moved = np.concatenate([m.change, m.last, m.before])
        lack = y - m.y - m.rest_before - m.last - m.phi @ moved
        m.phi += np.outer(lack, moved) / (1.0 + moved @ moved)
        # What multiplies the newest du is put back where it changes its sign.
        gain = np.diag(m.phi[:, 2:4])
        gain = np.where(gain > 0.0, gain, 1.0)
        m.phi[:, 2:4] = np.diag(gain)
        l1, l2, l3, nu = map(np.asarray, (self.lambda_1, self.lambda_2, self.lambda_3, self.nu))
        e, m.change = m.wanted - y, y - m.y
        tau = 0.5 * np.log(np.abs((m.rho + e) / (m.rho - e)))
        m.rho = (1.0 - nu) * m.rho + nu * 0.02
        m.powers = np.vstack([np.sign(tau) * np.abs(tau) ** 0.6, m.powers[:-1]])
        weights = np.cumprod([1.0, *(1.0 - (self.order + 1.0) / np.arange(1, PAST + 1))])
        weights[0 if self.whole_sum else 1 :] *= state.step**-self.order
        m.s = m.s + l3 * (tau - m.tau) + l1 * tau + l2 * m.total
        m.tau, m.total = tau, weights @ m.powers
        reached = np.tanh((l3 * tau - l2 * m.total) / (l1 + l3)) * m.rho
        asked = ahead - y - m.rest - reached - m.phi[:, :2] @ m.change - m.phi[:, 4:] @ m.before
        m.before, m.last = m.last, (asked + 1e-4 * np.sign(m.s)) / (gain + 1.0)
        m.torque = m.torque + m.last
        wrong, m.rest_before = y - m.predicted, m.rest
        m.predicted = m.predicted + m.rest + 1.5 * wrong
        m.predicted += m.phi @ np.concatenate([m.change, m.last, m.before])
        m.rest = m.rest + 0.2 * wrong
        m.y, m.wanted = np.array(y), np.array(ahead)
        return m.torque


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
    rows = []
    for name, whole in (("as published", False), ("newest sample weighed too", True)):
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
