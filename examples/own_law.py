"""A law of your own beside the package's: a UR5 with a payload that none of them knows of."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

import fpid_pin as fp


@dataclass(frozen=True, eq=False)
class IntegralTorque(fp.Controller):
    """``M (q''_d + k1 e' + k0 e + ki int e) + C q' + G``: computed torque with an integral."""

    k0: ArrayLike  # [1/s^2]
    k1: ArrayLike  # [1/s]
    ki: ArrayLike  # [1/s^3]
    uses_model = True  # M a + C w + G of the arm that the law knows

    @staticmethod
    def surface(c):
        c.a = c.a_ref + c.k1 * c.e_dot + c.k0 * c.e + c.ki * c.int_e
        c.w = c.v


arm = fp.Arm.from_example("ur5")
experiment = fp.Experiment(
    arm,
    fp.references.Sinusoid(
        amplitude=0.3,  # [rad]
        frequency=1.0,  # [rad/s]
        offset=arm.home,  # [rad]
    ),
    plant=fp.Plant(arm=arm.with_payload(2.0)),  # [kg]
    duration=10.0,  # [s]
)
laws = [
    fp.ComputedTorque(k0=100.0, k1=20.0),
    IntegralTorque(k0=100.0, k1=20.0, ki=300.0, name="own: with an integral"),
    fp.suggest_gains(arm, bandwidth=10.0, name="adaptive FPID"),
]
print("law                     worst joint, mrad   variation, N m")
for run in fp.simulate(experiment, laws):
    worst = 1e3 * run.metrics.rms_tail.max()  # [mrad]
    print(f"{run.name:24s}{worst:17.1f}{run.metrics.total_variation.sum():17.0f}")
