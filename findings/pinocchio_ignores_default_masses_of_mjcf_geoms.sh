#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF ignores a geom's mass that a <default> class gives, and takes
# 1000 kg/m³ instead; other attributes of the same class (here the type and the size) are read.
# mass="0" in a default, which files use to give pictures no mass, makes them heavy, too. MuJoCo
# 4.0.0 reads what the file says.
# Seen, kg of MuJoCo and Pinocchio: mass in a class 3 and 48, picture without mass 2 and 6.19.
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

BODY = '<body name="link"><joint name="hip"/>{}</body>'
CLASS = '<default><default class="part"><geom {}/></default></default>'
PART = '<geom class="part"/>'
FILES = {
    "mass in a class": (CLASS.format('type="box" size="0.1 0.2 0.3" mass="3"'), PART),
    "picture without mass": (
        CLASS.format('type="sphere" size="0.1" mass="0"'),
        '<geom type="box" size="0.1 0.2 0.3" mass="2"/>' + PART,
    ),
}
seen = {}
for name, (defaults, geoms) in FILES.items():
    path = Path("link.xml")
    body = BODY.format(geoms)
    path.write_text(f"<mujoco>{defaults}<worldbody>{body}</worldbody></mujoco>")
    truth = mujoco.MjModel.from_xml_path(str(path)).body_mass.sum()
    mass = pin.computeTotalMass(pin.buildModelFromMJCF(str(path)))
    seen[name] = (round(float(truth), 2), round(mass, 2))
    print(f"{name}: MuJoCo {seen[name][0]} kg, Pinocchio {seen[name][1]} kg")
assert seen == {"mass in a class": (3.0, 48.0), "picture without mass": (2.0, 6.19)}
END
