"""What a reference is: a trajectory for the joints, sampled at any time."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from fpid_pin.checks import FloatArray

#: Angles, rates and accelerations.
Motion = tuple[FloatArray, FloatArray, FloatArray]


@runtime_checkable
class Reference(Protocol):
    """A trajectory of one robot; anything with this method will do."""

    def sample(self, t: FloatArray) -> Motion:
        """Return angles [rad], rates [rad/s] and accelerations [rad/s^2] at times `t`.

        Parameters
        ----------
        t
            Times [s], (K,).

        Returns
        -------
        tuple of ndarray
            Three arrays (K, n), or (K, 1) where all joints do the same.
        """
        ...
