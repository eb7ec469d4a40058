"""The TOML configuration, format 1: what a file says, checked whole, as descriptions.

docs/configuration.md has its tables; their keys are the constructors' arguments. Every fault is
reported at once, each with its key path.
"""

import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, make_dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar

from fpid_pin import checks, descriptions, own_code
from fpid_pin.arms import Arm
from fpid_pin.checks import Text
from fpid_pin.cli.screen import say, say_if_compiling
from fpid_pin.control import Controller
from fpid_pin.descriptions import Description
from fpid_pin.disturbances import Disturbance, Sum
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.references import Reference
from fpid_pin.simulation import Experiment, Plant, Sensors
from fpid_pin.simulation.toml import SIMULATION, toml_text
from fpid_pin.text import named, shown

T = TypeVar("T", bound=Description)
FORMAT = 1
#: No configuration is longer; an endless device is [bytes].
MOST_BYTES = 1 << 24
#: Faults told of one file, each in a line.
MOST_FAULTS = 40
#: Keys of paths, wherever they are: relative ones start at the file's folder.
_PATHS = {"path", "package_dirs", "import"}
Table = Annotated[Mapping[str, Any], checks.Plain(Mapping, "a table")]


@dataclass(frozen=True, eq=False, kw_only=True)
class Surroundings(Description):
    """What a condition may have otherwise."""

    plant: Plant | None = None
    sensors: Sensors | None = None
    disturbance: Sequence[Disturbance] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Condition(Surroundings):
    """One [[condition]]."""

    name: Annotated[str, Text]


#: What ``[simulation]`` has; `Experiment` checks it.
Simulation = make_dataclass(
    "Simulation", [(key, Any, None) for key in SIMULATION], bases=(Description,), frozen=True
)


@dataclass(frozen=True, eq=False, kw_only=True)
class File(Surroundings):
    """A whole file, as it is written."""

    arm: Arm
    reference: Reference
    controller: Sequence[Controller]
    simulation: Simulation = field(default_factory=Simulation)  # type: ignore[valid-type]
    condition: Sequence[Condition] = ()
    tune: Table = field(default_factory=dict)
    campaign: Table = field(default_factory=dict)
    title: Annotated[str, Text] = ""


@dataclass(frozen=True, eq=False)
class Config:
    """What a configuration file describes."""

    path: str
    text: str
    title: str  # for reports; the file's name where it has none
    experiment: Experiment  # the nominal one
    controllers: dict[str, Controller]  # by name, in the file's order
    conditions: dict[str, Experiment]  # by name; only the nominal one where there is no other
    tune: Mapping[str, Any]  # this table and the next as they stand
    campaign: Mapping[str, Any]

    def under(self, name: str | None) -> "Config":
        """Return the file under one of its conditions, as ``--condition`` chose, and no other.

        None is the file as it stands; what is left out then is said.
        """
        if name is None:
            left = [label for label in self.conditions if label != "nominal"]
            if left:
                say(f"Conditions left out: {', '.join(map(named, left))} (--condition NAME).")
            return replace(self, conditions={"nominal": self.experiment})
        one = self.conditions[self._choice("--condition", name, self.conditions)]
        return replace(self, experiment=one, conditions={name: one})

    def only(self, name: str | None) -> "Config":
        """Return the file with the controller that ``--controller`` chose; None: the only one."""
        if name is None and len(self.controllers) > 1:
            several = ", ".join(map(named, self.controllers))
            fault = f"expected one controller, or --controller NAME, got {several}"
            raise ConfigError.of(self.path, [fault])
        name = self._choice("--controller", name or next(iter(self.controllers)), self.controllers)
        return replace(self, controllers={name: self.controllers[name]})

    def at(self, place: Path) -> "Config":
        """Return the file as it is to be written into the folder `place`: with the same meaning.

        Relative paths start at the file that has them. Where no more than these change, comments
        and all else stay.
        """
        source, given = Path(self.path).resolve().parent, tomllib.loads(self.text)
        told: dict[str, str] = {}

        def change(path: str) -> str:
            told[path] = path
            if not os.path.isabs(path):
                told[path] = os.path.relpath(source / path, place.resolve())
            return told[path]

        wanted, text = _with_paths(given, change), self.text
        for old, new in told.items():
            for quote in "\"'":
                text = text.replace(f"{quote}{old}{quote}", toml_text({"x": new})[4:].strip())
        try:
            same = tomllib.loads(text) == wanted
        except tomllib.TOMLDecodeError:
            same = False
        return replace(self, text=text if same else toml_text(wanted))

    def _choice(self, option: str, name: str, known: Mapping[str, object]) -> str:
        try:
            return checks.choice(option, name, known)
        except ArgumentError as error:
            raise ConfigError.of(self.path, [error]) from None


def load(path: str | Path, allow_import: bool = False) -> Config:
    """Read and check a configuration file; the Python files that it names are run where allowed."""
    path = Path(path)
    own_code.allowed.set(allow_import)
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
        # Line ends as TOML and the results' copy have them.
        text = data.decode("utf-8").replace("\r\n", "\n")
    except FileNotFoundError:
        raise ConfigError.of(path, ["no such file"]) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", "not a text file")
        raise ConfigError.of(path, [f"cannot be read ({why})"]) from None
    if len(data) > MOST_BYTES:
        raise ConfigError.of(path, [f"expected at most {MOST_BYTES} bytes, got more"])
    return parse(text, str(path), path.parent)


def demo_config() -> Config:
    """Return the configuration that `demo` runs, from the package."""
    text = resources.files("fpid_pin.cli").joinpath("demo.toml").read_text(encoding="utf-8")
    return parse(text, "demo.toml", Path.cwd())


def parse(text: str, name: str, folder: Path) -> Config:
    """Check a configuration's text; `folder` is where its relative paths start."""
    faults: list[FpidError] = []
    config = None
    try:
        try:
            table = tomllib.loads(text)
        except ValueError as error:
            raise FpidError(f"not valid TOML: {error}") from None
        config = _read(table, folder, name, text, faults)
    except RecursionError:
        faults = [FpidError("not valid TOML: nested too deeply")]
    except FpidError as error:
        faults = [error]
    if faults or config is None:
        # Conditions share what is wrong with the nominal experiment.
        told = list(dict.fromkeys(map(str, faults)))
        more = [f"faults: expected none, got {len(told)}"] if told[MOST_FAULTS:] else []
        raise ConfigError.of(name, told[:MOST_FAULTS] + more)
    return config


def _read(
    table: dict[str, Any], folder: Path, name: str, text: str, faults: list[FpidError]
) -> Config | None:
    """Build what a table describes; every fault is appended to `faults`.

    Raises
    ------
    FpidError
        That without which all else is wrong, too: another format, kinds that are not known.
    """
    number, files = table.pop("format", "none"), table.pop("import", [])
    # Of "true" and 1.0 Python says that they are 1.
    if type(number) is not int or number != FORMAT:
        raise ArgumentError("format", f"{FORMAT}", shown(number))
    files = [files] if isinstance(files, str) else files
    if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
        raise ArgumentError("import", "a path, or a list of them", shown(files))
    own_code.load([folder / file for file in files])
    reference = table.get("reference")
    if isinstance(reference, dict):
        cls = descriptions.kinds(Reference).get(str(reference.get("kind")))
        if cls is not None and "arm" in descriptions.keys(cls) and "arm" in table:
            # A circle of the tool is one of this arm's, if nothing else is said.
            reference.setdefault("arm", table["arm"])
    file: File | None = descriptions.build(
        _with_paths(table, lambda path: str(folder / path)), File, "", faults
    )
    if file is None:
        return None
    if not file.controller:
        faults.append(ArgumentError("controller", "at least one [[controller]]", "none"))
    labels = [law.name or getattr(law, "_kind", "law") for law in file.controller]
    for path, names in (("controller", labels), ("condition", [c.name for c in file.condition])):
        for k, label in enumerate(names):
            if not label or label in names[:k]:
                got = f"{shown(label)} again" if label else "none"
                faults.append(ArgumentError(f"{path}.{k}.name", "a name of its own", got))
    if faults:
        return None
    nominal = _experiment(file, file, "", faults)
    conditions = {
        c.name: _experiment(file, c, f"condition.{k}", faults) for k, c in enumerate(file.condition)
    }
    if faults:
        return None
    say_if_compiling()
    for label, law in zip(labels, file.controller, strict=True):
        try:
            law.start(nominal.arm, step=nominal.step)
        except FpidError as error:
            faults.append(moved(error, f"controller {shown(label)}"))
    controllers = dict(zip(labels, file.controller, strict=True))
    return Config(
        name, text, file.title or Path(name).stem, nominal, controllers,
        conditions or {"nominal": nominal}, file.tune, file.campaign,
    )  # fmt: skip


def _with_paths(value: Any, change: Callable[[str], str]) -> Any:
    """Return a table with other paths: of robots' files, recordings, meshes, own code."""
    if isinstance(value, list):
        return [_with_paths(item, change) for item in value]
    if not isinstance(value, dict):
        return value
    table = {key: _with_paths(item, change) for key, item in value.items()}
    for key in _PATHS & table.keys():
        given = table[key]
        if isinstance(given, str):
            table[key] = change(given)
        elif isinstance(given, list):
            table[key] = [change(item) if isinstance(item, str) else item for item in given]
    return table


def _experiment(file: File, own: Surroundings, path: str, faults: list[FpidError]) -> Any:
    """Build the experiment of a condition, with what it does not say as the file has it."""
    plant, sensors, disturbance = (
        getattr(file, name) if getattr(own, name) is None else getattr(own, name)
        for name in ("plant", "sensors", "disturbance")
    )
    pushes = [*(() if plant is None or plant.disturbance is None else (plant.disturbance,))]
    pushes += disturbance or ()
    if pushes:
        one = Sum(pushes) if pushes[1:] else pushes[0]
        plant = replace(plant or Plant(), disturbance=one)
    table = {"arm": file.arm, "reference": file.reference, "sensors": sensors, "plant": plant}
    table |= {key: value for key, value in vars(file.simulation).items() if value is not None}
    found: list[FpidError] = []
    experiment = descriptions.build(table, Experiment, "", found)
    for fault in found:
        head = fault.name.split(".")[0] if isinstance(fault, ArgumentError) else ""
        if head in SIMULATION:
            fault = moved(fault, "simulation")
        elif path and getattr(own, head, None) is not None:
            fault = moved(fault, path)
        faults.append(fault)
    return experiment


def read_table(config: Config, path: str, kind: type[T], names: Mapping[str, Any]) -> T:
    """Return [tune] or [campaign]; `names` are the controllers that it names, by key."""
    faults: list[FpidError] = []
    table = descriptions.build(getattr(config, path), kind, path, faults)
    for key, name in names.items():
        try:
            checks.choice(f"{path}.{key}", name, config.controllers)
        except ArgumentError as error:
            faults.append(error)
    if faults:
        raise ConfigError.of(config.path, faults)
    return table  # type: ignore[no-any-return]


def moved(error: FpidError, path: str) -> FpidError:
    """Return an error with its argument's name under a table's path."""
    if isinstance(error, ArgumentError):
        return ArgumentError(f"{path}.{error.name}", error.expected, error.got)
    return error
