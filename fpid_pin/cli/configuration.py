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
    [tune]           see `plans.read_plan`
    [campaign]       see `plans.read_campaign`

Keys are the constructors' arguments. Every fault is reported at once, each with its key path.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from fpid_pin import checks, descriptions, own_code
from fpid_pin.arms import Arm
from fpid_pin.cli.progress import say_if_compiling
from fpid_pin.control import Controller
from fpid_pin.disturbances import Disturbance, Sum
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.references import Reference
from fpid_pin.simulation import Experiment, Plant, Sensors
from fpid_pin.text import named, shown

FORMAT = 1
#: No configuration is longer; an endless device is [bytes].
MOST_BYTES = 1 << 24
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


@dataclass(frozen=True, eq=False)
class Config:
    """What a configuration file describes.

    Attributes
    ----------
    path, text
        Where it came from, and all of it.
    title
        For reports; the file's name where it has none.
    experiment
        The nominal one.
    controllers
        By name, in the file's order.
    conditions
        Experiments by name; only the nominal one where the file has no ``[[condition]]``.
    tune, campaign
        The tables of these names as they stand.
    """

    path: str
    text: str
    title: str
    experiment: Experiment
    controllers: dict[str, Controller]
    conditions: dict[str, Experiment]
    tune: Mapping[str, Any]
    campaign: Mapping[str, Any]

    def chosen(self, name: str | None) -> str:
        """Return which controller ``--controller`` chose, by its name; None: the only one.

        Raises
        ------
        ConfigError
            A name that is not there; none where there are several.
        """
        if name is None and len(self.controllers) > 1:
            several = ", ".join(map(named, self.controllers))
            fault = f"expected one controller, or --controller NAME, got {several}"
            raise ConfigError.of(self.path, [fault])
        try:
            found = name or next(iter(self.controllers))
            return checks.choice("--controller", found, self.controllers)
        except ArgumentError as error:
            raise ConfigError.of(self.path, [error]) from None


def load(path: str | Path) -> Config:
    """Read and check a configuration file.

    Raises
    ------
    ConfigError
        A line for every fault: file, key path, what was expected, what came.
    """
    path = Path(path)
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise ConfigError.of(path, [f"expected at most {MOST_BYTES} bytes, got more"])
        # Line ends as TOML and the results' copy have them.
        text = data.decode("utf-8").replace("\r\n", "\n")
    except FileNotFoundError:
        raise ConfigError.of(path, ["no such file"]) from None
    except OSError as error:
        raise ConfigError.of(path, [f"cannot be read ({error.strerror})"]) from None
    except ValueError:
        raise ConfigError.of(path, ["cannot be read (not a text file)"]) from None
    return parse(text, str(path), path.parent)


def demo_config() -> Config:
    """Return the configuration that `demo` runs, from the package."""
    text = resources.files("fpid_pin.cli").joinpath("demo.toml").read_text(encoding="utf-8")
    return parse(text, "demo.toml", Path.cwd())


def parse(text: str, name: str, folder: Path) -> Config:
    """Check a configuration's text; `folder` is where its relative paths start."""
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise ConfigError.of(name, ["not valid TOML: nested too deeply"]) from None
    except ValueError as error:
        raise ConfigError.of(name, [f"not valid TOML: {error}"]) from None
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
            self._fault("format", f"{FORMAT}", shown(number))
            return None
        known("", table, TABLES, faults)
        if "import" in table and not self._import(table["import"]):
            # Without them their kinds are unknown, which would be told over and over.
            return None
        for key in ("arm", "reference", "controller"):
            if key not in table:
                self._fault(key, "a table", "none")
        arm = self._build(table["arm"], Arm, "arm") if "arm" in table else None
        reference = self._reference(table["reference"]) if "reference" in table else None
        controllers = self._controllers(self._list("controller", table))
        section = self._section("simulation", table.get("simulation", {}))
        simulation = known("simulation", section, SIMULATION_KEYS, faults)
        nominal = self._surroundings(table, "", arm)
        conditions = self._conditions(arm, nominal)
        tune, campaign = (self._section(key, table.get(key, {})) for key in ("tune", "campaign"))
        title = table.get("title", "")
        if not isinstance(title, str):
            self._fault("title", "a text", shown(title))
        if faults:
            return None
        base = {"arm": arm, "reference": reference} | simulation
        experiment = self._experiment(base | nominal)
        named = {label: self._experiment(base | parts) for label, parts in conditions.items()}
        if faults or experiment is None:
            return None
        say_if_compiling()
        for label, controller in controllers.items():
            try:
                controller.start(experiment.arm, step=experiment.step)
            except FpidError as error:
                faults.append(moved(error, f"controller {shown(label)}"))
        return Config(
            name, text, title or Path(name).stem, experiment, controllers,
            named or {"nominal": experiment}, tune, campaign,
        )  # fmt: skip

    def _fault(self, key: str, expected: str, got: str) -> None:
        self._faults.append(ArgumentError(key, expected, got))

    def _import(self, value: Any) -> bool:
        files = [value] if isinstance(value, str) else value
        if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
            self._fault("import", "a path, or a list of them", shown(value))
            return False
        try:
            own_code.load([self._folder / file for file in files])
        except FpidError as error:
            self._faults.append(error)
            return False
        return True

    def _section(self, path: str, value: Any) -> Mapping[str, Any]:
        if isinstance(value, Mapping):
            return value
        self._fault(path, "a table", shown(value))
        return {}

    def _list(self, key: str, table: Mapping[str, Any], path: str = "") -> list[Any]:
        value = table.get(key, [])
        if isinstance(value, list):
            return value
        self._fault(f"{path}{key}", f"a list of tables ([[{path}{key}]])", shown(value))
        return []

    def _build(self, value: Any, family: type, path: str) -> Any:
        if isinstance(value, Mapping) and isinstance(value.get("path"), str):
            # A relative path starts at the configuration's folder.
            value = dict(value) | {"path": str(self._folder / value["path"])}
        return descriptions.build(value, family, path, self._faults)

    def _reference(self, value: Any) -> Any:
        kind = value.get("kind") if isinstance(value, Mapping) else None
        cls = descriptions.kinds(Reference).get(str(kind))
        if cls is not None and "arm" in descriptions.keys(cls) and "arm" not in value:
            # A circle of the tool is one of this arm's, if nothing else is said.
            value = dict(value) | {"arm": self._build(self._table.get("arm"), Arm, "arm")}
        return self._build(value, Reference, "reference")

    def _controllers(self, tables: list[Any]) -> dict[str, Controller]:
        found: dict[str, Controller] = {}
        if not tables and self._table.get("controller") == []:
            self._fault("controller", "at least one [[controller]]", "none")
        for k, value in enumerate(tables):
            controller = self._build(value, Controller, f"controller.{k}")
            if controller is not None:
                name = str(controller.name or getattr(controller, "_kind", f"controller.{k}"))
                if name in found:
                    self._fault(f"controller.{k}.name", "a name of its own", f"{shown(name)} again")
                found[name] = controller
        return found

    def _surroundings(self, table: Mapping[str, Any], path: str, arm: Arm | None) -> dict[str, Any]:
        """Build plant, disturbance and sensors from the tables under `path`."""
        parts: dict[str, Any] = {}
        if "sensors" in table:
            parts["sensors"] = self._build(table["sensors"], Sensors, f"{path}sensors")
        if "disturbance" in table:
            items = enumerate(self._list("disturbance", table, path))
            built = [self._build(x, Disturbance, f"{path}disturbance.{k}") for k, x in items]
            whole = built and None not in built
            parts["disturbance"] = (built[0] if built[1:] == [] else Sum(built)) if whole else None
        if "plant" in table:
            parts["plant"] = self._plant(table["plant"], f"{path}plant", arm)
        return parts

    def _plant(self, value: Any, path: str, arm: Arm | None) -> Plant | None:
        table = dict(self._section(path, value))
        if "disturbance" in table:
            self._fault(f"{path}.disturbance", "[[disturbance]] tables instead", "a key")
            return None
        base = self._build(table["arm"], Arm, f"{path}.arm") if "arm" in table else arm
        if "payload" in table:
            section = self._section(f"{path}.payload", table.pop("payload"))
            given = known(f"{path}.payload", section, PAYLOAD_KEYS, self._faults)
            if "mass" not in given:
                self._fault(f"{path}.payload.mass", "a number", "none")
            elif base is not None:
                try:
                    table["arm"] = base.with_payload(**given)
                except FpidError as error:
                    self._faults.append(moved(error, f"{path}.payload"))
        elif "arm" in table:
            table["arm"] = base
        if "arm" in table and table["arm"] is None:
            return None
        plant: Plant | None = self._build(table, Plant, path)
        return plant

    def _conditions(self, arm: Arm | None, parts: dict[str, Any]) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        for k, value in enumerate(self._list("condition", self._table)):
            path = f"condition.{k}"
            table = self._section(path, value)
            known(path, table, CONDITION_KEYS, self._faults)
            name = table.get("name")
            if not isinstance(name, str) or not name or name in found:
                self._fault(f"{path}.name", "a name of its own", shown(name))
                continue
            found[name] = parts | self._surroundings(table, f"{path}.", arm)
        return found

    def _experiment(self, table: dict[str, Any]) -> Any:
        faults: list[FpidError] = []
        disturbance = table.pop("disturbance", None)
        if disturbance is not None:
            plant = table.get("plant") or Plant()
            table["plant"] = dataclasses.replace(plant, disturbance=disturbance)
        experiment = descriptions.build(table, Experiment, "", faults)
        for fault in faults:
            own = isinstance(fault, ArgumentError) and fault.name.split(".")[0] in SIMULATION_KEYS
            self._faults.append(moved(fault, "simulation") if own else fault)
        return experiment


def known(
    path: str, table: Mapping[str, Any], keys: tuple[str, ...], faults: list[FpidError]
) -> dict[str, Any]:
    """Return what a table has under `keys`; every other key is a fault.

    Only what this returns may become arguments of a call: a key can be called ``self``.
    """
    for key in table:
        try:
            checks.choice(f"{path}.{key}".strip(".") or '""', key, keys)
        except ArgumentError as error:
            faults.append(error)
    return {key: table[key] for key in keys if key in table}


def moved(error: FpidError, path: str) -> FpidError:
    """Return an error with its argument's name under a table's path."""
    if isinstance(error, ArgumentError):
        return ArgumentError(f"{path}.{error.name}", error.expected, error.got)
    return error
