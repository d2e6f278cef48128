"""The whole-body program, written again from Pinocchio's functions and NumPy, and random states for
it.
"""

import daqp
import numpy as np
import pinocchio as pin
from forward_dynamics import frame_terms, mass_matrix

import harpy_pin as hp
from harpy_pin.gaits.straight import tuned_parameters
from harpy_pin.wbc import WholeBodyTargets, WholeBodyWeights

ROBOT = hp.load_harpy()
NV = 12
MU = 0.5
STANDING = hp.make_gait(ROBOT).initial_state()[0]
SUPPORTS = ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
WEIGHTS = WholeBodyWeights(**{**tuned_parameters(ROBOT)["weights"], "posture": 1e-10})
"""The condensed controller has no posture task: limbs leave no posture free. The whole-body program
must have one.
"""


def random_case(seed: int):
    """A state near standing, targets within reach, and which feet are held."""
    rng = np.random.default_rng(seed)
    q = pin.integrate(ROBOT.model, STANDING, 0.15 * rng.standard_normal(NV))
    v = 0.5 * rng.standard_normal(NV)
    targets = WholeBodyTargets(ROBOT)
    targets.body[:] = rng.uniform(-2.0, 2.0, 3)
    targets.orientation[:] = rng.uniform(-5.0, 5.0, 3)
    targets.feet[:] = rng.uniform(-5.0, 5.0, (2, 3))
    targets.joints[:] = rng.uniform(-5.0, 5.0, 6)
    targets.held[:] = SUPPORTS[seed % 4]
    targets.force_range[:] = (5.0, 150.0)
    targets.force[:] = rng.uniform(-50.0, 50.0, (2, 3))
    return q, v, targets


def wild_case(rng, *, spread):
    """A state around standing, targets however far from what is possible, and which feet are
    held.
    """
    q = pin.integrate(ROBOT.model, STANDING, spread * rng.standard_normal(NV))
    v = 3.0 * spread * rng.standard_normal(NV)
    targets = WholeBodyTargets(ROBOT)
    size = 10.0 ** rng.uniform(-1.0, 2.0)
    targets.body[:] = size * rng.standard_normal(3)
    targets.orientation[:] = 3.0 * size * rng.standard_normal(3)
    targets.feet[:] = size * rng.standard_normal((2, 3))
    targets.held[:] = SUPPORTS[rng.integers(4)]
    targets.force_range[:] = (rng.uniform(0.0, 20.0), 200.0)
    targets.force[:] = size * rng.standard_normal((2, 3))
    return q, v, targets


def oracle(q, v, targets, limits, weights=None, *, frames=None):
    """The same program in [a; f; u], written from Pinocchio's functions and plain NumPy, least
    squares left as such.

    All in world axes; the pyramids are about the third axes of ``frames`` (feet, 3, 3), by default
    the world's.
    """
    model, weights = ROBOT.model, weights or WholeBodyWeights.for_robot(ROBOT)
    mass, bias = mass_matrix(model, q), pin.nle(model, model.createData(), q, v)
    jacobians, drifts = frame_terms(model, (*ROBOT.feet, "base", *ROBOT.thrusters), q, v)
    (*feet, (base_jacobian, base_drift)), mounts = (
        [*zip(jacobians[:3], drifts[:3], strict=True)],
        jacobians[3:],
    )
    n = NV + 12
    rows, values = [], []

    def task(weight, matrix, value):
        full = np.zeros((len(value), n))
        full[:, : matrix.shape[1]] = matrix
        rows.append(np.sqrt(weight) * full)
        values.append(np.sqrt(weight) * value)

    task(weights.body, base_jacobian, targets.body - base_drift)
    task(weights.orientation, np.eye(6, NV)[3:], targets.orientation)
    task(weights.posture, np.eye(NV)[6:], targets.joints)
    rows.append(np.sqrt(weights.force) * np.eye(n)[NV : NV + 6])
    rows.append(np.sqrt(weights.thrust) * np.eye(n)[NV + 6 :])
    values += [np.sqrt(weights.force) * targets.force.ravel(), np.zeros(6)]
    for k, (jacobian, drift) in enumerate(feet):
        if not targets.held[k]:
            task(weights.swing, jacobian, targets.feet[k] - drift)
    a, b = np.vstack(rows), np.concatenate(values)

    to_torque = np.hstack(
        [mass, *(-j.T for j, _ in feet), *(-j.T for j in mounts)]
    )  # M a − Jᵀf − Jᵀu
    equality, equality_value = [to_torque[:6]], [-bias[:6]]
    inequality, upper = [], []
    for k, (jacobian, drift) in enumerate(feet):
        block = np.zeros((3, n))
        force = np.eye(n)[NV + 3 * k : NV + 3 * k + 3]
        if frames is not None:
            force = frames[k].T @ force
        if targets.held[k]:
            block[:, :NV] = jacobian
            equality.append(block)
            equality_value.append(targets.feet[k] - drift)
            for side in range(limits.faces):  # a regular pyramid whose edges lie on Coulomb's cone
                angle = 2.0 * np.pi * side / limits.faces
                across = np.cos(angle) * force[0] + np.sin(angle) * force[1]
                used = limits.friction_share * limits.mu * np.cos(np.pi / limits.faces)
                inequality.append(across - used * force[2])
                upper.append(0.0)
            inequality += [force[2], -force[2]]
            upper += [targets.force_range[k, 1], -targets.force_range[k, 0]]
        else:
            equality.append(force)
            equality_value.append(np.zeros(3))
    offset = bias[6:] + model.damping[6:] * v[6:]
    for sign in (1.0, -1.0):
        inequality += list(sign * to_torque[6:])
        upper += list(ROBOT.torque_limit - sign * offset)
        inequality += list(sign * np.eye(n)[NV + 6 :])
        side = limits.lateral_thrust * ROBOT.thrust_limit
        up = np.sqrt(ROBOT.thrust_limit**2 - 2.0 * side**2)
        upper += [side, side, up] * 2
    return (
        a,
        b,
        np.vstack(equality),
        np.concatenate(equality_value),
        np.array(inequality),
        np.array(upper),
    )


def solve_oracle(case):
    a, b, equality, equality_value, inequality, upper = case
    matrix = np.vstack((equality, inequality))
    sense = np.array([5] * len(equality) + [0] * len(inequality), dtype=np.int32)
    lower = np.concatenate((equality_value, np.full(len(upper), -1e30)))
    z, _, flag, _ = daqp.solve(
        a.T @ a,
        -a.T @ b,
        np.ascontiguousarray(matrix),
        np.concatenate((equality_value, upper)),
        lower,
        sense,
    )
    return z, flag
