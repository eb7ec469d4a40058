"""Arms on the command line: how one is named, a list of them, what there is to know of one.

And a configuration to begin with for any of them: commented, within its limits, and it runs.
"""

import itertools
import os
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms import Arm, catalogue, robot_file
from fpid_pin.arms.catalogue import ENDING
from fpid_pin.arms.parts import PRISMATIC
from fpid_pin.arms.tree import HoldError
from fpid_pin.checks import FloatArray
from fpid_pin.cli.screen import Row, print_table, say
from fpid_pin.control import explain_gains, gain_ceilings, stability_report
from fpid_pin.control.gains import impossible_joints
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.files import kind_of, put_text
from fpid_pin.simulation.toml import toml_text
from fpid_pin.text import visible

WIDTH = 80
#: Limits that drafts write for all joints; a link's mass to its neighbours'; more than an arm turns
#: to one side [rad].
_PLACEHOLDERS, _HEAVY, _TURNS = (10.0, 1000.0), 10.0, 20.0
#: A joint that friction stops within less is one that a file's author meant to stand still [s].
_FASTEST = 1e-4
#: The reference of ``init.toml``: so far to both sides at most [rad], [m], this part of what
#: position and speed limits allow, and its frequency [rad/s].
_SWING, _SLIDE, _PART, _FREQUENCY = 0.3, 0.1, 0.4, 1.0
#: The payload: this part of what the drives can bear beyond the arm, or of its mass.
_LOAD = 0.3


# ---------------------------------------------------------------------- by name


def arm_table(text: str, locks: Sequence[str] | None, **options: Any) -> dict[str, Any]:
    """Return the ``[arm]`` table of what was written for an arm, with the options beside it.

    `text` is ``two_link``, a name of ``fpid-pin arms`` or robot_descriptions, or a file's path.
    """
    if folders := options.get("package_dirs"):
        options["package_dirs"] = [str(folder.resolve()) for folder in folders]
    options["lock"] = dict(_lock(item) for item in locks or ())
    return _table(text) | {key: value for key, value in options.items() if value}


def _table(text: str) -> dict[str, Any]:
    if text == "two_link":
        return {"kind": "two_link"}
    if text in catalogue.names():
        return {"kind": "example", "name": text}
    path = Path(text)
    if path.suffix or path.is_file() or len(path.parts) > 1:
        return {"kind": robot_file.KINDS[robot_file.kind_of(path)][0].lower(), "path": text}
    if not text.lower().endswith(ENDING):
        checks.choice("arm", text, ("two_link", *catalogue.names(), *catalogue.descriptions()))
    return {"kind": "description", "name": text}


def _lock(item: str) -> tuple[str, float]:
    name, sign, value = item.rpartition("=")
    try:
        if not sign:
            raise ValueError
        return name, float(value)
    except ValueError:
        raise ArgumentError("--lock", "JOINT=VALUE", repr(item)) from None


def arm_of_table(table: dict[str, Any]) -> Arm:
    """Build the arm of `arm_table`; an error is written as the command line has it."""
    try:
        return Arm.from_table(table)
    except HoldError as error:
        raise error.written("shell") from None
    except ArgumentError as error:
        option, *rest = error.name.split(".")
        if option in ("lock", "keep", "tool", "inertia", "package_dirs"):
            name = " ".join([f"--{option.removesuffix('s').replace('_', '-')}", *rest])
            raise ArgumentError(name, error.expected, error.got) from None
        raise


def arm_rows() -> list[Row]:
    """Return a row for each arm that ``Arm.from_example`` knows, and the paper's own."""
    arms = [("two_link", Arm.two_link(), "the paper's section 5.1, no limits given")]
    for name in catalogue.names():
        arms.append((name, Arm.from_example(name), catalogue.ENTRIES[name].note))
    return [
        {
            "name": name,
            "n": arm.n,
            "effort limit [N m]": _brief(arm.effort_limit),
            "viscous friction [N m s/rad]": _brief(arm.viscous_friction),
            "dry friction [N m]": _brief(arm.dry_friction),
            "note": note,
        }
        for name, arm, note in arms
    ]


def _brief(values: FloatArray) -> str:
    """Write equal neighbours once: ``150 x3, 28 x3``; no limit or no friction is a dash."""
    parts = []
    for value, group in itertools.groupby(values.tolist()):
        text, count = "-" if np.isinf(value) or value == 0.0 else f"{value:g}", len(list(group))
        parts.append(text if count == 1 else f"{text} x{count}")
    return "-" if len(parts) == 1 and parts[0].startswith("-") else ", ".join(parts)


# ---------------------------------------------------------------------- what there is to know


def run_inspect(table: dict[str, Any], bandwidth: float, step: float, picture: Path | None) -> None:
    """Print all of it; draw the arm where a picture is asked for."""
    arm = arm_of_table(table)
    if picture is not None:
        from fpid_pin.view import save_figure
        from fpid_pin.view.shapes import portrait

        # First: a name that no picture can have is told before a page of numbers.
        save_figure(portrait(arm), picture)
    # All of it before the first line: what is refused leaves no half of a page.
    for part in list(described(arm, bandwidth, step)):
        if isinstance(part, str):
            lines = textwrap.wrap(
                visible(part), WIDTH, break_long_words=False, break_on_hyphens=False
            )
            say(*(lines or [""]))
        else:
            print_table(part)
    if picture is not None:
        say(f"Written: {picture}")


def described(arm: Arm, bandwidth: float = 10.0, step: float = 1e-3) -> Iterator[str | list[Row]]:
    """Yield what `inspect` prints: paragraphs, and tables as rows."""
    few = "" if arm.n == 1 else "s"
    yield (
        f"{arm.name}: {arm.n} joint{few}, gravity {arm.gravity:.4g} m/s^2, tool frame {arm.tool}"
    )
    yield from [arm.credit] if arm.credit else []
    units = "angles in rad, speeds in rad/s, efforts in N m"
    if PRISMATIC in arm.joint_kinds:
        units += "; of prismatic joints m, m/s and N"
    yield ""
    yield f"Joints and their limits; -: not given ({units})"
    yield _rows({
        "kind": arm.joint_kinds, "lower": arm.lower, "upper": arm.upper,
        "speed": arm.velocity_limit, "effort": arm.effort_limit, "name": arm.joint_names,
    })  # fmt: skip
    weight = arm.gravity_vector(arm.home)
    weight = np.where(np.abs(weight) > 1e-9 * np.abs(weight).max(), weight, 0.0)
    part = np.abs(weight) / arm.effort_limit
    yield ""
    yield (
        "At home: each joint's inertia M_jj [kg m^2] or [kg]; its gravity torque G_j, also as a "
        "share of its effort limit; viscous and dry friction F_v, F_d"
    )
    yield _rows({
        "home": np.round(arm.home, 9) + 0.0,
        "M_jj": np.diag(arm.mass_matrix(arm.home)), "G_j": weight,
        "of effort": [f"{100.0 * x:.0f} %" if x > 0.0 else "-" for x in part],
        "F_v": np.where(arm.viscous_friction, arm.viscous_friction, np.nan),
        "F_d": np.where(arm.dry_friction, arm.dry_friction, np.nan),
    })  # fmt: skip
    found = list(oddities(arm))
    yield from ["", "What looks wrong:"] if found else []
    yield from (f"- {line}" for line in found)
    suggested = explain_gains(arm, bandwidth, step=step)
    law = suggested.controller
    ceilings = gain_ceilings(arm, law, step=step)
    yield ""
    yield (
        f"Suggested FPID: suggest_gains(arm, bandwidth={bandwidth:g}), at a step of "
        f"{1e3 * step:g} ms; u = scale (Kp e + Ki I^lambda e + Kd D^mu e), and the gains' ceilings "
        "(gain_ceilings)"
    )
    columns = {
        "scale": law.scale_on(arm), "lambda": law.integral_order, "mu": law.derivative_order,
        "Kp": law.kp, "Ki": law.ki, "Kd": law.kd,
        "Kp max": ceilings.kp, "Ki max": ceilings.ki, "Kd max": ceilings.kd,
    }  # fmt: skip
    yield _rows({head: np.broadcast_to(column, arm.n) for head, column in columns.items()})
    yield from suggested.notes or ["Nothing had to be lowered."]
    report = stability_report(arm, law, step=step)
    pole, stable = report.dominant_pole, "stable" if report.stable else "UNSTABLE"
    yield ""
    yield (
        f"Margins at home: {stable}, dominant pole {pole.real:.3g} ± {abs(pole.imag):.3g}j 1/s; "
        "the factors by which one joint's gain may rise or fall while the others stay"
    )
    labels = [*range(1, arm.n + 1), "all"]
    heads = [head for head in report.rows()[0] if head != "joint"]
    yield [
        {"#": label} | {head: _finite(row.get(head)) for head in heads}
        for label, row in zip(labels, report.rows(), strict=True)
    ]


def oddities(arm: Arm) -> Iterator[str]:
    """Yield what looks wrong about an arm; a file is often a draft where it says so."""

    def of(which: Any) -> str:
        return ", ".join(arm.joint_names[k] for k in np.flatnonzero(which))

    yield from impossible_joints(arm)
    limits = {"effort": arm.effort_limit, "speed": arm.velocity_limit}
    for name, limit in limits.items():
        if arm.n > 1 and limit[0] in _PLACEHOLDERS and (limit == limit[0]).all():
            yield f"the {name} limits of all joints are {limit[0]:g}, as drafts have them"
    ends = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    if (far := (ends > _TURNS) & np.isfinite(ends) & (np.array(arm.units) == "rad")).any():
        yield f"position limits beyond {_TURNS:g} rad, perhaps meant in degrees: {of(far)}"
    inertia = np.diag(arm.mass_matrix(arm.home))
    if (held := arm.viscous_friction * _FASTEST > inertia).any():
        yield f"viscous friction holds the joint, which --lock would do better: {of(held)}"
    masses = np.array([0.0, *(body.mass for body in list(arm.model.inertias)[1:]), 0.0])
    beside = np.maximum(masses[:-2], masses[2:])
    if (heavy := (beside > 0.0) & (masses[1:-1] > _HEAVY * beside)).any():
        yield f"the link outweighs its neighbours more than {_HEAVY:g} times: {of(heavy)}"
    if (outside := (arm.lower > 0.0) | (arm.upper < 0.0)).any():
        yield f"the zero pose is outside the limits: {of(outside)}"


def _rows(columns: Mapping[str, Any]) -> list[Row]:
    """Return rows numbered from 1; what is not finite is left open."""
    return [
        {"#": k} | {head: _finite(cell) for head, cell in zip(columns, row, strict=True)}
        for k, row in enumerate(zip(*columns.values(), strict=True), start=1)
    ]


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


# ---------------------------------------------------------------------- init


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
        offset=(np.round(offset, 6) + 0.0).tolist(),  # never -0.0
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
