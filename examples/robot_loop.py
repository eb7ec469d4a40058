"""A robot that measures angles only, lists its joints in its own order, and calls when it can."""

import numpy as np
import pinocchio as pin

import fpid_pin as fp
from fpid_pin.control import EncoderRate, RobotLoop

STEP = 1e-3  # [s]


class FakeRobot:
    """A UR5 with 1 kg more than it says, 14-bit encoders, and a clock that jitters."""

    resolution = 2 * np.pi / 2**14  # [rad]

    def __init__(self, arm, q):
        self.joint_names = arm.joint_names[::-1]
        self.true = arm.with_payload(1.0)
        self.data = self.true.model.createData()
        self.q, self.v, self.clock = q.copy(), np.zeros_like(q), 0.0
        self.random = np.random.default_rng(0)

    def wait(self):
        """Wait for the next tick: jitter of 0.1 ms, and one in 200 never comes."""
        ticks = 1 + (self.random.random() < 1 / 200)
        self.clock += ticks * STEP
        return self.clock + abs(self.random.normal(0.0, 1e-4)), ticks

    def angles(self):
        rounded = self.resolution * np.round(self.q / self.resolution)
        return dict(zip(self.joint_names, rounded[::-1], strict=True))

    def give(self, torque, ticks):
        tau = np.array([torque[name] for name in self.true.joint_names])
        for _ in range(4 * ticks):  # the world moves on while the drives hold the torque
            a = pin.aba(self.true.model, self.data, self.q, self.v, tau)
            self.v = self.v + STEP / 4 * a
            self.q = self.q + STEP / 4 * self.v


arm = fp.Arm.from_example("ur5")
rate = EncoderRate(tau=0.001)
law = fp.suggest_gains(arm, bandwidth=20.0)
margin = fp.stability_report(arm, law, step=STEP).common_delay_margin
print(f"rates are {1e3 * rate.delay(STEP):.1f} ms late; the loop bears {1e3 * margin:.1f} ms")

# The drives hold the arm against gravity until the law takes over, softly.
robot = FakeRobot(arm, arm.home)
loop = RobotLoop(
    law.start(arm, step=STEP, horizon=10.0),
    joint_names=robot.joint_names,
    rate=rate,
    soft_start=0.2,
    hold=arm.gravity_vector(arm.home),
)
record = loop.record()
reference = fp.references.Quintic(arm.home, arm.home + 0.4, duration=2.0)
now, ticks = 0.0, 1
while now < 4.0:
    wanted = [part[0] for part in reference.sample(np.array([now]))]
    by_name = [dict(zip(arm.joint_names, part, strict=True)) for part in wanted]
    torque = loop.torque(robot.angles(), *by_name, now=now)
    now, ticks = robot.wait()
    robot.give(torque, ticks)

run = fp.Run.from_record(record, name="robot")
print(loop.ticks)
print(run)
worst, last = 1e3 * np.abs(run.error).max(), 1e3 * np.abs(run.error[-1]).max()
print(f"largest error {worst:.1f} mrad (the payload is felt first), at the end {last:.2f} mrad")
print(f"largest error of the tool {1e3 * run.tool_error.max():.1f} mm")
run.save("robot.npz")  # fpid-pin view robot.npz replays it
