"""The cases of the golden runs: experiments and laws, by public names alone.

Gains are written out as numbers, so that what `suggest_gains` proposes may change without a case
changing with it. `CASES` has them all; `SENSITIVE` names those that are compared less strictly.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import fpid_pin as fp
from fpid_pin.disturbances import Cosine, Pulse, Sum
from fpid_pin.references import Hold, Sinusoid, Waypoints


class Case(NamedTuple):
    """One golden run."""

    experiment: fp.Experiment
    controller: fp.Controller


# ---------------------------------------------------------------------------------- arms and gains

TWO_LINK = fp.Arm.two_link()
PLANAR = fp.Arm.planar(lengths=(0.6, 0.5, 0.3), masses=(2.0, 1.5, 0.5), gravity=9.8)
UR5 = fp.Arm.from_example("ur5")
PANDA = fp.Arm.from_example("panda")
XARM7 = fp.Arm.from_example("xarm7")
Z1 = fp.Arm.from_example("z1")


def scaled(scale: tuple[float, ...], kd: float, derivative_order: float) -> fp.AdaptiveFpid:
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

# ------------------------------------------------------------------------------------- experiments

PAPER = fp.Experiment(
    arm=TWO_LINK, reference=Sinusoid(amplitude=1.0), q0=(0.0, 0.35), v0=(-0.2, 0.5),
    plant=fp.Plant(disturbance=Cosine(amplitude=(0.4, 0.6), frequency=5.0 * np.pi)), duration=2.0,
)  # fmt: skip


def swing(arm: fp.Arm, **changes: Any) -> fp.Experiment:
    """Return a second of an arm that follows sinusoids about its home, from 0.03 rad beside it."""
    reference = Sinusoid(amplitude=0.3, frequency=2.0, offset=arm.home)
    q0 = np.array(arm.home) + 0.03
    return replace(fp.Experiment(arm=arm, reference=reference, q0=q0, duration=1.0), **changes)


def pushed(torque: tuple[float, ...], **changes: Any) -> fp.Experiment:
    """Return the paper's experiment under a push of torque cos t."""
    push = fp.Plant(disturbance=Cosine(amplitude=torque, frequency=1.0))
    return replace(PAPER, plant=push, **changes)


UR5_LOADED = fp.Plant(arm=UR5.with_payload(2.0, com=(0.0, 0.05, 0.03)))
NOISE = fp.Sensors(position_noise=2e-5, velocity_noise=2e-3, velocity_bias=1e-3)
ENCODERS = fp.Sensors(
    position_resolution=1.3e-5, velocity="differentiated", velocity_cutoff=300.0, delay=2
)
COMPILED = {"dynamics": "compiled"}

# --------------------------------------------------------------------------------------- the cases


def fpid(**law: Any) -> Case:
    """Return the paper's experiment under its law, but for some of the law's arguments."""
    return Case(PAPER, replace(FPID_PAPER, **law))


def guarded(*given: Any, experiment: fp.Experiment | None = None, **supervisor: Any) -> Case:
    """Return the paper's law with a supervisor, under a push unless something else is said."""
    guard = fp.Supervisor(*given, **supervisor)
    return Case(experiment or pushed((30.0, 12.0)), replace(FPID_PAPER, supervisor=guard))


def paper(law: fp.Controller = FPID_PAPER, **changes: Any) -> Case:
    """Return the paper's experiment but for some of it; what a plant has is the plant's."""
    own = ("arm", "effort_limit", "viscous_friction", "dry_friction", "disturbance")
    plant = {key: changes.pop(key) for key in own if key in changes}
    return Case(replace(PAPER, **changes, **({"plant": fp.Plant(**plant)} if plant else {})), law)


def ur5(law: fp.Controller = FPID_UR5, **changes: Any) -> Case:
    return Case(swing(UR5, **changes), law)


def panda(law: fp.Controller = FPID_PANDA, **changes: Any) -> Case:
    return Case(swing(PANDA, **changes), law)


PAPER_GUARD = {"kind": "paper", "disturbance_bound": (30.0, 12.0)}
UR5_PUSHED = fp.Plant(disturbance=Pulse((60.0, 60.0, 30.0, 5.0, 5.0, 1.0), 0.2))
PANDA_PUSHED = fp.Plant(disturbance=Pulse((30.0, 30.0, 20.0, 20.0, 3.0, 3.0, 0.3)))

#: Sensors, friction and integrators under the paper's law, and every form of that law.
TWO_LINK_FPID = {
    "published orders": fpid(),
    "orders at 0 and between": fpid(integral_order=(0.0, 0.5), derivative_order=(0.5, 0.0)),
    "learning rates a gain": fpid(learning_rate=((30.0, 20.0), (10.0, 50.0), (5.0, 0.0)), k1=3.0),
    "bounds": fpid(
        safeguards=fp.Safeguards(
            minimum=((9.0, 11.0), (24.0, 19.0), (19.0, 14.0)),
            maximum=((10.5, 12.5), (26.0, 21.0), (20.5, 15.5)),
        )
    ),
    "sigma": fpid(safeguards=fp.Safeguards(sigma=0.5)),
    "e-modification": fpid(safeguards=fp.Safeguards(e_modification=0.05)),
    "dead zone": fpid(safeguards=fp.Safeguards(dead_zone=0.1)),
    "all safeguards, noise": paper(
        replace(FPID_PAPER, safeguards=fp.Safeguards(8.0, 30.0, 0.1, 0.01, 0.02)),
        sensors=NOISE, seed=3,
    ),
    "scale by inertia": fpid(kp=40.0, ki=60.0, kd=12.0, scale="inertia"),
    "start of Grunwald-Letnikov": fpid(initialisation="grunwald_letnikov"),
    "CRONE": fpid(design=fp.fractional.Crone(n=5, widening=1.0)),
    "CRONE, start of Grunwald-Letnikov": fpid(
        design=fp.fractional.Crone(1e-2, 200.0, n=3), initialisation="grunwald_letnikov"
    ),
    "32 modes": fpid(design=fp.fractional.ExponentialSum(modes=32)),
    "adaptive orders": fpid(order_learning_rate=0.1),
    "adaptive orders, bounds, dead zone": fpid(
        order_learning_rate=((1.0, 0.5), (0.3, 0.0)), integral_order_bounds=(0.85, 0.95),
        derivative_order_bounds=(0.9, 1.0), safeguards=fp.Safeguards(dead_zone=0.02, sigma=0.05),
    ),
    "feedforward": fpid(feedforward=True),
    "observer": fpid(observer=60.0),
    "feedforward, observer, heavier plant": paper(
        replace(FPID_PAPER, feedforward=True, observer=80.0),
        arm=TWO_LINK.with_payload(0.5), viscous_friction=0.3,
    ),
    "paper's supervisor, silent": guarded(
        5.0, 1.0, experiment=PAPER, kind="paper", disturbance_bound=(0.4, 0.6),
        gravity_bound=(27.44, 7.84),
    ),
    "paper's supervisor, boundary layer": guarded(2.5, 1.0, **PAPER_GUARD, boundary_layer=3.0),
    "paper's supervisor, sgn": guarded(
        2.5, 1.0, experiment=pushed((30.0, 12.0), duration=1.0), **PAPER_GUARD,
        gravity_bound=(27.44, 7.84),
    ),
    "sampled supervisor": guarded(2.5, 1.0, disturbance_bound=(3.0, 1.0)),
    "sampled supervisor, look-ahead, trigger": guarded(
        2.5, 1.0, lookahead=0.005, target=0.9, trigger=0.8
    ),
    "quiet supervisor": Case(
        pushed((30.0, 12.0)), replace(FPID_PAPER, supervisor=fp.Supervisor.quiet(2.5, 1.0))
    ),
    "quiet supervisor, feedforward, observer, noise": Case(
        pushed((30.0, 12.0), sensors=NOISE),
        replace(
            FPID_PAPER, supervisor=fp.Supervisor.quiet(2.5, 1.0), feedforward=True, observer=100.0
        ),
    ),
    "rk4": paper(integrator="rk4"),
    "steps of 0.25 ms": paper(step=2.5e-4, duration=0.5),
    "steps of 4 ms": paper(step=4e-3, duration=4.0),
    "viscous and dry friction": paper(
        viscous_friction=(0.5, 0.3), dry_friction=(1.5, 0.8)
    ),
    "effort limits": paper(effort_limit=(32.0, 7.0)),
    "noise": paper(sensors=NOISE, seed=7),
    "encoders": paper(sensors=ENCODERS),
    "pulses": paper(disturbance=Sum((Pulse((5.0, -2.0), 0.3, 0.6), Cosine(1.0, 20.0, 0.4)))),
}  # fmt: skip

#: What is not in tests/control/test_laws.py of the other laws, and runs that end early.
TWO_LINK_OTHERS = {
    "sliding mode, switching": paper(
        fp.SlidingMode(4.0, 10.0, boundary_layer=0.0), duration=1.0
    ),
    "Slotine-Li, nothing known": paper(
        fp.SlotineLi(5.0, 10.0, adaptation_rate=3.0, initial=0.0, friction=False)
    ),
    "runs away": paper(fp.GravityOnly(), disturbance=Pulse((20.0, 0.0)), runaway_speed=15.0),
    "unstable": paper(fp.ComputedTorque(k0=100.0, k1=2050.0)),
}  # fmt: skip

#: Three to seven joints, at rest and loaded, rubbing and bounded.
LARGER = {
    "planar: FPID by waypoints": Case(
        swing(
            PLANAR,
            reference=Waypoints((0.0, 0.5, 1.0), [(0, 0, 0), (0.5, -0.4, 0.8), (0.2, 0.4, 0)]),
        ),
        fp.AdaptiveFpid(100.0, 200.0, 20.0, 0.9, 0.9, learning_rate=100.0, scale="inertia"),
    ),
    "ur5: FPID": ur5(),
    "ur5: FPID, rk4": ur5(integrator="rk4", duration=0.5),
    "ur5: FPID, CRONE, effort limits": ur5(
        replace(FPID_UR5, design=fp.fractional.Crone()),
        plant=fp.Plant(effort_limit=(60.0, 60.0, 25.0, 5.0, 5.0, 1.0)),
    ),
    "ur5: FPID, adaptive orders": ur5(
        replace(
            FPID_UR5, order_learning_rate=np.outer((0.3, 0.03), np.ones(6)),
            integral_order_bounds=(0.02, 0.9), derivative_order_bounds=(0.3, 0.95),
        )
    ),
    "ur5: FPID, feedforward, observer, loaded": ur5(
        replace(FPID_UR5, feedforward=True, observer=40.0), plant=UR5_LOADED
    ),
    "ur5: FPID, observer, compiled, noise": ur5(
        replace(FPID_UR5, observer=40.0), sensors=NOISE, plant=UR5_LOADED, **COMPILED
    ),
    "ur5: FPID, quiet supervisor": ur5(
        replace(FPID_UR5, supervisor=fp.Supervisor.quiet(0.75, 0.67)), plant=UR5_PUSHED
    ),
    "ur5: FPID, paper's supervisor": ur5(
        replace(
            FPID_UR5, supervisor=fp.Supervisor(0.75, 0.67, 1.0, kind="paper", boundary_layer=50.0)
        ),
        plant=UR5_PUSHED,
    ),
    "panda: FPID": panda(),
    "panda: FPID, compiled, rk4": panda(integrator="rk4", duration=0.5, **COMPILED),
    "panda: FPID, encoders": panda(sensors=ENCODERS),
    "panda: FPID, a step of the set point, effort limits": panda(
        replace(FPID_PANDA, initialisation="grunwald_letnikov"), reference=Hold(PANDA.home),
        q0=np.array(PANDA.home) + 0.2,
        plant=fp.Plant(effort_limit=(60.0, 60.0, 60.0, 40.0, 5.0, 5.0, 0.5)),
    ),
    "panda: FPID, feedforward, compiled": panda(
        replace(FPID_PANDA, feedforward=True), **COMPILED
    ),
    "panda: FPID, sampled supervisor": panda(
        replace(FPID_PANDA, supervisor=fp.Supervisor(2.6, 2.5, observer=50.0)), plant=PANDA_PUSHED
    ),
    "xarm7: FPID, dry friction": Case(swing(XARM7), FPID_XARM7),
    "z1: FPID, dry friction, encoders": Case(swing(Z1, sensors=ENCODERS), FPID_Z1),
}  # fmt: skip

#: All cases by name.
CASES = {
    **{f"two_link: FPID, {name}": case for name, case in TWO_LINK_FPID.items()},
    **{f"two_link: {name}": case for name, case in TWO_LINK_OTHERS.items()},
    **LARGER,
}

#: Cases in which a start that is 1e-12 rad off moves a joint by more than 1e-11 rad, so that their
#: tolerance is above 1e-9 rad. Encoders do not feel so small a difference: nothing holds it down.
SENSITIVE = frozenset(
    {
        "two_link: FPID, encoders",
        "panda: FPID, encoders",
    }
)
