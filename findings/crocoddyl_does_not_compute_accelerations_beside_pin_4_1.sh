#!/usr/bin/env bash
# crocoddyl 3.2.1: pip installs it beside pin 4.1.0 without a complaint, and "pip check" has none.
# Its free forward dynamics then leave their result as it was allocated: bodies do not fall.
# Beside pin 4.0.0 the same lines give Pinocchio's accelerations. Seen, of a body with a link:
# beside 4.1.0 a largest acceleration below 1e-300 m/s2, beside 4.0.0 the -9.81 m/s2 of pin.aba.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat >"$folder/fall.py" <<'END'
import crocoddyl
import numpy as np
import pinocchio as pin

model = pin.Model()
base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
model.appendBodyToJoint(base, pin.Inertia(2.0, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity())
hinge = model.addJoint(base, pin.JointModelRY(), pin.SE3.Identity(), "hinge")
link = pin.Inertia(1.0, np.array([0.3, 0.0, 0.0]), 0.01 * np.eye(3))
model.appendBodyToJoint(hinge, link, pin.SE3.Identity())

state = crocoddyl.StateMultibody(model)
actuation = crocoddyl.ActuationModelFloatingBase(state)
costs = crocoddyl.CostModelSum(state, actuation.nu)
dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
data = dynamics.createData()
x = state.zero()
dynamics.calc(data, x, np.zeros(actuation.nu))
true = pin.aba(model, model.createData(), x[: model.nq], x[model.nq :], np.zeros(model.nv))
equal = bool(np.allclose(data.xout, true, atol=1e-9))
fall = float(np.nan_to_num(data.xout[2]))
print(f"pin {pin.__version__}: falls with {fall:.2f} m/s2, pin.aba with {true[2]:.2f}")
assert equal == (pin.__version__ == "4.0.0"), (data.xout, true)
END
for version in 4.0.0 4.1.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install -q crocoddyl==3.2.1 "pin==$version" "libpinocchio==$version"
  "$folder/$version/bin/pip" check
  "$folder/$version/bin/python" "$folder/fall.py"
done
