"""Stability of suggested gains that are let go: frozen anywhere in their box, or moving fast.

    python benchmarks/boxes.py [--draws N] [--certificates] [--steps MS ...] [NAME ...]

Every arm, three steps. Gains are drawn inside the box of `suggest_gains` (every other draw at a
random corner of it), each with a pose of its own within the joints' limits, every tenth at the pose
that bears least Kd, found by a search of its own. Each is judged twice: by the poles of the sampled
loop with 12 modes over 200 s, and by a simulation of the whole arm under the law as it is, held
against its weight, which is kicked by 1e-6 rad/s: unstable if it diverges or moves more in the last
half of twelve seconds than over all of them. Wanted: none. Writes benchmarks/results/boxes.md.

With --certificates: the box of `certify_gains` around the same gains, the part of each by which it
may move either way at any speed, at home and at the least of seven poses; and the same where only
one of Kp, Ki and Kd moves. Writes benchmarks/results/certificates.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
import warnings

import numpy as np
from common import Report, head, row

import fpid_pin as fp
from fpid_pin.arms import names
from fpid_pin.checks import FloatArray
from fpid_pin.control import Safeguards, certify_gains, explain_gains, gain_ceilings
from fpid_pin.control.ceilings import seeded_poses
from fpid_pin.control.damping import GainBox, damping_ratios
from fpid_pin.control.linear_law import feedback, terms_of

SEED, DURATION, CHUNK = 20, 12.0, 100
BOXES = [
    "arm", "step [ms]", "mu", "least bandwidth [rad/s]", "damping at home", "at other poses",
    "Kp high/low", "Ki", "Kd", "unstable by poles", "by simulation", "least damping drawn", "s",
]  # fmt: skip
CERTIFICATES = [
    "arm", "n", "step [ms]", "reach at home [%]", "at the worst of 7 poses", "Kp alone there",
    "Ki alone", "Kd alone", "s",
]  # fmt: skip


class Growth(fp.costs.Cost):
    """Error over the last half over that of the whole run, worst joint: above 1 it grows."""

    def of(self, metrics: fp.costs.Metrics) -> float:
        """See `Cost.of`."""
        return float(metrics.rms_tail.max() / metrics.rms.max())


def drawn(box: GainBox, draws: int) -> list[FloatArray]:
    """Return gains inside a box, (3, n) each, scale included."""
    rng = np.random.default_rng(SEED)
    parts = rng.random((draws, *box.low.shape))
    parts[1::2] = parts[1::2] < 0.5
    return [box.at(part) for part in parts]


def kicked(arm: fp.Arm, step: float, q: FloatArray) -> fp.Experiment:
    """Return a kick of the arm at a pose where its weight is held for it."""
    held = fp.disturbances.Pulse(arm.gravity_vector(q))
    return fp.Experiment(
        arm, fp.references.Hold(q), q0=q, v0=np.full(arm.n, 1e-6), step=step, duration=DURATION,
        plant=fp.Plant(disturbance=held),
    )  # fmt: skip


def box_of(name: str, step: float, draws: int) -> str:
    """Judge one arm's box at one step and return its row of the table."""
    arm = fp.Arm.from_example(name)
    began = time.process_time()
    found = explain_gains(arm, step=step)
    spent = time.process_time() - began
    law = found.controller
    scale = law.scale_on(arm)
    low, high = (scale * side for side in Safeguards.bounds_of(law.safeguards, arm.n))
    gains = drawn(GainBox(low, low, high), draws)
    poses = seeded_poses(arm, draws, SEED)
    poses[::10] = gain_ceilings(arm, law, step=step, poses=1000, seed=SEED).pose
    twelve = fp.fractional.ExponentialSum(modes=12)
    loops = terms_of(law, arm, poses, step=step, horizon=200.0, design=twelve)
    ratios = np.array([
        damping_ratios(np.linalg.eigvals(loop.closed(feedback(k))) + 0j, step).min()
        for loop, k in zip(loops, gains, strict=True)
    ])  # fmt: skip
    # Dry friction would only help, and torque limits have no place in a kick of 1e-6 rad/s.
    free = arm.with_friction(dry=0.0).with_limits(effort=0.0)
    fixed = dataclasses.replace(law, learning_rate=0.0, safeguards=None)
    growth = np.concatenate([
        fp.evaluate(
            [kicked(free, step, q) for q in poses[k : k + CHUNK]],
            [dataclasses.replace(fixed, kp=x[0], ki=x[1], kd=x[2])
             for x in (g / scale for g in gains[k : k + CHUNK])],
            Growth(),
        )
        for k in range(0, draws, CHUNK)
    ])  # fmt: skip
    return row([
        name, f"{1e3 * step:g}", f"{float(np.asarray(law.derivative_order)):g}",
        f"{found.bandwidth.min():.2g}", f"{found.damping_ratio:.2f}",
        f"{found.least_damping_ratio:.2f}", f"{(high / low)[0].min():.2g}",
        f"{np.median((high / low)[1]):.2g}", f"{(high / low)[2].min():.2g}",
        np.sum(ratios <= 0.0), np.sum(~(growth <= 1.0)), f"{ratios.min():.3f}", f"{spent:.1f}",
    ])  # fmt: skip


def certificate_of(name: str, step: float) -> str:
    """Certify one arm's gains at one step and return its row of the table."""
    arm = fp.Arm.from_example(name)
    law = fp.suggest_gains(arm, step=step)
    began = time.process_time()
    found = certify_gains(arm, law, step=step)
    spent = time.process_time() - began
    alone = [
        certify_gains(arm, law, step=step, spread=only, poses=found.poses[found.reaches.argmin()])
        for only in np.eye(3)[:, :, np.newaxis]
    ]
    reaches = [found.reaches[0], *(x.reach for x in (found, *alone))]
    return row([name, arm.n, f"{1e3 * step:g}", *(f"{100.0 * reach:.0f}" for reach in reaches),
                f"{spent:.1f}"])  # fmt: skip


def main() -> None:
    """Judge or certify all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="arms; all of the catalogue if none is given")
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--certificates", action="store_true")
    parser.add_argument("--steps", type=float, nargs="+", default=[1.0, 2.0, 4.0], help="[ms]")
    options = parser.parse_args()
    # Joints that cannot carry or move the arm are the business of arms.py.
    warnings.simplefilter("ignore", fp.FpidWarning)
    report = Report(*head(CERTIFICATES if options.certificates else BOXES))
    for step in options.steps:
        for name in options.names or sorted(names()):
            if options.certificates:
                report.add(certificate_of(name, 1e-3 * step))
            else:
                report.add(box_of(name, 1e-3 * step, options.draws))
    if options.names:
        return
    if options.certificates:
        title = ("How far gains around `suggest_gains(arm, 10.0)` may move at any speed; s: "
                 "processor time of the seven poses.")  # fmt: skip
        report.write("certificates.md", title)
    else:
        title = (f"{options.draws} frozen gains inside the box of `suggest_gains(arm, 10.0)`, each "
                 "at a pose of its own; s: processor time of the suggestion.")  # fmt: skip
        report.write("boxes.md", title)


if __name__ == "__main__":
    main()
