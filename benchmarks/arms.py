"""Every arm of the catalogue under an adaptive FPID with suggested gains, none tuned by hand.

    python benchmarks/arms.py [--quick] [--bandwidth W] [NAME ...]

1 kHz, the file's effort limits and friction, gravity in the plant, 0.3 rad sinusoids at 1 rad/s
around home with phases spread over the joints. Wanted: RMS of the last half under 0.05 rad on every
joint, no divergence, no gain run-away. Writes benchmarks/results/arms.md.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
from common import Report, around_home, head, row

import fpid_pin as fp
from fpid_pin.arms import names
from fpid_pin.control.gains import impossible_joints, suggest_gains
from fpid_pin.simulation.limits import limit_report

WANTED = 0.05
ASKED = ("asr_twodof", "ur5", "ur10", "panda", "xarm7", "z1", "talos_arm", "kinova", "bravo7_no_ee")


def row_of(name: str, bandwidth: float, duration: float) -> str:
    """Simulate one arm and return its row of the table."""
    arm = fp.Arm.from_example(name)
    with warnings.catch_warnings():
        # The table says what the warnings say.
        warnings.simplefilter("ignore", fp.FpidWarning)
        controller = suggest_gains(arm, bandwidth)
        run = fp.simulate(fp.Experiment(arm, around_home(arm), duration=duration), controller)
    notes = [] if run.outcome.completed else [str(run.outcome)]
    rms = run.metrics.rms_tail
    late = [arm.joint_names[j] for j in np.flatnonzero(~(rms < WANTED))]
    if late:
        notes.append("over the mark: " + ", ".join(late))
    notes += [reason.split(": ", 1)[1] for reason in impossible_joints(arm)]
    saturated = (np.abs(run.torque) >= arm.effort_limit * (1.0 - 1e-9)).mean(axis=0)
    notes += [
        f"{arm.joint_names[j]} saturated {100.0 * saturated[j]:.0f} % of the time"
        for j in np.flatnonzero(saturated > 0.01)
    ]
    notes += [str(e) for e in limit_report(run) if e.quantity != "effort"]
    start = np.stack([controller.kp, controller.ki, controller.kd])
    gains = np.stack([run.kp, run.ki, run.kd])
    growth = (gains / start[:, np.newaxis]).max()
    return row([
        name, arm.n, "yes" if run.outcome.completed else "no", f"{1e3 * np.nanmax(rms):.1f}",
        f"{1e3 * np.median(rms):.1f}", f"{growth:.2f}", "; ".join(notes) or "-",
    ])  # fmt: skip


def main() -> None:
    """Run all arms and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="arms; all of the catalogue if none is given")
    parser.add_argument("--quick", action="store_true", help="4 s instead of 20 s, nothing written")
    parser.add_argument("--bandwidth", type=float, default=10.0, help="[rad/s]")
    options = parser.parse_args()
    others = sorted(set(names()) - set(ASKED))
    heads = ["arm", "n", "completed", "worst joint [mrad]", "median [mrad]", "largest gain/start"]
    report = Report(*head([*heads, "note"]))
    for name in options.names or [*ASKED, *others]:
        report.add(row_of(name, options.bandwidth, 4.0 if options.quick else 20.0))
    if not (options.quick or options.names):
        report.write(
            "arms.md",
            f"Suggested gains, bandwidth {options.bandwidth:g} rad/s, RMS error over the last half "
            "of 20 s:",
        )


if __name__ == "__main__":
    main()
