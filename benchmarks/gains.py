"""What are suggested gains worth, and are they safe where they are let go?

first_run: every arm of the catalogue with suggested gains for 10 rad/s, none tuned by hand: 1 kHz,
the file's effort limits and friction, gravity in the plant, 0.3 rad sinusoids at 1 rad/s around
home with phases spread over the joints. Wanted: RMS of the last half under 0.05 rad on every joint,
no divergence, no gain run-away.

assists: what feedforward and a disturbance observer add, 0.3 rad at 2 rad/s around home, from the
reference, quiet sensors; tail RMS over all joints: the table of docs/observer.md.

boxes: gains are drawn inside the box of `suggest_gains(arm, 10.0)` (every other draw at a random
corner of it), each with a pose of its own within the joints' limits, every tenth at the pose that
bears least Kd, found by a search of its own. Each is judged twice: by the poles of the sampled loop
with 12 modes over 200 s, and by a simulation of the whole arm under the law as it is, held against
its weight, which is kicked by 1e-6 rad/s: unstable if it diverges or moves more in the last half of
twelve seconds than over all of them. Wanted: none.

certificates: the box of `certify_gains` around the same gains, the part of each by which it may
move either way at any speed, at home and at the least of seven poses; and the same where only one
of Kp, Ki and Kd moves.

long: twenty minutes of the two-link arm tracking sin t, and holding a pose against gravity, with
noise of encoders and rates, under the paper's law and `suggest_gains`, with and without what keeps
the gains bounded. Wanted with projection and with sigma-modification: gains bounded, the RMS over
the last ten periods at most 1.02 times that of the second ten, no burst.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from common import Bench, arm_of, around_home, on_reference, panels, run, tail, variation

import fpid_pin as fp
from fpid_pin.arms import names
from fpid_pin.checks import FloatArray
from fpid_pin.control import (
    Safeguards,
    certify_gains,
    explain_gains,
    gain_ceilings,
    stability_report,
)
from fpid_pin.control.ceilings import FrozenLoops, between
from fpid_pin.control.gains import impossible_joints
from fpid_pin.control.poses import seeded_poses
from fpid_pin.simulation import limit_report

WANTED, LATE = 0.05, "over the mark"  # [rad]
QUIET = fp.Sensors(position_noise=2e-5, velocity_noise=0.01)  # [rad], [rad/s]
LOUD = fp.Sensors(position_noise=1e-4, velocity_noise=0.05, delay=2)
SEED, DURATION = 20, 12.0
WINDOW = 20.0 * np.pi  # ten periods [s]
NOISE = fp.Sensors(position_noise=1e-4, velocity_noise=0.02)  # [rad], [rad/s]
SIGMA = 0.03  # 1/s; 0.05 holds too, but for the paper's gains in regulation (1.024)


def row_of(name: str, duration: float) -> dict[str, Any]:
    """Simulate one arm; return its row of the table."""
    arm = fp.Arm.from_example(name)
    law = fp.suggest_gains(arm, 10.0)
    experiment = fp.Experiment(arm, around_home(arm), duration=duration, dynamics="compiled")
    seen = fp.simulate(experiment, law)
    notes = [] if seen.outcome.completed else [str(seen.outcome)]
    rms = seen.metrics.rms_tail
    late = [arm.joint_names[j] for j in np.flatnonzero(~(rms < WANTED))]
    if late:
        notes.append(f"{LATE}: {', '.join(late)}")
    notes += [reason.split(": ", 1)[1] for reason in impossible_joints(arm)]
    saturated = (np.abs(seen.torque) >= arm.effort_limit * (1.0 - 1e-9)).mean(axis=0)
    notes += [
        f"{arm.joint_names[j]} saturated {100.0 * saturated[j]:.0f} % of the time"
        for j in np.flatnonzero(saturated > 0.01)
    ]
    notes += [str(e) for e in limit_report(seen) if e.quantity != "effort"]
    start = np.stack([law.kp, law.ki, law.kd])
    growth = (np.stack([seen.kp, seen.ki, seen.kd]) / start[:, np.newaxis]).max()
    return {
        "arm": name, "n": arm.n, "completed": "yes" if seen.outcome.completed else "no",
        "worst joint [mrad]": f"{1e3 * np.nanmax(rms):.1f}",
        "median [mrad]": f"{1e3 * np.median(rms):.1f}", "largest gain/start": f"{growth:.2f}",
        "note": "; ".join(notes) or "-",
    }  # fmt: skip


def first_run(bench: Bench) -> None:
    chosen = ("asr_twodof", "ur5") if bench.quick else sorted(names())
    rows = [row_of(name, 4.0 if bench.quick else 20.0) for name in chosen]
    good = sum(row["completed"] == "yes" and LATE not in row["note"] for row in rows)
    bench.say(f"First runs: all joints within {1e3 * WANTED:g} mrad on {good} of {len(rows)} arms.")
    bench.records(rows)


def wrong_models(arm: fp.Arm) -> dict[str, tuple[fp.Plant | None, fp.Sensors]]:
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


def assists(bench: Bench) -> None:
    for name in bench.arms:
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
        plants = wrong_models(arm)
        experiments = [
            replace(base, plant=plant, sensors=sensors) for plant, sensors in plants.values()
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


class Growth(fp.costs.Cost):
    """Error over the last half over that of the whole run, worst joint: above 1 it grows."""

    def of(self, metrics: fp.costs.Metrics) -> float:
        return float(metrics.rms_tail.max() / metrics.rms.max())


def cases(bench: Bench) -> Iterator[tuple[str, float]]:
    """Yield arms and steps [s]."""
    for step in (1e-3,) if bench.quick else (1e-3, 2e-3, 4e-3):
        for name in ("asr_twodof",) if bench.quick else sorted(names()):
            yield name, step


def kicked(arm: fp.Arm, step: float, q: FloatArray) -> fp.Experiment:
    """Return a kick of the arm at a pose where its weight is held for it."""
    held = fp.disturbances.Pulse(arm.gravity_vector(q))
    return fp.Experiment(
        arm, fp.references.Hold(q), q0=q, v0=np.full(arm.n, 1e-6), step=step, duration=DURATION,
        plant=fp.Plant(disturbance=held),
    )  # fmt: skip


def box_of(name: str, step: float, draws: int) -> dict[str, Any]:
    """Judge one arm's box at one step; return its row of the table."""
    arm = fp.Arm.from_example(name)
    began = time.process_time()
    found = explain_gains(arm, step=step)
    spent = time.process_time() - began
    law = found.controller
    scale = law.scale_on(arm)
    low, high = (scale * side for side in Safeguards.bounds_of(law.safeguards, arm.n))
    parts = np.random.default_rng(SEED).random((draws, *low.shape))
    parts[1::2] = parts[1::2] < 0.5
    gains = [between(low, high, part) for part in parts]
    poses = seeded_poses(arm, draws, SEED)
    poses[::10] = gain_ceilings(arm, law, step=step, poses=1000, seed=SEED).pose
    loops = FrozenLoops(arm, law, poses, step=step, horizon=200.0, modes=12)
    ratios = np.array([loops.damping(k, pose) for pose, k in enumerate(gains)])
    # Dry friction would only help, and torque limits have no place in a kick of 1e-6 rad/s.
    free = arm.with_friction(dry=0.0).with_limits(effort=0.0)
    fixed = replace(law, learning_rate=0.0, safeguards=None)
    laws = [replace(fixed, kp=p, ki=i, kd=d) for p, i, d in (x / scale for x in gains)]
    growth = fp.evaluate([kicked(free, step, q) for q in poses], laws, Growth())
    kp, ki, kd = high / low
    return {
        "arm": name, "step [ms]": f"{1e3 * step:g}",
        "mu": f"{float(np.asarray(law.derivative_order)):g}",
        "least bandwidth [rad/s]": f"{found.bandwidth.min():.2g}",
        "damping at home": f"{found.damping_ratio:.2f}",
        "at other poses": f"{found.least_damping_ratio:.2f}",
        "Kp high/low": f"{kp.min():.2g}", "Ki": f"{np.median(ki):.2g}", "Kd": f"{kd.min():.2g}",
        "unstable by poles": np.sum(ratios <= 0.0), "by simulation": np.sum(~(growth <= 1.0)),
        "least damping drawn": f"{ratios.min():.3f}", "s": f"{spent:.1f}",
    }  # fmt: skip


def certificate_of(name: str, step: float) -> dict[str, Any]:
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
    heads = "reach at home [%]", "at the worst of 7 poses", "Kp alone there", "Ki alone", "Kd alone"
    reaches = (found.reaches[0], found.reach, *(x.reach for x in alone))
    percent = {head: f"{100.0 * x:.0f}" for head, x in zip(heads, reaches, strict=True)}
    return {"arm": name, "n": arm.n, "step [ms]": f"{1e3 * step:g}", **percent, "s": f"{spent:.1f}"}


def variants() -> dict[tuple[str, str], fp.AdaptiveFpid]:
    """Return the laws by (law, safeguard); projection is to half and four times the start."""
    suggested = fp.suggest_gains(fp.Arm.two_link())
    laws = {"paper": fp.paper_controller(supervised=False), "suggested": suggested}
    found = {}
    for label, law in laws.items():
        start = np.stack([law.kp, law.ki, law.kd])
        bounds = {"minimum": 0.5 * start, "maximum": 4.0 * start}
        if label == "suggested" and law.safeguards is not None:
            bounds = {"minimum": law.safeguards.minimum, "maximum": law.safeguards.maximum}
        for guard, safeguards in {
            "none": None,
            "projection": Safeguards(**bounds),
            "sigma-modification": Safeguards(sigma=SIGMA),
            "both": Safeguards(**bounds, sigma=SIGMA),
        }.items():
            found[label, guard] = replace(law, safeguards=safeguards)
    return found


def long(bench: Bench) -> None:
    duration = 130.0 if bench.quick else 1200.0
    track = fp.paper_experiment(duration=duration).with_dynamics("compiled")
    track = replace(track, sensors=NOISE)
    hold = replace(track, reference=fp.references.Hold((0.5, 0.5)), q0=(0.0, 0.35), v0=None)
    rows, curves, guarded = [], {}, []
    for job, experiment in {"tracking": track, "regulation": hold}.items():
        for (label, guard), law in variants().items():
            seen = fp.simulate(experiment, law)
            per = round(WINDOW / experiment.step)
            windows = seen.error[: len(seen.t) // per * per].reshape(-1, per, 2)
            start = np.stack([law.kp, law.ki, law.kd]) * np.ones((3, 2))
            growth = np.stack([seen.kp, seen.ki, seen.kd], axis=1) / start
            rms = 1e3 * np.sqrt((windows**2).mean(axis=1).sum(axis=1))
            late = rms[-1] / rms[1] if seen.outcome.completed else np.inf
            if guard in ("projection", "sigma-modification"):
                guarded.append(late)
            curves[job, label, guard] = rms, growth[per - 1 :: per].max(axis=(1, 2))
            peak = 1e3 * np.abs(windows[1:]).max()
            rows.append({
                "job": job, "law": label, "safeguard": guard, "RMS, 2nd": f"{rms[1]:.3f}",
                "last": f"{rms[-1]:.3f}", "last/2nd": f"{late:.3f}",
                "worst/2nd": f"{rms[1:].max() / rms[1]:.3f}", "peak after 1st": f"{peak:.2f}",
                "largest gain/start": f"{growth.max():.2f}", "outcome": seen.outcome,
            })  # fmt: skip
    bench.say(
        f"In {duration / 60.0:.0f} minutes under noise, the RMS of the last ten periods is at most "
        f"{max(guarded):.3f} times that of the second ten with projection or sigma-modification."
    )
    bench.say(f"Windows of ten periods ({WINDOW:.1f} s), both joints; RMS and peak in mrad:")
    bench.records(rows, 3)
    bench.figure(drawn(curves), "long_runs.png", "RMS error and gains over twenty minutes")


def drawn(curves: dict[tuple[str, str, str], tuple[FloatArray, FloatArray]]) -> Any:
    """Draw RMS and the largest gain over time, a column for each job and law."""
    columns = list(dict.fromkeys((job, law) for job, law, _ in curves))
    figure, axes = panels((14, 6.5), 2, len(columns), sharex=True, sharey="row")
    for (job, law, guard), rows in curves.items():
        column = columns.index((job, law))
        style = {"none": {"color": "k", "lw": 2.0}, "both": {"linestyle": "--"}}.get(guard, {})
        for axis, values in zip(axes[:, column], rows, strict=True):
            minutes = (np.arange(len(values)) + 0.5) * WINDOW / 60.0
            axis.semilogy(minutes, values, label=guard, **style)
        axes[0, column].set_title(f"{job}, {law} gains")
        axes[1, column].set_xlabel("simulated time [min]")
    axes[0, 0].set_ylabel("RMS error per window [mrad]")
    axes[1, 0].set_ylabel("largest gain over its start")
    axes[0, -1].legend(title="safeguard", fontsize="small")
    return figure


def boxes(bench: Bench) -> None:
    draws = 20 if bench.quick else 500
    rows = [box_of(name, step, draws) for name, step in cases(bench)]
    bad = sum(row["unstable by poles"] + row["by simulation"] for row in rows)
    bench.say(
        f"Of {len(rows) * draws:,} frozen gains inside the boxes of `suggest_gains(arm, 10.0)`, "
        f"each at a pose of its own, {bad} are unstable, by poles or by simulation; the least "
        f"damping ratio drawn is {min(row['least damping drawn'] for row in rows)}."
    )
    bench.details("Boxes: s is the processor time of the suggestion")
    bench.records(rows)


def certificates(bench: Bench) -> None:
    bench.details("How far gains may move at any speed: s is the processor time of seven poses")
    bench.records([certificate_of(*case) for case in cases(bench)])


if __name__ == "__main__":
    run(__doc__, first_run, assists, long, boxes, certificates)
