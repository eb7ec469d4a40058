"""What the controller is told about q and q': encoders, noise, delay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import Number, OneOf, PerJoint, Whole
from fpid_pin.descriptions import Description, described
from fpid_pin.kernels.records import SENSOR, Sensing
from fpid_pin.simulation.blocks import BLOCK_ROWS


@described("sensors")
@dataclass(frozen=True, eq=False)
class Sensors(Description):
    """Imperfect measurements, in the order in which they spoil: delay, noise, bias, quantisation.

    Parameters
    ----------
    position_resolution
        Encoder step [rad], scalar or (n,); 0: not quantised.
    position_noise, velocity_noise
        Standard deviation of white noise on each sample [rad], [rad/s].
    velocity_bias
        Constant error of the velocity sensors [rad/s], scalar or (n,).
    velocity
        ``"measured"``: by a sensor of its own; ``"differentiated"``: from the measured position
        by a first-order filtered difference.
    velocity_cutoff
        Of that filter [rad/s].
    delay
        Whole samples by which everything measured is late.
    """

    _path = "sensors"

    position_resolution: Annotated[ArrayLike, PerJoint("rad", low=0.0)] = 0.0
    position_noise: Annotated[ArrayLike, PerJoint("rad", low=0.0)] = 0.0
    velocity_noise: Annotated[ArrayLike, PerJoint("rad/s", low=0.0)] = 0.0
    velocity_bias: Annotated[ArrayLike, PerJoint("rad/s")] = 0.0
    velocity: Annotated[str, OneOf("measured", "differentiated")] = "measured"
    velocity_cutoff: Annotated[float, Number("rad/s", above=0.0)] = 500.0
    delay: Annotated[int, Whole(low=0, high=1_000_000)] = 0


class SensorState:
    """The sensors of one run, as records for the kernels.

    Parameters
    ----------
    sensors
        None: exact ones.
    seed
        Of the noise, which depends on nothing else.
    n
        Number of joints.
    step
        Sampling period [s].
    """

    def __init__(self, sensors: Sensors | None, seed: int, n: int, step: float) -> None:
        joints = np.zeros(0 if sensors is None else n, SENSOR)
        if sensors is not None:
            _fill(joints, sensors, n, step)
        noisy = bool(joints["noise_q"].any() or joints["noise_v"].any())
        self._generator = np.random.default_rng(seed)
        depth = 1 + (0 if sensors is None else int(joints["delay"].max()))
        self._records = Sensing(
            joints, np.zeros((depth, 2, n)), np.zeros((BLOCK_ROWS if noisy else 0, 2, n))
        )
        self._drawn = 0

    def records(self, first: int, count: int) -> Sensing:
        """Return the records for rows from `first` on, which end with their block at the latest.

        Noise is drawn a block at a time: it does not depend on how many ticks are made at once.
        """
        noise = self._records.noise
        if len(noise) and first + count > self._drawn:
            noise[:] = self._generator.standard_normal(noise.shape)
            self._drawn += len(noise)
        return self._records


def _fill(joints: Any, sensors: Sensors, n: int, step: float) -> None:
    """Write sensors into their records, (n,)."""
    for name, value in (
        ("noise_q", "position_noise"), ("noise_v", "velocity_noise"), ("bias", "velocity_bias"),
        ("resolution", "position_resolution"),
    ):  # fmt: skip
        joints[name] = checks.per_joint(f"sensors.{value}", getattr(sensors, value), n)
    joints["keep"] = np.exp(-sensors.velocity_cutoff * step)
    joints["gain"] = (1.0 - joints["keep"]) / step
    joints["delay"] = sensors.delay
    joints["derived"] = sensors.velocity == "differentiated"
