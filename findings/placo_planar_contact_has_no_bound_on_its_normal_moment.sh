#!/usr/bin/env bash
# placo 0.10.2, DynamicsSolver.add_planar_contact: the friction coefficient bounds the tangential
# forces, and the sides of the sole the moments about them. The moment about the normal has no bound:
# a sole of 0.2 by 0.1 m that bears 108 N at friction 0.5 takes 500 N m, where friction at its corners
# gives 6.0 N m at most. The program counts as solved.
# Seen: solved, normal force 107.9 N, moment about the normal -500.0 N m, friction gives at most 6.0 N m
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q placo==0.10.2 pin==3.8.0 numpy==2.3.5
mkdir "$folder/robot"
cat > "$folder/robot/robot.urdf" <<'END'
<robot name="turntable">
  <link name="base">
    <inertial>
      <mass value="10"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/>
    <child link="foot"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1000" velocity="100"/>
  </joint>
  <link name="foot">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
</robot>
END
"$folder/venv/bin/python" - "$folder/robot" <<'END'
import sys

import numpy as np
import placo

LENGTH, WIDTH, FRICTION = 0.2, 0.1, 0.5
robot = placo.RobotWrapper(sys.argv[1], placo.Flags.ignore_collisions)
robot.update_kinematics()
solver = placo.DynamicsSolver(robot)
foot = solver.add_frame_task("foot", np.eye(4))
for part in (foot.position(), foot.orientation()):
    part.kp = part.kd = 0.0
    part.configure("foot stays", "hard")
contact = solver.add_planar_contact(foot)
contact.length, contact.width, contact.mu = LENGTH, WIDTH, FRICTION
turn = solver.add_joints_task()
turn.kp = turn.kd = 0.0
turn.set_joint("hinge", 0.0, 0.0, 500.0)  # rad/s2, of an inertia of 1 kg m2
turn.configure("body turns", "hard")
result = solver.solve(False)
force, moment = contact.wrench[2], contact.wrench[5]
most = FRICTION * force * np.hypot(LENGTH, WIDTH) / 2
print(f"{'solved' if result.success else 'failed'}, normal force {force:.1f} N,", end=" ")
print(f"moment about the normal {moment:.1f} N m, friction gives at most {most:.1f} N m")
assert result.success
assert abs(moment) > 50 * most
END
