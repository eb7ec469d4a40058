"""One tick at a time: the controller in a simulator (or on a robot) of your own."""

import numpy as np
import pinocchio as pin

import fpid_pin as fp

arm = fp.Arm.two_link()
step = 1e-3  # [s]
loop = fp.paper_controller().start(arm, step=step, horizon=2.0)

data = arm.model.createData()
q, v = np.array([0.0, 0.35]), np.array([-0.2, 0.5])  # [rad], [rad/s]
for k in range(2000):
    t = k * step
    tau = loop.torque(q, v, np.sin([t, t]), np.cos([t, t]), -np.sin([t, t]))
    v = v + step * pin.aba(arm.model, data, q, v, tau)
    q = q + step * v
print("error after 2 s [rad]:", np.round(np.sin(2.0) - q, 3))
print("gains Kd now:", np.round(loop.signals()["kd"], 1))
