"""How fast is the engine?

Whole steps of every law beside one `pin.aba` call from Python on the same arm, which is the unit;
beside a bare step of MuJoCo (extra `mujoco`), without control, contacts or limits, of the same
bodies; and beside the loop that a good user of NumPy and Pinocchio would write. Then: a tick of
`Loop`, threads, compiling, a campaign beside the engine alone.

All figures are ratios in one process; times are processor time, the least of some turns. What a
step costs is the difference between a longer and a shorter run, so that no start is counted.
"""

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from common import Bench, aba_calls, arm_of, run, turn_by_turn
from numpy.typing import ArrayLike, NDArray

import fpid_pin as fp
from fpid_pin.campaign import LogUniform, Scenarios, Study, Uniform
from fpid_pin.control import Derivative, Integral
from fpid_pin.fractional.design import integrate_step
from fpid_pin.references import Sinusoid
from fpid_pin.simulation.engine import horizon_of

#: Steps of the shorter and the longer run, of one robot and of each of sixty.
STEPS = {1: (500, 2500), 60: (100, 500)}
ARMS = ("two_link", "ur5", "panda")
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NormalisedMit(fp.Controller):
    """A fractional law of one's own: gains by the normalised MIT rule, as in CONTRIBUTING."""

    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    gamma: ArrayLike = 1.0
    floor: ArrayLike = 1e-2

    operators: ClassVar = {"i_e": Integral(0.9), "d_e": Derivative(0.9)}
    shown: ClassVar = {"kp": "kp", "ki": "ki", "kd": "kd"}

    @staticmethod
    def torque(c: Any) -> Any:
        return c.kp * c.e + c.ki * c.i_e + c.kd * c.d_e

    @staticmethod
    def adapt(c: Any) -> None:
        size = c.floor + c.e * c.e + c.i_e * c.i_e + c.d_e * c.d_e
        rate = c.h * c.gamma * c.e / size
        c.kp += rate * c.e
        c.ki += rate * c.i_e
        c.kd += rate * c.d_e


def laws() -> dict[str, fp.Controller]:
    """Return the laws that are timed, gains per unit of inertia."""
    gains = {"kp": 100.0, "ki": 100.0, "kd": 20.0, "scale": "inertia"}
    fpid = {**gains, "integral_order": 0.9, "derivative_order": 0.9, "learning_rate": 1.0}
    both = {**fpid, "feedforward": True, "observer": 40.0}
    guard = fp.Supervisor(m_x=9.0, reference_bound=4.0, observer=40.0)
    return {
        "adaptive FPID, 24 modes": fp.AdaptiveFpid(**fpid),
        "a fractional law of one's own": NormalisedMit(**gains),
        "PID": fp.Pid(100, 50, 20, scale="inertia"),
        "PD + gravity": fp.PdGravity(kp=100, kd=20, scale="inertia"),
        "computed torque": fp.ComputedTorque(k0=64, k1=16),
        "sliding mode": fp.SlidingMode(slope=4, gain=5, scale="inertia"),
        "Slotine-Li": fp.SlotineLi(slope=4, damping=4, scale="inertia"),
        "FPID + feedforward + observer": fp.AdaptiveFpid(**both),
        "and the sampled supervisor": fp.AdaptiveFpid(**both, supervisor=guard),
    }


def experiment_of(arm: fp.Arm, steps: int) -> fp.Experiment:
    reference = Sinusoid(0.2, 1.0, offset=arm.home)
    return fp.Experiment(arm, reference, q0=arm.home, duration=steps * 1e-3)


def steps_of(arm: fp.Arm, law: fp.Controller, runs: int) -> list[Callable[[], object]]:
    """Return a shorter and a longer run of so many robots, compiled dynamics."""
    return [partial(fp.evaluate, experiment_of(arm, steps), [law] * runs) for steps in STEPS[runs]]


def marginal(times: list[float], runs: int) -> float:
    """Return the time of a step of one robot, by a shorter and a longer run [s]."""
    short, long = STEPS[runs]
    return (times[1] - times[0]) / (long - short) / runs


class FractionalDerivatives:
    """D^alpha of some signals whose rates are known, (4,): exact newest step, then modes."""

    def __init__(
        self, order: Array, design: fp.fractional.Design, h: float, horizon: float
    ) -> None:
        found = design.coefficients(order, step=h, horizon=horizon)
        pole = integrate_step(found.poles[:, np.newaxis], h)
        # Of rate, last rate and m: what the modes and the output take of them.
        self.drive = np.hstack([pole["b1"], pole["b0"], pole["b2"]])
        self.newest = np.stack([found.now, found.before, found.mean])
        self.decay, self.weights = pole["decay"], found.weights
        self.h = h
        self.x = np.zeros((len(pole), len(order)))
        self.inputs = np.zeros((3, len(order)))

    def update(self, f: Array, f0: Array, rate: Array, rate0: Array) -> Array:
        inputs = self.inputs
        inputs[0], inputs[1] = rate, rate0
        inputs[2] = (f - f0) / self.h - (rate + rate0) / 2
        self.x *= self.decay
        y = (self.newest * inputs).sum(axis=0) + (self.weights * self.x).sum(axis=0)
        self.x += self.drive @ inputs
        return y


def plain_loop(experiment: fp.Experiment, controller: fp.AdaptiveFpid, rows: int) -> Array:
    """Return q of so many rows of the paper's experiment, (rows, 2), as a good user would write it.

    One robot, one run, NumPy and `pin.aba`; all modes, of both joints and both terms, are one
    array: 20 us a step where an array for each term takes 37.
    """
    model = experiment.arm.model
    data = model.createData()
    h, horizon = experiment.step, horizon_of(experiment.duration)
    q, v = np.array(experiment.q0), np.array(experiment.v0)
    gains = np.array([controller.kp, controller.ki, controller.kd])
    gamma, k0, k1 = (float(x) for x in (controller.learning_rate, controller.k0, controller.k1))
    orders = np.concatenate([1 - controller.integral_order, controller.derivative_order])
    fractional = FractionalDerivatives(orders, controller.design, h, horizon)
    integral, terms = np.zeros(2), np.zeros((3, 2))
    last_e = last_rate = np.zeros(2)
    angles = np.empty((rows, 2))
    amplitude, frequency = np.array([0.4, 0.6]), 5 * math.pi
    for k in range(rows):
        t = k * h
        angles[k] = q
        e = math.sin(t) - q
        rate = math.cos(t) - v
        if k:
            last = integral
            integral = integral + h * (e + last_e) / 2 + h * h * (last_rate - rate) / 12
            f, f0 = np.concatenate([integral, e]), np.concatenate([last, last_e])
            g, g0 = np.concatenate([e, rate]), np.concatenate([last_e, last_rate])
            terms[1:] = fractional.update(f, f0, g, g0).reshape(2, 2)
        terms[0] = e
        last_e, last_rate = e, rate
        u = (gains * terms).sum(axis=0)
        s = rate + k1 * e + k0 * integral
        gains += h * gamma * s * terms
        v = v + h * pin.aba(model, data, q, v, u + amplitude * math.cos(frequency * t))
        q = q + h * v
    return angles


def mujoco_model(arm: fp.Arm) -> Any:
    """Return the arm in MuJoCo, written from Pinocchio's: bodies, joints, rotor inertias."""
    import mujoco

    model, spec = arm.model, mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = 1e-3, model.gravity.linear
    off = mujoco.mjtDisableBit
    spec.option.disableflags = int(off.mjDSBL_CONTACT) | int(off.mjDSBL_LIMIT)
    data, parent = model.createData(), spec.worldbody
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for k in range(1, model.njoints):
        place, body = model.jointPlacements[k], model.inertias[k]
        turn = pin.Quaternion(place.rotation).coeffs()  # x, y, z, w
        six = np.asarray(body.inertia)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        six[:3] += 0.0 if six[:3].all() else 1e-12  # MuJoCo has no point masses
        parent = parent.add_body(
            pos=place.translation, quat=turn[[3, 0, 1, 2]], mass=body.mass, ipos=body.lever,
            fullinertia=six, explicitinertial=True,
        )  # fmt: skip
        axis = np.reshape(pin.getJointJacobian(model, data, k, pin.LOCAL), (6, -1))[:, k - 1]
        slides = bool(np.abs(axis[:3]).max() > 0.5)
        kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
        parent.add_joint(
            type=kind, axis=axis[:3] if slides else axis[3:], armature=model.armature[k - 1]
        )
    return spec.compile()


def mujoco_steps(arm: fp.Arm) -> list[Callable[[], object]]:
    """Return a shorter and a longer run of bare steps, semi-implicit Euler on one thread."""
    import mujoco
    from mujoco import rollout

    model = mujoco_model(arm)
    data = mujoco.MjData(model)
    data.qpos[:] = arm.home
    mujoco.mj_forward(model, data)
    mass = np.zeros((arm.n, arm.n))
    mujoco.mj_fullM(model, data, mass)
    assert np.allclose(mass, arm.mass_matrix(arm.home), rtol=1e-9, atol=1e-9)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros((1, mujoco.mj_stateSize(model, kind)))
    mujoco.mj_getState(model, data, state[0], kind)
    return [partial(rollout.rollout, model, data, state, nstep=steps) for steps in STEPS[1]]


def steps(bench: Bench) -> None:
    repeats, arms = 3 if bench.quick else 25, [arm_of(name) for name in ARMS]
    units = dict.fromkeys(ARMS, np.inf)
    bare = "MuJoCo's bare step, no law"
    found: dict[str, list[list[float]]] = {name: [] for name in laws()} | {bare: []}
    for arm in arms:
        works = {name: [*steps_of(arm, law, 1), *steps_of(arm, law, 60)]
                 for name, law in laws().items()}  # fmt: skip
        works[bare] = mujoco_steps(arm)
        for name, each in works.items():
            each[0]()
            unit, *times = turn_by_turn([aba_calls(arm), *each], repeats)
            units[arm.name] = min(units[arm.name], unit / 1000)
            found[name].append([marginal(times[k : k + 2], runs)
                                for k, runs in ((0, 1), (2, 60)) if times[k:]])  # fmt: skip
    paper, law = fp.paper_experiment(duration=4.0), fp.paper_controller(supervised=False)
    apart = np.abs(plain_loop(paper, law, 4001) - fp.simulate(paper, law).q).max()
    ours = [partial(fp.evaluate, fp.paper_experiment(duration=1e-3 * n), [law] * runs)
             for runs, counts in STEPS.items() for n in counts]  # fmt: skip
    plain, *times = turn_by_turn([partial(plain_loop, paper, law, 501), *ours], repeats)
    plain /= 501
    ratios = [plain / marginal(times[:2], 1), plain / marginal(times[2:], 60)]
    rows = [
        [name, *(" / ".join(f"{x / unit:.2f}" for x in times)
                 for times, unit in zip(each, units.values(), strict=True))]
        for name, each in found.items()
    ]  # fmt: skip
    rows.append(["the plain loop, FPID", f"{plain / units['two_link']:.1f}", "", ""])
    told = ", ".join(f"{1e6 * unit:.2f}" for unit in units.values())
    fpid = found["adaptive FPID, 24 modes"]
    beside = [f"{ours[0] / m[0]:.2f}" for ours, m in zip(fpid, found[bare], strict=True)]
    bench.say(
        f"A whole step of the adaptive FPID takes {fpid[0][0] / units['two_link']:.2f} to "
        f"{max(f[0] / u for f, u in zip(fpid, units.values(), strict=True)):.2f} calls of "
        f"`pin.aba` from Python, {ratios[0]:.0f} times less than the plain loop "
        f"({1e6 * plain:.1f} us; {ratios[1]:.0f} times where sixty run), which gives the same "
        f"angles within {apart:.0e} rad"
        f"; of MuJoCo's bare step of the same arm it takes {', '.join(beside)}."
    )
    bench.say(f"A step of one robot / of each of sixty, in calls of `pin.aba` ({told} us):")
    bench.table(["law", *ARMS], rows)


def ticks(bench: Bench) -> None:
    arm = fp.Arm.from_example("panda")
    q, zero = np.array(arm.home), np.zeros(arm.n)
    told = []
    for name in ("adaptive FPID, 24 modes", "and the sampled supervisor"):
        loop = laws()[name].start(arm, step=1e-3)

        def many(loop: fp.control.Loop = loop) -> None:
            for _ in range(1000):
                loop.torque(q, zero, q, zero, zero)

        unit, taken = turn_by_turn([aba_calls(arm), many], 3 if bench.quick else 25)
        told.append(f"{taken / unit:.2f} ({name})")
    bench.say(f"A tick of `Loop` on the Panda takes {', '.join(told)} calls of `pin.aba`.")


def threads(bench: Bench) -> None:
    # As long as a candidate of the paper's search: the start of a run, in Python, is not shared.
    e = experiment_of(fp.Arm.from_example("ur5"), 2_000 if bench.quick else 20_000)
    law = laws()["adaptive FPID, 24 modes"]
    works = [partial(fp.evaluate, e, [law] * 60, workers=workers) for workers in (1, 2)]
    one, two = turn_by_turn(works, 2 if bench.quick else 5, time.perf_counter)
    bench.say(f"Two threads do sixty UR5s {one / two:.2f} times as fast as one.")


def compiling(bench: Bench) -> None:
    """Print how long it takes to compile, in an empty cache and a full one."""
    code = (
        "import time, fpid_pin as fp, fpid_pin.simulation.engine\n"
        "for law in (fp.Pid(1, 1, 1), fp.paper_controller(), fp.ComputedTorque(),"
        " fp.SlidingMode(1, 1), fp.SlotineLi(1, 1)):\n"
        "    t = time.process_time(); fp.evaluate(fp.paper_experiment(duration=.01), law)\n"
        "    print(f'{time.process_time() - t:.2f}', end=' ')"
    )
    caches = {"from the cache": os.environ}
    with tempfile.TemporaryDirectory() as folder:
        if not bench.quick:
            caches = {"anew": {**os.environ, "NUMBA_CACHE_DIR": folder}} | caches
        told = [
            f"{name} {subprocess.check_output([sys.executable, '-c', code], env=env, text=True)}"
            for name, env in caches.items()
        ]
    bench.say(
        "Compiling the engine with PID, then FPID, computed torque, sliding mode, Slotine-Li [s]: "
        + "; ".join(line.strip() for line in told)
    )


def campaign(bench: Bench) -> None:
    plants, duration = (64, 1.0) if bench.quick else (10_000, 10.0)
    law, experiment = fp.paper_controller(supervised=False), fp.paper_experiment(duration=duration)
    uncertain = {
        "mass": Uniform(low=0.8, high=1.2), "inertia": Uniform(low=0.8, high=1.2),
        "payload": Uniform(low=0.0, high=1.0), "viscous_friction": Uniform(low=0.0, high=0.2),
        "disturbance_amplitude": LogUniform(low=0.1, high=2.0),
        "disturbance_frequency": Uniform(low=1.0, high=20.0, shared=True),
    }  # fmt: skip
    study = Study(experiment, {"FPID": law}, Scenarios(uncertain), "two_link")

    # The engine by itself: plants that are there already, and nothing recorded.
    some = [study.experiment_of(k, sample) for k, sample in enumerate(study.samples(0, 64))]
    fp.evaluate(some[:1], law)  # what is fitted, or compiled, is so from then on
    began = time.process_time()
    fp.evaluate(some, law)
    alone = (time.process_time() - began) / len(some)
    rows: list[list[Any]] = []
    clocks = []
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            clock, spent = time.perf_counter(), time.process_time()
            fp.campaign.run(study, Path(folder, "ledger"), plants, workers=workers)
            clocks.append(time.perf_counter() - clock)
            spent = time.process_time() - spent
        rows.append([workers, f"{clocks[-1]:.1f}", f"{clocks[-1] * workers / alone / plants:.2f}",
                     f"{spent:.1f}"])  # fmt: skip
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    bench.say(
        f"A campaign of {plants} two-link plants x {duration:g} s takes {rows[1][2]} times what "
        f"the engine alone takes ({1e9 * alone / (experiment.rows - 1):.0f} ns a run-step), with "
        f"an efficiency of {clocks[0] / 2 / clocks[1]:.2f} from 1 to 2 workers and {most:.0f} MB."
    )
    bench.table(["workers", "clock [s]", "over the engine's own", "processors [s]"], rows)


if __name__ == "__main__":
    run(__doc__, steps, ticks, threads, compiling, campaign)
