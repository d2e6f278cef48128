#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF drops all that stands inside <frame>, which MJCF has for moving
# what is in it: geoms (the body loses its mass), joints (the body is welded), bodies (the chain
# ends). Nothing is said, and the model computes. Only a frame around the first body is refused.
# MuJoCo 4.0.0 reads each file.
# Seen, (degrees of freedom, kg) of MuJoCo and Pinocchio: geom (1, 2) and (1, 0), joint (1, 2) and
# (0, 0), body (2, 4) and (1, 2).
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

GEOM = '<geom type="box" size="0.1 0.2 0.3" mass="2"/>'
FRAME = '<frame pos="0 0 0.1">{}</frame>'
JOINT = '<joint name="{}" axis="0 1 0"/>'
INSIDE = {
    "geom": JOINT.format("hip") + FRAME.format(GEOM),
    "joint": FRAME.format(JOINT.format("hip")) + GEOM,
    "body": JOINT.format("hip")
    + GEOM
    + FRAME.format(f'<body name="shank">{JOINT.format("knee")}{GEOM}</body>'),
}
seen = {}
for name, inside in INSIDE.items():
    path = Path("leg.xml")
    path.write_text(
        f'<mujoco><worldbody><body name="thigh">{inside}</body></worldbody></mujoco>'
    )
    truth = mujoco.MjModel.from_xml_path(str(path))
    model = pin.buildModelFromMJCF(str(path))
    seen[name] = (
        (truth.nv, round(float(truth.body_mass.sum()), 9)),
        (model.nv, round(pin.computeTotalMass(model), 9)),
    )
    print(f"{name} in a frame: MuJoCo {seen[name][0]}, Pinocchio {seen[name][1]}")
assert seen == {
    "geom": ((1, 2.0), (1, 0.0)),
    "joint": ((1, 2.0), (0, 0.0)),
    "body": ((2, 4.0), (1, 2.0)),
}
END
