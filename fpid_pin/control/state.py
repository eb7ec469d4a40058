"""What changes while a law runs on one robot: numbers of its joints, operators, model, torque."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.arms.rigid_body import inertial_numbers
from fpid_pin.checks import FloatArray
from fpid_pin.control.functions import Model, address_of, check_in_python
from fpid_pin.exceptions import ArgumentError, DesignError, SimulationError
from fpid_pin.fractional import Bank, Design
from fpid_pin.fractional.design import Records, modes_of
from fpid_pin.kernels import records
from fpid_pin.kernels.compiled import entry_point
from fpid_pin.kernels.tick import tick_parts
from fpid_pin.text import shown

#: Rates of given signals.
RATES = {"e": "e_dot", "int_e": "e", "q": "v", "q_ref": "v_ref", "v_ref": "a_ref"}
#: Parts of a tick, for `kernels.tick.tick_parts`.
SIGNALS, MODEL, TORQUES, ADAPT = 1, 2, 4, 8
#: Orders at which the table is laid out that orders which vary are interpolated in: a cubic on this
#: grid is within 1e-7 of the operator, as the operator of 24 modes is of the exact one.
NODES = 201
#: Signals that are there before a law's surface, and so operators of them.
EARLY = {*records.GIVEN_NAMES} - {"s", "a", "w"}


@lru_cache(maxsize=256)
def _record(own: tuple[str, ...]) -> Any:
    return records.record_type(dict.fromkeys((*records.GIVEN_NAMES, *own), ""))


@lru_cache(maxsize=8)
def _order_table(design: Design, step: float, horizon: float) -> FloatArray:
    """Return the table of `kernels.operator.variable_order_derivative`."""
    nodes = np.linspace(0.0, 1.0, NODES)
    return np.ascontiguousarray(modes_of(design, nodes, step=step, horizon=horizon).table())


@lru_cache(maxsize=64)
def _operators(
    design: Design, initialisation: str, orders: bytes, n: int, step: float, horizon: float
) -> Records:
    """Return the records of operators for n joints; most populations have the same ones."""
    alpha = np.frombuffer(orders).reshape(n, -1)
    return modes_of(design, alpha, step=step, horizon=horizon).records(initialisation)


class State:
    """One robot under one law, for the longest time that it will run, `horizon` [s].

    `design` is for the law's fractional operators, in place of its own.
    `c` are all arrays of the controller, `joints` a record of each joint by name, (n,); `inputs`,
    (5, n), are q, v, and the reference's q, v, a of a tick, `torque`, (n,) [N m], what it makes of
    them. A law in plain Python has `memory`, and `shown` for signals to record, (n,) arrays.
    """

    def __init__(
        self, controller: Any, arm: Arm, *, step: float, horizon: float,
        design: Design | None = None,
    ) -> None:  # fmt: skip
        self.step = checks.sampling_step(step)
        controller = controller.on(arm, step=step)
        self.controller, self.arm, self.n = controller, arm, arm.n
        self.design = design or controller.fractional_design
        self.horizon, n = horizon, arm.n
        given = controller.numbers(arm, step, horizon)
        checks.instance("numbers", given, Mapping, "a dictionary of numbers")
        own = np.asarray(controller.arrays(arm, step, horizon), dtype=np.float64)
        if own.ndim != 2:
            raise ArgumentError("arrays", "shape (rows, columns)", f"shape {own.shape}")
        controller.check_declared(list(given))
        # Operators of given signals come first; the others follow the law's surface.
        self._operators = sorted(controller.operators.items(), key=lambda x: x[1].of not in EARLY)
        names = [*records.ESTIMATES, *records.DERIVATIVES] if controller.estimates_model else []
        names += [*given, *controller.memory]
        for output, operator in self._operators:
            names += [output, f"{output}_by_order"] if operator.adapts else [output]
        try:
            self.record = _record(tuple(names))
        except ValueError as error:
            raise ArgumentError("fields and memory", "other names", str(error)) from None
        self._columns = {name: k for k, name in enumerate(self.record.names)}
        for name, field in controller.shown.items():
            if field not in self._columns:
                raise ArgumentError(f"shown.{name}", "a number of the law", field)
        numbers = np.zeros((n, len(self.record.names)))
        self.joints = numbers.view(self.record)[:, 0]
        numbers[:, records.INERTIA : records.INERTIA + 10] = inertial_numbers(arm.bodies)
        for name, value in given.items():
            try:
                self.joints[name] = value
            except ValueError:
                self.joints[name] = checks.per_joint(name, value, n)
        self.joints["h"], self.joints["limit"] = self.step, arm.effort_limit
        self.joints["viscous"] = arm.viscous_friction
        self.joints["scale"] = controller.scale_on(arm)
        zeros = np.zeros
        self.c = records.Controller(
            robot=zeros(1, records.ROBOT),
            joints=np.ndarray((n,), records.GIVEN, buffer=numbers, strides=numbers.strides[:1]),
            numbers=numbers,
            own=np.array(own, order="C"),
            ops=zeros((n, 0), records.OPERATOR),
            poles=zeros((1, 0), records.POLE),
            modes=zeros((n, 0, 0), records.MODE),
            table=zeros((0, 4)),
            bodies=arm.bodies.copy(),
            links=zeros(n, records.LINK),
            motions=zeros((3, n, 6)),
            frames=zeros(n + 1, records.FRAME),
            gravity=np.array(arm.model.gravity.linear),
            mass=zeros((n, n)),
            factored=zeros((n, n)),
            terms=zeros((records.TERMS, n)),
        )
        self.inputs: FloatArray = zeros((5, n))
        self.torque: FloatArray = zeros(n)
        self.memory: dict[str, Any] = {}
        self.shown: dict[str, FloatArray] = {}
        self._ticked = False
        self._step: Any = None
        self.orders = self._initial_orders()
        if self.orders.size:
            self._fit_operators()
        self._fill_robot()
        self.in_python = controller.control is not None
        if self.in_python:
            controller.begin(self)
        else:
            self._bind()
        for name, array in self.shown.items():
            if np.shape(array) not in ((n,), ()):
                raise ArgumentError(f"shown.{name}", f"shape ({n},)", f"shape {np.shape(array)}")

    # ------------------------------------------------------------------ at the start

    def _fill_robot(self) -> None:
        law, robot = self.controller, self.c.robot
        robot["h"], robot["threshold"] = self.step, np.inf
        robot["feedforward"] = law.feedforward
        robot["uses_model"] = law.uses_model and law.torques is None
        robot["inertia"], robot["estimates"] = records.INERTIA, law.estimates_model
        if law.estimates_model:
            robot["inertia"] = self._columns[records.ESTIMATES[0]]
        robot["observes"], robot["compensates"] = law.bandwidth > 0.0, law.observer > 0.0
        if law.bandwidth:
            robot["l1"], robot["l2"] = law.observer_gains(self.step)
        guard = law.supervisor
        if guard is not None:
            robot["supervised"], robot[guard.kind] = 1, 1
            self.joints["bound"] = guard.bound(self.n)
            for name, value in guard.constants(self.step).items():
                robot[name] = value
            if not law.bandwidth:
                guard.warn(self.arm, self.step)

    def _bind(self) -> None:
        """Find the law's functions, try those of a user's on copies, and note their addresses."""
        law, c, kind = self.controller, self.c, type(self.controller).__name__
        if law.torques is None and law.torque is None and law.surface is None:
            raise SimulationError(
                f"{kind}: expected functions (torque, or torques, or control), got none of them"
            )
        roles = {"surface": "joint", "torque": "torque", "adapt": "joint"}
        if law.torques is not None:
            roles = {"torques": "robot", "adapts": "robot"}
        for name, role in roles.items():
            function = getattr(law, name)
            if function is None:
                continue
            joints = self.joints.copy()
            joints["e"], joints["e_dot"] = 0.1, -0.1
            calls: list[tuple[Any, ...]] = [(joint,) for joint in joints]
            if role == "robot":
                model = Model(c.bodies, c.links.copy(), c.motions.copy(), c.gravity)
                calls = [(joints, c.own.copy(), model)]
            check_in_python(function, role, calls, who=f"{kind}.{name}")
            address = address_of(function, self.record, role, columns=c.own.shape[1])
            c.robot[name.rstrip("s")] = address

    def _initial_orders(self) -> FloatArray:
        """Return the orders alpha of the law's operators, (n, operators), each checked."""
        orders: FloatArray = np.zeros((self.n, len(self._operators)))
        for i, (output, operator) in enumerate(self._operators):
            name = f"operators.{output}"
            order: Any = operator.order
            if isinstance(order, str):
                if order not in self._columns:
                    raise ArgumentError(name, "a field with its order", order)
                order = self.joints[order]
            order = checks.per_joint(name, order, self.n, low=0.0, high=1.0)
            orders[:, i] = 1.0 - order if operator.integrates else order
            if operator.of not in self._columns:
                known = ", ".join(self.record.names)
                raise ArgumentError(name, f"a signal ({known})", operator.of)
        self.c.robot["first_operators"] = sum(x.of in EARLY for _, x in self._operators)
        return orders

    def _fit_operators(self) -> None:
        """Make the operators' records, which know where in a joint's record their signals are."""
        start, grid = self.controller.fractional_initialisation, (self.step, self.horizon)
        fitted = _operators(self.design, start, self.orders.tobytes(), self.n, *grid)
        ops, poles, modes = (part.copy() for part in fitted)
        table, columns = np.zeros((3 + modes.shape[-1], 4)), self._columns
        ops["kind"], ops["order_column"] = records.DERIVATIVE, -1
        for i, (output, operator) in enumerate(self._operators):
            column = ops[:, i]  # a view
            column["source"], column["output"] = columns[operator.of], columns[output]
            column["rate"] = columns[RATES[operator.of]] if operator.of in RATES else -1
            column["sign"] = operator.sign
            if operator.integrates:
                column["kind"] = records.INTEGRAL
                if operator.of == "e":
                    column["kind"] = records.INTEGRAL_OF_ERROR
                    column["source"], column["rate"] = columns["int_e"], columns["e"]
            if operator.adapts:
                if len(poles) > 1:
                    kind = type(self.design).__name__
                    raise DesignError(f"orders: expected a design with shared poles, got {kind}")
                column["variable"], column["order_column"] = 1, columns[str(operator.order)]
                table = _order_table(self.design, *grid)
        self.c = self.c._replace(ops=ops, poles=poles, modes=modes, table=table)

    # ------------------------------------------------------------------------- a tick

    def prepare(self) -> None:
        """Compile what is yet to be compiled, so that no tick has to wait for it."""
        self._step = entry_point(tick_parts, self.c, self.inputs, self.torque, 0)

    def make(self, parts: int) -> None:
        """Make parts of a tick: a sum of `SIGNALS`, `MODEL`, `TORQUES`, `ADAPT`."""
        if self._step is None:
            self.prepare()
        self._step(self.c, self.inputs, self.torque, parts)

    def tick(self, model: Callable[["State"], None] | None = None) -> None:
        """Advance by one tick: from `inputs` to `torque`.

        `model` writes what the nominal model says (`kernels.tick.evaluate_model`); None: the
        compiled one. A law in plain Python that raises, or returns no (n,) numbers, is a
        SimulationError.
        """
        # Gains move by the signals of the last tick, so that until then they are those that made
        # its torque.
        first = (ADAPT if self._ticked else 0) | SIGNALS
        self._ticked = True
        if model is None and not self.in_python:
            self.make(first | MODEL | TORQUES)
            return
        self.make(first if model is not None else first | MODEL)
        if model is not None:
            model(self)
        if self.in_python:
            self.ask_python()
        self.make(TORQUES)

    def ask_python(self) -> None:
        """Have a law in plain Python say its torques."""
        law = self.controller
        try:
            asked = np.asarray(law.control(self, *self.inputs.copy()))
        except Exception as error:
            name = type(error).__name__
            raise SimulationError(f"the law raised {name}: {error}") from error
        if asked.shape != (self.n,) or asked.dtype.kind not in "fiu":
            got = asked.shape if asked.dtype.kind in "fiu" else shown(asked.tolist())
            raise SimulationError(f"the law's torque: expected shape ({self.n},), got {got}")
        self.joints["u_law"] = self.joints["scale"] * asked

    def signals(self) -> Mapping[str, Any]:
        """Return live views of what a record should hold beside the torque, (n,) or scalars."""
        found: dict[str, Any] = {}
        for name, field in self.controller.shown.items():
            found[name] = self.joints[field]
            if field == "lyapunov":
                found[name] = found[name][:1].reshape(())
        return found | self.shown

    def columns(self, names: Sequence[str]) -> Any:
        """Return which columns of the numbers hold some signals, (names,)."""
        fields = self.controller.shown
        return np.array([self._columns[fields[name]] for name in names], dtype=np.int64)

    # ----------------------------------------------------------- for laws in plain Python

    @property
    def int_e(self) -> FloatArray:
        """Int e so far, held where the effort limit would wind it up, (n,) [rad s]."""
        return self.joints["int_e"]  # type: ignore[no-any-return]

    @property
    def cut(self) -> FloatArray:
        """By how much the last torque was cut by the effort limit, (n,) [N m]."""
        return self.joints["cut"]  # type: ignore[no-any-return]

    def operator(self, order: ArrayLike, *, rate: str = "measured") -> Bank:
        """Return a streaming fractional derivative of (n,) signals: see `fractional.Bank`."""
        orders = checks.per_joint("order", order, self.n)
        return Bank(self.design, orders, step=self.step, horizon=self.horizon, rate=rate)
