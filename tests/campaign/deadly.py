"""Disturbances that kill the process which simulates them, or fail: for tests of executors."""

import dataclasses
import os
import time
from pathlib import Path

import numpy as np

from fpid_pin.disturbances import Cosine


@dataclasses.dataclass(frozen=True, eq=False)
class Deadly(Cosine):
    """Kills its process where its amplitude is beyond DEADLY; a note in DEATHS for each death."""

    def sample(self, t):
        if np.max(self.amplitude) > float(os.environ.get("DEADLY", "inf")):
            Path(os.environ["DEATHS"], f"{time.monotonic_ns()}-{os.getpid()}").touch()
            os._exit(9)
        return super().sample(t)


@dataclasses.dataclass(frozen=True, eq=False)
class Faulty(Cosine):
    """Fails where its amplitude is beyond 1."""

    def sample(self, t):
        if np.max(self.amplitude) > 1.0:
            raise ZeroDivisionError("a fault of its own")
        return super().sample(t)
