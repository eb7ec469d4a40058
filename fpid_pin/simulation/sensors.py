"""What the controller is told about q and q': encoders, noise, delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described

VELOCITY_SOURCES = ("measured", "differentiated")
_NOISE_ROWS = 256


@described("sensors")
@dataclass(frozen=True, eq=False)
class Sensors:
    """Imperfect measurements, in the order in which they spoil: delay, noise, bias, quantisation.

    Parameters
    ----------
    position_resolution
        Encoder step, rad, scalar or (n,); 0: not quantised.
    position_noise, velocity_noise
        Standard deviation of white noise on each sample, rad and rad/s.
    velocity_bias
        Constant error of the velocity sensors, rad/s, scalar or (n,).
    velocity
        ``"measured"``: by a sensor of its own; ``"differentiated"``: from the measured position
        by a first-order filtered difference.
    velocity_cutoff
        Of that filter, rad/s.
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
        Sampling period, s.
    """

    def __init__(
        self, sensors: Sequence[Sensors | None], seeds: Sequence[int], n: int, step: float
    ) -> None:
        runs = len(sensors)
        given = [Sensors() if s is None else s for s in sensors]

        def each(name: str) -> FloatArray:
            return np.array(
                [checks.per_joint(f"sensors.{name}", getattr(s, name), n) for s in given]
            )

        self._noise_scale = np.stack([each("position_noise"), each("velocity_noise")])
        self._noisy = bool(self._noise_scale.any())
        self._generators = [np.random.default_rng(seed) for seed in seeds]
        self._noise = np.empty((_NOISE_ROWS if self._noisy else 0, 2, runs, n))
        self._noise_row = _NOISE_ROWS

        self._bias = each("velocity_bias")
        self._biased = bool(self._bias.any())
        resolution = each("position_resolution")
        self._coarse = resolution > 0.0
        self._quantised = bool(self._coarse.any())
        self._resolution = np.where(self._coarse, resolution, 1.0)

        derived = np.array([s.velocity == "differentiated" for s in given])
        self._derived = np.ascontiguousarray(np.broadcast_to(derived[:, np.newaxis], (runs, n)))
        self._derives = bool(derived.any())
        keep = np.array([np.exp(-s.velocity_cutoff * step) for s in given])[:, np.newaxis]
        self._keep, self._gain = keep, (1.0 - keep) / step
        self._filtered = np.zeros((runs, n))
        self._last_q = np.zeros((runs, n))

        delays = np.array([s.delay for s in given])
        self._delays, self._depth = delays, int(delays.max()) + 1
        self._history = np.zeros((self._depth, 2, runs, n))
        self._measured = np.zeros((2, runs, n))
        self._runs = np.arange(runs)
        self._tick = 0

    def measure(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return what is measured of q and v at this tick, (2, runs, n); its own buffer."""
        measured = self._measured
        self._delay(q, v, measured)
        if self._noisy:
            if self._noise_row == _NOISE_ROWS:
                for run, generator in enumerate(self._generators):
                    shape = (_NOISE_ROWS, 2, self._noise.shape[-1])
                    self._noise[:, :, run] = generator.standard_normal(shape)
                self._noise *= self._noise_scale
                self._noise_row = 0
            measured += self._noise[self._noise_row]
            self._noise_row += 1
        if self._biased:
            measured[1] += self._bias
        if self._quantised:
            counts = np.rint(measured[0] / self._resolution) * self._resolution
            np.copyto(measured[0], counts, where=self._coarse)
        if self._derives:
            if self._tick == 0:
                self._last_q[:] = measured[0]
            self._filtered *= self._keep
            self._filtered += self._gain * (measured[0] - self._last_q)
            self._last_q[:] = measured[0]
            np.copyto(measured[1], self._filtered, where=self._derived)
        self._tick += 1
        return measured

    def _delay(self, q: FloatArray, v: FloatArray, out: FloatArray) -> None:
        if self._depth == 1:
            out[0], out[1] = q, v
            return
        history = self._history
        if self._tick == 0:
            # Before t = 0 the arm is taken to have been where it starts.
            history[:, 0], history[:, 1] = q, v
        slot = self._tick % self._depth
        history[slot, 0], history[slot, 1] = q, v
        late = (slot - self._delays) % self._depth
        out[:] = history[late, :, self._runs].transpose(1, 0, 2)

    def retire(self, run: int) -> None:
        """Make a diverged run's rows exact zeros."""
        self._noise_scale[:, run] = 0.0
        self._bias[run] = 0.0
        self._noise[:, :, run] = 0.0
        self._history[:, :, run] = 0.0
        self._measured[:, run] = 0.0
        self._filtered[run] = self._last_q[run] = 0.0
