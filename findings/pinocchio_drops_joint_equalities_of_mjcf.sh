#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF gives the open tree of a file whose equalities close it, and
# says nothing. buildModelAndConstraintsFromMJCF gives those of <connect> and <weld>, but
# <equality><joint>, which couples two joints, is dropped without a word there, too. MuJoCo 4.0.0
# reads one equality in each file.
# Seen, constraints found: connect 1, weld 1, joint 0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pin==4.1.0 libpinocchio==4.1.0 mujoco==4.0.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'END'
from pathlib import Path

import mujoco
import pinocchio as pin

XML = """
<mujoco>
  <worldbody>
    <body name="base" pos="0 0 1">
      <freejoint/>
      <geom size="0.1" mass="1"/>
      <body name="left" pos="0 0.1 -0.2">
        <joint name="left" axis="0 1 0"/>
        <geom size="0.05" mass="0.5"/>
      </body>
      <body name="right" pos="0 -0.1 -0.2">
        <joint name="right" axis="0 1 0"/>
        <geom size="0.05" mass="0.5"/>
      </body>
    </body>
  </worldbody>
  <equality>
    {equality}
  </equality>
</mujoco>
"""
EQUALITIES = {
    "connect": '<connect body1="left" body2="right" anchor="0 -0.1 0"/>',
    "weld": '<weld body1="left" body2="right"/>',
    "joint": '<joint joint1="right" joint2="left" polycoef="0 1 0 0 0"/>',
}
found = {}
for name, equality in EQUALITIES.items():
    path = Path(f"{name}.xml")
    path.write_text(XML.format(equality=equality))
    assert mujoco.MjModel.from_xml_path(str(path)).neq == 1
    plain = pin.buildModelFromMJCF(str(path))
    assert isinstance(plain, pin.Model) and plain.nv == 8
    model, points, frames = pin.buildModelAndConstraintsFromMJCF(str(path))
    assert model.nv == 8
    found[name] = len(points) + len(frames)
    print(f"{name}: {found[name]} constraints")
assert found == {"connect": 1, "weld": 1, "joint": 0}
END
