"""What the controller is told about q and q': encoders, noise, delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.descriptions import described
from fpid_pin.simulation.recorders import BLOCK_ROWS

VELOCITY_SOURCES = ("measured", "differentiated")


@described("sensors")
@dataclass(frozen=True, eq=False)
class Sensors:
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

    position_resolution: ArrayLike = 0.0
    position_noise: ArrayLike = 0.0
    velocity_noise: ArrayLike = 0.0
    velocity_bias: ArrayLike = 0.0
    velocity: str = "measured"
    velocity_cutoff: float = 500.0
    delay: int = 0

    def __post_init__(self) -> None:
        for name in ("position_resolution", "position_noise", "velocity_noise"):
            array = checks.floats(f"sensors.{name}", getattr(self, name), low=0.0, max_ndim=1)
            object.__setattr__(self, name, array)
        bias = checks.floats("sensors.velocity_bias", self.velocity_bias, max_ndim=1)
        object.__setattr__(self, "velocity_bias", bias)
        checks.choice("sensors.velocity", self.velocity, VELOCITY_SOURCES)
        cutoff = checks.number("sensors.velocity_cutoff", self.velocity_cutoff, above=0.0)
        object.__setattr__(self, "velocity_cutoff", cutoff)
        object.__setattr__(self, "delay", checks.integer("sensors.delay", self.delay, low=0))


class SensorState:
    """The sensors of all runs; exact ones where a run has none.

    Parameters
    ----------
    sensors
        One a run, or None.
    seeds
        One a run: a run's noise depends on nothing else.
    n
        Number of joints.
    step
        Sampling period [s].
    """

    def __init__(
        self, sensors: Sequence[Sensors | None], seeds: Sequence[int], n: int, step: float
    ) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels.sensors import SENSOR, measure

        self._measure: Any = measure
        runs = len(sensors)
        self._joints = np.zeros((runs, n), SENSOR)
        for own, given in zip(self._joints, sensors, strict=True):
            _fill(own, Sensors() if given is None else given, n, step)
        noisy = self._joints["noise_q"].any() or self._joints["noise_v"].any()
        self._generators = [np.random.default_rng(seed) for seed in seeds]
        self._noise = np.zeros((BLOCK_ROWS if noisy else 0, 2, runs, n))
        self._history = np.zeros((int(self._joints["delay"].max()) + 1, 2, runs, n))
        self._tick = 0

    def prepare(self) -> int:
        """Draw the noise of the next ticks where it is used up; return this tick's row of it."""
        row = self._tick % BLOCK_ROWS
        if row == 0 and len(self._noise):
            for run, generator in enumerate(self._generators):
                shape = (BLOCK_ROWS, 2, self._noise.shape[-1])
                self._noise[:, :, run] = generator.standard_normal(shape)
        return row

    def flight(self, ticks: int) -> tuple[Any, ...]:
        """Return records, ring, noise and tick for `kernels.flight`, which makes so many ticks."""
        self.prepare()
        self._tick += ticks
        return self._joints, self._history, self._noise, self._tick - ticks

    def measure(self, alive: BoolArray, x: FloatArray, seen: FloatArray) -> None:
        """Write what is measured of x = [q, q'], (2, runs, n), into `seen`, (5, runs, n)."""
        row = self.prepare()
        self._measure(
            alive, self._joints, x, self._tick, self._history, self._noise, row, seen
        )  # fmt: skip
        self._tick += 1


def _fill(joints: Any, sensors: Sensors, n: int, step: float) -> None:
    """Write the sensors of one run into its records, (n,)."""
    for name, value in (
        ("noise_q", "position_noise"), ("noise_v", "velocity_noise"), ("bias", "velocity_bias"),
        ("resolution", "position_resolution"),
    ):  # fmt: skip
        joints[name] = checks.per_joint(f"sensors.{value}", getattr(sensors, value), n)
    joints["keep"] = np.exp(-sensors.velocity_cutoff * step)
    joints["gain"] = (1.0 - joints["keep"]) / step
    joints["delay"] = sensors.delay
    joints["derived"] = sensors.velocity == "differentiated"
