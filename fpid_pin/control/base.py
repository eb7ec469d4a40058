"""What the engine asks of a control law: its options, numbers, operators and functions."""

from __future__ import annotations

import dataclasses
from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import Flag, FloatArray, Number, OneOf, PerJoint
from fpid_pin.control.operators import Operator
from fpid_pin.control.parameters import is_number
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.descriptions import Description
from fpid_pin.fractional import Design, ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@dataclass(frozen=True, eq=False, kw_only=True)
class Law(Description, ABC):
    """A control law as the engine knows it. Users write a `Controller`, which says what is what."""

    memory: ClassVar[tuple[str, ...]] = ()
    uses_model: ClassVar[bool] = False
    estimates_model: ClassVar[bool] = False
    surface: ClassVar[Any] = None
    torque: ClassVar[Any] = None
    adapt: ClassVar[Any] = None
    torques: ClassVar[Any] = None
    adapts: ClassVar[Any] = None
    control: ClassVar[Any] = None

    scale: Annotated[str | ArrayLike, OneOf("none", "inertia"), PerJoint(above=0.0)] = "none"
    feedforward: Annotated[bool, Flag] = False
    observer: Annotated[float, Number("rad/s", low=0.0)] = 0.0
    supervisor: Supervisor | None = None
    name: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.feedforward and self.uses_model:
            kind = type(self).__name__
            raise checks.ArgumentError("feedforward", f"none: {kind} has the model itself", True)
        _ = self.bandwidth  # refuses two observers that differ

    def check_fields(self) -> None:
        """Refuse a field of a law of one's own that hides something that all laws have.

        A field ``bandwidth`` would be taken for the observer's.
        """
        for field in dataclasses.fields(self):
            if field.name in _TAKEN:
                raise checks.ArgumentError(field.name, "another name", "one that all laws have")

    @property
    def bandwidth(self) -> float:
        """Of the one observer of law and supervisor [rad/s]; 0: none.

        Raises
        ------
        ArgumentError
            The two ask for different ones.
        """
        other = 0.0 if self.supervisor is None else self.supervisor.observer
        if self.observer and other and self.observer != other:
            raise checks.ArgumentError(
                "observer", f"the supervisor's bandwidth ({other:g} rad/s)", self.observer
            )
        return self.observer or other

    # ------------------------------------------------------------- what the engine asks

    @property
    def operators(self) -> Mapping[str, Operator]:
        """Fractional operators, by the name of their output."""
        return {}

    @property
    def shown(self) -> Mapping[str, str]:
        """Numbers for the record, by the name that a run has for them."""
        return {name: name for name in self.memory}

    @property
    def fractional_design(self) -> Design:
        """How the operators are realised."""
        design = getattr(self, "design", None)
        return design if isinstance(design, Design) else ExponentialSum(modes=24)

    def numbers(self, arm: Arm, step: float, horizon: float) -> Mapping[str, ArrayLike]:
        """Return the law's numbers on an arm at the start, by name, each a scalar or (n,).

        By default all fields that are numbers. `scale` is the engine's.
        """
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name not in _OPTIONS and is_number(getattr(self, field.name))
        }

    def arrays(self, arm: Arm, step: float, horizon: float) -> FloatArray:
        """Return the arrays of a law of the whole robot at the start, (rows, columns)."""
        return np.zeros((0, 0))

    def scale_on(self, arm: Arm) -> FloatArray:
        """Return the factor of the law's own torque on each joint of an arm, (n,)."""
        if isinstance(self.scale, str) and self.scale == "none":
            return np.ones(arm.n)
        if isinstance(self.scale, str):
            return np.diag(arm.mass_matrix(arm.home)).copy()
        return checks.per_joint("scale", self.scale, arm.n)

    def begin(self, state: Any) -> None:
        """Prepare what a law in plain Python remembers; see `control.state.State`."""

    def on(self, arm: Arm, *, step: float, horizon: float = 3600.0) -> Law:
        """Return the law that this is on an arm."""
        return self


_OPTIONS = {field.name for field in dataclasses.fields(Law)}
#: What a law of one's own cannot have a field for.
_TAKEN = {name for name in dir(Law) if name not in _OPTIONS} | {"start"}
