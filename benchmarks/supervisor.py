"""What the supervisor does, and where a sampled loop ends its guarantee.

    python benchmarks/supervisor.py

The paper's arm and controller (M_x = 3, so that V_M is near), pushed by (30, 12) cos t N m, a bound
that the supervisor knows. Its guarantee is one of continuous time; sgn in a sampled loop holds
the torque a step too long. Prints, for two steps and some boundary layers, how far V gets, how
long the supervisor acts and the largest torque.
"""

from __future__ import annotations

import dataclasses

import numpy as np

import fpid_pin as fp
from fpid_pin.disturbances import Cosine

PUSH = (30.0, 12.0)  # [N m]


def main() -> None:
    base = fp.paper_controller()
    threshold = dataclasses.replace(base.supervisor, m_x=3.0).threshold
    print(f"V_M = {threshold:.3f}, V(0) = 1.200\n")
    heads = ("step [ms]", "boundary layer", "largest V / V_M", "acting [s]", "peak torque [N m]")
    print("| " + " | ".join((*heads, "variation of u_s [N m]")) + " |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for step in (1e-3, 2.5e-4):
        experiment = dataclasses.replace(
            fp.paper_experiment(duration=4.0, step=step),
            plant=fp.Plant(disturbance=Cosine(PUSH, frequency=1.0)),
        )
        guards = [None] + [
            dataclasses.replace(
                base.supervisor, m_x=3.0, disturbance_bound=PUSH, boundary_layer=layer
            )
            for layer in (0.0, 0.5, 2.0)
        ]
        runs = fp.simulate(experiment, [dataclasses.replace(base, supervisor=g) for g in guards])
        p = base.supervisor.p
        for guard, run in zip(guards, runs, strict=True):
            state = np.stack([run.error, run.v_ref - run.v], axis=-1)
            v = 0.5 * np.einsum("kja,ab,kjb->k", state, p, state)
            acting = step * float((run.u_s != 0.0).any(axis=1).sum())
            name = "no supervisor" if guard is None else f"{guard.boundary_layer:g}"
            variation = float(np.abs(np.diff(run.u_s, axis=0)).sum())
            print(
                f"| {1e3 * step:g} | {name} | {v.max() / threshold:.3f} | {acting:.3f} "
                f"| {np.abs(run.torque).max():.0f} | {variation:.0f} |"
            )


if __name__ == "__main__":
    main()
