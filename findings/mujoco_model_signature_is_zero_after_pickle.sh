#!/usr/bin/env bash
# MuJoCo 4.0.0: MjModel.signature tells models apart, and copies keep it. A model that went through
# pickle, as into another process, has signature 0: so have two different ones.
# Seen: two models 2 signatures, copies 2, pickled 1 (which is 0)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q mujoco==4.0.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'END'
import copy
import pickle

import mujoco

XML = "<mujoco><worldbody><body>{}<geom size='0.1' mass='1'/></body></worldbody></mujoco>"
models = [mujoco.MjModel.from_xml_string(XML.format(joint)) for joint in ("<freejoint/>", "<joint/>")]
made = {
    "two models": models,
    "copies": [copy.deepcopy(model) for model in models],
    "pickled": [pickle.loads(pickle.dumps(model)) for model in models],
}
found = {name: {model.signature for model in these} for name, these in made.items()}
print(", ".join(f"{name} {len(signatures)}" for name, signatures in found.items()))
assert len(found["two models"]) == len(found["copies"]) == 2
assert found["pickled"] == {0}
END
