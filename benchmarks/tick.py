"""How long one tick of `loop.torque` takes for a seven-joint arm.

    python benchmarks/tick.py [--ticks N]

Full law, 24 modes; wanted: at most 2.5 `pin.aba` calls of the arm, 3 with a supervisor standing by.
Beside it the time of one `pin.aba` on the same arm, as a measure of the machine, and the parts of
the law. Writes benchmarks/results/tick.md.
"""

from __future__ import annotations

import argparse
import gc
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

import fpid_pin as fp
from fpid_pin.control import adapt_orders, suggest_gains


def ticks_of(loop: fp.control.Loop, arm: fp.Arm, count: int) -> np.ndarray:
    """Return the seconds of each of `count` ticks, (2, count): by the clock, and of processor time.

    On a machine that does other things the first counts their turns too.
    """
    t = np.arange(count) * 1e-3
    phase = np.linspace(0.0, np.pi, arm.n)
    angle = t[:, np.newaxis] + phase
    q_ref, v_ref, a_ref = arm.home + 0.3 * np.sin(angle), 0.3 * np.cos(angle), -0.3 * np.sin(angle)
    noise = np.random.default_rng(0).normal(0.0, 1e-3, (2, count, arm.n))
    q, v = q_ref + noise[0], v_ref + noise[1]
    taken = np.empty((2, count))
    for row, clock in zip(taken, (time.perf_counter, time.thread_time), strict=True):
        for k in range(count):
            began = clock()
            loop.torque(q[k], v[k], q_ref[k], v_ref[k], a_ref[k])
            row[k] = clock() - began
    return taken


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=20_000)
    count = parser.parse_args().ticks
    arm = fp.Arm.from_example("panda")
    law = suggest_gains(arm)
    guards = {kind: fp.Supervisor(10.0, 3.5, kind=kind) for kind in ("paper", "sampled")}
    one = {
        "kp": law.kp, "ki": law.ki, "kd": law.kd, "scale": law.scale, "integral_order": 0.9,
        "derivative_order": 0.95, "learning_rate": law.learning_rate, "design": law.design,
    }  # fmt: skip
    laws = {
        "projection, the paper's supervisor standing by": fp.AdaptiveFpid(
            **one, safeguards=law.safeguards, supervisor=guards["paper"]
        ),
        "projection, the sampled supervisor standing by": fp.AdaptiveFpid(
            **one, safeguards=law.safeguards, supervisor=guards["sampled"]
        ),
        "with projection, no supervisor": law,
        "the same, orders adapt": adapt_orders(law, arm),
        "adaptation only": fp.AdaptiveFpid(**one),
    }
    model, data = arm.model, arm.model.createData()
    x = np.array(arm.home)
    began = time.thread_time()
    for _ in range(2000):
        pin.aba(model, data, x, x, x)
    aba = (time.thread_time() - began) / 2000
    lines = [
        f"{count} ticks each on panda (7 joints), 24 modes; one pin.aba takes {1e6 * aba:.1f} us.",
        "",
        "| law | by | median [us] | 99 % [us] | 99.9 % [us] | longest [us] | median / aba |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    gc.disable()
    for name, controller in laws.items():
        loop = controller.start(arm, step=1e-3)
        ticks_of(loop, arm, 500)
        for by, taken in zip(("clock", "processor"), ticks_of(loop, arm, count), strict=True):
            figures = 1e6 * np.array([*np.percentile(taken, [50.0, 99.0, 99.9]), taken.max()])
            ratio = figures[0] / (1e6 * aba)
            cells = [name, by, *(f"{x:.1f}" for x in figures), f"{ratio:.1f}"]
            lines.append("| " + " | ".join(cells) + " |")
    gc.enable()
    print("\n".join(lines))
    path = Path(__file__).parent / "results" / "tick.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
