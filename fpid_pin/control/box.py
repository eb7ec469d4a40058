"""A box of gains every corner of which is damped at every pose looked at: adapted gains end there.

That each of its points is stable while it stands still says nothing about gains that move: see
`certificate`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.damping import FrozenLoops

#: Damping ratio that a box keeps: room for what lies between the poses and gains that are tried.
BOX_DAMPING = 0.05
#: Points inside that are tried.
INSIDE = 24
#: Every joint's gains at the same end, (8, 3, 1).
CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))[:, :, np.newaxis]


@dataclass(frozen=True, eq=False)
class GainBox:
    """Least and largest Kp, Ki, Kd, (3, n), scale included, around `initial` ones."""

    low: FloatArray
    initial: FloatArray
    high: FloatArray

    def shrunk(self, part: float) -> GainBox:
        """Return the box whose sides are nearer, in ratio: at part 0 it is `initial` alone.

        The low side comes nearer with the square of `part`: it is of less use to adaptation, and
        where an arm topples, low Kp is what breaks the loop.
        """
        low = self.initial * (self.low / self.initial) ** part**2
        return GainBox(low, self.initial, self.initial * (self.high / self.initial) ** part)

    def at(self, part: FloatArray) -> FloatArray:
        """Return the gains between low (0) and high (1), in ratio."""
        return np.asarray(self.low ** (1.0 - part) * self.high**part)

    def is_damped(self, loops: FrozenLoops, least: float = BOX_DAMPING) -> bool:
        """Return whether all that is tried keeps the `least` damping ratio at every pose.

        Tried are the eight corners at which all joints are alike; from the worst of them, corners
        that the derivative of the damping ratio points to, until it points nowhere new; and
        seeded points inside.
        """
        rng = np.random.default_rng(0)
        for pose in range(len(loops.poses)):
            found = [loops.damping(self.at(corner), pose) for corner in CORNERS]
            if min(found) < least:
                return False
            corner = np.broadcast_to(CORNERS[np.argmin(found)], self.low.shape)
            for _ in range(4):
                ratio, slope = loops.slopes(self.at(corner), pose)
                if ratio[0] < least:
                    return False
                worse = np.where(slope[0] > 0.0, 0.0, 1.0)
                if np.array_equal(worse, corner):
                    break
                corner = worse
        inside = (
            loops.damping(self.at(rng.random(self.low.shape)), int(rng.integers(len(loops.poses))))
            for _ in range(INSIDE)
        )
        return all(ratio >= least for ratio in inside)

    def certified(self, loops: FrozenLoops) -> tuple[GainBox, float]:
        """Return the largest part of the box that is found damped, and that part, by bisection."""
        if self.is_damped(loops):
            return self, 1.0
        low, high = 0.0, 1.0
        for _ in range(4):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.shrunk(middle).is_damped(loops) else (low, middle)
        return self.shrunk(low), low
