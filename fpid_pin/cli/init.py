"""`init`: a configuration to begin with, for any arm: commented, within its limits, and it runs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.arms import Arm
from fpid_pin.arms.joints import PRISMATIC
from fpid_pin.checks import FloatArray
from fpid_pin.cli.arms import arm_of_table
from fpid_pin.cli.screen import say
from fpid_pin.control.gains import impossible_joints
from fpid_pin.exceptions import FileFormatError
from fpid_pin.files import kind_of, put_text

#: The reference: so far to both sides at most [rad], [m], and this part of what position and speed
#: limits allow.
_SWING, _SLIDE = 0.3, 0.1
_PART = 0.4
#: Its frequency [rad/s].
_FREQUENCY = 1.0
#: Bandwidth of all controllers [rad/s]: ten times the reference's.
_BANDWIDTH = 10.0
#: The payload: this part of what the drives can bear beyond the arm, or of its mass.
_LOAD = 0.3

_TEMPLATE = """\
# Which controller is best on this arm, under which conditions?
#   fpid-pin compare {file}
# Written by `fpid-pin init {asked}`. Keys are the arguments of the package's classes.
format = 1
title = {title}

{arm}

[reference]                     # around home, within the joints' limits; out of phase
kind = "sinusoid"
amplitude = {amplitude}  # {units}
frequency = {frequency:.1f}                 # [rad/s]
phase = {phase}  # [rad]
offset = {offset}  # {units}

[simulation]
duration = 10.0                 # [s]
step = 1e-3                     # [s], one tick of the controller

# Every controller knows the arm above, and none of what the conditions change.

[[controller]]                  # gains from the arm's inertia, friction and limits
name = "FPID"
kind = "suggested_fpid"
bandwidth = {bandwidth:.1f}                # [rad/s]: ten times the reference's frequency

[[controller]]                  # the same with orders 1
name = "integer PID"
kind = "suggested_fpid"
bandwidth = {bandwidth:.1f}
integral_order = 1.0
derivative_order = 1.0

[[controller]]
name = "PD + gravity"
kind = "pd_gravity"
kp = {square:.1f}                      # [1/s^2]: the scale is each joint's inertia at home
kd = {double:.1f}                       # [1/s]
scale = "inertia"

[[controller]]                  # the whole model, eq. (8)
name = "computed torque"
kind = "computed_torque"
k0 = {square:.1f}                      # [1/s^2]
k1 = {double:.1f}                       # [1/s]

[[condition]]
name = "nominal"

[[condition]]                   # held at the tool; nobody told the controllers
name = "payload {payload:g} kg"
plant = {{ payload = {{ mass = {payload!r} }} }}

[[condition]]                   # on top of the file's
name = "friction"
plant = {{ viscous_friction = {viscous}, dry_friction = {dry} }}

[[condition]]                   # encoders and the speeds that are made of them
name = "noise"
sensors = {{ position_resolution = 1e-4, velocity_noise = 0.01 }}  # {units}, {rates}

[[condition]]
name = "delay 2 ms"
sensors = {{ delay = 2 }}           # samples of one step
"""


def run_init(text: str, table: dict[str, Any], out: Path) -> None:
    """Write a configuration; what is there already stays, and is an error."""
    if kind_of(out) is not None:
        raise FileFormatError(
            f"{out}: expected a new file, got one that exists (--out names another)"
        )
    arm = arm_of_table(table)
    for line in impossible_joints(arm):
        say(line)
    written = configuration(arm, _relative(table, out), asked=text, file=out)
    put_text(out, written)
    say(f"Written: {out} (fpid-pin compare {out})")


def configuration(arm: Arm, table: dict[str, Any], *, asked: str, file: Path) -> str:
    """Return the text of a configuration for an arm."""
    import tomli_w

    amplitude, offset = swing(arm)
    kinds = sorted(set(arm.units), reverse=True)
    phase = np.round(np.linspace(0.0, np.pi, arm.n, endpoint=False), 2)
    viscous, dry = (np.round(values, 9) for values in frictions(arm))
    return _TEMPLATE.format(
        asked=_comment(asked),
        file=_comment(str(file)),
        title=tomli_w.dumps({"t": f"{arm.name}: which controller?"}).partition("= ")[2].strip(),
        arm=tomli_w.dumps({"arm": table}).strip(),
        amplitude=amplitude.tolist(),
        offset=np.round(offset, 6).tolist(),
        phase=phase.tolist(),
        units=" and ".join(f"[{unit}]" for unit in kinds),
        frequency=_FREQUENCY,
        bandwidth=_BANDWIDTH,
        square=_BANDWIDTH**2,
        double=2.0 * _BANDWIDTH,
        payload=payload(arm),
        viscous=viscous.tolist(),
        dry=dry.tolist(),
        rates=" and ".join(f"[{unit}/s]" for unit in kinds),
    )


def swing(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return how far each joint moves, and around where, (n,) [rad] or [m]: within its limits.

    Around home, or as near to it as leaves room.
    """
    most = [_SLIDE if kind == PRISMATIC else _SWING for kind in arm.joint_kinds]
    room = 0.5 * (arm.upper - arm.lower)
    amplitude = rounded(np.minimum(most, _PART * np.minimum(room, arm.velocity_limit / _FREQUENCY)))
    # Room to overshoot by a quarter.
    return amplitude, np.clip(arm.home, arm.lower + 1.25 * amplitude, arm.upper - 1.25 * amplitude)


def payload(arm: Arm) -> float:
    """Return a payload [kg] that the drives can hold at home, else a part of the arm's mass."""
    mass = sum(float(body.mass) for body in list(arm.model.inertias)[1:])
    lifted = np.abs(arm.tool_jacobian(arm.home)[:3].T @ arm.model.gravity.linear)
    spare = arm.effort_limit - np.abs(arm.gravity_vector(arm.home))
    bears = [s / x for s, x in zip(spare, lifted, strict=True) if x > 1e-9 and np.isfinite(s)]
    most = min([_LOAD * mass, *(_LOAD * max(x, 0.0) for x in bears)]) if (spare > 0).all() else 0.0
    return float(rounded(np.array([max(most, 1e-3 * mass)]))[0])


def frictions(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return F_v and F_d beyond the arm's own, (n,): for the weight and the inertia it moves."""
    inertia = np.diag(arm.mass_matrix(arm.home))
    viscous = arm.viscous_friction + rounded(inertia)
    # A hundredth of the effort limit, or of what moves the arm at 10 rad/s^2.
    limit = np.where(np.isfinite(arm.effort_limit), arm.effort_limit, 10.0 * inertia)
    return viscous, arm.dry_friction + rounded(0.01 * limit)


def rounded(values: FloatArray) -> FloatArray:
    """Return numbers cut to two digits, towards 0."""
    decade = 10.0 ** (np.floor(np.log10(np.maximum(values, 1e-12))) - 1.0)
    return np.array([float(f"{x:.2g}") for x in np.floor(values / decade + 1e-9) * decade])


def _relative(table: dict[str, Any], out: Path) -> dict[str, Any]:
    """Let paths start where the configuration's do: at its folder."""
    moved = dict(table)
    if "path" in moved:
        moved["path"] = os.path.relpath(moved["path"], out.parent)
    return moved


def _comment(text: str) -> str:
    from fpid_pin.text import visible

    return visible(text)
