"""`init`: a configuration to begin with, for any arm: commented, within its limits, and it runs."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from string import Template
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
from fpid_pin.simulation.toml import toml_text
from fpid_pin.text import visible

#: The reference of ``init.toml``: so far to both sides at most [rad], [m], this part of what
#: position and speed limits allow, and its frequency [rad/s].
_SWING, _SLIDE, _PART, _FREQUENCY = 0.3, 0.1, 0.4, 1.0
#: The payload: this part of what the drives can bear beyond the arm, or of its mass.
_LOAD = 0.3


def run_init(text: str, table: dict[str, Any], out: Path) -> None:
    """Write a configuration; what is there already stays, and is an error."""
    if kind_of(out) is not None:
        raise FileFormatError(
            f"{out}: expected a new file, got one that exists (--out names another)"
        )
    arm = arm_of_table(table)
    say(*impossible_joints(arm))
    if "path" in table:  # starts where the configuration's do: at its folder
        table = table | {"path": os.path.relpath(table["path"], out.parent)}
    put_text(out, configuration(arm, table, asked=text, file=out))
    say(f"Written: {out} (fpid-pin compare {out})")


def configuration(arm: Arm, table: dict[str, Any], *, asked: str, file: Path) -> str:
    """Return the text of a configuration for an arm."""
    amplitude, offset = swing(arm)
    kinds = sorted(set(arm.units), reverse=True)
    load = payload(arm)
    viscous, dry = frictions(arm)
    template = resources.files("fpid_pin.cli").joinpath("init.toml").read_text(encoding="utf-8")
    return Template(template).substitute(
        asked=visible(asked),
        file=visible(str(file)),
        title=toml_text({"t": f"{arm.name}: which controller?"}).partition("= ")[2].strip(),
        arm=toml_text({"arm": table}).strip(),
        amplitude=amplitude.tolist(),
        offset=np.round(offset, 6).tolist(),
        phase=np.round(np.linspace(0.0, np.pi, arm.n, endpoint=False), 2).tolist(),
        units=" and ".join(f"[{unit}]" for unit in kinds),
        load=f"{load:g}",
        payload=load,
        viscous=np.round(viscous, 9).tolist(),
        dry=np.round(dry, 9).tolist(),
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
