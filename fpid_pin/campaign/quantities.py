"""What of an experiment can be uncertain, and an experiment with other values of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.disturbances import Cosine
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment, Plant, Sensors


@dataclass(frozen=True)
class Quantity:
    """A key of ``[campaign.uncertain]``.

    Attributes
    ----------
    unit
        Of its values.
    each
        ``"link"`` or ``"joint"`` where there is one number for each, ``""`` where there is one.
    low, above
        Least value, or what it has to be more than; -inf: any.
    whole
        Whether values are rounded to whole numbers.
    """

    unit: str
    each: str = "joint"
    low: float = -np.inf
    above: float = -np.inf
    whole: bool = False


#: By key. Masses and inertias are factors of the nominal ones, all else takes the nominal's place.
QUANTITIES = {
    "mass": Quantity("1", "link", above=0.0),
    "inertia": Quantity("1", "link", above=0.0),
    "payload": Quantity("kg", "", low=0.0),
    "viscous_friction": Quantity("N m s/rad", low=0.0),
    "dry_friction": Quantity("N m", low=0.0),
    "disturbance_amplitude": Quantity("N m"),
    "disturbance_frequency": Quantity("rad/s", low=0.0),
    "disturbance_phase": Quantity("rad"),
    "position_noise": Quantity("rad", low=0.0),
    "velocity_noise": Quantity("rad/s", low=0.0),
    "delay": Quantity("samples", "", low=0.0, whole=True),
    "q0": Quantity("rad"),
    "v0": Quantity("rad/s"),
    "reference_amplitude": Quantity("rad"),
    "reference_frequency": Quantity("rad/s", low=0.0),
    "reference_phase": Quantity("rad"),
}
_REFERENCE = "reference_"
_DISTURBANCE = "disturbance_"


def require_possible(experiment: Experiment, key: str) -> None:
    """Refuse a quantity that the experiment does not have.

    Raises
    ------
    ArgumentError
        A reference without such a number, or a disturbance that is no cosine.
    """
    if key.startswith(_REFERENCE):
        name = key.removeprefix(_REFERENCE)
        reference: Any = experiment.reference
        fields = dataclasses.fields(reference) if dataclasses.is_dataclass(reference) else ()
        if name not in {field.name for field in fields}:
            kind = getattr(type(reference), "_kind", type(reference).__name__)
            raise ArgumentError(key, f"a reference with {name} (a sinusoid)", kind)
    elif key.startswith(_DISTURBANCE):
        plant = experiment.plant or Plant()
        if not isinstance(plant.disturbance, Cosine):
            kind = getattr(type(plant.disturbance), "_kind", "none")
            raise ArgumentError(key, "one [[disturbance]] of kind cosine", kind)


def varied(nominal: Experiment, values: Mapping[str, FloatArray], seed: int) -> Experiment:
    """Return an experiment with other true values; what the controller believes in stays.

    Parameters
    ----------
    nominal
        With what is not varied.
    values
        By the keys of `QUANTITIES`, (1,) or (n,).
    seed
        Of its sensors' noise.

    Raises
    ------
    FpidError
        Values that together are none of an experiment.
    """
    value = {key: numbers if len(numbers) > 1 else numbers[0] for key, numbers in values.items()}
    parts: dict[str, Any] = {"plant": _plant(nominal, value), "seed": seed}
    sensed = _some(value, "position_noise", "velocity_noise")
    if "delay" in value:
        sensed["delay"] = int(value["delay"])
    if sensed:
        parts["sensors"] = dataclasses.replace(nominal.sensors or Sensors(), **sensed)
    moved = _under(value, _REFERENCE)
    if moved:
        reference: Any = nominal.reference
        parts["reference"] = dataclasses.replace(reference, **moved)
    return dataclasses.replace(nominal, **parts, **_some(value, "q0", "v0"))


def _plant(nominal: Experiment, value: Mapping[str, Any]) -> Plant:
    plant = nominal.plant or Plant()
    changed = _some(value, "viscous_friction", "dry_friction")
    arm = nominal.arm if plant.arm is None else plant.arm
    carried: list[dict[str, Any]] = []
    scaled = _some(value, "mass", "inertia")
    if scaled:
        carried.append({"scaled_links": scaled})
    if "payload" in value:
        carried.append({"payload": {"mass": float(value["payload"])}})
    if carried:
        changed["arm"] = arm.with_changes(*carried)
    pushed = _under(value, _DISTURBANCE)
    if pushed:
        disturbance: Any = plant.disturbance
        changed["disturbance"] = dataclasses.replace(disturbance, **pushed)
    return dataclasses.replace(plant, **changed) if changed else plant


def _some(value: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value[key] for key in keys if key in value}


def _under(value: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    return {key.removeprefix(prefix): v for key, v in value.items() if key.startswith(prefix)}
