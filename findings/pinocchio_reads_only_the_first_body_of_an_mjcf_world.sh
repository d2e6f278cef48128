#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF reads the first <body> of <worldbody> and drops its
# neighbours without a word. A robot that stands behind a fixed table in the file is a model without
# joints and without mass; of two robots the first is left. MuJoCo 4.0.0 has them all.
# Seen, degrees of freedom of (MuJoCo, Pinocchio): two arms (2, 1), an arm behind a table (1, 0).
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

ARM = """
<body name="{0}" pos="{1} 0 1">
  <joint name="{0}" axis="0 1 0"/>
  <geom type="box" size="0.1 0.1 0.3" mass="2"/>
</body>"""
TABLE = '<body name="table" pos="0 0 0.3"><geom type="box" size="0.4 0.4 0.3" mass="9"/></body>'
WORLDS = {
    "two arms": ARM.format("left", 0) + ARM.format("right", 1),
    "an arm behind a table": TABLE + ARM.format("left", 0),
}
seen = {}
for name, bodies in WORLDS.items():
    path = Path("world.xml")
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    model = pin.buildModelFromMJCF(str(path))
    seen[name] = (mujoco.MjModel.from_xml_path(str(path)).nv, model.nv)
    print(f"{name}: {seen[name]}, joints {list(model.names)}, {pin.computeTotalMass(model)} kg")
assert seen == {"two arms": (2, 1), "an arm behind a table": (1, 0)}
END
