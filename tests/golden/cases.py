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
from fpid_pin.references import Hold, Quintic, Sinusoid, Waypoints


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
PANDA_LOADED = fp.Plant(arm=PANDA.with_payload(1.5, com=(0.02, 0.0, 0.05)))
NOISE = fp.Sensors(position_noise=2e-5, velocity_noise=2e-3, velocity_bias=1e-3)
ENCODERS = fp.Sensors(
    position_resolution=1.3e-5, velocity="differentiated", velocity_cutoff=300.0, delay=2
)
COMPILED = {"dynamics": "compiled"}

# --------------------------------------------------------------------------------------- the cases

#: Sensors, friction and integrators under the paper's law, and every form of that law.
TWO_LINK_FPID = {
    "published orders": Case(PAPER, FPID_PAPER),
    "integer orders": Case(
        PAPER, replace(FPID_PAPER, integral_order=1.0, derivative_order=1.0)
    ),
    "orders at 0 and between": Case(
        PAPER, replace(FPID_PAPER, integral_order=(0.0, 0.5), derivative_order=(0.5, 0.0))
    ),
    "integer regressors": Case(PAPER, replace(FPID_PAPER, regressors="integer")),
    "fixed gains": Case(PAPER, replace(FPID_PAPER, learning_rate=0.0)),
    "learning rates a gain": Case(
        PAPER, replace(FPID_PAPER, learning_rate=((30.0, 20.0), (10.0, 50.0), (5.0, 0.0)), k1=3.0)
    ),
    "bounds": Case(
        PAPER,
        replace(
            FPID_PAPER,
            safeguards=fp.Safeguards(
                minimum=((9.0, 11.0), (24.0, 19.0), (19.0, 14.0)),
                maximum=((10.5, 12.5), (26.0, 21.0), (20.5, 15.5)),
            ),
        ),
    ),
    "sigma": Case(PAPER, replace(FPID_PAPER, safeguards=fp.Safeguards(sigma=0.5))),
    "e-modification": Case(
        PAPER, replace(FPID_PAPER, safeguards=fp.Safeguards(e_modification=0.05))
    ),
    "dead zone": Case(PAPER, replace(FPID_PAPER, safeguards=fp.Safeguards(dead_zone=0.1))),
    "all safeguards, noise": Case(
        replace(PAPER, sensors=NOISE, seed=3),
        replace(
            FPID_PAPER,
            safeguards=fp.Safeguards(
                minimum=8.0, maximum=30.0, sigma=0.1, e_modification=0.01, dead_zone=0.02
            ),
        ),
    ),
    "scale by inertia": Case(
        PAPER, replace(FPID_PAPER, kp=40.0, ki=60.0, kd=12.0, scale="inertia")
    ),
    "start of Grunwald-Letnikov": Case(
        PAPER, replace(FPID_PAPER, initialisation="grunwald_letnikov")
    ),
    "CRONE": Case(PAPER, replace(FPID_PAPER, design=fp.fractional.Crone(n=5, widening=1.0))),
    "CRONE, start of Grunwald-Letnikov": Case(
        PAPER,
        replace(
            FPID_PAPER, design=fp.fractional.Crone(1e-2, 200.0, n=3),
            initialisation="grunwald_letnikov",
        ),
    ),
    "32 modes": Case(PAPER, replace(FPID_PAPER, design=fp.fractional.ExponentialSum(modes=32))),
    "adaptive orders": Case(PAPER, replace(FPID_PAPER, order_learning_rate=0.1)),
    "adaptive orders, bounds, dead zone": Case(
        PAPER,
        replace(
            FPID_PAPER, order_learning_rate=((1.0, 0.5), (0.3, 0.0)),
            integral_order_bounds=(0.85, 0.95), derivative_order_bounds=(0.9, 1.0),
            safeguards=fp.Safeguards(dead_zone=0.02, sigma=0.05),
        ),
    ),
    "feedforward": Case(PAPER, replace(FPID_PAPER, feedforward=True)),
    "observer": Case(PAPER, replace(FPID_PAPER, observer=60.0)),
    "feedforward, observer, heavier plant": Case(
        replace(PAPER, plant=fp.Plant(arm=TWO_LINK.with_payload(0.5), viscous_friction=0.3)),
        replace(FPID_PAPER, feedforward=True, observer=80.0),
    ),
    "paper's supervisor, silent": Case(
        PAPER,
        replace(
            FPID_PAPER,
            supervisor=fp.Supervisor(
                5.0, 1.0, kind="paper", disturbance_bound=(0.4, 0.6), gravity_bound=(27.44, 7.84)
            ),
        ),
    ),
    "paper's supervisor, boundary layer": Case(
        pushed((30.0, 12.0)),
        replace(
            FPID_PAPER,
            supervisor=fp.Supervisor(
                2.5, 1.0, kind="paper", disturbance_bound=(30.0, 12.0), boundary_layer=3.0
            ),
        ),
    ),
    "paper's supervisor, sgn": Case(
        pushed((30.0, 12.0), duration=1.0),
        replace(
            FPID_PAPER,
            supervisor=fp.Supervisor(
                2.5, 1.0, kind="paper", disturbance_bound=(30.0, 12.0), gravity_bound=(27.44, 7.84)
            ),
        ),
    ),
    "sampled supervisor": Case(
        pushed((30.0, 12.0)),
        replace(FPID_PAPER, supervisor=fp.Supervisor(2.5, 1.0, disturbance_bound=(3.0, 1.0))),
    ),
    "sampled supervisor, look-ahead, trigger": Case(
        pushed((30.0, 12.0)),
        replace(
            FPID_PAPER,
            supervisor=fp.Supervisor(2.5, 1.0, lookahead=0.005, target=0.9, trigger=0.8),
        ),
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
    "compiled": Case(replace(PAPER, **COMPILED), FPID_PAPER),
    "rk4": Case(replace(PAPER, integrator="rk4"), FPID_PAPER),
    "compiled, rk4": Case(replace(PAPER, integrator="rk4", **COMPILED), FPID_PAPER),
    "steps of 0.25 ms": Case(replace(PAPER, step=2.5e-4, duration=0.5), FPID_PAPER),
    "steps of 4 ms": Case(replace(PAPER, step=4e-3, duration=4.0), FPID_PAPER),
    "viscous and dry friction": Case(
        replace(PAPER, plant=fp.Plant(viscous_friction=(0.5, 0.3), dry_friction=(1.5, 0.8))),
        FPID_PAPER,
    ),
    "compiled, viscous and dry friction": Case(
        replace(
            PAPER, plant=fp.Plant(viscous_friction=(0.5, 0.3), dry_friction=(1.5, 0.8)), **COMPILED
        ),
        FPID_PAPER,
    ),
    "effort limits": Case(
        replace(PAPER, plant=fp.Plant(effort_limit=(32.0, 7.0))), FPID_PAPER
    ),
    "noise": Case(replace(PAPER, sensors=NOISE, seed=7), FPID_PAPER),
    "encoders": Case(replace(PAPER, sensors=ENCODERS), FPID_PAPER),
    "compiled, encoders, effort limits": Case(
        replace(PAPER, sensors=ENCODERS, plant=fp.Plant(effort_limit=(32.0, 7.0)), **COMPILED),
        FPID_PAPER,
    ),
    "pulses": Case(
        replace(
            PAPER,
            plant=fp.Plant(
                disturbance=Sum((Pulse((5.0, -2.0), 0.3, 0.6), Cosine(1.0, 20.0, 0.4)))
            ),
        ),
        FPID_PAPER,
    ),
}  # fmt: skip

#: The paper's arm under the other laws.
TWO_LINK_OTHERS = {
    "gravity only": Case(PAPER, fp.GravityOnly()),
    "PID, effort limits": Case(
        replace(PAPER, plant=fp.Plant(effort_limit=(30.0, 7.0))), fp.Pid(100.0, 80.0, 30.0)
    ),
    "PD and gravity with integral": Case(PAPER, fp.PdGravity(60.0, 20.0, ki=30.0)),
    "computed torque": Case(PAPER, fp.ComputedTorque()),
    "computed torque with observer, dry friction": Case(
        replace(PAPER, plant=fp.Plant(dry_friction=(1.5, 0.8))),
        fp.ComputedTorque(k0=50.0, k1=15.0, observer=50.0),
    ),
    "computed torque with integral, heavier plant": Case(
        replace(PAPER, plant=fp.Plant(arm=TWO_LINK.with_payload(0.5))),
        fp.ComputedTorque(k0=50.0, k1=15.0, ki=40.0),
    ),
    "sliding mode, switching": Case(
        replace(PAPER, duration=1.0), fp.SlidingMode(4.0, 10.0, boundary_layer=0.0)
    ),
    "sliding mode with observer": Case(
        PAPER, fp.SlidingMode(4.0, 10.0, boundary_layer=0.3, observer=50.0)
    ),
    "Slotine-Li, nothing known": Case(
        PAPER, fp.SlotineLi(5.0, 10.0, adaptation_rate=3.0, initial=0.0, friction=False)
    ),
    "Slotine-Li, effort limits": Case(
        replace(PAPER, plant=fp.Plant(effort_limit=(30.0, 7.0))), fp.SlotineLi(5.0, 10.0)
    ),
    "runs away": Case(
        replace(PAPER, plant=fp.Plant(disturbance=Pulse((20.0, 0.0))), runaway_speed=15.0),
        fp.GravityOnly(),
    ),
    "unstable": Case(PAPER, fp.ComputedTorque(k0=100.0, k1=2050.0)),
}  # fmt: skip

#: Six and seven joints, at rest and loaded, rubbing and bounded.
LARGER = {
    "planar: FPID by waypoints": Case(
        swing(
            PLANAR,
            reference=Waypoints((0.0, 0.5, 1.0), [(0, 0, 0), (0.5, -0.4, 0.8), (0.2, 0.4, 0)]),
        ),
        fp.AdaptiveFpid(
            100.0, 200.0, 20.0, 0.9, 0.9, learning_rate=100.0, scale="inertia"
        ),
    ),
    "planar: computed torque, rk4": Case(
        swing(PLANAR, integrator="rk4"), fp.ComputedTorque(100.0, 20.0)
    ),
    "ur5: FPID": Case(swing(UR5), FPID_UR5),
    "ur5: FPID, compiled": Case(swing(UR5, **COMPILED), FPID_UR5),
    "ur5: FPID, rk4": Case(swing(UR5, integrator="rk4", duration=0.5), FPID_UR5),
    "ur5: adaptive integer PID": Case(
        swing(UR5), replace(FPID_UR5, integral_order=1.0, derivative_order=1.0, kd=20.0)
    ),
    "ur5: FPID, CRONE, effort limits": Case(
        swing(UR5, plant=fp.Plant(effort_limit=(60.0, 60.0, 25.0, 5.0, 5.0, 1.0))),
        replace(FPID_UR5, design=fp.fractional.Crone()),
    ),
    "ur5: FPID, adaptive orders": Case(
        swing(UR5),
        replace(
            FPID_UR5, order_learning_rate=np.outer((0.3, 0.03), np.ones(6)),
            integral_order_bounds=(0.02, 0.9), derivative_order_bounds=(0.3, 0.95),
        ),
    ),
    "ur5: FPID, feedforward, observer, loaded": Case(
        swing(UR5, plant=UR5_LOADED), replace(FPID_UR5, feedforward=True, observer=40.0)
    ),
    "ur5: FPID, observer, compiled, noise": Case(
        swing(UR5, sensors=NOISE, plant=UR5_LOADED, **COMPILED), replace(FPID_UR5, observer=40.0)
    ),
    "ur5: FPID, quiet supervisor": Case(
        swing(UR5, plant=fp.Plant(disturbance=Pulse((60.0, 60.0, 30.0, 5.0, 5.0, 1.0), 0.2))),
        replace(FPID_UR5, supervisor=fp.Supervisor.quiet(0.75, 0.67)),
    ),
    "ur5: FPID, paper's supervisor": Case(
        swing(UR5, plant=fp.Plant(disturbance=Pulse((60.0, 60.0, 30.0, 5.0, 5.0, 1.0), 0.2))),
        replace(
            FPID_UR5, supervisor=fp.Supervisor(0.75, 0.67, 1.0, kind="paper", boundary_layer=50.0)
        ),
    ),
    "ur5: PID": Case(swing(UR5), fp.Pid(100.0, 200.0, 20.0, scale="inertia")),
    "ur5: PID, compiled, encoders": Case(
        swing(UR5, sensors=ENCODERS, **COMPILED), fp.Pid(100.0, 200.0, 20.0, scale="inertia")
    ),
    "ur5: PD and gravity, a move": Case(
        swing(UR5, reference=Quintic(0.0, 0.6, 0.7, begin=0.1), plant=UR5_LOADED),
        fp.PdGravity(100.0, 20.0, scale="inertia"),
    ),
    "ur5: PD and gravity with observer, loaded": Case(
        swing(UR5, plant=UR5_LOADED), fp.PdGravity(100.0, 20.0, scale="inertia", observer=30.0)
    ),
    "ur5: computed torque, noise": Case(
        swing(UR5, sensors=NOISE, seed=5), fp.ComputedTorque(100.0, 20.0)
    ),
    "ur5: computed torque, compiled": Case(
        swing(UR5, **COMPILED), fp.ComputedTorque(100.0, 20.0)
    ),
    "ur5: computed torque with observer, loaded": Case(
        swing(UR5, plant=UR5_LOADED), fp.ComputedTorque(100.0, 20.0, observer=40.0)
    ),
    "ur5: sliding mode": Case(
        swing(UR5, plant=UR5_LOADED), fp.SlidingMode(10.0, (60.0, 60.0, 30.0, 6.0, 6.0, 1.0), 0.5)
    ),
    "ur5: Slotine-Li, rotors, loaded": Case(
        swing(UR5.with_armature(0.1), plant=fp.Plant(viscous_friction=0.5)),
        fp.SlotineLi(10.0, 20.0, scale="inertia"),
    ),
    "ur5: Slotine-Li, leakage": Case(
        swing(UR5, plant=UR5_LOADED),
        fp.SlotineLi(10.0, 20.0, 2.0, 0.8, friction=False, leakage=0.5, scale="inertia"),
    ),
    "panda: FPID": Case(swing(PANDA), FPID_PANDA),
    "panda: FPID, compiled, rk4": Case(
        swing(PANDA, integrator="rk4", duration=0.5, **COMPILED), FPID_PANDA
    ),
    "panda: FPID, encoders": Case(swing(PANDA, sensors=ENCODERS), FPID_PANDA),
    "panda: FPID, a step of the set point, effort limits": Case(
        swing(
            PANDA, reference=Hold(PANDA.home), q0=np.array(PANDA.home) + 0.2,
            plant=fp.Plant(effort_limit=(60.0, 60.0, 60.0, 40.0, 5.0, 5.0, 0.5)),
        ),
        replace(FPID_PANDA, initialisation="grunwald_letnikov"),
    ),
    "panda: FPID, feedforward, compiled": Case(
        swing(PANDA, **COMPILED), replace(FPID_PANDA, feedforward=True)
    ),
    "panda: FPID, sampled supervisor": Case(
        swing(PANDA, plant=fp.Plant(disturbance=Pulse((30.0, 30.0, 20.0, 20.0, 3.0, 3.0, 0.3)))),
        replace(FPID_PANDA, supervisor=fp.Supervisor(2.6, 2.5, observer=50.0)),
    ),
    "panda: gravity only": Case(swing(PANDA, v0=0.5), fp.GravityOnly()),
    "panda: PID": Case(swing(PANDA), fp.Pid(100.0, 200.0, 20.0, scale="inertia")),
    "panda: PD and gravity with integral": Case(
        swing(PANDA, plant=PANDA_LOADED), fp.PdGravity(100.0, 20.0, scale="inertia", ki=150.0)
    ),
    "panda: computed torque with integral": Case(
        swing(PANDA, plant=PANDA_LOADED), fp.ComputedTorque(100.0, 20.0, ki=150.0)
    ),
    "panda: sliding mode with observer": Case(
        swing(PANDA, plant=PANDA_LOADED),
        fp.SlidingMode(10.0, 20.0, 0.2, scale="inertia", observer=30.0),
    ),
    "panda: Slotine-Li": Case(
        swing(PANDA, plant=PANDA_LOADED), fp.SlotineLi(10.0, 20.0, scale="inertia")
    ),
    "xarm7: FPID, dry friction": Case(swing(XARM7), FPID_XARM7),
    "xarm7: FPID, dry friction, compiled": Case(swing(XARM7, **COMPILED), FPID_XARM7),
    "z1: computed torque, dry friction": Case(
        swing(Z1), fp.ComputedTorque(100.0, 20.0)
    ),
    "xarm7: Slotine-Li, dry friction": Case(
        swing(XARM7), fp.SlotineLi(10.0, 20.0, scale="inertia")
    ),
    "z1: FPID, dry friction, encoders": Case(swing(Z1, sensors=ENCODERS), FPID_Z1),
    "z1: PID, dry friction, compiled": Case(
        swing(Z1, **COMPILED), fp.Pid(100.0, 200.0, 10.0, scale=FPID_Z1.scale)
    ),
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
        "two_link: FPID, compiled, encoders, effort limits",
        "panda: FPID, encoders",
    }
)
