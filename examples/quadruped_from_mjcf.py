"""A quadruped from an MJCF walks in MuJoCo (extra mujoco): the file, the robot, the loop."""

from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco  # type: ignore[import-untyped]

import harpy_pin as hp

LEG = """
<body name="{0}_hip" pos="{1} {2} 0">
 <inertial pos="0 0 0" mass="0.7" diaginertia="1e-3 1e-3 1e-3"/>
 <joint name="{0}_hip" axis="1 0 0" range="-0.8 0.8"/>
 <body name="{0}_thigh" pos="0 {3} 0">
  <inertial pos="0 0 -0.05" mass="1" diaginertia="5e-3 5e-3 1e-3"/>
  <joint name="{0}_thigh" axis="0 1 0" range="-1.5 2.5"/>
  <body name="{0}_calf" pos="0 0 -0.21">
   <inertial pos="0 0 -0.1" mass="0.2" diaginertia="1e-3 1e-3 1e-4"/>
   <joint name="{0}_calf" axis="0 1 0" range="-2.6 -0.4"/>
   <body name="{0}_foot" pos="0 0 -0.21">
    <inertial pos="0 0 0" mass="0.04" diaginertia="1e-5 1e-5 1e-5"/><geom size="0.02"/>
   </body></body></body></body>"""
PLACES = {"FL": (0.2, 0.05), "FR": (0.2, -0.05), "RL": (-0.2, 0.05), "RR": (-0.2, -0.05)}
JOINTS = [f"{leg}_{part}" for leg in PLACES for part in ("hip", "thigh", "calf")]
FEET = [f"{leg}_foot" for leg in PLACES]
MOTORS = "".join(f'<motor joint="{joint}" ctrlrange="-35 35"/>' for joint in JOINTS)
DOG = f"""<mujoco model="dog"><compiler angle="radian"/>
<default><joint armature="0.01" damping="0.1"/></default>
<worldbody><geom type="plane" size="0 0 1"/><body name="trunk" pos="0 0 0.4"><freejoint/>
<inertial pos="0 0 0" mass="7" diaginertia="0.03 0.1 0.12"/>
{"".join(LEG.format(leg, x, y, 2 * y) for leg, (x, y) in PLACES.items())}
</body></worldbody><actuator>{MOTORS}</actuator></mujoco>"""

with TemporaryDirectory() as folder:  # your file instead
    file = Path(folder) / "dog.xml"
    file.write_text(DOG)
    model = mujoco.MjModel.from_xml_path(str(file))
    robot = hp.load_robot(file, feet=FEET).with_mujoco(model)

data, bridge = mujoco.MjData(model), hp.MujocoBridge(model, robot)
print(bridge.differences or "model and robot agree")
gait = hp.WalkingGait(robot, velocity=(0.3, 0.0, 0.0))
controller = hp.make_controller("condensed", gait, mu=0.6, bridge=bridge)
bridge.place(gait.initial_state(penetration=-bridge.foot_radius[0]), data)
while data.time < 3.0:
    state = bridge.read(data)
    bridge.write(controller.step(state), data)
    mujoco.mj_step(model, data)
print(f"walked {state.q[0]:.2f} m in {state.t:.1f} s, the body {state.q[2]:.2f} m above the floor")
