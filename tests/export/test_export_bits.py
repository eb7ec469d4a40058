"""The exported C, compiled strictly, and the JavaScript give the torques of the simulation."""

import dataclasses
import math
import re
import shutil
from dataclasses import dataclass

import numpy as np
import pytest
from bounded import finished
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.control.law import Derivative, Integral
from fpid_pin.export import build, javascript
from fpid_pin.export.folder import Vectors, answers, signals, simulated
from fpid_pin.export.kinds import INT, bundle, real, words
from fpid_pin.export.law import CSource, by_name, start
from fpid_pin.export.printer import Program
from fpid_pin.kernels import tick

pytestmark = pytest.mark.usefixtures("gcc")
HORIZON = 20.0
SANE = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g", "-O1")
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
LAWS = PLAIN | OTHERS
#: Laws that small differences grow in where torques have no effect: they take a plant.
CHAOTIC = {
    "moving orders and supervisor": fpid(order_learning_rate=0.01, supervisor=QUIET),
    "observer beside the paper's supervisor": fpid(
        observer=50.0, feedforward=True, supervisor=dataclasses.replace(PAPER, m_x=1.02)
    ),
}


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


def torques(folder, flags=()):
    """Return what the compiled C answers to the vectors; it restarts half way."""
    build.check(folder, flags, folder / "torques.bin")
    return np.fromfile(folder / "torques.bin")


def off(found, proof):
    """Return the largest difference of torques, as a part of the largest torque."""
    return np.abs(found - proof.torque.ravel()).max() / np.abs(proof.torque).max()


# On the larger arms the reserve is more than this step can promise, which is warned of.
@pytest.mark.filterwarnings("ignore:supervisor.disturbance_bound")
@pytest.mark.parametrize("robot", ["two_link", "ur5", "panda"])
@pytest.mark.parametrize("name", LAWS)
def test_every_law_is_the_loops_over_twenty_thousand_ticks(
    name, robot, tmp_path, monkeypatch, node
):
    """Strictly compiled: a function that is printed but not used would be refused."""
    controller = LAWS[name]
    arm = arm_of(robot, controller)
    proof = recorded(controller, arm, 20_000)
    limited = np.abs(proof.torque) == arm.effort_limit
    assert limited.any()
    assert not limited.all()
    folder, most = write(controller, arm, tmp_path / "c", proof), 0.0 if name in PLAIN else 1e-12
    if robot == "two_link":
        # In single precision, too.
        single = torques(folder, ("-DFPID_SINGLE", "-O1"))[: 2000 * arm.n]
        first = proof.torque.ravel()[: single.size]
        assert 0.0 < np.abs(single - first).max() < 1e-3 * np.abs(first).max()
    if robot == "ur5" and shutil.which("clang"):
        monkeypatch.setattr(build, "compiler", lambda: shutil.which("clang"))
    assert off(torques(folder, SANE if robot == "ur5" else ()), proof) <= most
    if robot == "ur5":
        found = in_node(node, tmp_path, controller, arm, proof.inputs[:2000])
        assert np.abs(found - proof.torque[:2000]).max() <= most * np.abs(proof.torque).max()
    if getattr(controller, "supervisor", None) is not None and robot == "two_link":
        bare = recorded(dataclasses.replace(controller, supervisor=None), arm, 2000).torque
        assert off(bare.ravel(), proof._replace(torque=proof.torque[:2000])) > 0.01


# The supervisor stands by, all through the paper's experiment.
CLOSED = CHAOTIC | {
    "the paper's": fp.paper_controller(supervised=False),
    "the paper's, supervised": fp.paper_controller(),
}


@pytest.mark.parametrize("case", [*range(10), *CLOSED])
def test_random_laws_and_those_of_the_papers_experiment(case, tmp_path, node):
    """What is chaotic on prescribed inputs is compared in a closed loop."""
    if case in CLOSED:
        controller, arm, step = CLOSED[case], fp.Arm.two_link(), 1e-3
        proof = simulated_by(controller)
        assert len(proof.torque) >= 20_000
    else:
        controller, arm, step = random_law(case)
        proof = recorded(controller, arm, 3000, step)
    assert np.isfinite(proof.torque).all()
    folder = write(controller, arm, tmp_path / "c", proof, step)
    assert off(torques(folder), proof) <= (1e-12 if case in CHAOTIC else 0.0)
    if controller.supervisor is None:
        found = in_node(node, tmp_path, controller, arm, proof.inputs, step)
        assert np.array_equal(found, proof.torque)


@pytest.mark.parametrize("name", ["FPID, quiet", "Slotine-Li"])
def test_valgrind_finds_no_read_of_what_was_not_written(name, tmp_path):
    if shutil.which("valgrind") is None:
        pytest.skip("no valgrind")
    controller, arm = LAWS[name], fp.Arm.from_example("ur5")
    folder = write(controller, arm, tmp_path / "c", recorded(controller, arm, 200))
    program = build.compile_check(folder, folder / "check", ("-g",))
    command = ["valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full"]
    done = finished([*command, str(program), str(folder / "vectors.bin")])
    assert done.returncode == 0, done.stderr


def test_with_32_bits_and_sse_the_bits_are_the_same(tmp_path):
    controller, arm, flags = PLAIN["FPID"], fp.Arm.two_link(), ("-m32", "-msse2", "-mfpmath=sse")
    (tmp_path / "none.c").write_text("#include <math.h>\nint main(void) { return 0; }\n")
    wanted = [build.compiler(), *flags, str(tmp_path / "none.c"), "-o", str(tmp_path / "none")]
    if finished(wanted).returncode:
        pytest.skip("the compiler has no libraries of 32 bits")
    proof = recorded(controller, arm, 20_000)
    found = torques(write(controller, arm, tmp_path / "c", proof), flags)
    assert np.array_equal(found, proof.torque.ravel())


def test_only_what_a_law_uses_is_printed(tmp_path):
    arm = fp.Arm.two_link()
    folder = write(PLAIN["PID"], arm, tmp_path / "c", recorded(PLAIN["PID"], arm, 2))
    text = (folder / "fpid.h").read_text() + (folder / "fpid.c").read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    for word in ("body", "modes", "mass", "ipow", "solve_symmetric", "estimates"):
        assert word not in text


RUN = """
const fs = require('fs');
const given = (name) => new Float64Array(new Uint8Array(fs.readFileSync(name)).buffer);
const M = given(process.argv[2]), inputs = given(process.argv[3]);
const ticks = inputs.length / (5 * JOINTS), out = new Float64Array(ticks * JOINTS);
for (let k = 0; k < ticks; k++) {
    M.set(inputs.subarray(k * 5 * JOINTS, (k + 1) * 5 * JOINTS), INPUTS);
    TICK(INPUTS, TORQUE, k == 0 ? 7 : 15);
    out.set(M.subarray(TORQUE, TORQUE + JOINTS), k * JOINTS);
}
fs.writeFileSync(process.argv[4], Buffer.from(out.buffer));
"""


def in_node(node, tmp_path, controller, arm, inputs, step=1e-3):
    """Return the torques of a law printed as JavaScript."""
    state = start(controller, arm, step, HORIZON)
    values = {**state.c._asdict(), "joints": state.joints}
    memory, places, at = [], {}, 0
    for name, array in {**values, "inputs": state.inputs, "out": state.torque}.items():
        # A joint's record and its numbers are one and the same.
        places[name] = places["joints"] if name == "numbers" else at
        if name != "numbers":
            memory.append(words(array))
            at += memory[-1].size
    texts = {name: str(place) for name, place in places.items()}
    program = Program(javascript.JavaScript(), by_name(state.controller))
    kinds = [bundle("controller", values, texts), real(5, state.n), real(state.n), INT]
    known = {
        "TICK": program.add(tick.tick_parts, kinds).name, "JOINTS": state.n,
        "INPUTS": places["inputs"], "TORQUE": places["out"],
    }  # fmt: skip
    lines = [f"const {name} = {value};" for name, value in known.items()]
    paths = [tmp_path / name for name in ("run.js", "memory.bin", "inputs.bin", "out.bin")]
    paths[0].write_text("\n".join([*lines, javascript.HELPERS, program.text, RUN]))
    np.concatenate(memory).tofile(paths[1])
    np.ascontiguousarray(inputs).tofile(paths[2])
    node(*paths)
    return np.fromfile(paths[3]).reshape(-1, arm.n)
