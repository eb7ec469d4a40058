"""A disturbance observer: the speed of each joint, and the acceleration that the model lacks.

    v^ = v^- + (1 - p^2) (v - v^-),   xi += (1 - p)^2/h (v - v^-),   p = exp(-omega h)
    v^- of the next sample = v^ + h (a(q, v^, u) + xi)

Both error poles are p; a(q, v^, u) is the nominal model's acceleration over a step, viscous
friction implicit and of the measured speed, (M + h F_v) a = u - C v^ - G - F_v v. It is a
Luenberger observer of the speed with a constant disturbance as its second state, both poles placed
at p (Franklin, Powell and Workman, *Digital Control of Dynamic Systems*, 1998, section 8.2).
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel


@kernel(inline=True)
def correct_observer(robot, joints):
    """Correct v^ and xi by the measured speeds; without an observer v^ is what is measured."""
    for j in range(joints.size):
        c = joints[j]
        if robot.l1 == 0.0 or robot.ticks == 0:
            c.v_hat = c.v
        else:
            miss = c.v - c.predicted
            c.v_hat = c.predicted + robot.l1 * miss
            c.xi += robot.l2 * miss


@kernel(inline=True)
def predict(robot, joints, acceleration, change):
    """Say what speed the next sample should find.

    `acceleration` is the model's, (n,); `change` what a supervisor adds to it.
    """
    for j in range(joints.size):
        c = joints[j]
        c.predicted = c.v_hat + robot.h * (acceleration[j] + change[j] + c.xi)
