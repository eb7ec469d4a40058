"""The adaptive FPID beside the controllers that people use, every one tuned by the same budget.

    python benchmarks/baselines.py [--quick] [--only ARM] [--evaluations N]

Two-link, UR5 and Panda. Each controller's few parameters, shared by the joints, are found by
scipy's differential evolution with the same number of simulations, on the same cost (33), under
the same condition (nominal plant, noisy sensors). Then all are tried under conditions that they
were not tuned for. Writes benchmarks/results/baselines-ARM.md: also where the
FPID loses.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

import fpid_pin as fp
from fpid_pin.control import Controller, Safeguards
from fpid_pin.control.baselines import GravityOnly, PdGravity, Pid, SlidingMode, SlotineLi
from fpid_pin.control.gains import LEARNING_ERROR, LEARNING_TIME, suggest_gains
from fpid_pin.costs import QuadraticCost
from fpid_pin.disturbances import Cosine
from fpid_pin.references import Reference, Sinusoid

POPULATION = 24
NOISE = fp.Sensors(position_noise=2e-5, velocity_noise=0.01)  # [rad], [rad/s]
Genes = Mapping[str, float]


@dataclass(frozen=True)
class Contestant:
    """A kind of controller and its search space; bounds with a ratio above 20 are logarithmic."""

    build: Callable[[fp.Arm, Genes], Controller]
    space: Mapping[str, tuple[float, float]]

    def decode(self, x: np.ndarray) -> dict[str, float]:
        """Turn a point of the unit cube into parameters."""
        genes = {}
        for part, (name, (low, high)) in zip(x, self.space.items(), strict=True):
            if low > 0.0 and high / low > 20.0:
                genes[name] = float(low * (high / low) ** part)
            else:
                genes[name] = float(low + (high - low) * part)
        return genes


_SCALES: dict[int, tuple[fp.Arm, np.ndarray]] = {}


def scale_of(arm: fp.Arm) -> np.ndarray:
    """Return the joints' proportions that `suggest_gains` finds; all contestants share them."""
    if id(arm) not in _SCALES:
        _SCALES[id(arm)] = (arm, np.asarray(suggest_gains(arm).scale))
    return _SCALES[id(arm)][1]


def fpid(arm: fp.Arm, g: Genes, name: str) -> Controller:
    """Build an FPID: orders default to 1 and the rate to 0."""
    one = np.ones(arm.n)
    start = np.stack([g["kp"] * one, g["ki"] * one, g["kd"] * one])
    strength = 2.0 * LEARNING_ERROR**2 * LEARNING_TIME * np.array([[1.0], [1.0], [g["kp"]]])
    return fp.AdaptiveFpid(
        kp=start[0], ki=start[1], kd=start[2], scale=scale_of(arm), name=name,
        integral_order=g.get("lambda", 1.0), derivative_order=g.get("mu", 1.0),
        learning_rate=g.get("rate", 0.0) * start / strength,
        safeguards=Safeguards(minimum=0.5 * start, maximum=4.0 * start) if "rate" in g else None,
    )  # fmt: skip


GAINS = {"kp": (5.0, 3000.0), "ki": (1.0, 30000.0), "kd": (2.0, 200.0)}
RATE = {"rate": (0.01, 30.0)}
ORDERS = {"lambda": (0.0, 1.0), "mu": (0.3, 1.0)}
CONTESTANTS = {
    "adaptive FPID": Contestant(
        lambda arm, g: fpid(arm, g, "adaptive FPID"), GAINS | RATE | ORDERS
    ),
    "adaptive PID": Contestant(lambda arm, g: fpid(arm, g, "adaptive PID"), GAINS | RATE),
    "FPID, fixed": Contestant(lambda arm, g: fpid(arm, g, "FPID, fixed"), GAINS | ORDERS),
    "PID": Contestant(lambda arm, g: Pid(g["kp"], g["ki"], g["kd"], scale_of(arm)), GAINS),
    "PD + gravity": Contestant(
        lambda arm, g: PdGravity(g["kp"], g["kd"], scale_of(arm)),
        {"kp": GAINS["kp"], "kd": GAINS["kd"]},
    ),
    "computed torque": Contestant(
        lambda arm, g: fp.ComputedTorque(g["kp"], g["kd"]),
        {"kp": GAINS["kp"], "kd": GAINS["kd"]},
    ),
    "Slotine-Li": Contestant(
        lambda arm, g: SlotineLi(g["slope"], g["damping"], g["rate"], scale=scale_of(arm)),
        {"slope": (0.5, 60.0), "damping": (1.0, 150.0), "rate": (1e-4, 100.0)},
    ),
    "sliding mode": Contestant(
        lambda arm, g: SlidingMode(g["slope"], g["gain"], g["layer"], scale_of(arm)),
        {"slope": (0.5, 60.0), "gain": (1.0, 300.0), "layer": (0.02, 5.0)},
    ),
}


@dataclass(frozen=True)
class Job:
    """An arm, what it is asked to do, and the weight of energy in the cost."""

    arm: fp.Arm
    reference: Reference
    w2: float
    payload: float
    disturbance: float

    def conditions(self, duration: float) -> dict[str, fp.Experiment]:
        """Return the experiments by name; the first is tuned for, the others are not."""
        arm = self.arm
        size = np.asarray(scale_of(arm))
        base = fp.Experiment(arm, self.reference, sensors=NOISE, duration=duration)
        reference = self.reference
        assert isinstance(reference, Sinusoid)
        fast = dataclasses.replace(reference, frequency=2.0 * np.asarray(reference.frequency))
        # A different true arm: each link up to 20 % heavier or lighter.
        other = arm.perturbed(np.random.default_rng(1), mass=0.2, com=0.01)
        push = Cosine(self.disturbance * size / size.max(), frequency=5.0 * np.pi)
        plants = {
            "payload": fp.Plant(arm=arm.with_payload(self.payload)),
            "wrong masses": fp.Plant(arm=other),
            "friction": fp.Plant(
                viscous_friction=arm.viscous_friction + size,
                dry_friction=arm.dry_friction + 0.5 * size,
            ),
            "disturbance": fp.Plant(disturbance=push),
        }
        table = {"tuned for": base}
        table |= {name: dataclasses.replace(base, plant=plant) for name, plant in plants.items()}
        loud = fp.Sensors(position_noise=1e-4, velocity_noise=0.05, position_resolution=1e-4)
        table["noise x 5"] = dataclasses.replace(base, sensors=loud)
        table["delay 3 ms"] = dataclasses.replace(base, sensors=dataclasses.replace(NOISE, delay=3))
        table["twice as fast"] = dataclasses.replace(base, reference=fast, q0=None)
        return table


def jobs() -> dict[str, Job]:
    """Return the three arms with their work."""

    def around(arm: fp.Arm) -> Sinusoid:
        phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
        return Sinusoid(amplitude=0.3, frequency=2.0, phase=phase, offset=arm.home)

    ur5, panda = fp.Arm.from_example("ur5"), fp.Arm.from_example("panda")
    return {
        "two_link": Job(fp.Arm.two_link(), Sinusoid((1.0, 1.0)), 1e-4, 0.5, 3.0),
        "ur5": Job(ur5, around(ur5), 1e-6, 3.0, 10.0),
        "panda": Job(panda, around(panda), 1e-6, 2.0, 5.0),
    }


def tuned(
    contestant: Contestant, job: Job, experiment: fp.Experiment, evaluations: int
) -> tuple[Controller, dict[str, float], float]:
    """Search with the given number of simulations."""
    cost = QuadraticCost(1.0, job.w2)

    def costs(points: np.ndarray) -> np.ndarray:
        laws = [contestant.build(job.arm, contestant.decode(x)) for x in points.T]
        # The search wants finite numbers; a run that diverges is worse than any that does not.
        return np.nan_to_num(fp.evaluate(experiment, laws, cost), posinf=1e12)

    d = len(contestant.space)
    start = np.random.default_rng(7).random((POPULATION, d))
    result = differential_evolution(
        costs, [(0.0, 1.0)] * d, init=start, maxiter=evaluations // POPULATION - 1, tol=0.0,
        atol=0.0, polish=False, vectorized=True, updating="deferred", rng=11,
    )  # fmt: skip
    genes = contestant.decode(result.x)
    return contestant.build(job.arm, genes), genes, float(result.fun)


def compare(name: str, job: Job, evaluations: int, duration: float) -> list[str]:
    """Tune all contestants on one arm, try them, and return the section of the report."""
    conditions = job.conditions(duration)
    experiment = conditions["tuned for"]
    laws: dict[str, Controller] = {}
    found = []
    for label, contestant in CONTESTANTS.items():
        began = time.perf_counter()
        law, genes, best = tuned(contestant, job, experiment, evaluations)
        laws[label] = law
        values = ", ".join(f"{key} {value:.3g}" for key, value in genes.items())
        found.append(f"- {label}: cost {best:.5g}; {values}")
        print(f"{name}: {found[-1]} ({time.perf_counter() - began:.0f} s)", flush=True)
    laws["none (gravity only)"] = GravityOnly()
    pairs = [(c, law) for c in conditions for law in laws]
    runs = fp.simulate([conditions[c] for c, _ in pairs], [laws[law] for _, law in pairs])
    table = dict(zip(pairs, runs, strict=True))
    lines = [
        f"## {name}",
        "",
        f"Cost (33) with w2 = {job.w2:g}, {duration:g} s, {evaluations} simulations each.",
        "",
        *found,
        "",
    ]

    def section(title: str, value: Callable[[fp.Run], float], form: str) -> None:
        lines.extend([title, "", "| controller | " + " | ".join(conditions) + " |"])
        lines.append("| --- |" + " ---: |" * len(conditions))
        # Doing nothing is not a contestant where the least torque wins.
        best = {c: min(value(table[c, law]) for law in CONTESTANTS) for c in conditions}
        for law in laws:
            cells = []
            for c in conditions:
                run = table[c, law]
                text = form.format(value(run)) if run.outcome.completed else "diverged"
                first = law in CONTESTANTS and value(run) == best[c]
                cells.append(f"**{text}**" if first else text)
            lines.append(f"| {law} | " + " | ".join(cells) + " |")
        lines.append("")

    def root_mean_square(run: fp.Run) -> float:
        ok = run.outcome.completed
        return 1e3 * float(np.sqrt(np.mean(run.metrics.rms**2))) if ok else np.inf

    def cost_of(run: fp.Run) -> float:
        ok = run.outcome.completed
        return QuadraticCost(1.0, job.w2).of(run.metrics) if ok else np.inf

    def variation(run: fp.Run) -> float:
        ok = run.outcome.completed
        return 1e-3 * float(run.metrics.total_variation.sum()) if ok else np.inf

    section("RMS error over all joints, mrad:", root_mean_square, "{:.2f}")
    section("Cost (33):", cost_of, "{:.4g}")
    section("Total variation of the torque, kN m:", variation, "{:.3g}")
    wins = [c for c in conditions if _first(table, c, laws, cost_of)]
    lines.append(
        "On the cost the adaptive FPID is first in: " + (", ".join(wins) or "no condition") + "."
    )
    return [*lines, ""]


def _first(
    table: Mapping[tuple[str, str], fp.Run],
    condition: str,
    laws: Mapping[str, Controller],
    value: Callable[[fp.Run], float],
) -> bool:
    own = value(table[condition, "adaptive FPID"])
    return all(own <= value(table[condition, law]) for law in laws)


def main() -> None:
    """Run the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few simulations, nothing written")
    parser.add_argument("--only", help="one arm")
    parser.add_argument("--evaluations", type=int, default=360, help="simulations a controller")
    parser.add_argument("--duration", type=float, default=6.0, help="s")
    options = parser.parse_args()
    evaluations = 48 if options.quick else options.evaluations
    duration = 2.0 if options.quick else options.duration
    for name, job in jobs().items():
        if options.only not in (None, name):
            continue
        report = "\n".join(compare(name, job, evaluations, duration))
        print(report, flush=True)
        if not options.quick:
            path = Path(__file__).parent / "results" / f"baselines-{name}.md"
            path.parent.mkdir(exist_ok=True)
            path.write_text(report + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
