"""Does it hold on other arms? The same two laws on two hundred UR5s that differ."""

import fpid_pin as fp
from fpid_pin.campaign import LogUniform, Scenarios, Study, Uniform, load, run

arm = fp.Arm.from_example("ur5")
experiment = fp.Experiment(
    arm, fp.references.Sinusoid(0.3, 1.0, offset=arm.home), dynamics="compiled", duration=4.0
)
laws = {
    "FPID": fp.suggest_gains(arm),
    "FPID + feedforward + observer": fp.suggest_gains(arm, feedforward=True, observer="suggested"),
}
uncertain = {
    "mass": Uniform(low=0.8, high=1.2),  # of the nominal ones, each link its own
    "payload": Uniform(low=0.0, high=3.0),  # [kg]
    "dry_friction": LogUniform(low=0.1, high=5.0),  # [N m]
}
study = Study(experiment, laws, Scenarios(uncertain, seed=0), "UR5")
run(study, "arms.fpid", runs=200)
print(load("arms.fpid"))
