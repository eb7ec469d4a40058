"""How far may suggested gains move at any speed? Every arm, three steps.

    python benchmarks/certificates.py [--steps MS ...] [NAME ...]

The box of `certify_gains` around `suggest_gains(arm, 10.0)`: the part of each gain by which it may
move either way, at home and at the least of seven poses; and the same where only one of Kp, Ki and
Kd moves. Writes benchmarks/results/certificates.md.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np

import fpid_pin as fp
from fpid_pin.arms import names
from fpid_pin.control import certify_gains


def row_of(name: str, step: float) -> str:
    """Certify one arm's gains at one step and return its row of the table."""
    arm = fp.Arm.from_example(name)
    with warnings.catch_warnings():
        # Joints that cannot carry or move the arm are the business of arms.py.
        warnings.simplefilter("ignore", fp.FpidWarning)
        law = fp.suggest_gains(arm, step=step)
    began = time.process_time()
    found = certify_gains(arm, law, step=step)
    spent = time.process_time() - began
    alone = [
        certify_gains(arm, law, step=step, spread=only, poses=found.poses[found.reaches.argmin()])
        for only in np.eye(3)[:, :, np.newaxis]
    ]
    cells = [name, str(arm.n), f"{1e3 * step:g}", f"{100.0 * found.reaches[0]:.0f}"]
    cells += [f"{100.0 * x.reach:.0f}" for x in (found, *alone)]
    return "| " + " | ".join([*cells, f"{spent:.1f}"]) + " |"


def main() -> None:
    """Certify all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="arms; all of the catalogue if none is given")
    parser.add_argument("--steps", type=float, nargs="+", default=[1.0, 2.0, 4.0], help="[ms]")
    options = parser.parse_args()
    lines = [
        "| arm | n | step [ms] | reach at home [%] | at the worst of 7 poses | Kp alone there "
        "| Ki alone | Kd alone | s |",
        "| --- |" + " ---: |" * 8,
    ]
    print("\n".join(lines))
    for step in options.steps:
        for name in options.names or sorted(names()):
            lines.append(row_of(name, 1e-3 * step))
            print(lines[-1], flush=True)
    if not options.names:
        path = Path(__file__).parent / "results" / "certificates.md"
        title = (
            "How far gains around `suggest_gains(arm, 10.0)` may move at any speed; s: processor "
            "time of the seven poses.\n\n"
        )
        path.write_text(title + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
