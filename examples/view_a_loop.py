"""A MuJoCo loop of one's own, seen in Meshcat while it runs. Needs robots, mujoco and view."""

import sys
import time

import mujoco  # type: ignore[import-untyped]

import harpy_pin as hp
from harpy_pin.simulation.mujoco import MujocoPlant
from harpy_pin.view import Viewer

robot, ground = hp.load_robot("go2"), hp.Ground(mu_s=0.6)
plant = MujocoPlant(robot, ground)
model = plant.model  # or one of yours: mujoco.MjModel.from_xml_path("scene.xml")
data = mujoco.MjData(model)
bridge = hp.MujocoBridge(model, robot)
gait = hp.WalkingGait(robot, velocity=(0.4, 0.0, 0.0))
controller = hp.make_controller("condensed", gait, mu=0.6, bridge=bridge)
bridge.place(gait.initial_state(), data)
controller.step(bridge.read(data))  # compiles

with Viewer(robot, ground=ground, open="--open" in sys.argv) as viewer:  # its address is printed
    begin = time.perf_counter()
    while data.time < 4.0:
        state = bridge.read(data)
        command = controller.step(state)
        viewer.show(state, command, controller)
        bridge.write(command, data)
        mujoco.mj_step(model, data)
        time.sleep(max(0.0, begin + data.time - time.perf_counter()))
    print(f"walked {data.qpos[0]:.2f} m; its last moment is in {viewer.save('last_moment.html')}")
