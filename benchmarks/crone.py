"""What the paper's own realisation, a CRONE filter, makes of its experiment.

    python benchmarks/crone.py

Section 5.1 for 20 s with the published orders, by Oustaloup's filter for several bands and N, and
by the default design with fewer and more modes. Prints, for each: poles of one operator; largest
difference of the joint angles from those of the operator itself (40 modes, which are within 1e-11
rad of the kernel integrated over the whole past: tests/simulation/test_independent_operator.py),
over the run and over its last half; cost (33); peak torque; processor time of a tick in units of
the default's, alone in its loop. The paper gives neither band nor N.

The last row starts as a block at rest in Simulink does: it sees the error jump to e(0).
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np
from common import head, row

import fpid_pin as fp
from fpid_pin.fractional import Crone, Design, ExponentialSum

BANDS = ((1e-2, 1e2), (1e-2, 1e3), (1e-3, 1e3), (1e-3, 1e4), (1e-4, 1e4))
ORDERS = (2, 5, 10, 20)


def law(design: Design, start: str = "caputo") -> fp.AdaptiveFpid:
    return dataclasses.replace(fp.paper_controller(), design=design, initialisation=start)


def timed(experiment: fp.Experiment, controller: fp.AdaptiveFpid) -> tuple[fp.Run, float]:
    """Simulate twice, and return the shorter time: the first may still be warming up."""
    times = []
    for _ in range(2):
        begin = time.process_time()
        run = fp.simulate(experiment, controller)
        times.append(time.process_time() - begin)
    return run, min(times)


def main() -> None:
    experiment = fp.paper_experiment()
    exact = fp.simulate(experiment, law(ExponentialSum(modes=40)))
    _, unit = timed(experiment, law(ExponentialSum()))
    rows = [
        (f"CRONE, {low:g} to {high:g} rad/s, N = {n}", 2 * n + 1, law(Crone(low, high, n)))
        for low, high in BANDS
        for n in ORDERS
    ]
    rows += [(f"{m} modes", m, law(ExponentialSum(modes=m))) for m in (12, 16, 24, 32)]
    at_rest = law(Crone(1e-2, 1e3, 5), "grunwald_letnikov")
    rows.append(("CRONE, 0.01 to 1000 rad/s, N = 5, block at rest", 11, at_rest))
    heads = ["operator", "poles", "largest [mrad]", "last half [mrad]", "cost (33)", "peak [N m]"]
    print("\n".join(head([*heads, "time"])))
    for name, poles, controller in rows:
        run, seconds = timed(experiment, controller)
        gap = 1e3 * np.abs(run.q - exact.q)
        cost = fp.costs.QuadraticCost().of(run.metrics)
        late, peak = gap[len(gap) // 2 :].max(), np.abs(run.torque).max()
        print(row([name, poles, f"{gap.max():.2g}", f"{late:.2g}", f"{cost:.4f}", f"{peak:.4g}",
                   f"{seconds / unit:.2f}"]))  # fmt: skip


if __name__ == "__main__":
    main()
