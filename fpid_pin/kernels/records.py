"""What a controller and its plant are in memory: records, and all arrays of one robot."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np


def record_type(numbers: Iterable[str], integers: Iterable[str] = ()) -> np.dtype[Any]:
    """Return the type of a record, whose fields a kernel reads and writes by name.

    Names of real fields and of whole ones (counts and flags) are keys of tables that say what each
    is; several names in one key share a meaning. A name of a method of NumPy's records is refused.
    """
    fields: list[tuple[str, Any]] = [
        (name, kind)
        for keys, kind in ((numbers, np.float64), (integers, np.int64))
        for key in keys
        for name in key.split()
    ]
    taken = [name for name, _ in fields if hasattr(np.record, name)]
    if taken:
        raise ValueError(f"{taken}: without compilation these would be methods of a record")
    return np.dtype((np.record, fields))


#: A body and the joint that carries it, the joint's axis being z of its frame: constants.
BODY = record_type(
    {
        "x0 x1 x2": "x axis of the joint's frame at q = 0, in the frame of the body before",
        "y0 y1 y2": "its y axis",
        "z0 z1 z2": "its z axis, the joint's",
        "p0 p1 p2": "[m] its origin",
        "m": "[kg] mass",
        "h0 h1 h2": "[kg m] first moments, mass times centre of mass",
        "j00 j01 j02 j11 j12 j22": "[kg m^2] inertia about the frame's origin",
        "armature": "[kg m^2] rotor inertia at the joint",
    },
    {"slides": "whether the joint is prismatic"},
)
#: Where a body is and what it takes to move it with all that it carries, in world coordinates.
FRAME = record_type(
    {
        "x0 x1 x2 y0 y1 y2 z0 z1 z2": "axes",
        "o0 o1 o2": "[m] origin",
        "s0 s1 s2 r0 r1 r2": "what a unit of joint speed does, linear and angular",
        "v0 v1 v2 w0 w1 w2": "velocity, linear and angular",
        "a0 a1 a2 b0 b1 b2": "acceleration without joint accelerations",
        "m h0 h1 h2 j00 j01 j02 j11 j12 j22": "inertia of the body, then with all it carries",
        "f0 f1 f2 n0 n1 n2": "force and moment of the body, then with all it carries",
    }
)
#: Where a body is, in coordinates of the one before, and what inverse dynamics needs of it.
LINK = record_type(
    {
        "x0 x1 x2 y0 y1 y2 z0 z1 z2": "axes",
        "p0 p1 p2": "[m] origin",
        "a0 a1 a2 b0 b1 b2": "acceleration A, linear and angular",
        "f0 f1 f2 n0 n1 n2": "force and moment F, of the body, then with all it carries",
    }
)

#: What every law is given, a joint: the first numbers of each joint's record. The law's own follow.
GIVEN = record_type(
    {
        "h": "[s] sampling period",
        "t": "[s] time",
        "q": "[rad] measured angle",
        "v": "[rad/s] measured rate",
        "q_ref": "[rad] reference q_d",
        "v_ref": "[rad/s] its rate",
        "a_ref": "[rad/s^2] its acceleration",
        "e": "[rad] error q_d - q",
        "e_dot": "[rad/s] its rate",
        "int_e": "[rad s] its integral",
        "limit": "[N m] effort limit",
        "cut": "[N m] by how much the last torque was cut by the limit",
        "scale": "factor of the law's own torque",
        "s": "sliding surface S, (22), of a law that has one",
        "a": "[rad/s^2] acceleration that a law asks the model about",
        "w": "[rad/s] velocity that it asks about",
        "u_law": "[N m] the law's own torque, scaled",
        "u_model": "[N m] what the model adds to it",
        "u_s": "[N m] what the supervisor adds, (20)",
        "viscous": "[N m s/rad] F_v of the nominal arm",
        "bound": "[N m] d_u of the supervisor; in (20) d_u + G_u",
        "v_hat": "[rad/s] the observer's speed",
        "xi": "[rad/s^2] acceleration of unknown cause",
        "predicted": "[rad/s] speed that the next sample should find",
        "lyapunov": "V of (14), the same for all joints",
        # The ten inertial numbers of the body that the joint carries, in this order: see BODY.
        "m h0 h1 h2 j00 j01 j02 j11 j12 j22": "inertia of the nominal arm",
    }
)
GIVEN_NAMES = GIVEN.names or ()
#: Where these ten begin.
INERTIA = GIVEN_NAMES.index("m")
#: What a law that estimates the model has beside them: its estimates, and the derivatives of
#: S . tau by each of them.
ESTIMATES = tuple(f"{name}_hat" for name in GIVEN_NAMES[INERTIA:])
DERIVATIVES = tuple(f"by_{name}" for name in GIVEN_NAMES[INERTIA:])
ROBOT = record_type(
    {
        "h": "[s] sampling period",
        "p11 p12 p22": "P of (15)",
        "k0": "[1/s^2] of the supervisor's error dynamics (39)",
        "k1": "[1/s] of the same",
        "threshold": "V_M of (16) of the paper's supervisor; inf: none",
        "layer": "boundary layer of (20)",
        "lookahead": "[s] T of the sampled supervisor",
        "target": "V_T",
        "trigger": "V_on",
        "distance": "[rad/s^2] |z|, from the ball's centre",
        "radius": "[rad/s^2] r of the ball",
        "l1": "gain of the observer's speed",
        "l2": "[1/s] gain of the observer's acceleration",
    },
    {
        "ticks": "ticks so far",
        "acting": "whether the paper's supervisor acts in this tick",
        "correcting": "whether the sampled supervisor corrects the torque in this tick",
        "first_operators": "operators of given signals; the others follow the law's surface",
        "uses_model": "whether the model adds M a + C w + G of the law's a and w",
        "inertia": "column of the inertial numbers of that part",
        "estimates": "whether the law estimates them: derivatives are wanted",
        "feedforward": "whether the reference's torque is added",
        "observes": "whether an observer runs",
        "compensates": "whether what it finds is cancelled",
        "supervised": "whether V is watched",
        "paper": "whether the paper's supervisor is there",
        "sampled": "whether the sampled one is",
        "own_gravity": "whether G_u of (20) is |G(q)| of the model",
        "surface torque adapt": "address of the law's function; 0: none",
    },
)

#: Rows of a controller's `terms`: what the nominal model says in this tick, (n,) each [N m].
LAW_TERM, FEEDFORWARD, BIAS, GRAVITY, CORIOLIS = range(5)
#: Rows to work in: what the model makes of the torque; a change of it; and three for any use.
ACCELERATION, CHANGE, WORK, WORK_2, WORK_3 = range(5, 10)
TERMS = 10


#: Kinds of operators of a law: a derivative of a signal; the integral of the error; the integral of
#: another signal, which the operator sums up itself.
DERIVATIVE, INTEGRAL_OF_ERROR, INTEGRAL = range(3)

OPERATOR = record_type(
    {
        "order": "alpha of D^alpha, in [0, 1]",
        "c1": "weight of the newest rate f'_k",
        "c0": "weight of the rate before it, f'_(k-1)",
        "c2": "weight of m_k",
        "initial_mode": "what the modes hold of f(0) at t = 0",
        "initial_output": "output at t = 0 for each unit of f(0)",
        "sensitivity": "dD/dalpha, where the order varies",
        "previous_sensitivity": "the same one sample ago",
        "f_": "the signal one sample ago (operators of a law)",
        "rate_": "its rate one sample ago (operators of a law)",
        "total": "integral of the signal so far (kind INTEGRAL)",
        "sign": "1 or -1: which sign of the signal pushes the torque upwards",
    },
    {
        "row": "which row of the poles is its own",
        "kind": "DERIVATIVE, INTEGRAL_OF_ERROR or INTEGRAL",
        "source": "column of the signal in the law's numbers",
        "rate": "column of its rate; -1: not known, differences are taken",
        "output": "column of the result",
        "variable": "whether the order changes while the law runs",
        "order_column": "column of an order that the law itself moves; -1: none",
    },
)
POLE = record_type(
    {
        "decay": "E = exp(-p h)",
        "b1": "weight of f'_k in the mode",
        "b0": "weight of f'_(k-1)",
        "b2": "weight of m_k",
    }
)
MODE = record_type({"weight": "g, of the mode in the output", "x": "the mode's value"})


class Controller(NamedTuple):
    """All arrays of one robot's controller."""

    robot: Any  # ROBOT, (1,)
    joints: Any  # GIVEN, (n,): the first of `numbers`, by name
    numbers: Any  # (n, words): given numbers, then the law's own
    own: Any  # arrays of a law of the whole robot, (rows, columns)
    ops: Any  # OPERATOR, (n, operators)
    poles: Any  # POLE, (rows, modes)
    modes: Any  # MODE, (n, operators, modes)
    table: Any  # see `operator.variable_order_derivative`
    bodies: Any  # BODY, (n,): the nominal arm
    links: Any  # LINK, (n,), for inverse dynamics
    motions: Any  # velocities of the bodies, (3, n, 6), for inverse dynamics
    frames: Any  # FRAME, (n + 1,), for M
    gravity: Any  # (3,) [m/s^2]
    mass: Any  # the lower half of M, (n, n)
    factored: Any  # its factors, (n, n)
    terms: Any  # (TERMS, n): see above


PLANT = record_type(
    {
        "limit": "[N m] what the drives give at most",
        "viscous": "[N m s/rad] F_v",
        "push": "[N m] a torque from outside",
        "runaway": "[rad/s] speed beyond which a run is lost",
        "dry": "[N m] F_d",
        "friction": "[N m] dry friction's torque in the last step",
    },
    {"stuck": "whether the joint sticks"},
)


#: Rows of a plant's workspace before its matrices.
WORKSPACE = 3


class Plant(NamedTuple):
    """All arrays of one robot's true arm."""

    joints: Any  # PLANT, (n,)
    q: Any  # angles, (n,)
    v: Any  # rates, (n,)
    a: Any  # accelerations, (n,)
    tau: Any  # torques on the arm, (n,)
    bodies: Any  # BODY, (n,); friction's h F_v is part of the rotor inertias
    frames: Any  # FRAME, (n + 1,)
    gravity: Any  # (3,) [m/s^2]
    mass: Any  # the lower half of M, or its factors, (n, n)
    #: (WORKSPACE + 2 n + stages, n): for friction, its two matrices, and the stages of the
    #: integrator, none for semi-implicit Euler.
    workspace: Any


SENSOR = record_type(
    {
        "noise_q": "[rad] standard deviation of the angle's noise",
        "noise_v": "[rad/s] of the rate's noise",
        "bias": "[rad/s] the rate's constant error",
        "resolution": "[rad] encoder step; 0: none",
        "keep": "what a filter of differences keeps a sample",
        "gain": "[1/s] what it takes of a difference",
        "filtered": "[rad/s] its state",
        "last": "[rad] the last angle",
    },
    {
        "delay": "how many samples everything is late",
        "derived": "whether the rate is the filter's",
    },
)
MEASURE = record_type(
    {
        "limit": "[N m] of the torque, the least of law's and drives'",
        "band": "[rad] within which the error counts as settled",
        "square": "sum of e^2",
        "late": "sum of e^2 of the planned last half",
        "absolute": "sum of |e|",
        "aged": "sum of t |e|",
        "effort": "sum of u^2",
        "changes": "sum of |u_k - u_(k-1)|",
        "jumps": "sum of (u_k - u_(k-1))^2",
        "peak": "[N m] largest |u|",
        "last": "[N m] the last u",
        "start": "[rad] the first e",
        "worst": "[rad] largest |e|",
        "beyond": "[rad] largest e on the side opposite to the first",
    },
    {
        "rows": "how many rows there were",
        "late_rows": "how many of the planned last half",
        "settled": "number of the row from which on |e| stayed within the band",
        "at_limit": "rows whose torque is at its limit",
    },
)


class Sensing(NamedTuple):
    """A robot's sensors."""

    joints: Any  # SENSOR, (n,); none: what is measured is exact
    history: Any  # a ring of true values, (depth, 2, n)
    noise: Any  # white noise, (K, 2, n); a tick's row is taken modulo K


class Rows(NamedTuple):
    """What a robot is given and what is kept of it, K rows."""

    reference: Any  # q_d, its rate and acceleration, (3, K, n)
    forces: Any  # the disturbance d(t), (parts of the step, K, n)
    motion: Any  # q, q' and the torque that the drives gave, (3, K, n)
    columns: Any  # which columns of the controller's numbers are kept, (signals,)
    kept: Any  # they, (signals, K, n)
    sums: Any  # figures of merit, MEASURE (n,); none: they are not wanted
