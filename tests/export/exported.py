"""Controllers to export, and how a folder is made of one."""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.control.law import Derivative, Integral
from fpid_pin.export.folder import Vectors, answers, signals, simulated
from fpid_pin.export.law import CSource, start

HORIZON = 20.0


def random_law(seed):
    """Return a controller, its arm and step: all that a law without a model may have."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    arm = fp.Arm.planar(lengths=rng.uniform(0.3, 1.0, n), masses=rng.uniform(0.5, 3.0, n))
    if rng.random() < 0.6:
        arm = arm.with_limits(effort=rng.uniform(2.0, 40.0, n))
    moves = rng.random() < 0.4
    modes = fp.fractional.ExponentialSum(modes=int(rng.integers(8, 28)))
    design = modes if moves or rng.random() < 0.7 else fp.fractional.Crone(n=4)
    guard = None
    if rng.random() < 0.5:
        guard = fp.Safeguards(maximum=60.0, sigma=rng.uniform(0, 1), dead_zone=0.01)
    ends = rng.integers(0, 2, (2, n))
    orders = np.where(rng.random((2, n)) < 0.2, ends, rng.uniform(0.05, 0.98, (2, n)))
    controller = fp.AdaptiveFpid(
        kp=rng.uniform(1, 50, n), ki=rng.uniform(0, 50, n), kd=rng.uniform(0.1, 20, n),
        integral_order=orders[0], derivative_order=orders[1],
        learning_rate=rng.uniform(0.0, 20.0, (3, n)),
        k0=rng.uniform(0.1, 3.0), k1=rng.uniform(0.1, 5.0),
        regressors=str(rng.choice(["law", "integer"])), design=design,
        initialisation=str(rng.choice(["caputo", "grunwald_letnikov"])),
        scale=rng.uniform(0.5, 2.0, n), safeguards=guard,
        order_learning_rate=rng.uniform(0.0, 0.05, (2, n)) if moves else 0.0,
    )  # fmt: skip
    if controller.initialisation == "caputo" and seed % 2:
        controller = dataclasses.replace(controller, derivative_on="measurement")
    return controller, arm, float(rng.choice([5e-4, 1e-3, 4e-3]))


SMALL = 1e-3


def soft(x, width):
    """Return x, or less where it is large."""
    return width * math.tanh(x / width)


@dataclass(frozen=True, eq=False)
class Softened(fp.Controller):
    """A law of one's own: a surface, operators of it, memory, and functions of `math`."""

    kp: ArrayLike
    kd: ArrayLike
    order: ArrayLike = 0.6
    rate: ArrayLike = 0.2

    memory = ("s", "gain")
    operators = {
        "d_s": Derivative("order", of="s"), "i_q": Integral(0.4, of="s", sign=-1),
        "d_e": Derivative(0.9),
    }  # fmt: skip

    @staticmethod
    def surface(c):
        c.s = soft(c.e, 0.3) + 0.1 * c.e_dot

    @staticmethod
    def torque(c):
        size = math.exp(-abs(c.s)) + math.log(1.0 + c.s * c.s) + math.copysign(SMALL, c.s)
        power = math.pow(abs(c.s), 0.5) + c.s**3
        return c.kp * (c.d_e + 0.1 * size + 0.1 * power) + (c.kd + c.gain) * c.d_s - c.i_q

    @staticmethod
    def adapt(c):
        c.gain += c.h * c.rate * c.s * c.d_s if abs(c.s) > SMALL else 0.0


@dataclass(frozen=True, eq=False)
class WholeRobot(fp.Controller):
    """A law of the whole robot: weight, and springs between neighbours that learn."""

    kp: ArrayLike

    @staticmethod
    def torques(joints, own, model):
        for j in range(joints.size):
            c = joints[j]
            before = joints[j - 1].e if j > 0 else 0.0
            c.u_law = c.scale * (c.kp * c.e + own[j, 0] * (c.e - before))
            c.u_law -= model.bodies[j].m * model.gravity[2] * own[j, 1]

    @staticmethod
    def adapts(joints, own, model):
        for j in range(joints.size):
            own[j, 0] += joints[j].h * joints[j].e * joints[j].e

    def arrays(self, arm, step, horizon):
        return np.full((arm.n, 2), 0.1)


def fpid(**others):
    return fp.AdaptiveFpid(
        kp=60.0, ki=30.0, kd=12.0, integral_order=0.9, derivative_order=0.8, learning_rate=2.0,
        **others,
    )  # fmt: skip


PAPER = fp.Supervisor(m_x=1.1, reference_bound=1.0, kind="paper", disturbance_bound=0.5)
QUIET = fp.Supervisor.quiet(1.3, 1.0)
RESERVE = fp.Supervisor(1.2, 1.0, disturbance_bound=0.3, lookahead=0.01)
#: Laws whose torques are sums, products and roots of what they are given: equal to the last bit.
PLAIN = {
    "FPID": fpid(safeguards=fp.Safeguards(maximum=95.0, sigma=0.1, dead_zone=0.02)),
    "FPID, CRONE": fpid(design=fp.fractional.Crone(n=4)),
    "FPID, orders that move": fpid(order_learning_rate=0.01),
    "PID": fp.Pid(kp=60.0, ki=20.0, kd=9.0),
}
#: Laws with sines, or more of `math`, in them.
OTHERS = {
    "FPID, quiet": fpid(feedforward=True, observer=100.0, supervisor=QUIET),
    "FPID, reserve": fpid(supervisor=RESERVE),
    "FPID, paper": fpid(supervisor=PAPER),
    "PD + gravity": fp.PdGravity(kp=60.0, kd=9.0),
    "computed torque": fp.ComputedTorque(k0=100.0, k1=20.0, ki=5.0, observer=50.0),
    "sliding mode": fp.SlidingMode(slope=5.0, gain=10.0, scale="inertia"),
    "Slotine-Li": fp.SlotineLi(slope=5.0, damping=8.0, leakage=0.1),
    "own": Softened(kp=20.0, kd=3.0, feedforward=True),
    "own, whole robot": WholeRobot(kp=20.0, observer=30.0),
}
#: Laws that small differences grow in where torques have no effect: they take a plant.
CHAOTIC = {
    "moving orders and supervisor": fpid(order_learning_rate=0.01, supervisor=QUIET),
    "observer beside the paper's supervisor": fpid(
        observer=50.0, feedforward=True, supervisor=dataclasses.replace(PAPER, m_x=1.02)
    ),
}


def arm_of(name, controller):
    """Return an arm whose limits the controller reaches at times, so that what is held is held."""
    arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
    arm = arm.with_limits(effort=1e6)
    return arm.with_limits(effort=0.6 * np.abs(recorded(controller, arm, 1000).torque).max(axis=0))


def simulated_by(controller):
    """Return what the paper's whole experiment gave a controller, and what it answered."""
    experiment = fp.paper_experiment()
    inputs = simulated(experiment, controller, 20_000)
    return Vectors(inputs, fp.simulate(experiment, controller).torque)


def recorded(controller, arm, ticks, step=1e-3):
    """Return prescribed motions, and what a controller answered."""
    return answers(controller, arm, step, HORIZON, signals(arm, step, ticks))


def write(controller, arm, folder, proof, step=1e-3):
    """Write what is compiled, and the vectors, without the README that measures them."""
    folder.mkdir(parents=True)
    CSource(start(controller, arm, step, HORIZON)).write(folder)
    proof.write(folder / "vectors.bin")
    return folder
