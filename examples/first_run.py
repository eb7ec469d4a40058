"""The paper's experiment: fractional against integer adaptive PID, in ten lines."""

import fpid_pin as fp

experiment = fp.paper_experiment()
runs = fp.simulate(
    experiment,
    [fp.paper_controller("symbol"), fp.paper_controller("integer")],
)
for run in runs:
    rms = 1e3 * run.metrics.rms  # [mrad]
    print(f"{run.name:24s} RMS error {rms[0]:6.1f} and {rms[1]:6.1f} mrad; {run.outcome}")
