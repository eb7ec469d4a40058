"""Write `configuration.md`, every table and key of a TOML file, from the package's descriptions.

    python docs/configuration.py [PATH]

`tests/test_pages.py` compares the page with what this writes.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import fpid_pin as fp
from fpid_pin import checks, descriptions
from fpid_pin.arms.arm import KINDS
from fpid_pin.campaign import Distribution, Scenarios, Success
from fpid_pin.campaign.study import QUANTITIES, CampaignTable
from fpid_pin.cli.tune import TuneTable
from fpid_pin.disturbances import Disturbance
from fpid_pin.fractional.design import Design
from fpid_pin.references import Reference
from fpid_pin.simulation.experiment import Payload
from fpid_pin.text import shown
from fpid_pin.tuning import SearchSettings

PAGE = Path(__file__).parent / "configuration.md"
INTRODUCTION = """\
# Every table and key of a configuration

All tables and keys that a configuration file can have. `fpid-pin init ARM` writes a commented
file to start from. (`docs/configuration.py` generates this page from the code.)

```toml
format = 1                 # always
title = "My study"         # title of reports; default: the file's name
import = "mine.py"         # your own laws, costs, ...; only with --allow-import

[arm]                      # the arm that the controllers know
[reference]                # the motion to follow
[simulation]               # step, duration, integrator, ...
[plant]                    # the true robot, if it differs from the arm
[sensors]                  # imperfect measurements
[[disturbance]]            # external torques; several add up
[[controller]]             # one table for each law
[[condition]]              # a name, and its own plant, sensors, disturbance
[tune]                     # what `fpid-pin tune` searches
[campaign]                 # what `fpid-pin campaign run` draws
```

The keys are the arguments of the Python classes. "Or one per joint" means a list with one number
for each joint. Relative paths start at the folder of the file that names them.
"""


#: Where more is said of a table's keys.
ALSO: dict[type, Any] = {TuneTable: SearchSettings, CampaignTable: Scenarios}


def described_fields(*things: Any) -> dict[str, str]:
    """Return what docstrings say of each parameter: the later ones' words, unless they refer."""
    found: dict[str, str] = {}
    for base in things:
        text = inspect.cleandoc(base.__doc__ or "")
        # Arm has the arguments that all of its constructors share in its notes.
        sections = re.findall(
            r"^(?:Parameters|Notes)\n-+\n(.*?)(?=^\w[^\n]*\n-{3,}$|\Z)", text, re.M | re.S
        )
        for names, body in re.findall(
            r"^(\S[^\n]*)\n((?:[ ]{4}[^\n]*\n?)+)", "\n".join([*sections, ""]), re.M
        ):
            said = " ".join(body.split())
            for name in names.split(" : ")[0].split(", "):
                if not re.match(r"See `\w+`", said):
                    found[name] = said
    return found


def brief(value: Any) -> str:
    """Return a value as TOML has it."""
    kind = getattr(type(value), "_kind", None)
    if value is None:
        return ""
    if kind is not None:
        return f'`kind = "{kind}"`'
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`' if value else ""
    if np.size(value) == 0:
        return ""
    return f"`{shown(np.asarray(value).tolist() if not np.isscalar(value) else value)}`"


def allowed(key: descriptions.Key) -> str:
    """Return what a key takes: its shape and its bounds."""
    said = []
    for check in key.checks or ((key.plain,) if key.plain else ()):
        bounds = dict(check.bounds)
        if check.function is checks.choice:
            said.append(", ".join(f'`"{option}"`' for option in bounds["options"]))
        elif check.function in (
            checks.number,
            descriptions._number_or_joints,
            checks.scalar_or_joints,
            checks.floats,
            checks.integer,
        ):
            limits = (bounds.get(name) for name in ("low", "high", "above"))
            where = checks._interval(*limits).replace("finite", "")
            shape = str(bounds.get("shape", "")).replace("None", "K")
            what = "a whole number" if check.function is checks.integer else "a number"
            what = f"numbers {shape}".strip() if check.function is checks.floats else what
            each = ", or one per joint" if check.function is checks.scalar_or_joints else ""
            said.append(f"{what} {where}".strip() + each)
        elif "expected" in bounds:
            said.append(str(bounds["expected"]))
    if key.family is not None:
        arms, known = sorted([*KINDS, "model"]), descriptions.kinds(key.family)
        kinds = arms if key.family is fp.Arm else [*known]
        many = {None: "a table", list: "tables"}.get(key.several, "tables")
        said.append(f"{many}: {', '.join(f'`{kind}`' for kind in kinds)}" if kinds else many)
    return "; ".join(said)


def cell(text: str) -> str:
    """Return a text as one cell of a table."""
    return re.sub(r"``?", "`", text).replace("|", "\\|")


def fields(cls: type, leave: Iterable[str] = ()) -> list[str]:
    """Return the table of a description's keys."""
    said = described_fields(ALSO.get(cls), *reversed(cls.__mro__))
    lines = ["| key | value | default | |", "| --- | --- | --- | --- |"]
    for key in descriptions.keys(cls).values():
        if key.name in leave:
            continue
        name = "variant" if key.name == "kind" else key.name
        default = "**needed**" if key.required else brief(key.default)
        unit = rf" \[{key.unit}\]" if key.unit else ""
        row = (f"`{name}`", allowed(key) + unit, default, said.get(key.name, ""))
        lines.append(f"| {' | '.join(map(cell, row))} |")
    return [*lines, ""] if lines[2:] else []


def first_line(thing: Any) -> str:
    """Return the first paragraph of a docstring, on one line."""
    return re.sub(
        r"``", "`", " ".join(inspect.cleandoc(thing.__doc__ or "").split("\n\n")[0].split())
    )


def family(title: str, base: type, words: str, leave: Iterable[str] = ()) -> list[str]:
    """Return a section for all kinds of one family."""
    lines = [f"## {title}", "", words, ""]
    for kind, cls in descriptions.kinds(base).items():
        lines += [f'### `kind = "{kind}"`', "", first_line(cls), "", *fields(cls, leave)]
    return lines


def arms() -> list[str]:
    """Return the section on arms, whose keys are the arguments of `Arm`'s constructors."""
    lines = [
        "## `[arm]`",
        "",
        "One `kind`, and optionally `changes`, a list of tables.",
        "",
    ]
    for kind, make in KINDS.items():
        said = described_fields(*fp.Arm.__mro__, make)
        what = first_line(make).removeprefix("Return ")
        lines += [f'### `kind = "{kind}"`', "", what[0].upper() + what[1:], ""]
        parameters = inspect.signature(make).parameters.values()
        if parameters:
            lines += ["| key | default | |", "| --- | --- | --- |"]
            for p in parameters:
                default = "**needed**" if p.default is p.empty else brief(p.default)
                row = (f"`{p.name}`", default, said.get(p.name, ""))
                lines.append(f"| {' | '.join(map(cell, row))} |")
            lines.append("")
    return lines


def page() -> str:
    """Return the whole page."""
    lines = [INTRODUCTION, *arms()]
    lines += family("`[reference]`", Reference, "The motion to follow: one `kind`.")
    simulation = ("arm", "reference", "plant", "sensors")
    lines += ["## `[simulation]`", "", "Time, start and integration.", ""]
    lines += fields(fp.Experiment, simulation)
    lines += ["## `[plant]`", "", first_line(fp.Plant), "", *fields(fp.Plant)]
    lines += ["### `payload`", "", first_line(Payload), "", *fields(Payload)]
    lines += ["## `[sensors]`", "", first_line(fp.Sensors), "", *fields(fp.Sensors)]
    lines += family("`[[disturbance]]`", Disturbance, "External torques; several add up.")
    common = [name for name in descriptions.keys(fp.Controller) if name != "name"]
    lines += ["## `[[controller]]`", "", "Every law has these keys, and its own:", ""]
    lines += fields(fp.Controller)
    lines += family("Laws", fp.Controller, "One `kind` for each law.", (*common, "name"))[2:]
    for title, cls in (("supervisor", fp.Supervisor), ("safeguards", fp.Safeguards)):
        lines += [f"### `{title}`", "", first_line(cls), "", *fields(cls)]
    lines += family("`design` of an adaptive FPID", Design, "How its operators are realised.")
    lines += ["## `[tune]`", "", "What `fpid-pin tune` searches.", "", *fields(TuneTable)]
    lines += family("`[tune.cost]`", fp.costs.Cost, "The cost to minimise.")
    lines += ["## `[campaign]`", "", "What `campaign run` draws.", "", *fields(CampaignTable)]
    lines += ["## `[campaign.success]`", "", first_line(Success), "", *fields(Success)]
    words = "A distribution for any of these quantities:"
    quantities = [
        f"| `{name}` | {quantity.unit} | {'one number' if quantity.single else 'one per joint'} |"
        for name, quantity in QUANTITIES.items()
    ]
    heads = ["| quantity | unit | |", "| --- | --- | --- |"]
    lines += ["## `[campaign.uncertain]`", "", words, "", *heads, *quantities, ""]
    lines += family("Distributions", Distribution, "One `kind` for each distribution.")[2:]
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    Path(sys.argv[1] if sys.argv[1:] else PAGE).write_text(page(), encoding="utf-8")
