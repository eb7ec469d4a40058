"""The TOML configuration, format 1: what a file says, checked whole, as descriptions.

    format = 1
    import           a Python file, or several, with kinds of one's own (see `fpid_pin.own_code`)
    [arm]            kind and the arguments of that kind of arm
    [plant]          arguments of Plant, and payload = {mass, com, frame}
    [reference]      kind and its arguments
    [[disturbance]]  kind and its arguments; several add up
    [sensors]        arguments of Sensors
    [simulation]     step, duration, integrator, dynamics, seed, runaway_speed, q0, v0
    [[controller]]   kind, name and arguments of the controller
    [[condition]]    name, and plant, sensors, disturbance in place of those above
    [tune]           see fpid_pin.tuning
    [campaign]       see fpid_pin.campaign

Keys are the constructors' arguments. Every fault is reported at once, each with its key path.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fpid_pin import checks, descriptions, own_code
from fpid_pin.arms import Arm
from fpid_pin.cli.configuration import Config
from fpid_pin.cli.progress import say_if_compiling
from fpid_pin.cli.toml import parse_table, read_text
from fpid_pin.control import Controller
from fpid_pin.disturbances import Disturbance, Sum
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.references import Reference
from fpid_pin.simulation import Experiment, Plant, Sensors
from fpid_pin.text import shown

FORMAT = 1
#: Faults told of one file, each in a line.
MOST_FAULTS = 40
TABLES = (
    "format", "title", "import", "arm", "plant", "reference", "disturbance", "sensors",
    "simulation", "controller", "condition", "tune", "campaign",
)  # fmt: skip
SIMULATION_KEYS = (
    "step", "duration", "integrator", "dynamics", "seed", "runaway_speed", "q0", "v0",
)  # fmt: skip
PAYLOAD_KEYS = ("mass", "com", "frame")
CONDITION_KEYS = ("name", "plant", "sensors", "disturbance")


def load(path: str | Path) -> Config:
    """Read and check a configuration file.

    Raises
    ------
    ConfigError
        A line for every fault: file, key path, what was expected, what came.
    """
    path = Path(path)
    return parse(read_text(path), str(path), path.parent)


def parse(text: str, name: str, folder: Path) -> Config:
    """Check a configuration's text; `folder` is where its relative paths start."""
    try:
        table = parse_table(text)
    except FpidError as error:
        raise ConfigError.of(name, [error]) from None
    faults: list[FpidError] = []
    config = _Reader(table, folder, faults).read(name, text)
    if faults or config is None:
        # Conditions share what is wrong with the nominal experiment.
        told = list(dict.fromkeys(map(str, faults)))
        more = [f"faults: expected none, got {len(told)}"] if told[MOST_FAULTS:] else []
        raise ConfigError.of(name, told[:MOST_FAULTS] + more)
    return config


class _Reader:
    """Builds the parts of a configuration and collects their faults."""

    def __init__(self, table: Mapping[str, Any], folder: Path, faults: list[FpidError]) -> None:
        self._table, self._folder, self._faults = table, folder, faults

    def read(self, name: str, text: str) -> Config | None:
        table, faults = self._table, self._faults
        number = table.get("format", "none")
        # Of "true" and 1.0 Python says that they are 1.
        if type(number) is not int or number != FORMAT:
            faults.append(ArgumentError("format", f"{FORMAT}", shown(number)))
            return None
        self._known("", table, TABLES)
        if "import" in table and not self._import(table["import"]):
            # Without them their kinds are unknown, which would be told over and over.
            return None
        for key in ("arm", "reference", "controller"):
            if key not in table:
                faults.append(ArgumentError(key, "a table", "none"))
        arm = self._arm() if "arm" in table else None
        reference = self._build("reference", Reference) if "reference" in table else None
        controllers = self._controllers()
        section = self._section("simulation", table.get("simulation", {}))
        simulation = self._known("simulation", section, SIMULATION_KEYS)
        parts = self._surroundings(table, "", arm)
        conditions = self._conditions(arm, parts)
        tune, campaign = (self._section(key, table.get(key, {})) for key in ("tune", "campaign"))
        if faults or arm is None or reference is None:
            return None
        experiment = self._experiment(arm, reference, simulation, parts)
        if experiment is None:
            return None
        named = {}
        for label, surroundings in conditions.items():
            changed = self._experiment(arm, reference, simulation, surroundings)
            if changed is not None:
                named[label] = changed
        say_if_compiling()
        for label, controller in controllers.items():
            self._try(
                f"controller {shown(label)}",
                lambda c=controller: c.start(arm, step=experiment.step),
            )
        title = table.get("title", "")
        if not isinstance(title, str):
            faults.append(ArgumentError("title", "a text", shown(title)))
        if faults:
            return None
        conditions_ = named or {"nominal": experiment}
        return Config(name, text, title, experiment, controllers, conditions_, tune, campaign)

    # ------------------------------------------------------------------ parts

    def _known(self, path: str, table: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
        """Return what a table has under `keys`; every other key is a fault.

        Only what this returns may become arguments of a call: a key can be called ``self``.
        """
        for key in table:
            named = f"{path}.{key}".strip(".") or '""'
            self._try("", lambda key=key, named=named: checks.choice(named, key, keys))
        return {key: table[key] for key in keys if key in table}

    def _import(self, value: Any) -> bool:
        files = [value] if isinstance(value, str) else value
        if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
            self._faults.append(ArgumentError("import", "a path, or a list of them", shown(value)))
            return False
        before = len(self._faults)
        self._try("", lambda: own_code.load([self._folder / file for file in files]))
        return len(self._faults) == before

    def _section(self, path: str, value: Any) -> Mapping[str, Any]:
        if isinstance(value, Mapping):
            return value
        self._faults.append(ArgumentError(path, "a table", shown(value)))
        return {}

    def _list(self, path: str, value: Any) -> list[Any]:
        if isinstance(value, list):
            return value
        self._faults.append(ArgumentError(path, f"a list of tables ([[{path}]])", shown(value)))
        return []

    def _build(self, key: str, family: type) -> Any:
        value = self._rooted(self._table[key])
        if isinstance(value, Mapping) and "arm" in self._table:
            kind = descriptions.kinds(family).get(str(value.get("kind")))
            if kind is not None and any(f.name == "arm" for f in dataclasses.fields(kind)):
                # A circle of the tool is one of this arm's, if nothing else is said.
                value = {"arm": self._rooted(self._table["arm"]), **value}
        return descriptions.build(value, family, key, self._faults)

    def _rooted(self, value: Any) -> Any:
        """Let a table's relative path start at the configuration's folder."""
        if isinstance(value, Mapping) and isinstance(value.get("path"), str):
            return dict(value) | {"path": str(self._folder / value["path"])}
        return value

    def _arm(self) -> Arm | None:
        value = self._section("arm", self._table["arm"])
        return self._arm_from(value, "arm")

    def _arm_from(self, value: Any, path: str) -> Arm | None:
        arm: Arm | None = descriptions.build(self._rooted(value), Arm, path, self._faults)
        return arm

    def _controllers(self) -> dict[str, Controller]:
        named: dict[str, Controller] = {}
        tables = self._list("controller", self._table.get("controller", []))
        if not tables and self._table.get("controller") == []:
            self._faults.append(ArgumentError("controller", "at least one [[controller]]", "none"))
        for k, value in enumerate(tables):
            path = f"controller.{k}"
            controller = descriptions.build(value, Controller, path, self._faults)
            if controller is None:
                continue
            name = str(getattr(controller, "name", "") or getattr(type(controller), "_kind", path))
            if name in named:
                self._faults.append(
                    ArgumentError(f"{path}.name", "a name of its own", f"{shown(name)} again")
                )
            named[name] = controller
        return named

    def _surroundings(self, table: Mapping[str, Any], path: str, arm: Arm | None) -> dict[str, Any]:
        """Build plant (with its disturbance) and sensors from the tables under `path`."""
        prefix = f"{path}." if path else ""
        parts: dict[str, Any] = {}
        if "sensors" in table:
            parts["sensors"] = descriptions.build(
                table["sensors"], Sensors, f"{prefix}sensors", self._faults
            )
        if "disturbance" in table:
            items = self._list(f"{prefix}disturbance", table["disturbance"])
            built = [
                descriptions.build(item, Disturbance, f"{prefix}disturbance.{k}", self._faults)
                for k, item in enumerate(items)
            ]
            if built and None not in built:
                parts["disturbance"] = built[0] if len(built) == 1 else Sum(built)
            else:
                parts["disturbance"] = None
        if "plant" in table:
            parts["plant"] = self._plant(table["plant"], f"{prefix}plant", arm)
        return parts

    def _plant(self, value: Any, path: str, arm: Arm | None) -> Plant | None:
        table = dict(self._section(path, value))
        true_arm = arm
        if "arm" in table:
            true_arm = self._arm_from(table.pop("arm"), f"{path}.arm")
        payload = table.pop("payload", None)
        if payload is not None and true_arm is not None:
            section = self._section(f"{path}.payload", payload)
            given = self._known(f"{path}.payload", section, PAYLOAD_KEYS)
            if "mass" not in given:
                self._faults.append(ArgumentError(f"{path}.payload.mass", "a number", "none"))
                return None
            base = true_arm
            true_arm = self._try(f"{path}.payload", lambda: base.with_payload(**given))
        if "disturbance" in table:
            self._faults.append(
                ArgumentError(f"{path}.disturbance", "[[disturbance]] tables instead", "a key")
            )
            return None
        plant: Plant | None = descriptions.build(table, Plant, path, self._faults)
        if plant is None or true_arm is arm:
            return plant
        return dataclasses.replace(plant, arm=true_arm)

    def _conditions(self, arm: Arm | None, parts: dict[str, Any]) -> dict[str, dict[str, Any]]:
        named: dict[str, dict[str, Any]] = {}
        for k, value in enumerate(self._list("condition", self._table.get("condition", []))):
            path = f"condition.{k}"
            table = self._section(path, value)
            self._known(path, table, CONDITION_KEYS)
            name = table.get("name")
            if not isinstance(name, str) or not name or name in named:
                self._faults.append(ArgumentError(f"{path}.name", "a name of its own", shown(name)))
                continue
            named[name] = parts | self._surroundings(table, path, arm)
        return named

    def _experiment(
        self,
        arm: Arm,
        reference: Reference,
        simulation: dict[str, Any],
        parts: dict[str, Any],
    ) -> Experiment | None:
        plant = parts.get("plant")
        disturbance = parts.get("disturbance")
        if disturbance is not None:
            plant = dataclasses.replace(plant or Plant(), disturbance=disturbance)
        found: list[FpidError] = []
        table = {"arm": arm, "reference": reference, "plant": plant} | simulation
        table["sensors"] = parts.get("sensors")
        experiment: Experiment | None = descriptions.build(table, Experiment, "", found)
        for fault in found:
            if isinstance(fault, ArgumentError) and fault.name.split(".")[0] in SIMULATION_KEYS:
                fault = ArgumentError(f"simulation.{fault.name}", fault.expected, fault.got)
            self._faults.append(fault)
        return experiment

    def _try(self, path: str, action: Any) -> Any:
        try:
            return action()
        except ArgumentError as error:
            name = error.name
            if path and not name.startswith(("plant", "reference", "sensors")):
                name = f"{path}.{name}"
            self._faults.append(ArgumentError(name, error.expected, error.got))
        except FpidError as error:
            self._faults.append(error)
        return None
