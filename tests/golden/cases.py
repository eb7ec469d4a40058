"""The cases of the golden runs: experiments and laws, by public names alone.

Each has several things at once: that each by itself is right, other tests say. Gains are written
out as numbers, so that what `suggest_gains` proposes may change without a case changing with it.
"""

from dataclasses import replace

import numpy as np

import fpid_pin as fp
from fpid_pin.disturbances import Cosine, Pulse, Sum
from fpid_pin.references import Hold, Sinusoid, Waypoints

TWO_LINK = fp.Arm.two_link()
PLANAR = fp.Arm.planar(lengths=(0.6, 0.5, 0.3), masses=(2.0, 1.5, 0.5), gravity=9.8)
UR5 = fp.Arm.from_example("ur5")
PANDA = fp.Arm.from_example("panda")


def scaled(scale, kd, derivative_order):
    """Return gains about as `suggest_gains` finds them for 10 rad/s, with their learning rates."""
    return fp.AdaptiveFpid(
        kp=100.0, ki=238.0, kd=kd, integral_order=0.9, derivative_order=derivative_order,
        learning_rate=np.outer((4000.0, 9500.0, 0.4 * kd), np.ones(len(scale))), scale=scale,
        safeguards=fp.Safeguards(
            minimum=np.outer((70.0, 167.0, 0.7 * kd), np.ones(len(scale))),
            maximum=np.outer((220.0, 310.0, 1.6 * kd), np.ones(len(scale))),
        ),
    )  # fmt: skip


FPID_PAPER = fp.AdaptiveFpid(
    kp=(10.0, 12.0), ki=(25.0, 20.0), kd=(20.0, 15.0),
    integral_order=(0.901, 0.931), derivative_order=(0.921, 0.932),
    learning_rate=25.0, k0=1.0, k1=2.0,
)  # fmt: skip
FPID_UR5 = scaled((4.38, 5.15, 1.15, 0.245, 0.253, 0.0171), 22.4, 0.95)
FPID_PANDA = scaled((0.53, 2.67, 1.58, 1.41, 0.0973, 0.112, 0.0076), 44.8, 0.65)
FPID_XARM7 = scaled((1.24, 2.13, 1.04, 1.29, 0.643, 0.345, 0.312), 43.6, 0.6)
FPID_Z1 = scaled((0.317, 0.949, 0.675, 0.32, 0.263, 0.212, 0.212), 43.8, 0.6)

PAPER = fp.Experiment(
    arm=TWO_LINK, reference=Sinusoid(amplitude=1.0), q0=(0.0, 0.35), v0=(-0.2, 0.5),
    plant=fp.Plant(disturbance=Cosine(amplitude=(0.4, 0.6), frequency=5.0 * np.pi)), duration=2.0,
)  # fmt: skip
PUSHED = fp.Plant(disturbance=Cosine(amplitude=(30.0, 12.0), frequency=1.0))
NOISE = fp.Sensors(position_noise=2e-5, velocity_noise=2e-3, velocity_bias=1e-3)
ENCODERS = fp.Sensors(
    position_resolution=1.3e-5, velocity="differentiated", velocity_cutoff=300.0, delay=2
)


def paper(law=None, *, of_law=None, **changes):
    """Return the paper's experiment, some of it changed, and a law, by default the paper's."""
    law = replace(law or FPID_PAPER, **(of_law or {}))
    return replace(PAPER, **changes), law


def swing(arm, law, **changes):
    """Return a second of an arm that follows sinusoids about its home, from 0.03 rad beside it."""
    reference = Sinusoid(amplitude=0.3, frequency=2.0, offset=arm.home)
    q0 = np.array(arm.home) + 0.03
    return replace(fp.Experiment(arm=arm, reference=reference, q0=q0, duration=1.0), **changes), law


#: Experiment and controller of each golden run.
CASES = {
    "two_link: FPID, all safeguards, noise": paper(
        of_law={"safeguards": fp.Safeguards(8.0, 30.0, 0.1, 0.01, 0.02)}, sensors=NOISE, seed=3
    ),
    "two_link: FPID, CRONE, start of Grunwald-Letnikov": paper(
        of_law={
            "design": fp.fractional.Crone(1e-2, 200.0, n=3),
            "initialisation": "grunwald_letnikov",
        }
    ),
    "two_link: FPID, adaptive orders, bounds, dead zone": paper(
        of_law={
            "order_learning_rate": ((1.0, 0.5), (0.3, 0.0)),
            "integral_order_bounds": (0.85, 0.95), "derivative_order_bounds": (0.9, 1.0),
            "safeguards": fp.Safeguards(dead_zone=0.02, sigma=0.05),
        }
    ),
    "two_link: FPID, paper's supervisor, boundary layer": paper(
        of_law={
            "supervisor": fp.Supervisor(
                2.5, 1.0, kind="paper", disturbance_bound=(30.0, 12.0), boundary_layer=3.0
            )
        },
        plant=PUSHED,
    ),
    "two_link: FPID, quiet supervisor, feedforward, observer, noise": paper(
        of_law={
            "supervisor": fp.Supervisor.quiet(2.5, 1.0), "feedforward": True, "observer": 100.0
        },
        plant=PUSHED, sensors=NOISE,
    ),
    "two_link: FPID, pulses": paper(
        plant=fp.Plant(disturbance=Sum((Pulse((5.0, -2.0), 0.3, 0.6), Cosine(1.0, 20.0, 0.4))))
    ),
    "two_link: sliding mode, switching": paper(
        fp.SlidingMode(4.0, 10.0, boundary_layer=0.0), duration=1.0
    ),
    "two_link: Slotine-Li, nothing known": paper(
        fp.SlotineLi(5.0, 10.0, adaptation_rate=3.0, initial=0.0, friction=False)
    ),
    "two_link: runs away": paper(
        fp.GravityOnly(), plant=fp.Plant(disturbance=Pulse((20.0, 0.0))), runaway_speed=15.0
    ),
    "planar: FPID by waypoints": swing(
        PLANAR,
        fp.AdaptiveFpid(100.0, 200.0, 20.0, 0.9, 0.9, learning_rate=100.0, scale="inertia"),
        reference=Waypoints((0.0, 0.5, 1.0), [(0, 0, 0), (0.5, -0.4, 0.8), (0.2, 0.4, 0)]),
    ),
    "ur5: FPID, rk4": swing(UR5, FPID_UR5, integrator="rk4", duration=0.5),
    "ur5: FPID, CRONE, effort limits": swing(
        UR5, replace(FPID_UR5, design=fp.fractional.Crone()),
        plant=fp.Plant(effort_limit=(60.0, 60.0, 25.0, 5.0, 5.0, 1.0)),
    ),
    "ur5: FPID, observer, compiled, noise": swing(
        UR5, replace(FPID_UR5, observer=40.0), sensors=NOISE, dynamics="compiled",
        plant=fp.Plant(arm=UR5.with_payload(2.0, com=(0.0, 0.05, 0.03))),
    ),
    "panda: FPID, a step of the set point, effort limits": swing(
        PANDA, replace(FPID_PANDA, initialisation="grunwald_letnikov"), reference=Hold(PANDA.home),
        q0=np.array(PANDA.home) + 0.2,
        plant=fp.Plant(effort_limit=(60.0, 60.0, 60.0, 40.0, 5.0, 5.0, 0.5)),
    ),
    "panda: FPID, sampled supervisor": swing(
        PANDA, replace(FPID_PANDA, supervisor=fp.Supervisor(2.6, 2.5, observer=50.0)),
        plant=fp.Plant(disturbance=Pulse((30.0, 30.0, 20.0, 20.0, 3.0, 3.0, 0.3))),
    ),
    "xarm7: FPID, dry friction": swing(fp.Arm.from_example("xarm7"), FPID_XARM7),
    "z1: FPID, dry friction, encoders": swing(
        fp.Arm.from_example("z1"), FPID_Z1, sensors=ENCODERS
    ),
}  # fmt: skip
