"""Robots as texts: URDFs piece by piece, and an MJCF arm as people write it."""

LIMIT = '<limit lower="-2" upper="1" effort="10" velocity="3"/>'


def link(name, mass=1.0, inertia=0.1, visual="", com=""):
    """Return a link with one moment of inertia about all axes, or one about each [kg m^2]."""
    about = inertia if isinstance(inertia, tuple) else (inertia,) * 3
    moments = " ".join(f'i{x}{x}="{i}"' for x, i in zip("xyz", about, strict=True))
    origin = f'<origin xyz="{com}"/>' if com else ""
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>{visual}</link>'
    )


def joint(name, parent, child, kind="revolute", extra=LIMIT, axis="0 1 0", origin="0.3 0 0"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{origin}"/><axis xyz="{axis}"/>{extra}</joint>'
    )


def robot(*parts):
    return f'<robot name="made">{"".join(parts)}</robot>'


def write(folder, text, name="arm.urdf"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


#: A hinge, a slide along an oblique axis, a hinge with an inertia at an angle; angles in degrees.
LIFTER = """<mujoco model="lifter">
  <option gravity="0 0.5 -9.7"/>
  <default>
    <joint damping="0.4"/>
    <default class="strong"><motor ctrlrange="-4 4" gear="10"/></default>
    <general forcerange="-7 7"/>
  </default>
  <worldbody>
    <geom type="plane" size="2 2 0.1"/>
    <body name="base" pos="0 0.1 0.3" euler="0 20 40">
      <geom type="cylinder" size="0.1 0.15" mass="5"/>
      <body name="upper" pos="0.1 0 0.2" euler="10 0 30">
        <joint name="shoulder" type="hinge" axis="0 1 0" range="-120 60" armature="0.02"
          frictionloss="0.3"/>
        <inertial pos="0.2 0.01 0" mass="2.5" diaginertia="0.01 0.03 0.035"/>
        <geom type="capsule" size="0.04" fromto="0 0 0 0.4 0 0" rgba="0.9 0.2 0.1 1"/>
        <body name="carriage" pos="0.4 0 0">
          <joint name="slide" type="slide" axis="1 0.2 -0.1" pos="0.3 0 0" range="-0.1 0.5"/>
          <geom type="box" size="0.1 0.05 0.04" mass="1.2" pos="0.02 0 0"/>
          <body name="hand" pos="0.2 0 0.05" quat="0.9 0.1 0.3 -0.2">
            <joint name="wrist" type="hinge" axis="0.3 0 1" pos="0 0.02 0" damping="0.1"/>
            <inertial pos="0.05 0.01 0.02" mass="0.7"
              fullinertia="0.004 0.003 0.005 1e-4 2e-4 -3e-4"/>
            <site name="tool" pos="0.15 0 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="m1" class="strong" joint="shoulder"/>
    <general name="m2" joint="slide"/>
    <motor name="m3" joint="wrist"/>
  </actuator>
  <keyframe><key name="home" qpos="-0.5 0.1 0.2"/></keyframe>
</mujoco>
"""
