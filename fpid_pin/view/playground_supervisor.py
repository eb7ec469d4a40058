"""The supervisor of a playground: the description's, or one that its switch puts there."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.fpid_state import FpidState
from fpid_pin.control.supervisor import Supervisor
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.engine import horizon_of


def supervisor_of(e: Experiment, controller: AdaptiveFpid) -> Supervisor:
    """Return a law's supervisor; where it has none, the quiet one of a page's switch."""
    if controller.supervisor is not None:
        return controller.supervisor
    q, v, _ = e.motion(np.linspace(0.0, e.duration, 2001))
    bound = float(f"{1.01 * float(np.hypot(q, v).max()):.3g}")
    return Supervisor.quiet(m_x=float(f"{2.0 * bound + 1.0:.3g}"), reference_bound=bound)


def supervision(e: Experiment, controller: AdaptiveFpid) -> dict[str, Any]:
    """Return what the engine makes a supervisor's records from, whatever M_x and step."""
    s = supervisor_of(e, controller)
    law = dataclasses.replace(controller, supervisor=s)
    begun = FpidState([law], e.arm, e.step, horizon_of(e.duration))
    smallest = float(np.linalg.eigvalsh(s.p)[0])
    return {
        "p": [s.p[0, 0], s.p[0, 1], s.p[1, 1]], "k0": s.k0, "k1": s.k1, "kind": s.kind,
        "reference_bound": s.reference_bound, "half_smallest": 0.5 * smallest,
        "layer": s.boundary_layer, "own_gravity": s.gravity_bound is None,
        "lookahead": s.lookahead or 0.0, "target": s.target, "trigger": s.trigger,
        "observer": s.observer, "bound": s.bound(e.arm.n).tolist(),
        # As Python's own state has it at t = 0.
        "observing": int(begun.robots["observing"][0]),
        "predicted": (begun.joints["predicted"][0] / e.step).tolist(),
    }  # fmt: skip
