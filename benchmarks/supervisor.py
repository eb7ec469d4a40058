"""What the supervisors do in a sampled loop: the paper's sgn, and the projection in both settings.

    python benchmarks/supervisor.py

R is `Supervisor` as it comes, with the push as d_u; F is `Supervisor.quiet`. On the paper's arm and
controller M_x is 3, so that V_M is near. V is that of the true state at the samples. Prints how far
it gets, how long u_s acts, the largest torque, and how much u_s moves in all.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence

import numpy as np
from common import around_home, head, on_reference, row

import fpid_pin as fp
from fpid_pin.disturbances import Cosine, Disturbance, Pulse

PUSH, CONSTANT = (30.0, 12.0), (40.0, 20.0)  # [N m]
STEPS = (2.5e-4, 1e-3, 2e-3, 4e-3)  # [s]
UR5_PUSH = (60.0, 60.0, 30.0, 5.0, 5.0, 0.5)  # [N m]
HEADS = ("largest V / V_M", "acting [s]", "peak torque [N m]", "variation of u_s [N m]")


def begin(*first: str) -> None:
    print("", *head([*first, *HEADS], len(first)), sep="\n")


def worst(first: str, name: str, guard: fp.Supervisor, runs: Sequence[fp.Run]) -> None:
    """Print the worst of some runs."""
    v, acting, peak, moved = [], [], [], []
    for run in runs:
        state = np.stack([run.error, run.v_ref - run.v], axis=-1)
        v.append(0.5 * np.einsum("kja,ab,kjb->k", state, guard.p, state).max() / guard.threshold)
        acting.append(float((run.u_s != 0.0).any(axis=1).sum() * (run.t[1] - run.t[0])))
        peak.append(np.abs(run.torque).max())
        moved.append(np.abs(np.diff(run.u_s, axis=0)).sum())
    numbers = (f"{max(v):.4f}", f"{max(acting):.3f}", f"{max(peak):.0f}", f"{max(moved):.0f}")
    print(row([first, name, *numbers]))


def guards(push: Sequence[float], **quiet: float) -> dict[str, fp.Supervisor | None]:
    r = fp.Supervisor(3.0, 1.0, disturbance_bound=push)
    sgn = dataclasses.replace(r, kind="paper", gravity_bound=(27.44, 7.84))
    f = fp.Supervisor.quiet(3.0, 1.0, **quiet)
    return {"none": None, "sgn, eq. (20)": sgn, "R": r, "F": f}


def two_link(
    disturbance: Disturbance, step: float = 1e-3, arm: fp.Arm | None = None
) -> fp.Experiment:
    plant = fp.Plant(arm=arm, disturbance=disturbance)
    return dataclasses.replace(fp.paper_experiment(duration=4.0, step=step), plant=plant)


def rows(first: str, experiments: Sequence[fp.Experiment], chosen: dict[str, fp.Supervisor | None],
         law: fp.AdaptiveFpid) -> None:  # fmt: skip
    v_m = chosen["R"]
    assert v_m is not None
    for name, guard in chosen.items():
        runs = fp.simulate(experiments, dataclasses.replace(law, supervisor=guard))
        worst(first, name, v_m, runs)


def pushes(law: fp.AdaptiveFpid) -> None:
    for title, push, force in (
        ("(30, 12) cos t", PUSH, Cosine(PUSH, 1.0)), ("(40, 20)", CONSTANT, Pulse(CONSTANT)),
    ):  # fmt: skip
        print(f"\nPush {title} N m:")
        begin("step [ms]", "supervisor")
        for step in STEPS:
            chosen = guards(push)
            sgn = chosen["sgn, eq. (20)"]
            assert sgn is not None
            chosen["the same, boundary layer 2"] = dataclasses.replace(sgn, boundary_layer=2.0)
            rows(f"{1e3 * step:g}", [two_link(force, step)], chosen, law)


def wrong(law: fp.AdaptiveFpid) -> None:
    print("\nPush (30, 12) cos t at 1 ms, worst of 20:")
    begin("", "supervisor")
    arms = [fp.Arm.two_link().perturbed(np.random.default_rng(k), mass=0.2) for k in range(20)]
    chosen = guards(PUSH)
    chosen["R, d_u 20 % more"] = fp.Supervisor(3.0, 1.0, disturbance_bound=np.multiply(1.2, PUSH))
    experiments = [two_link(Cosine(PUSH, 1.0), arm=arm) for arm in arms]
    rows("masses +-20 %", experiments, chosen, law)
    noise = fp.Sensors(velocity_noise=0.05)
    experiments = [
        dataclasses.replace(two_link(Cosine(PUSH, 1.0)), sensors=noise, seed=k) for k in range(20)
    ]
    chosen = guards(PUSH, lookahead=0.02)
    chosen["F, V_T = 0.92 V_M"] = fp.Supervisor.quiet(3.0, 1.0, lookahead=0.02, target=0.92)
    rows("noise 0.05 rad/s, F: T = 20 ms", experiments, chosen, law)


def ur5() -> None:
    arm = fp.Arm.from_example("ur5")
    reference = around_home(arm)
    law = fp.AdaptiveFpid(
        kp=100.0, ki=240.0, kd=22.0, integral_order=0.9, derivative_order=0.95,
        learning_rate=0.0, scale=(4.4, 5.2, 1.2, 0.24, 0.25, 0.02),
    )  # fmt: skip
    r = fp.Supervisor(2.3, 0.3, disturbance_bound=UR5_PUSH)
    chosen = {"none": None, "sgn, eq. (20)": dataclasses.replace(r, kind="paper"), "R": r,
              "F": fp.Supervisor.quiet(2.3, 0.3),
              "F, observer 200 rad/s": fp.Supervisor.quiet(2.3, 0.3, observer=200.0)}  # fmt: skip
    print("\nUR5, 0.3 rad at 1 rad/s, push (60, 60, 30, 5, 5, 0.5) cos t N m, M_x = 2.3:")
    begin("step [ms]", "supervisor")
    for step in STEPS[1:]:
        plant = fp.Plant(disturbance=Cosine(UR5_PUSH, 1.0))
        experiment = fp.Experiment(
            arm, reference, **on_reference(reference), plant=plant, step=step, duration=4.0
        )
        rows(f"{1e3 * step:g}", [experiment], chosen, law)


def main() -> None:
    # The pushes are beyond r_min, on purpose.
    warnings.simplefilter("ignore", fp.FpidWarning)
    r = fp.Supervisor(3.0, 1.0)
    r_min = ", ".join(f"{r.tolerance(step):.0f}" for step in STEPS)
    mass = fp.Arm.two_link().mass_matrix([0.0, 0.0])
    reach = [np.linalg.norm(np.abs(np.linalg.inv(mass)) @ push) for push in (PUSH, CONSTANT)]
    print(
        f"V_M = {r.threshold:.3f}, V(0) = 1.200; r_min of R is {r_min} rad/s^2 at "
        f"{', '.join(f'{1e3 * step:g}' for step in STEPS)} ms, the pushes reach "
        f"{reach[0]:.0f} and {reach[1]:.0f}"
    )
    law = fp.paper_controller()
    pushes(law)
    wrong(law)
    ur5()


if __name__ == "__main__":
    main()
