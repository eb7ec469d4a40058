"""Configurations written: experiments and controllers as TOML that `fpid-pin` reads."""

import dataclasses
import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from fpid_pin import checks, descriptions, own_code
from fpid_pin.checks import checked
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.text import listed

#: Keys of ``[simulation]``: the arguments of `Experiment` that have no table of their own.
SIMULATION = ("step", "duration", "integrator", "dynamics", "seed", "runaway_speed", "q0", "v0")


@checked
def to_toml(
    experiments: Experiment | Mapping[str, Experiment],
    controllers: Controller | Sequence[Controller] | Mapping[str, Controller],
    *,
    title: str = "",
) -> str:
    """Return a configuration: what ``fpid-pin run``, ``compare``, ``playground``, ... read.

    Parameters
    ----------
    experiments
        One, or several by name that differ in their plants and sensors: the file's conditions.
    controllers
        One, several with names of their own, or by name.
    title
        Of the file.

    Returns
    -------
    str
        Every number has all its digits: what is read from it simulates the same bits. Files that
        were loaded by ``import`` are imported again, by their whole paths.

    Raises
    ------
    ArgumentError
        Experiments that differ in more, controllers of one name, or a class of one's own that
        `fpid_pin.described` has given no name.
    """
    several = {"": experiments} if isinstance(experiments, Experiment) else dict(experiments)
    first = next(iter(several.values()))
    tables = [descriptions.to_dict(experiment) for experiment in several.values()]
    own = {"plant", "sensors"}
    for name, table in zip(several, tables, strict=True):
        shared = ({k: v for k, v in t.items() if k not in own} for t in (table, tables[0]))
        if next(shared) != next(shared):
            raise ArgumentError("experiments", "those that differ in plant and sensors only", name)
    laws = by_name(controllers)
    head: dict[str, Any] = {"format": 1} | ({"title": title} if title else {})
    things = [*laws.values(), first.reference, *(e.plant for e in several.values())]
    if files := own_files(things):
        head["import"] = files
    rest = {"arm": tables[0]["arm"], "reference": tables[0]["reference"]}
    rest["simulation"] = {key: tables[0][key] for key in SIMULATION if key in tables[0]}
    found = [
        {"name": name} | {key: _without_kind(table[key]) for key in sorted(own & table.keys())}
        for name, table in zip(several, tables, strict=True)
    ]
    if isinstance(experiments, Experiment):
        del found[0]["name"]
        rest |= found[0]
    else:
        rest["condition"] = found
    text = "\n".join([toml_text(head | rest), controllers_toml(laws)])
    if odd := re.search(r'kind = "custom",?\s+repr = "((?:\\.|[^"\\])*)"', text):
        raise ArgumentError(
            "experiments, controllers", "classes named by fpid_pin.described", odd[1]
        )
    return text


def by_name(
    controllers: Controller | Sequence[Controller] | Mapping[str, Controller],
) -> dict[str, Controller]:
    """Return controllers by the names that tables give them; refuse two of one name."""
    if isinstance(controllers, Mapping):
        return dict(controllers)
    given = checks.several("controllers", controllers, Controller, "a Controller")
    named = {law.name or type(law).__name__: law for law in given}
    if len(named) < len(given):
        raise ArgumentError("controllers", "a name of its own each", listed(named))
    return named


def controllers_toml(laws: Mapping[str, Controller], notes: Mapping[str, str] | None = None) -> str:
    """Return the ``[[controller]]`` tables of laws, units as comments; `notes` are by name."""
    parts = []
    for name, law in laws.items():
        table = {"name": name} | descriptions.to_dict(law) | {"name": name}
        own, *rest = toml_text({"controller": [table]}).partition("\n[")
        if table.get("scale") == "none":
            for key in descriptions.keys(type(law)).values():
                noted = rf"\g<0>  # [{key.unit}]" if key.unit else r"\g<0>"
                own = re.sub(rf"(?m)^{key.name} = .*", noted, own)
        if notes and name in notes:
            own = own.replace("\n", f"  # {notes[name]}\n", 1)
        parts.append("".join([own, *rest]))
    return "\n".join(parts)


def toml_text(table: Mapping[str, Any]) -> str:
    """Return a table as TOML, each list on one line."""
    import tomli_w

    # Where nothing is indented, a line ends in "[" or "," only within a list.
    text = tomli_w.dumps(table, indent=0)
    return text.replace(",\n]", "]").replace("[\n", "[").replace(",\n", ", ")


def _without_kind(table: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key != "kind"}


def own_files(things: Sequence[Any]) -> list[str]:
    """Return the files that were loaded by ``import`` and define these, or what is in them."""
    files, modules, known = set(own_code.loaded()), set(), [*things]
    while known:
        thing = known.pop()
        modules.add(type(thing).__module__)
        if isinstance(thing, (list, tuple)):
            known += thing
        elif dataclasses.is_dataclass(thing):
            known += [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    return sorted(files & {str(getattr(sys.modules.get(m), "__file__", None)) for m in modules})
