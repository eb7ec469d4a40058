"""An arm on paper: three uniform rods, a payload that the controller does not know of."""

import fpid_pin as fp

arm = fp.Arm.planar(
    lengths=(0.5, 0.4, 0.3),  # [m]
    masses=(2.0, 1.5, 1.0),  # [kg]
    rods=True,
)
experiment = fp.Experiment(
    arm,
    fp.references.Sinusoid(
        amplitude=0.3,  # [rad]
        frequency=1.0,  # [rad/s]
        phase=(0.0, 0.5, 1.0),  # [rad]
    ),
    plant=fp.Plant(arm=arm.with_payload(0.5)),  # [kg]
    duration=10.0,  # [s]
)
controller = fp.suggest_gains(
    arm,
    bandwidth=20.0,  # [rad/s]
    feedforward=True,
    observer="suggested",
)
run = fp.simulate(experiment, controller)
print(run.outcome)
print("RMS error over the last half [mrad]:", (1e3 * run.metrics.rms_tail).round(1))
print("peak torque [N m]:", run.metrics.peak_torque.round(1))
