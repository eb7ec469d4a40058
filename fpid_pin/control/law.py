"""What a control law is: a frozen description, and one joint's arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fpid_pin.control.base import Law
from fpid_pin.control.operators import Derivative, Integral, Operator

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.loop import Loop


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller(Law):
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
        Bandwidth [rad/s] of an observer of what the nominal model lacks, whose estimate is
        cancelled; 0: none.
    supervisor
        None: no supervisory torque.
    name
        What tables and figures call it; the kind of law if empty.

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

    def on(self, arm: Arm, *, step: float = 1e-3, horizon: float = 3600.0) -> Controller:
        """Return the law that this is on an arm: itself, unless its gains depend on the arm."""
        return self

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
        """
        # Imported late: it loads numba.
        from fpid_pin.control.loop import Loop
        from fpid_pin.control.start import start_all

        return Loop(lambda: start_all([self], arm, step=step, horizon=horizon)[0], self)


__all__ = ["Controller", "Derivative", "Integral", "Operator"]
