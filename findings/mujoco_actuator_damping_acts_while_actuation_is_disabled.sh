#!/usr/bin/env bash
# MuJoCo 4.0.0: an actuator may have a damping of its own. With actuation disabled by flag, or the
# actuator's group disabled, its control has no effect, but its damping still brakes the joint.
# Seen, for damping 2 and control 3 at 1 rad/s: passive force -2 and actuator force 3 as it is;
# -2 and 0 with actuation disabled; -2 and 0 with the group disabled.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q mujoco==4.0.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'END'
import mujoco

XML = """
<mujoco>
  <worldbody>
    <body>
      <joint name="hinge" type="hinge" axis="0 1 0"/>
      <geom size="0.1" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <general joint="hinge" gainprm="1" damping="2" group="1"/>
  </actuator>
</mujoco>
"""
found = {}
for case in ("as it is", "actuation disabled", "group disabled"):
    model = mujoco.MjModel.from_xml_string(XML)
    if case == "actuation disabled":
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    if case == "group disabled":
        model.opt.disableactuator = 1 << 1
    data = mujoco.MjData(model)
    data.qvel[0], data.ctrl[0] = 1.0, 3.0
    mujoco.mj_forward(model, data)
    found[case] = (float(data.qfrc_passive[0]), float(data.qfrc_actuator[0]))
    print(f"{case}: passive {found[case][0]:g}, actuator {found[case][1]:g}")
assert found == {
    "as it is": (-2.0, 3.0),
    "actuation disabled": (-2.0, 0.0),
    "group disabled": (-2.0, 0.0),
}
END
