"""The loop in MuJoCo (pip install fpid_pin[mujoco]): its model, its physics, our law."""

import mujoco
import numpy as np

import fpid_pin as fp

MODEL = """<mujoco><compiler angle="radian"/><option timestep="0.001"/><worldbody>
  <body pos="0 0 1"><joint name="shoulder" axis="0 1 0" damping="0.1"/>
    <geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="2"/>
    <body pos=".4 0 0"><joint name="elbow" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/>
  </body></body></worldbody>
  <actuator><motor joint="shoulder" ctrlrange="-40 40"/><motor joint="elbow" ctrlrange="-15 15"/>
  </actuator></mujoco>"""

with open("arm.xml", "w") as file:
    file.write(MODEL)
arm = fp.Arm.from_mjcf("arm.xml")
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)

law = fp.suggest_gains(arm, bandwidth=15.0, feedforward=True, observer="suggested")
loop = law.start(arm, step=1e-3, horizon=4.0)
reference = fp.references.Quintic((0.0, 0.0), (0.8, -0.6), duration=2.0)
worst = 0.0
for q_ref, v_ref, a_ref in zip(*reference.sample(1e-3 * np.arange(4000)), strict=True):
    data.ctrl[:] = loop.torque(data.qpos, data.qvel, q_ref, v_ref, a_ref)
    mujoco.mj_step(model, data)
    worst = max(worst, np.abs(q_ref - data.qpos).max())
print(f"effort limits as MuJoCo has them: {arm.effort_limit} N m")
last = np.abs(q_ref - data.qpos).max()
print(f"largest error {1e3 * worst:.1f} mrad, at the end {1e3 * last:.2f} mrad")
