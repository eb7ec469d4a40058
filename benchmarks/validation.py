"""Is the simulation right: beside a real machine, a study of others, and MuJoCo?

machine: our closed loop against the encoder log of a real double pendulum under PD, 75 s, and by
how much other laws would have followed better, with the machine's encoders, in the same simulation.
``--data FOLDER`` holds ``reference.csv`` and ``measured.csv`` (or ``.csv.gz``) of the pendulum A.0:
``trajectory-pos-20`` and the log ``20220812-061157-PM`` of its PD experiment, both from
github.com/dfki-ric-underactuated-lab/double_pendulum (BSD-3): time, pos1, pos2, vel1, vel2 and, in
the log, tau1, tau2. The package ships no data. Without it this part is left out.

study: thirteen scenarios of a planar two-link with PID: github.com/yzh423/PID-MATLAB, August 2026.

in_mujoco: our laws, tick by tick, in MuJoCo's own simulation of three arms.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from common import Bench, arm_of, around_home, on_reference, panels, run
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.costs import tool_distance
from fpid_pin.disturbances import Pulse
from fpid_pin.references import Quintic, RecordedMotion

# The machine, model 2.0 of its design: SI units.
MASSES, LENGTH = (0.5593806151425046, 0.6043459469186889), 0.3
CENTRES = (0.3, 0.18377686083653508)
INERTIAS = (0.053470810264216295, 0.02392374528789766)  # about the joints [kg m^2]
ROTORS = 36 * 7.659297952841183e-05  # behind a gear of 6
DRY = np.pi / 2 * np.array([0.093, 0.078])  # cf atan(100 v) at high speed [N m]
DRIVE = 8.0  # limit of the torque [N m]
# As the log has them: its rows are 1/300 s apart, angles come in steps of 0.38 mrad, and velocities
# differ from the smoothed angles' by 0.13 and 0.10 rad/s.
RATE = 1.0 / 300.0
SENSORS = fp.Sensors(position_resolution=3.81e-4, velocity_noise=(0.13, 0.10))


Pair = tuple[float, float]  # of the two links, or joints


def pendulum(
    masses: Pair, lengths: Pair, centres: Pair, inertias: Pair, *,
    rotors: float = 0.0, from_x: bool = False, tip: float = 0.0,
) -> pin.Model:  # fmt: skip
    """Return two links that turn about -y or, where q is measured from x, the same about y.

    `inertias` are about the centres of mass [kg m^2], `tip` a point mass at the end [kg]. With
    q = 0 the links hang along -z, or lie along x.
    """
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    along = np.array([1.0, 0.0, 0.0]) if from_x else np.array([0.0, 0.0, -1.0])
    place, parent = pin.SE3.Identity(), 0
    for k in range(2):
        joint = pin.JointModelRevoluteUnaligned(0.0, -1.0, 0.0)
        parent = model.addJoint(
            parent, joint, place, f"joint_{k + 1}", np.full(1, 1e3), np.full(1, 1e3),
            np.full(1, -1e3), np.full(1, 1e3),
        )  # fmt: skip
        # Of the inertia only the part about the joints' axis has an effect.
        body = pin.Inertia(masses[k], centres[k] * along, inertias[k] * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), lengths[k] * along)
    model.appendBodyToJoint(parent, pin.Inertia(tip, np.zeros(3), np.zeros((3, 3))), place)
    model.addFrame(pin.Frame("tool", parent, 0, place, pin.FrameType.OP_FRAME))
    model.armature = np.full(2, rotors)
    return model


def columns(folder: Path, name: str) -> np.ndarray:
    """Return a file's rows, without its line of names."""
    path = next(p for p in (folder / f"{name}.csv", folder / f"{name}.csv.gz") if p.exists())
    return np.loadtxt(path, delimiter=",", skiprows=1)


def rms(values: np.ndarray) -> np.ndarray:
    """Return the root mean square of each column."""
    return np.sqrt((values**2).mean(axis=0))


def both(values: np.ndarray, digits: int = 1) -> str:
    """Return two joints' numbers."""
    return " / ".join(f"{v:.{digits}f}" for v in values)


def machine(bench: Bench) -> None:
    if bench.data is None:
        bench.say("The real double pendulum was left out: no --data.")
        return
    reference, measured = columns(bench.data, "reference"), columns(bench.data, "measured")
    t, q, tau = measured[:, 0], measured[:, 1:3], measured[:, 5:7]
    inertias = tuple(i - m * c**2 for i, m, c in zip(INERTIAS, MASSES, CENTRES, strict=True))
    model = pendulum(MASSES, (LENGTH, 0.2), CENTRES, inertias, rotors=ROTORS)
    arm = fp.Arm.from_model(model).with_friction(viscous=1e-3, dry=DRY).with_limits(effort=DRIVE)
    motion = RecordedMotion(reference[:, 0], reference[:, 1:3])
    seconds = float(np.floor(t[-1]))
    pd = fp.Pid(kp=20.0, ki=0.0, kd=0.6, name="PD, as on the machine")
    ours = fp.simulate(fp.Experiment(arm, motion, duration=seconds, dynamics="compiled"), pd)

    def at(values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(t, ours.t, values[:, k]) for k in range(2)], axis=1)

    angles, torques = at(ours.q), at(ours.torque)
    wanted = motion.sample(t)[0]
    bench.say("A real double pendulum, 75 s, tracked by PD:")
    heads = ["joints 1 / 2", "angles, RMS [mrad]", "torque, RMS [N m]"]
    rows = [
        ("error on the machine, by its encoders", wanted - q, tau),
        ("error in our simulation", wanted - angles, torques),
        ("simulation - machine", angles - q, torques - tau),
    ]
    bench.table(heads, [(n, both(1e3 * rms(a)), both(rms(u), 3)) for n, a, u in rows])
    # Laws at the rate, and with the sensors, that the machine had.
    real = fp.Experiment(
        arm, motion, duration=seconds, step=RATE, sensors=SENSORS, dynamics="compiled"
    )
    best: dict[str, Any] = {"feedforward": True, "observer": "suggested", "step": RATE}
    laws = [
        pd,
        fp.suggest_gains(arm, step=RATE, name="FPID"),
        fp.suggest_gains(arm, **best, name="FPID + feedforward + observer"),
        fp.suggest_gains(
            arm, **best, integral_order=1.0, derivative_order=1.0,
            name="the same, integer orders",
        ),
    ]  # fmt: skip
    runs = fp.simulate(real, laws)
    bench.say("What other laws would have done there, by simulation with its encoders:")
    heads = ["law", "error, RMS [mrad]", "torque, RMS [N m]", "variation of the torque [N m]"]
    bench.table(heads, [
        (law.name, both(1e3 * run.metrics.rms), both(rms(run.torque), 3),
         both(run.metrics.total_variation, 0))
        for law, run in zip(laws, runs, strict=True)
    ])  # fmt: skip
    apart, ratio = both(1e3 * rms(angles - q)), runs[0].metrics.rms / runs[2].metrics.rms
    noise = runs[2].metrics.total_variation.sum() / runs[0].metrics.total_variation.sum()
    bench.say(
        f"The simulated angles are within {apart} mrad RMS of the machine's. With the sensors that "
        f"it had, FPID with feedforward and observer would have had {1 / ratio[0]:.0%} and "
        f"{1 / ratio[1]:.0%} of the PD's error, while its torque varies {noise:.1f} times as much."
    )
    bench.figure(drawn(t, q, angles, wanted), "validation.png", "The machine and our simulation")


def drawn(t: np.ndarray, q: np.ndarray, ours: np.ndarray, wanted: np.ndarray) -> Any:
    """Draw what was measured, what is simulated, and their difference."""
    figure, axes = panels((9.0, 6.0), 2, 2, sharex=True, height_ratios=(2, 1))
    for k in range(2):
        above, below = axes[:, k]
        above.plot(t, wanted[:, k], color="0.6", lw=1, ls="--", label="reference")
        above.plot(t, q[:, k], lw=1.4, label="machine")
        above.plot(t, ours[:, k], lw=1, label="our simulation")
        above.set_title(f"joint {k + 1}")
        below.plot(t, 1e3 * (ours[:, k] - q[:, k]), lw=0.8, color="tab:red")
        below.set_xlabel("time [s]")
        below.grid(alpha=0.3)
        above.grid(alpha=0.3)
    axes[0, 0].set_ylabel("angle [rad]")
    axes[1, 0].set_ylabel("simulation - machine\n[mrad]")
    axes[0, 0].legend()
    return figure


# The study: a planar two-link, q from the x axis, SI units.
CASES: dict[str, dict[str, Any]] = {
    "nominal": {}, "payload 0": {"tip": 0.0}, "payload 1 kg": {"tip": 1.0},
    "payload 1.5 kg": {"tip": 1.5}, "links .35, .25 m": {"lengths": (0.35, 0.25)},
    "links .55, .45 m": {"lengths": (0.55, 0.45)}, "masses x .8": {"factor": 0.8},
    "masses x .9": {"factor": 0.9}, "masses x 1.1": {"factor": 1.1},
    "masses x 1.2": {"factor": 1.2},
    "pulse (4, -3) N m": {"pulse": True}, "limits 18, 10 N m": {"limits": (18.0, 10.0)},
    "all together": {
        "lengths": (0.55, 0.45), "tip": 1.0, "factor": 1.2, "limits": (18.0, 10.0), "pulse": True,
    },
}  # fmt: skip
#: What the study's report printed: cases passed, the mean and the worst RMS error of a joint [rad].
PRINTED = {"manual": (8, 0.13109, 0.83476), "optimised": (10, 0.11074, 0.83037)}
NOMINAL = ((0.45, 0.35), 0.5, 1.0)  # lengths, tip, factor of the masses
STEADY_RMS, STEADY_ERROR, TOOL_ERROR = 0.02, 0.05, 0.15  # what passes [rad], [rad], [m]


@dataclass(frozen=True, eq=False)
class StudyPid(fp.Controller):
    """The study's PID: a filtered derivative, and an integral that back-calculation unwinds.

    u = Kp e + Ki i + Kd d;  d <- a d + (1 - a) e', a = exp(-2 pi 50 h);  i' = e - 0.002 (what the
    limit cut off), Euler's rule, i used before its update.
    """

    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    memory, shown = ("i", "d"), {}

    @staticmethod
    def torque(c: Any) -> Any:
        keep = math.exp(-100.0 * math.pi * c.h)
        c.d = keep * c.d + (1.0 - keep) * c.e_dot
        return c.kp * c.e + c.ki * c.i + c.kd * c.d

    @staticmethod
    def adapt(c: Any) -> None:
        c.i += c.h * (c.e - 0.002 * c.cut)


def study_case(
    lengths: Pair = (0.45, 0.35), tip: float = 0.5, factor: float = 1.0,
    limits: Pair = (25.0, 15.0), pulse: bool = False,
) -> fp.Experiment:  # fmt: skip
    """Return one of the study's thirteen experiments; every law has the nominal limits."""
    masses = (2.0 * factor, 1.5 * factor)
    inertias = tuple(m * x**2 / 12 for m, x in zip(masses, lengths, strict=True))
    centres = tuple(x / 2 for x in lengths)
    model = pendulum(masses, lengths, centres, inertias, from_x=True, tip=tip)
    arm = fp.Arm.from_model(model).with_friction(viscous=(0.05, 0.04)).with_limits(effort=limits)
    # Both ends of the pulse belong to it. Of the drives' limits the laws know, of all else nothing.
    push = Pulse((4.0, -3.0), 2.0, 2.1005) if pulse else None
    nominal = arm if (lengths, tip, factor) == NOMINAL else study_case().arm
    return fp.Experiment(
        nominal.with_limits(effort=limits), Quintic((0.0, 0.0), np.deg2rad([45.0, 60.0]), 3.0),
        duration=5.0, integrator="rk4", dynamics="compiled",
        plant=fp.Plant(arm=arm, disturbance=push),
    )  # fmt: skip


def study(bench: Bench) -> None:
    laws = {
        "manual": StudyPid(kp=(120.0, 100.0), ki=(40.0, 30.0), kd=(25.0, 18.0)),
        "optimised": StudyPid(kp=(240.0, 200.0), ki=(79.9554, 30.2026), kd=(29.3133, 18.3972)),
        "FPID": fp.suggest_gains(
            study_case().arm, feedforward=True, observer="suggested", name="FPID"
        ),
    }  # fmt: skip
    cells: dict[str, list[str]] = {name: [] for name in CASES}
    passed, errors = dict.fromkeys(laws, 0), {name: [] for name in laws}
    for case, changes in list(CASES.items())[: 3 if bench.quick else None]:
        experiment = study_case(**changes)
        for name, law in laws.items():
            seen = fp.simulate(experiment, law)
            last = seen.error[seen.t >= seen.t[-1] - 0.5 - 1e-9]
            steady = rms(last)
            good = (
                seen.outcome.completed
                and (steady <= STEADY_RMS).all()
                and (np.abs(last).max(axis=0) <= STEADY_ERROR).all()
                and tool_distance(experiment.resolved.arm, seen.q, seen.q_ref).max() <= TOOL_ERROR
            )
            passed[name] += good
            errors[name].append(rms(seen.error).mean())
            cells[case] += [both(1e3 * steady, 3), "yes" if good else "no"]
    rows = []
    for name in laws:
        found = (passed[name], float(np.mean(errors[name])), float(np.max(errors[name])))
        rows.append((
            name, f"{found[0]} of {len(errors[name])}", f"{found[1]:.5f}", f"{found[2]:.5f}",
            "{}, {:.5f}, {:.5f}".format(*PRINTED[name]) if name in PRINTED else "-",
        ))  # fmt: skip
    bench.say(
        f"Of {len(errors['FPID'])} scenarios of a planar two-link "
        + ", ".join(f"{name} passes {passed[name]}" for name in laws)
        + "; of all 13 the study printed 8 for its manual PID, 10 for its optimised one."
    )
    heads = ["law", "passed", "both joints' RMS error, mean [rad]", "largest [rad]", "printed"]
    bench.table(heads, rows)
    bench.details("Thirteen scenarios: error of the last .5 s, RMS [mrad]")
    heads = ["scenario", *(head for name in laws for head in (name, "passed"))]
    bench.table(heads, ([case, *row] for case, row in cells.items() if row))


def in_mujoco(bench: Bench) -> None:
    """Run laws in MuJoCo, a tick at a time, and here; its step is semi-implicit Euler, too."""
    import mujoco
    from speed import mujoco_model

    rows, seconds = [], 1.0 if bench.quick else 4.0
    for name in bench.arms:
        arm = arm_of(name).with_friction(viscous=0.0, dry=0.0)  # MuJoCo treats it otherwise
        model = mujoco_model(arm)
        motion = around_home(arm)
        experiment = fp.Experiment(arm, motion, duration=seconds, **on_reference(motion))
        for law in (
            fp.suggest_gains(arm, name="FPID"),
            fp.suggest_gains(arm, feedforward=True, observer="suggested", name="FPID + f. + o."),
            fp.ComputedTorque(k0=100.0, k1=20.0, name="computed torque"),
        ):
            seen, data = fp.simulate(experiment, law), mujoco.MjData(model)
            data.qpos[:], data.qvel[:] = seen.q[0], seen.v[0]
            loop, apart = law.start(arm, step=1e-3, horizon=20.0), 0.0  # as runs up to 20 s
            references = motion.sample(seen.t)
            for k in range(len(seen.t) - 1):
                data.qfrc_applied[:] = loop.torque(
                    data.qpos, data.qvel, *(part[k] for part in references)
                )
                mujoco.mj_step(model, data)
                apart = max(apart, float(np.abs(data.qpos - seen.q[k + 1]).max()))
            error = 1e3 * seen.metrics.rms_tail.max()
            rows.append((name, law.name, f"{apart:.1e}", f"{error:.3f}"))
    bench.say(
        f"Laws that run tick by tick in MuJoCo for {seconds:g} s come within "
        f"{max(float(row[2]) for row in rows):.0e} rad of our own simulation."
    )
    heads = ["arm", "law", "largest difference of the angles [rad]", "our tracking error [mrad]"]
    bench.table(heads, rows, text=2)


if __name__ == "__main__":
    run(__doc__, machine, study, in_mujoco)
