"""What a control law is: a frozen description, and one joint's arithmetic."""

import dataclasses
import math
from abc import ABC
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import Flag, FloatArray, Number, OneOf, PerJoint, Text, Whole, checked
from fpid_pin.control.loop import Loop
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.descriptions import Description
from fpid_pin.fractional import Design, ExponentialSum
from fpid_pin.kernels.records import GIVEN_NAMES
from fpid_pin.text import shown

#: What a law may take its signals to have been before t = 0: see `fpid_pin.fractional.Bank`.
INITIALISATIONS = ("caputo", "grunwald_letnikov")
#: Largest bandwidth of an observer, times the step. There what it estimates, once cancelled, still
#: bears two samples of delay that nobody told it of, or a model 5.7 times too heavy; from 1.4 on
#: two samples make it unstable. The noise of xi is 0.44 sigma/step there where that of speeds is
#: sigma, and 0.016 at 0.1.
FASTEST = 1.0


@dataclass(frozen=True)
class Operator(Description):
    """A fractional operator of one signal of a law, one for each joint.

    Parameters
    ----------
    order
        The law's field that holds the order, in [0, 1], or the order itself.
    of
        The signal: ``e``, another given number, or a number that the law remembers.
    sign
        1 or -1: whether the signal pushes the torque upwards or downwards where it is positive.
        An integral is held while the torque is cut and it would push further.
    adapts
        Whether the law changes the order while it runs, by its field's name; next to the output
        ``name`` it then has ``name_by_order``, the derivative of the output by the order, one
        sample old.
    """

    order: str | float
    of: Annotated[str, Text] = "e"
    sign: Annotated[int, Whole(low=-1, high=1)] = 1
    adapts: Annotated[bool, Flag] = False
    integrates: ClassVar[bool] = False


class Derivative(Operator):
    """D^mu of a signal, eq. (4) with a measured rate where the signal has one."""


class Integral(Operator):
    """I^lambda of a signal, that is D^(1 - lambda) of its integral."""

    integrates = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller(Description, ABC):
    """A control law and its parameters for one robot: a frozen dataclass (``eq=False``).

    A law of one's own has fields, and functions in one of three forms. CONTRIBUTING.md has an
    example of each.

    *Joint by joint*, which is compiled, tuned, exported to C99 and played in a page as the built-in
    ones are. ``c`` is one joint's record: the numbers that every law is given
    (`kernels.records.GIVEN`), the law's number fields, what it remembers and its operators'
    outputs.

        @dataclass(frozen=True, eq=False)
        class Damped(fp.Controller):
            kp: ArrayLike
            kd: ArrayLike

            @staticmethod
            def torque(c):
                return c.kp * c.e - c.kd * c.v

    ``surface(c)`` comes before it, for signals that operators or the model need; ``adapt(c)``
    after it, and not while a torque is held.

    *The whole robot*, compiled too: ``torques(joints, own, model)`` and ``adapts(joints, own,
    model)`` with all joints' records, the arrays of `arrays` and the model of
    `kernels.newton_euler`.

    *Plain Python*, for one robot: ``begin(state)`` and ``control(state, q, v, q_ref, v_ref,
    a_ref)``, which returns the torques, (n,).

    Effort limits, anti-windup of integrals, and what follows here, are the engine's for all laws.

    Parameters
    ----------
    scale
        Factor of the law's own torque: ``"none"`` (1, as in the paper), ``"inertia"`` (M_jj at the
        arm's home), or (n,).
    feedforward
        Whether the nominal model's torque for the reference, M q''_d + C q'_d + G + F_v q'_d, is
        added. Not for laws that ask the model themselves.
    observer
        Bandwidth [rad/s] of an observer that estimates and cancels what the nominal model lacks;
        0: none.
    supervisor
        None: no supervisory torque.
    name
        Name in tables and figures; if empty, the kind of law.

    Attributes
    ----------
    operators
        Fractional operators by the name of their output.
    memory
        Numbers that a joint remembers from tick to tick, 0 at first unless `numbers` has them.
    shown
        Numbers for the record, by the name that a run has for them. By default what is
        remembered.
    uses_model
        Whether the law has a model's part of its own, ``M c.a + C(q, v) c.w + G``, with a and w as
        `surface` writes them: 0 at first.
    estimates_model
        Whether that part is made of the law's own estimates of the bodies' inertia, m_hat, h0_hat
        to j22_hat, a joint's record having those of the body that it carries. ``adapt(c)`` then
        finds the derivatives of S . tau by them in ``c.by_m`` and so on.
    """

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
        checks.plain("name", self.name, str, "a text")
        if self.feedforward and self.uses_model:
            kind = type(self).__name__
            raise checks.ArgumentError("feedforward", f"none: {kind} has the model itself", True)
        _ = self.bandwidth  # refuses two observers that differ

    @property
    def bandwidth(self) -> float:
        """Of the one observer of law and supervisor [rad/s]; 0: none."""
        other = 0.0 if self.supervisor is None else self.supervisor.observer
        if self.observer and other and self.observer != other:
            raise checks.ArgumentError(
                "observer", f"the supervisor's bandwidth ({other:g} rad/s)", self.observer
            )
        return self.observer or other

    def observer_gains(self, step: float) -> tuple[float, float]:
        """Return the gains of the observer: see the function of this name."""
        return observer_gains(self.bandwidth, step)

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

    @property
    def fractional_initialisation(self) -> str:
        """What operators take their signals to have been before t = 0."""
        return str(getattr(self, "initialisation", "caputo"))

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
        if isinstance(self.scale, str):
            return np.ones(arm.n) if self.scale == "none" else np.diag(arm.mass_matrix(arm.home))
        return checks.per_joint("scale", self.scale, arm.n)

    def check_declared(self, numbers: Sequence[str]) -> None:
        """Check what the law declares, `numbers` being the names of its numbers.

        A name that is taken is refused: a field ``bandwidth`` would pass for the observer's.
        """
        own = [x.name for x in dataclasses.fields(self) if x.name not in _OPTIONS]
        for name in [*own, *numbers]:
            if name in GIVEN_NAMES or (name in own and hasattr(Controller, name)):
                raise checks.ArgumentError(name, "another name", f"{name}, which all laws have")
        checks.instance("memory", self.memory, (tuple, list), "a tuple of names")
        checks.instance("shown", self.shown, Mapping, "a dictionary of names")
        for name in self.memory:
            if not (isinstance(name, str) and name.isidentifier()):
                raise checks.ArgumentError("memory", "a tuple of names", shown(self.memory))
        taken = {*GIVEN_NAMES, *numbers, *self.memory}
        checks.instance("operators", self.operators, Mapping, "a dictionary of operators")
        for output, operator in self.operators.items():
            name = f"operators.{output}"
            checks.instance(name, operator, Operator, "a Derivative or an Integral")
            if output in taken:
                raise checks.ArgumentError(name, "a name of its own", f"{output}, which is taken")
            if operator.sign not in (1, -1):
                raise checks.ArgumentError(f"{name}.sign", "1 or -1", operator.sign)
            if operator.adapts and not isinstance(operator.order, str):
                raise checks.ArgumentError(name, "an order in a field, to adapt it", operator.order)
        if self.operators:
            design = getattr(self, "design", self.fractional_design)
            checks.instance("design", design, Design, "a fractional design")
            checks.choice("initialisation", self.fractional_initialisation, INITIALISATIONS)

    def begin(self, state: Any) -> None:
        """Prepare what a law in plain Python remembers; see `control.state.State`."""

    def on(self, arm: Arm, *, step: float = 1e-3) -> "Controller":
        """Return the law that this is on an arm: itself, unless its gains depend on the arm."""
        return self

    @checked
    def start(self, arm: Arm, *, step: float, horizon: float = 3600.0) -> Loop:
        """Start the law for one robot: a tick at a time, for any simulator or a real arm.

        Parameters
        ----------
        arm
            The nominal arm: its number of joints, model and effort limits.
        step
            Sampling period [s].
        horizon
            Longest time that the loop will run [s]; fractional memories are fitted for it.

        Returns
        -------
        Loop

        Raises
        ------
        ArgumentError, SimulationError
            What the law declares cannot be, or one of its functions, whose line is told.
        """
        # Imported late: it loads numba.
        from fpid_pin.control.state import State

        return Loop(lambda: State(self, arm, step=step, horizon=horizon), self)


_OPTIONS = {field.name for field in dataclasses.fields(Controller)}


def is_number(value: Any) -> bool:
    """Return whether a field holds numbers: a scalar or an array of them (truth is none)."""
    if isinstance(value, (tuple, list)):
        return len(value) > 0 and all(map(is_number, value))
    return isinstance(value, (int, float, np.ndarray, np.number)) and not isinstance(value, bool)


def observer_gains(bandwidth: float, step: float) -> tuple[float, float]:
    """Return the gains of `kernels.supervisor.correct_observer`; 0 for no bandwidth."""
    if bandwidth * step > FASTEST + 1e-9:
        expected = f"at most {FASTEST:g}/step ({FASTEST / step:g} rad/s)"
        raise checks.ArgumentError("observer", expected, f"{bandwidth:g} rad/s")
    pole = math.exp(-bandwidth * step)
    return 1.0 - pole**2, (1.0 - pole) ** 2 / step
