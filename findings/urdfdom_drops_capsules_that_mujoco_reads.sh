#!/usr/bin/env bash
# A capsule as the collision geometry of a URDF: MuJoCo 4.0.0 reads it, and so do simulators that have
# the element. urdfdom, through Pinocchio 4.1.0, prints that it cannot parse it and returns the model
# without it: a robot whose feet are capsules has none.
# Seen: cylinder: pinocchio 1, mujoco 1; capsule: pinocchio 0, mujoco 1
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pin==4.1.0 mujoco==4.0.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'END'
import sys
from pathlib import Path

import mujoco
import pinocchio as pin

found = {}
for shape in ("cylinder", "capsule"):
    path = Path(sys.argv[1]) / f"{shape}.urdf"
    geometry = f'<geometry><{shape} radius="0.03" length="0.1"/></geometry>'
    path.write_text(f'<robot name="foot"><link name="a"><collision>{geometry}</collision></link></robot>')
    model = pin.buildModelFromUrdf(str(path))
    shapes = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION)
    found[shape] = (shapes.ngeoms, mujoco.MjModel.from_xml_path(str(path)).ngeom)
    print(f"{shape}: pinocchio {found[shape][0]}, mujoco {found[shape][1]}")
assert found == {"cylinder": (1, 1), "capsule": (0, 1)}
END
