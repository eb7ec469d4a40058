"""Runs made by formula, where what is seen matters and not what was simulated."""

import numpy as np
import pytest
from robots import joint, link, robot, write

import fpid_pin as fp
from fpid_pin.references import Sinusoid
from fpid_pin.simulation import Outcome
from fpid_pin.simulation.recorded import describe_run


@pytest.fixture(scope="session")
def make_run():
    def make(arm, duration=2.0, name="wave", lag=0.3, integer=False, rows=None):
        n, h = arm.n, 1e-3
        order = 1.0 if integer else 0.9
        law = fp.AdaptiveFpid(
            10.0, 5.0, 3.0, integral_order=order, derivative_order=order, name=name,
            supervisor=fp.paper_controller().supervisor if n == 2 else None,
        )  # fmt: skip
        job = fp.Experiment(arm, Sinusoid(0.4, 1.5, offset=arm.home), duration=duration)
        t = np.arange(round(duration / h) + 1) * h
        q_ref = arm.home + 0.4 * np.sin(1.5 * t)[:, np.newaxis] * np.ones(n)
        q = arm.home + 0.4 * np.sin(1.5 * t - lag)[:, np.newaxis] * np.ones(n)
        v = 0.6 * np.cos(1.5 * t)[:, np.newaxis] * np.ones(n)
        u = 5.0 * np.cos(3.0 * t)[:, np.newaxis] * np.linspace(1.0, 2.0, n)
        gain = 10.0 + np.cumsum(np.abs(u), axis=0) * 1e-4
        signals = dict.fromkeys(("kp", "ki", "kd"), gain) | {
            "u_fpid": u, "u_s": np.zeros_like(u), "s": q_ref - q,
            "lyapunov": (q_ref - q)[:, 0] ** 2,
        }  # fmt: skip
        stop, outcome = len(t), Outcome(True, duration)
        if rows is not None:
            stop = rows
            outcome = Outcome(False, rows * h, arm.joint_names[0], "speed 2e3 rad/s")
        return fp.Run(
            t[:stop], q[:stop], v[:stop], q_ref[:stop], v[:stop], u[:stop],
            signals={k: x[:stop] for k, x in signals.items()}, outcome=outcome, step=h,
            planned_rows=len(t), meta=describe_run(job, law, "pinocchio") | {"name": name},
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def two_link():
    return fp.Arm.two_link()


@pytest.fixture(scope="session")
def wave(make_run, two_link):
    return make_run(two_link)


#: A column that turns, a carriage that goes up it, a boom that comes out.
JOINTS = (("revolute", "0 0 1", 0.0), ("prismatic", "0 0 1", 0.3), ("prismatic", "1 0 1", 0.2))


@pytest.fixture(scope="session")
def scara(tmp_path_factory):
    limit = '<limit lower="-0.4" upper="0.6" effort="90" velocity="2"/>'
    parts = [link(f"l{k}", 1.0, 0.02) for k in range(4)]
    for k, (kind, axis, z) in enumerate(JOINTS):
        origin = f'0 0 {z}" rpy="0 0 {0.3 * (k + 1)}'
        parts.append(joint(f"j{k + 1}", f"l{k}", f"l{k + 1}", kind, limit, axis, origin))
    return fp.Arm.from_urdf(write(tmp_path_factory.mktemp("scara"), robot(*parts)))


@pytest.fixture(scope="session")
def scara_run(scara):
    reference = Sinusoid(amplitude=[0.3, 0.2, 0.2], frequency=3.0, phase=[0, 1, 2])
    return fp.simulate(fp.Experiment(scara, reference, duration=0.2), fp.suggest_gains(scara))
