"""What the model's feedforward and a disturbance observer do for suggested gains.

    python benchmarks/observer.py    # prints the table of docs/observer.md, under a minute

0.3 rad at 2 rad/s around home, from the reference, quiet sensors; tail RMS over all joints.
"""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np

import fpid_pin as fp
from fpid_pin.control import stability_report
from fpid_pin.references import Sinusoid

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
        arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
        phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
        reference = Sinusoid(0.3, 2.0, phase=phase, offset=arm.home)
        v0 = reference.sample(np.zeros(1))[1][0]
        base = fp.Experiment(arm, reference, v0=v0, duration=4.0 * np.pi)
        laws = {
            "FPID": fp.suggest_gains(arm),
            "+ feedforward": fp.suggest_gains(arm, feedforward=True),
            "+ observer": fp.suggest_gains(arm, observer="suggested"),
            "+ both": fp.suggest_gains(arm, feedforward=True, observer="suggested"),
            "computed torque": fp.ComputedTorque(k0=100.0, k1=20.0),
        }
        table = conditions(arm)
        print(f"\n{name}: observer {laws['+ both'].observer:.3g} rad/s")
        print("| law | delay borne [ms] | " + " | ".join(table) + " |")
        print("| --- | ---: |" + " ---: |" * len(table))
        experiments = [
            dataclasses.replace(base, plant=plant, sensors=sensors)
            for plant, sensors in table.values()
        ]
        for label, law in laws.items():
            cells = [f"{1e3 * stability_report(arm, law).common_delay_margin:.1f}"]
            for run in fp.simulate(experiments, law):
                m = run.metrics
                text = f"{1e3 * np.sqrt(np.mean(m.rms_tail**2)):.2f}"
                kilo = 1e-3 * m.total_variation.sum()
                cells.append(f"{text} / {kilo:.1f}" if run.outcome.completed else "diverged")
            print(f"| {label} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
