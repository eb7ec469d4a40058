"""What descriptions, laws that start, loops and searches for gains refuse, each in a line."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from own_laws import JointGravity, JointPd, PythonFractional, PythonPd, own

import fpid_pin as fp
from fpid_pin.control import (
    Derivative,
    EncoderRate,
    Integral,
    RobotLoop,
    Safeguards,
    adapt_orders,
    certify_gains,
    gain_ceilings,
    suggest_gains,
    suggest_observer,
)
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional import L1, Crone, GrunwaldLetnikov

TWO, STEP, SHORT = fp.Arm.two_link(), 1e-3, fp.paper_experiment(duration=0.1)
ONE_NAME, TWO_NAME = TWO.joint_names
QUIET = fp.Supervisor.quiet(3.0, 1.0)
D = Derivative(0.5)


def paper(**changes):
    return dataclasses.replace(fp.paper_controller(supervised=False), **changes)


def start(law, step=STEP):
    return law.start(TWO, step=step)


def started(**changes):
    return start(paper(**changes))


def declared(**body):
    """Start a law of one's own that declares something."""
    return start(own(lambda c: c.e, **body))


def hiding(name):
    """Start a law with a field of a name that all laws have: it would be lost."""
    methods = {"torque": staticmethod(lambda c: c.e)}
    fields, bases = [(name, float, 3.0)], (fp.Controller,)
    return start(
        dataclasses.make_dataclass("Hiding", fields, bases=bases, namespace=methods, eq=False,
                                   frozen=True)()
    )  # fmt: skip


@dataclasses.dataclass(frozen=True, eq=False)
class Showing(PythonPd):
    """A law in Python with more for the record."""

    more: object = None

    def begin(self, state):
        state.shown.update(self.more)


def certified(**others):
    law = fp.AdaptiveFpid(100.0, 100.0, 20.0, scale="inertia")
    return certify_gains(TWO, dataclasses.replace(law, **others.pop("law", {})), **others)


THREE = dict.fromkeys(("kp", "ki", "kd", "integral_order", "derivative_order"), 1.0)
HAS_MODEL = "^feedforward: expected none: {} has the model itself, got True$"
BANDWIDTH = r"^observer: expected at most 1/step \(1000 rad/s\), got 2000 rad/s$"
# Each field's own check is in docs/configuration.md; that it acts, in tests/test_descriptions.py.
DESCRIPTIONS = [
    # Laws.
    (lambda: paper(kp=(1.0, np.nan)), "^kp.1: expected a number >= 0, got nan$"),
    (lambda: paper(design="crone"), "^design: expected a Design, got str$"),
    (lambda: paper(derivative_on="measurement", initialisation="grunwald_letnikov"),
     "^initialisation: expected caputo with derivative_on = measurement"),
    (lambda: paper(order_learning_rate=np.ones((3, 2))), r"\(2, n\), got shape \(3, 2\)$"),
    (lambda: paper(integral_order_bounds=(-0.1, 1.0)), r"^integral_order_bounds.0: .* got -0.1$"),
    (lambda: paper(derivative_order_bounds=(0.3, 1.2)), "^derivative_order_bounds.1: .* got 1.2$"),
    (lambda: paper(integral_order_bounds=(0.9, 0.2)), r"a lower and an upper bound, got \[0.9, 0"),
    (lambda: paper(derivative_order_bounds=0.5), "^derivative_order_bounds: expected a lower and"),
    (lambda: paper(derivative_order_bounds=(0.1, 0.5, 1.0)), "a lower and an upper bound"),
    (lambda: fp.SuggestedFpid(observer="fast"), "^observer: expected .*suggested"),
    (lambda: fp.SuggestedFpid(observer=-2.0), "^observer: expected a number >= 0, got -2$"),
    (lambda: fp.SuggestedFpid(order_learning_rate="fast"), "^order_learning_rate: .*suggested"),
    (lambda: fp.SuggestedFpid(scale="inertia"), "^scale: expected no scale .*, got 'inertia'$"),
    # Options of every law.
    (lambda: fp.ComputedTorque(feedforward=True), HAS_MODEL.format("ComputedTorque")),
    (lambda: fp.PdGravity(1.0, 1.0, feedforward=True), HAS_MODEL.format("PdGravity")),
    (lambda: JointGravity(1.0, 1.0, feedforward=True), HAS_MODEL.format("JointGravity")),
    (lambda: PythonPd(1.0, 1.0, supervisor=5.0), "^supervisor: expected a Supervisor or None, got"),
    (lambda: JointPd(1.0, 1.0, supervisor=QUIET, observer=50.0),
     r"^observer: expected the supervisor's bandwidth \(100 rad/s\), got 50.0$"),
    # What laws have, and what makes rates.
    (lambda: fp.Supervisor(1.0, 1.0), r"^supervisor.m_x: expected more than reference_bound \(1\)"),
    (lambda: fp.Supervisor(3.0, 1.0, weight=np.diag([1.0, -1.0])), "symmetric positive definite"),
    (lambda: Safeguards(5.0, 4.0), "^safeguards.minimum: expected at most safeguards.maximum, got"),
    (lambda: EncoderRate(turn=[1.0, -1.0]), "^turn.1: expected a number > 0, got -1$"),
]  # fmt: skip
STARTS = [
    (lambda: start(paper(), 0.0), "^step: expected a number > 0, got 0$"),
    (lambda: start(fp.AdaptiveFpid((1.0, 2.0, 3.0), 1.0, 1.0)),
     r"^kp: expected shape \(2,\) \(the arm has 2 joints\), got shape \(3,\)$"),
    (lambda: started(design=L1()), "^design: expected one with modes, got L1"),
    (lambda: started(order_learning_rate=np.ones((2, 3)), **THREE),
     r"^order_learning_rate: .*\(2,\) or \(2, 2\)"),
    (lambda: started(safeguards=Safeguards(maximum=np.ones(4)), **THREE),
     r"^safeguards.maximum: expected shape \(2,\) or"),
    # What sampling does not allow.
    (lambda: started(supervisor=fp.Supervisor(3.0, 1.0, lookahead=5e-4)),
     r"^supervisor.lookahead: expected at least the step \(0.001 s\), got 0.0005 s$"),
    (lambda: started(supervisor=fp.Supervisor.quiet(3.0, 1.0, observer=2000.0)), BANDWIDTH),
    (lambda: started(supervisor=fp.Supervisor(3.0, 1.0), observer=2000.0), BANDWIDTH),
    (lambda: start(JointPd(1.0, 1.0, observer=2000.0)), BANDWIDTH),
    (lambda: started(supervisor=fp.Supervisor(3.0, 1.0, (1.0, 1.0, 1.0))),
     r"disturbance_bound: expected shape \(2,\)"),
    # What a law of one's own declares.
    (lambda: declared(operators={"d": Derivative(0.5, of="nope")}),
     r"^operators.d: expected a signal \(.*\), got nope$"),
    (lambda: declared(operators={"d": Derivative("nope")}),
     "^operators.d: expected a field with its order, got nope$"),
    (lambda: declared(operators={"d": Derivative(1.5)}), r"^operators.d: .*\[0, 1\], got 1.5$"),
    (lambda: declared(operators={"d": Integral((0.5, -0.1))}), "^operators.d.1: .* got -0.1$"),
    (lambda: declared(operators={"d": Derivative("kp")}), r"^operators.d.*\[0, 1\], got 2$"),
    (lambda: declared(operators={"d": Derivative((0.1, 0.2, 0.3))}), r"expected shape \(2,\)"),
    (lambda: declared(operators={"d": Derivative(0.5, adapts=True)}),
     "^operators.d: expected an order in a field, to adapt it, got 0.5$"),
    (lambda: declared(operators={"d": Integral(0.5, of="s", sign=0)}),
     "^operators.d.sign: expected 1 or -1, got 0$"),
    (lambda: declared(operators={"d": 0.5}), "^operators.d: expected a Derivative or an Integral,"),
    (lambda: declared(operators=[D]), "^operators: expected a dictionary of operators"),
    (lambda: declared(operators={"kp": D}), "^operators.kp: .* got kp, which is taken$"),
    (lambda: declared(operators={"e": D}), "^operators.e: .* got e, which is taken$"),
    (lambda: declared(memory="rate"), "^memory: expected a tuple of names, got str$"),
    (lambda: declared(memory=("mean",)), r"^fields and memory: expected other names, got \['mean"),
    (lambda: declared(memory=("rate", 2)), r"^memory: expected .* of names, got \('rate', 2\)$"),
    (lambda: declared(memory=("a b",)), "^memory: expected a tuple of names"),
    (lambda: declared(shown=["kp"]), "^shown: expected a dictionary of names, got list$"),
    (lambda: start(Showing(1.0, 1.0, {"x": np.zeros(3)})), r"^shown.x: .*, got .*\(3,\)$"),
    (lambda: declared(arrays=lambda *_: np.zeros(3)), r"^arrays: expected shape \(rows, columns\)"),
    (lambda: declared(numbers=lambda *_: None), "^numbers: expected a dictionary of numbers, got"),
    (lambda: declared(operators={"d": D}, design="crone"), "^design: expected a fractional design"),
    (lambda: declared(shown={"x": "nope"}), "^shown.x: expected a number of the law, got nope$"),
    (lambda: declared(operators={"d": D}, design=L1()), "^design: expected one with modes, got L1"),
    (lambda: declared(operators={"d": D}, initialisation="riemann_liouville"),
     "^initialisation: expected one of caputo, grunwald_letnikov, got"),
    *((partial(hiding, name), f"^{name}: expected another name")
      for name in ("bandwidth", "limit", "q")),
    # A robot's joints.
    (lambda: RobotLoop(started(), joint_names=(ONE_NAME,)),
     f"^joint_names: expected each of .* once, got {TWO_NAME} 0 times$"),
    (lambda: RobotLoop(started(), joint_names=(ONE_NAME, TWO_NAME, ONE_NAME)),
     f"^joint_names: .* once, got {ONE_NAME} 2 times$"),
    (lambda: RobotLoop(started(), joint_names=(ONE_NAME, 1)), f"got {TWO_NAME} 0 times$"),
    (lambda: RobotLoop(started(), rate=EncoderRate(turn=[1.0, 1.0, 1.0])),
     r"^rate.turn: expected shape \(2,\) .* got shape"),
]  # fmt: skip
SEARCHES = [
    (lambda: suggest_gains(TWO, 0.0), "^bandwidth: expected a number > 0"),
    (lambda: gain_ceilings(TWO, fp.ComputedTorque()), "^controller: expected an AdaptiveFpid"),
    (lambda: suggest_observer(TWO, paper(), delay=-1), "^delay: expected a number >= 0, got -1$"),
    (lambda: suggest_observer(TWO, "fpid"), "^controller: expected a Controller"),
    (lambda: adapt_orders(fp.Pid(1.0, 0.0, 1.0), TWO),
     "^controller: expected an AdaptiveFpid, got Pid$"),
    (lambda: adapt_orders(paper(), TWO, speed=-1.0), "^speed: expected a number >= 0, got -1$"),
    (lambda: adapt_orders(paper(derivative_order=0.2), TWO),
     r"^derivative_order_bounds: .* got \[0.3, 0.2\]"),
    (lambda: certified(spread=0.0), "^spread: expected a gain above 0 that may move, got none$"),
    (lambda: certified(spread=-1.0), "^spread: "),
    (lambda: certified(poses=[[0.0, 0.0, 0.0]]),
     r"^poses: expected shape \(poses, 2\), got shape \(1, 3\)$"),
    (lambda: certified(step=0.0), "^step: expected a number > 0"),
    (lambda: certified(law={"order_learning_rate": 0.1}), "^controller: expected orders that stay"),
    (lambda: fp.stability_report(TWO, paper(design=GrunwaldLetnikov())),
     "^design: expected one with modes, got GrunwaldLetnikov"),
    # What cannot be linearised.
    (lambda: fp.stability_report(TWO, own(lambda c: 10.0 * c.e + (1.0 if c.e_dot > 0.0 else -1.0))),
     "smooth at rest, got a jump in Own"),
    (lambda: fp.stability_report(TWO, own(lambda c: 10.0 * abs(c.e))), "smooth at .* jump in Own"),
    (lambda: fp.stability_report(TWO, fp.SlidingMode(10.0, 5.0, 0.0)),
     "^controller: expected a law that is smooth at rest, got a jump in SlidingMode$"),
    (lambda: fp.stability_report(TWO, PythonFractional(100.0, 20.0)),
     "expected a law that declares its operators, got PythonFractional, whose torque depends on a "
     "past of its own, such as a Bank's$"),
]  # fmt: skip
# What functions are called with: in another order, of another kind, as text.
CALLS = [
    (lambda: fp.stability_report(paper(), TWO), "^arm: expected an Arm, got AdaptiveFpid$"),
    (lambda: suggest_gains(10.0), "^arm: expected an Arm, got float$"),
    (lambda: paper().start(fp.Arm, step=STEP), "^arm: expected an Arm, got the class Arm, not one"),
    (lambda: RobotLoop(started(), rate=0.01), "^rate: expected an EncoderRate, got float$"),
    (lambda: gain_ceilings(TWO, paper(), step="1 ms"), "^step: expected a number, got '1 ms'$"),
    (lambda: gain_ceilings(TWO, paper(), seed=-1), "^seed: expected a whole number >= 0, got -1$"),
    (lambda: fp.stability_report(TWO, paper(), step=1e300), r"^step: .* in \[1e-09, 10\], got"),
    (lambda: suggest_observer(TWO, paper(), delay=90.0), "^delay: expected a number <= 0.2, got 9"),
    (lambda: certified(spread=np.ones((2, 2))), r"^spread: expected shape \(n,\) or \(3, n\), got"),
    (lambda: certified(spread=np.ones(3)), r"^spread: expected shape \(2,\) or \(3, 2\), got .*3"),
    (lambda: fp.simulate(SHORT, paper(), progress=True), "^progress: expected a function, got b"),
    (lambda: fp.compare("a.toml", paper()), "^experiments: .* an Experiment or a dictionary"),
    (lambda: fp.evaluate(SHORT, paper(), 3), "^cost: expected a Cost, got int$"),
    (lambda: fp.evaluate(np.array(3), paper()), "^experiment: expected an Experiment, got ndarray"),
    (lambda: fp.export_c(paper(), TWO, STEP, None), "^folder: expected a path, got NoneType$"),
    (lambda: fp.Run.load(3), "^path: expected a path, got int$"),
    (lambda: fp.Run.from_arrays([0.0, 1.0], None, None, None, arm=TWO), "^q: expected numbers"),
    (lambda: fp.to_toml(SHORT, paper(), title=3), "^title: expected a text, got 3$"),
    (lambda: fp.paper_controller(supervised="no"), "^supervised: expected true or false, got 'no'"),
    (lambda: fp.Arm.from_example("ur5", lock=["x"]), "^lock: expected a dictionary, got list$"),
    (lambda: fp.Pid(1.0, 1.0, 1.0, name=3), "^name: expected a text, got 3$"),
    (lambda: fp.Pid(np.ma.array([1.0, 2.0], mask=[0, 1]), 1.0, 1.0), "^kp: expected numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "line"), DESCRIPTIONS + STARTS + SEARCHES + CALLS)
def test_what_cannot_be_is_refused_in_a_line(make, line):
    with pytest.raises(ArgumentError, match=line) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_what_is_taken_for_another_type_is_kept_as_the_declared_one():
    assert fp.Pid(1.0, 0.0, 1.0, feedforward=np.True_).feedforward is True
    with pytest.raises(TypeError, match=r"compare\(\) got an unexpected keyword .* 'metrics'"):
        fp.compare(SHORT, [paper()], metrics="tail")


def test_orders_that_move_want_shared_poles():
    line = "orders: expected a design with shared poles, got Crone"
    with pytest.raises(DesignError, match=line):
        declared(
            design=Crone(), operators={"d_e": Derivative("mu", adapts=True)},
            numbers=lambda self, arm, step, horizon: {"mu": 0.5},
        )  # fmt: skip


@pytest.mark.parametrize(
    "begin",
    [
        start,
        lambda law: fp.simulate(fp.paper_experiment(), law),
        lambda law: fp.evaluate(fp.paper_experiment(), [JointPd(1.0, 1.0), law]),
    ],
    ids=["loop", "simulation", "population"],
)
def test_a_field_of_the_wrong_length_is_named_wherever_its_law_starts(begin):
    with pytest.raises(ArgumentError, match=r"kp: expected shape \(2,\).* got .*3") as caught:
        begin(JointPd((1.0, 2.0, 3.0), 1.0))
    assert "\n" not in str(caught.value)
