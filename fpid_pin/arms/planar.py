"""Planar n-R arms from lengths and masses: the n-link generalisation of eq. (35)."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.chain import Chain, Frame, Joint
from fpid_pin.arms.parts import REVOLUTE, Numbers, Shape
from fpid_pin.exceptions import ArgumentError

Rotation = tuple[Numbers, Numbers, Numbers]
#: The base is turned over about x, exactly: the joints' y axes are then the world's -y, about
#: which a positive angle takes x towards z (counter-clockwise in the x-z plane). Pinocchio has
#: faster code for joints about y than about an arbitrary axis.
_TURNED: Rotation = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
_UPRIGHT: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: Turns the z axis of a cylinder to x, along the link.
_ALONG_X: Rotation = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
#: Turns the z axis of a cylinder to y, the joint's axis.
_ALONG_Y: Rotation = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
_DARK, _RED = (0.25, 0.27, 0.3, 1.0), (0.65, 0.15, 0.15, 1.0)
_LINKS = ((0.85, 0.5, 0.15, 1.0), (0.2, 0.45, 0.7, 1.0))


def planar_chain(
    lengths: ArrayLike, masses: ArrayLike, gravity: ArrayLike, rods: bool
) -> tuple[Chain, dict[str, Any]]:
    """Return the arm, with frames ``link1`` ... ``linkn`` at the joints and ``tool`` at the tip.

    And the short table that stands for it; see `Arm.planar`.
    """
    lengths, masses = (
        np.atleast_1d(checks.floats(name, value, above=0.0, max_ndim=1))
        for name, value in (("lengths", lengths), ("masses", masses))
    )
    if lengths.shape != masses.shape:
        raise ArgumentError(
            "masses", f"shape {lengths.shape} (one for each length)", f"shape {masses.shape}"
        )
    checks.instance("rods", rods, bool, "True or False")
    joints, frames, shapes = [], [], list[Shape]()
    placement = _at(_TURNED, 0.0)
    thick = 0.03 * float(lengths.mean())
    for k, (length, mass) in enumerate(zip(lengths.tolist(), masses.tolist(), strict=True)):
        # A point at the end, or a uniform thin rod: its centre at half its length, m l^2 / 12.
        across, com = (mass * length**2 / 12.0, length / 2.0) if rods else (0.0, length)
        inertia = (mass, com, 0.0, 0.0, 0.0, 0.0, across, 0.0, 0.0, across)
        joints.append(Joint(f"joint{k + 1}", REVOLUTE, (0.0, 1.0, 0.0), placement, inertia))
        frames.append(Frame(f"link{k + 1}", k, "link", _at(_UPRIGHT, 0.0)))
        placement = _at(_UPRIGHT, length)
        hub, middle = _at(_ALONG_Y, 0.0), _at(_ALONG_X, length / 2.0)
        shapes.append(Shape(k, hub, "cylinder", (1.8 * thick, 5.0 * thick), _DARK))
        shapes.append(Shape(k, middle, "cylinder", (thick, length), _LINKS[(k + 1) % 2]))
        if not rods:
            # Volume in proportion to mass, so that the eye sees the payload.
            radius = 2.5 * thick * float(np.cbrt(mass / masses.max()))
            shapes.append(Shape(k, placement, "sphere", (radius,), _RED))
    frames.append(Frame("tool", lengths.size - 1, "frame", placement))
    chain = Chain(joints, frames, shapes, f"planar{lengths.size}", gravity, tool="tool")
    numbers = {"lengths": lengths, "masses": masses, "gravity": np.asarray(gravity, float)}
    table = {name: value.tolist() for name, value in numbers.items()}
    return chain, {"kind": "planar", **table, "rods": rods}


def _at(rotation: Rotation, x: float) -> tuple[Numbers, ...]:
    """Return the placement turned so, at x along the link."""
    return tuple((*row, x if k == 0 else 0.0) for k, row in enumerate(rotation))
