"""Does a first run on any arm work?

Every arm of the catalogue under an adaptive FPID with suggested gains for 10 rad/s, none tuned by
hand: 1 kHz, the file's effort limits and friction, gravity in the plant, 0.3 rad sinusoids at 1
rad/s around home with phases spread over the joints. Wanted: RMS of the last half under 0.05 rad on
every joint, no divergence, no gain run-away.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from common import Bench, around_home, run

import fpid_pin as fp
from fpid_pin.arms import names
from fpid_pin.control.gains import impossible_joints
from fpid_pin.simulation.limits import limit_report

WANTED = 0.05  # [rad]
HEADS = ["arm", "n", "completed", "worst joint [mrad]", "median [mrad]", "largest gain/start"]


def row_of(name: str, duration: float) -> tuple[bool, list[Any]]:
    """Simulate one arm; return whether all is as wanted, and its row of the table."""
    arm = fp.Arm.from_example(name)
    law = fp.suggest_gains(arm, 10.0)
    experiment = fp.Experiment(arm, around_home(arm), duration=duration, dynamics="compiled")
    seen = fp.simulate(experiment, law)
    notes = [] if seen.outcome.completed else [str(seen.outcome)]
    rms = seen.metrics.rms_tail
    late = [arm.joint_names[j] for j in np.flatnonzero(~(rms < WANTED))]
    if late:
        notes.append("over the mark: " + ", ".join(late))
    notes += [reason.split(": ", 1)[1] for reason in impossible_joints(arm)]
    saturated = (np.abs(seen.torque) >= arm.effort_limit * (1.0 - 1e-9)).mean(axis=0)
    notes += [
        f"{arm.joint_names[j]} saturated {100.0 * saturated[j]:.0f} % of the time"
        for j in np.flatnonzero(saturated > 0.01)
    ]
    notes += [str(e) for e in limit_report(seen) if e.quantity != "effort"]
    start = np.stack([law.kp, law.ki, law.kd])
    growth = (np.stack([seen.kp, seen.ki, seen.kd]) / start[:, np.newaxis]).max()
    return seen.outcome.completed and not late, [
        name, arm.n, "yes" if seen.outcome.completed else "no", f"{1e3 * np.nanmax(rms):.1f}",
        f"{1e3 * np.median(rms):.1f}", f"{growth:.2f}", "; ".join(notes) or "-",
    ]  # fmt: skip


def arms(bench: Bench) -> None:
    """Print the table."""
    good = []

    def rows() -> Iterator[list[Any]]:
        for name in ("asr_twodof", "ur5") if bench.quick else sorted(names()):
            sound, row = row_of(name, 4.0 if bench.quick else 20.0)
            good.append(sound)
            yield row

    bench.table([*HEADS, "note"], rows())
    bench.say(f"All joints within {1e3 * WANTED:g} mrad on {sum(good)} of {len(good)} arms.")


if __name__ == "__main__":
    run(__doc__, {"arms": arms})
