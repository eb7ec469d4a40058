"""What the controller is told about q and q': encoders, noise, delay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

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
    """The sensors of one run, None exact, as records for the kernels; `seed` is the noise's."""

    def __init__(self, sensors: Sensors | None, seed: int, n: int, step: float) -> None:
        joints = np.zeros(0 if sensors is None else n, SENSOR)
        delay, noisy = 0, False
        if sensors is not None:
            for name, field in (
                ("noise_q", "position_noise"), ("noise_v", "velocity_noise"),
                ("bias", "velocity_bias"), ("resolution", "position_resolution"),
            ):  # fmt: skip
                joints[name] = checks.per_joint(f"sensors.{field}", getattr(sensors, field), n)
            joints["keep"] = np.exp(-sensors.velocity_cutoff * step)
            joints["gain"] = (1.0 - joints["keep"]) / step
            joints["delay"] = delay = sensors.delay
            joints["derived"] = sensors.velocity == "differentiated"
            noisy = bool(joints["noise_q"].any() or joints["noise_v"].any())
        self._generator = np.random.default_rng(seed)
        noise = np.zeros((BLOCK_ROWS if noisy else 0, 2, n))
        self._records = Sensing(joints, np.zeros((1 + delay, 2, n)), noise)
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
