"""What the model's feedforward and a disturbance observer do for suggested gains.

    python benchmarks/observer.py    # prints the table of docs/observer.md, under a minute

0.3 rad at 2 rad/s around home, from the reference, quiet sensors; tail RMS over all joints.
"""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
from common import arm_of, around_home, on_reference, table, tail, variation

import fpid_pin as fp
from fpid_pin.control import stability_report

QUIET = fp.Sensors(position_noise=2e-5, velocity_noise=0.01)  # [rad], [rad/s]
LOUD = fp.Sensors(position_noise=1e-4, velocity_noise=0.05, delay=2)


def conditions(arm: fp.Arm) -> dict[str, tuple[fp.Plant | None, fp.Sensors]]:
    size = np.asarray(fp.suggest_gains(arm).scale)
    wrong = arm.perturbed(np.random.default_rng(1), mass=0.2, com=0.01)
    load = fp.Plant(arm=arm.with_payload(3.0))
    return {
        "exact model": (None, QUIET),
        "payload 3 kg": (load, QUIET),
        "friction": (fp.Plant(viscous_friction=size, dry_friction=0.5 * size), QUIET),
        "masses 20 %": (fp.Plant(arm=wrong), QUIET),
        "payload, noise x 5, 2 ms late": (load, LOUD),
    }


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    for name in ("two_link", "ur5", "panda"):
        arm = arm_of(name)
        reference = around_home(arm, frequency=2.0)
        base = fp.Experiment(arm, reference, **on_reference(reference), duration=4.0 * np.pi)
        laws = {
            "FPID": fp.suggest_gains(arm),
            "+ feedforward": fp.suggest_gains(arm, feedforward=True),
            "+ observer": fp.suggest_gains(arm, observer="suggested"),
            "+ both": fp.suggest_gains(arm, feedforward=True, observer="suggested"),
            "computed torque": fp.ComputedTorque(k0=100.0, k1=20.0),
        }
        plants = conditions(arm)
        print(f"\n{name}: observer {laws['+ both'].observer:.3g} rad/s")
        experiments = [
            dataclasses.replace(base, plant=plant, sensors=sensors)
            for plant, sensors in plants.values()
        ]
        rows = []
        for label, law in laws.items():
            cells = [
                f"{tail(run):.2f} / {1e-3 * variation(run):.1f}"
                if run.outcome.completed else "diverged"
                for run in fp.simulate(experiments, law)
            ]  # fmt: skip
            margin = 1e3 * stability_report(arm, law).common_delay_margin
            rows.append([label, f"{margin:.1f}", *cells])
        print("\n".join(table(["law", "delay borne [ms]", *plants], rows)))


if __name__ == "__main__":
    main()
