"""What do the model's feedforward and a disturbance observer do for suggested gains?

0.3 rad at 2 rad/s around home, from the reference, quiet sensors; tail RMS over all joints. It is
the table of docs/observer.md.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from common import Bench, arm_of, around_home, on_reference, run, tail, variation

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


def observer(bench: Bench) -> None:
    """Print a table an arm."""
    for name in ("two_link",) if bench.quick else ("two_link", "ur5", "panda"):
        arm = arm_of(name)
        reference = around_home(arm, frequency=2.0)
        base = fp.Experiment(
            arm, reference, **on_reference(reference), duration=4.0 * np.pi, dynamics="compiled"
        )
        laws = {
            "FPID": fp.suggest_gains(arm),
            "+ feedforward": fp.suggest_gains(arm, feedforward=True),
            "+ observer": fp.suggest_gains(arm, observer="suggested"),
            "+ both": fp.suggest_gains(arm, feedforward=True, observer="suggested"),
            "computed torque": fp.ComputedTorque(k0=100.0, k1=20.0),
        }
        plants = conditions(arm)
        experiments = [
            dataclasses.replace(base, plant=plant, sensors=sensors)
            for plant, sensors in plants.values()
        ]
        rows, errors = [], {}
        for label, law in laws.items():
            runs = fp.simulate(experiments, law)
            errors[label] = [tail(seen) for seen in runs]
            cells = [
                f"{tail(seen):.2f} / {1e-3 * variation(seen):.1f}"
                if seen.outcome.completed else "diverged"
                for seen in runs
            ]  # fmt: skip
            margin = 1e3 * stability_report(arm, law).common_delay_margin
            rows.append([label, f"{margin:.1f}", *cells])
        gains = [a / b for a, b in zip(errors["FPID"], errors["+ both"], strict=True)]
        bench.say(
            f"{name}, observer {laws['+ both'].observer:.3g} rad/s: with both the error is "
            f"{min(gains):.2g} to {max(gains):.2g} times smaller; tail RMS [mrad] / variation of "
            "the torques [kN m]:"
        )
        bench.table(["law", "delay borne [ms]", *plants], rows)


if __name__ == "__main__":
    run(__doc__, {"observer": observer})
