"""Controllers to export, and how a folder is made of one."""

import numpy as np

import fpid_pin as fp
from fpid_pin.export import vectors
from fpid_pin.export.c_source import CSource
from fpid_pin.export.folder import write_sources
from fpid_pin.export.law import start

HORIZON = 20.0


def guarded_panda():
    """A Panda with all safeguards, effort limits that are reached, and orders of each joint."""
    arm = fp.Arm.from_example("panda").with_limits(effort=[20, 20, 15, 15, 4, 4, 4])
    guard = fp.Safeguards(maximum=95.0, sigma=0.1, e_modification=0.01, dead_zone=0.02)
    controller = fp.AdaptiveFpid(
        kp=(90, 90, 70, 70, 25, 20, 10), ki=30.0, kd=(30, 30, 20, 20, 6, 5, 2),
        integral_order=np.linspace(0.6, 1.0, 7), derivative_order=np.linspace(1.0, 0.7, 7),
        learning_rate=5.0, safeguards=guard,
    )  # fmt: skip
    return controller, arm


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
        initialisation=str(rng.choice(["caputo", "riemann_liouville", "grunwald_letnikov"])),
        scale=rng.uniform(0.5, 2.0, n), safeguards=guard,
        order_learning_rate=rng.uniform(0.0, 0.05, (2, n)) if moves else 0.0,
    )  # fmt: skip
    return controller, arm, float(rng.choice([5e-4, 1e-3, 4e-3]))


def simulated(controller):
    """Return what the paper's whole experiment gave a controller, and what it answered."""
    experiment = fp.paper_experiment()
    inputs = vectors.simulated(experiment, controller, 20_000)
    return vectors.Vectors(inputs, fp.simulate(experiment, controller).torque)


def write(controller, arm, step, ticks, folder, found=None):
    """Write what is compiled, and the vectors, without the README that measures them."""
    folder.mkdir()
    write_sources(CSource(start(controller, arm, step, HORIZON)), folder)
    if found is None:
        inputs = vectors.signals(arm, step, ticks)
        found = vectors.answers(controller, arm, step, HORIZON, inputs)
    found.write(folder / "vectors.bin")
    return found
