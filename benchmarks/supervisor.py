"""Does the supervisor keep its word in a sampled loop?

The paper's sgn, and the projection in both settings: R is `Supervisor` as it comes, with the push
as d_u; F is `Supervisor.quiet`. On the paper's arm and controller M_x is 3, so that V_M is near. V
is that of the true state at the samples: how far it gets, how long u_s acts, the largest torque,
and how much u_s moves in all.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from common import Bench, around_home, on_reference, run

import fpid_pin as fp
from fpid_pin.disturbances import Cosine, Disturbance, Pulse

PUSH, CONSTANT = (30.0, 12.0), (40.0, 20.0)  # [N m]
STEPS = (2.5e-4, 1e-3, 2e-3, 4e-3)  # [s]
UR5_PUSH = (60.0, 60.0, 30.0, 5.0, 5.0, 0.5)  # [N m]
HEADS = ("largest V / V_M", "acting [s]", "peak torque [N m]", "variation of u_s [N m]")


def worst(guard: fp.Supervisor, runs: Sequence[fp.Run]) -> list[str]:
    """Return the worst of some runs: the cells of a row."""
    v, acting, peak, moved = [], [], [], []
    for seen in runs:
        state = np.stack([seen.error, seen.v_ref - seen.v], axis=-1)
        v.append(0.5 * np.einsum("kja,ab,kjb->k", state, guard.p, state).max() / guard.threshold)
        acting.append(float((seen.u_s != 0.0).any(axis=1).sum() * (seen.t[1] - seen.t[0])))
        peak.append(np.abs(seen.torque).max())
        moved.append(np.abs(np.diff(seen.u_s, axis=0)).sum())
    return [f"{max(v):.4f}", f"{max(acting):.3f}", f"{max(peak):.0f}", f"{max(moved):.0f}"]


def guards(push: Sequence[float], **quiet: float) -> dict[str, Any]:
    r = fp.Supervisor(3.0, 1.0, disturbance_bound=push)
    sgn = replace(r, kind="paper", gravity_bound=(27.44, 7.84))
    f = fp.Supervisor.quiet(3.0, 1.0, **quiet)
    return {"none": None, "sgn, eq. (20)": sgn, "R": r, "F": f}


def two_link(
    disturbance: Disturbance, step: float = 1e-3, arm: fp.Arm | None = None
) -> fp.Experiment:
    plant = fp.Plant(arm=arm, disturbance=disturbance)
    experiment = fp.paper_experiment(duration=4.0, step=step).with_dynamics("compiled")
    return replace(experiment, plant=plant)


def rows(first: str, experiments: Sequence[fp.Experiment], chosen: dict[str, Any],
         law: fp.AdaptiveFpid) -> list[list[str]]:  # fmt: skip
    """Return a row a supervisor: the worst of some experiments."""
    found = []
    for name, guard in chosen.items():
        runs = fp.simulate(experiments, replace(law, supervisor=guard))
        found.append([first, name, *worst(chosen["R"], runs)])
    return found


def pushes(bench: Bench) -> None:
    # The pushes are beyond r_min, on purpose.
    r, law = fp.Supervisor(3.0, 1.0), fp.paper_controller()
    mass = fp.Arm.two_link().mass_matrix([0.0, 0.0])
    reach = [np.linalg.norm(np.abs(np.linalg.inv(mass)) @ push) for push in (PUSH, CONSTANT)]
    tables: dict[str, list[list[str]]] = {}
    for title, push, force in (
        ("(30, 12) cos t", PUSH, Cosine(PUSH, 1.0)), ("(40, 20)", CONSTANT, Pulse(CONSTANT)),
    ):  # fmt: skip
        tables[title] = []
        for step in STEPS[1:2] if bench.quick else STEPS:
            chosen = guards(push)
            layer = replace(chosen["sgn, eq. (20)"], boundary_layer=2.0)
            chosen["the same, boundary layer 2"] = layer
            tables[title] += rows(f"{1e3 * step:g}", [two_link(force, step)], chosen, law)
    most = {name: max(float(row[2]) for x in tables.values() for row in x if row[1] == name)
            for name in ("none", "sgn, eq. (20)", "R", "F")}  # fmt: skip
    bench.say(
        f"Against pushes that are far beyond its r_min, V reaches at most {most['R']:.3f} V_M with "
        f"the sampled supervisor, {most['F']:.3f} with the quiet one, {most['sgn, eq. (20)']:.2f} "
        f"with the paper's sgn and {most['none']:.2f} with none."
    )
    bench.say(
        f"V_M = {r.threshold:.3f}, V(0) = 1.200; r_min of R is "
        f"{', '.join(f'{r.tolerance(step):.0f}' for step in STEPS)} rad/s^2 at "
        f"{', '.join(f'{1e3 * step:g}' for step in STEPS)} ms, the pushes reach "
        f"{reach[0]:.0f} and {reach[1]:.0f}."
    )
    for title, table in tables.items():
        bench.say(f"Push {title} N m:")
        bench.table(["step [ms]", "supervisor", *HEADS], table, 2)


def wrong(bench: Bench) -> None:
    law, count = fp.paper_controller(), 2 if bench.quick else 20
    arms = [fp.Arm.two_link().perturbed(np.random.default_rng(k), mass=0.2) for k in range(count)]
    chosen = guards(PUSH)
    chosen["R, d_u 20 % more"] = fp.Supervisor(3.0, 1.0, disturbance_bound=np.multiply(1.2, PUSH))
    experiments = [two_link(Cosine(PUSH, 1.0), arm=arm) for arm in arms]
    found = rows("masses +-20 %", experiments, chosen, law)
    noise = fp.Sensors(velocity_noise=0.05)
    experiments = [replace(two_link(Cosine(PUSH, 1.0)), sensors=noise, seed=k)
                   for k in range(count)]  # fmt: skip
    chosen = guards(PUSH, lookahead=0.02)
    chosen["F, V_T = 0.92 V_M"] = fp.Supervisor.quiet(3.0, 1.0, lookahead=0.02, target=0.92)
    found += rows("noise 0.05 rad/s, F: T = 20 ms", experiments, chosen, law)
    bench.say(f"Push (30, 12) cos t at 1 ms, worst of {count}:")
    bench.table(["", "supervisor", *HEADS], found, 2)


def ur5(bench: Bench) -> None:
    arm = fp.Arm.from_example("ur5")
    reference = around_home(arm)
    law = fp.AdaptiveFpid(
        kp=100.0, ki=240.0, kd=22.0, integral_order=0.9, derivative_order=0.95,
        learning_rate=0.0, scale=(4.4, 5.2, 1.2, 0.24, 0.25, 0.02),
    )  # fmt: skip
    r = fp.Supervisor(2.3, 0.3, disturbance_bound=UR5_PUSH)
    chosen = {"none": None, "sgn, eq. (20)": replace(r, kind="paper"), "R": r,
              "F": fp.Supervisor.quiet(2.3, 0.3),
              "F, observer 200 rad/s": fp.Supervisor.quiet(2.3, 0.3, observer=200.0)}  # fmt: skip
    found = []
    for step in STEPS[1 : 2 if bench.quick else None]:
        experiment = fp.Experiment(
            arm, reference, **on_reference(reference), step=step, duration=4.0, dynamics="compiled",
            plant=fp.Plant(disturbance=Cosine(UR5_PUSH, 1.0)),
        )  # fmt: skip
        found += rows(f"{1e3 * step:g}", [experiment], chosen, law)
    bench.say("UR5, 0.3 rad at 1 rad/s, push (60, 60, 30, 5, 5, 0.5) cos t N m, M_x = 2.3:")
    bench.table(["step [ms]", "supervisor", *HEADS], found, 2)


if __name__ == "__main__":
    run(__doc__, pushes, wrong, ur5)
