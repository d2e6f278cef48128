from __future__ import annotations

import daqp
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin.wbc import (
    QPStatus,
    WarmProxQP,
    WholeBodyLimits,
    WholeBodyProblem,
    WholeBodyTargets,
    WholeBodyWeights,
)

ROBOT = hp.load_harpy()
NV = 12
MU = 0.5


def random_case(seed: int):
    """A state near standing, targets within reach, and which feet are held."""
    rng = np.random.default_rng(seed)
    q = pin.integrate(ROBOT.model, hp.make_gait(ROBOT).initial_state()[0], 0.15 * rng.standard_normal(NV))
    v = 0.5 * rng.standard_normal(NV)
    targets = WholeBodyTargets.zeros(ROBOT)
    targets.body[:] = rng.uniform(-2.0, 2.0, 3)
    targets.orientation[:] = rng.uniform(-5.0, 5.0, 3)
    targets.feet[:] = rng.uniform(-5.0, 5.0, (2, 3))
    targets.joints[:] = rng.uniform(-5.0, 5.0, 6)
    targets.held[:] = [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)][seed % 4]
    targets.force_range[:] = (5.0, 150.0)
    return q, v, targets


def built(q, v, targets, limits=None):
    dynamics = hp.Dynamics(ROBOT)
    dynamics.update(q, v)
    problem = WholeBodyProblem(ROBOT, limits=limits or WholeBodyLimits(mu=MU))
    problem.build(dynamics, v, pin.Quaternion(q[3:7]).matrix(), targets)
    return dynamics, problem


def oracle(q, v, targets, limits):
    """The same program written from Pinocchio's functions and plain NumPy, with least squares left as they are."""
    model, data = ROBOT.model, ROBOT.model.createData()
    weights = WholeBodyWeights()
    mass, bias = pin.crba(model, data, q).copy(), pin.nle(model, data, q, v).copy()
    pin.forwardKinematics(model, data, q, v, np.zeros(NV))
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)

    def frame(name):
        i = model.getFrameId(name)
        jacobian = pin.getFrameJacobian(model, data, i, pin.LOCAL_WORLD_ALIGNED)[:3].copy()
        return jacobian, pin.getFrameClassicalAcceleration(model, data, i, pin.LOCAL_WORLD_ALIGNED).linear.copy()

    feet = [frame(name) for name in ROBOT.feet]
    mounts = [frame(name)[0] for name in ROBOT.thrusters]
    base_jacobian, base_drift = frame("base")
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
    values += [np.zeros(6), np.zeros(6)]
    for k, (jacobian, drift) in enumerate(feet):
        if not targets.held[k]:
            task(weights.swing, jacobian, targets.feet[k] - drift)
    a, b = np.vstack(rows), np.concatenate(values)

    to_torque = np.hstack([mass, *(-j.T for j, _ in feet), *(-j.T for j in mounts)])  # M a − Jᵀf − Jᵀu
    equality, equality_value = [to_torque[:6]], [-bias[:6]]
    inequality, upper = [], []
    for k, (jacobian, drift) in enumerate(feet):
        block = np.zeros((3, n))
        force = np.eye(n)[NV + 3 * k : NV + 3 * k + 3]
        if targets.held[k]:
            block[:, :NV] = jacobian
            equality.append(block)
            equality_value.append(targets.feet[k] - drift)
            mu = limits.mu * limits.pyramid
            for sign in (1.0, -1.0):
                inequality += [sign * force[0] - mu * force[2], sign * force[1] - mu * force[2]]
                upper += [0.0, 0.0]
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
    return a, b, np.vstack(equality), np.concatenate(equality_value), np.array(inequality), np.array(upper)


def solve_oracle(case):
    a, b, equality, equality_value, inequality, upper = case
    matrix = np.vstack((equality, inequality))
    sense = np.array([5] * len(equality) + [0] * len(inequality), dtype=np.int32)
    lower = np.concatenate((equality_value, np.full(len(upper), -1e30)))
    z, _, flag, _ = daqp.solve(
        a.T @ a, -a.T @ b, np.ascontiguousarray(matrix), np.concatenate((equality_value, upper)), lower, sense
    )
    return z, flag


@given(st.integers(0, 10_000))
def test_solution_is_that_of_an_independent_program(seed):
    """ProxQP on our arrays against DAQP on a program written from the formulas."""
    q, v, targets = random_case(seed)
    limits = WholeBodyLimits(mu=MU)
    case = oracle(q, v, targets, limits)
    z, flag = solve_oracle(case)
    _, problem = built(q, v, targets, limits)
    solution = WarmProxQP(problem, tolerance=1e-9, max_iterations=10_000).solve(problem)
    if flag < 0:
        assert not solution.usable
        return
    assert solution.status is QPStatus.SOLVED
    a, b = case[:2]
    objective = np.sum((a @ z - b) ** 2)
    assert np.sum((a @ solution.z - b) ** 2) == pytest.approx(objective, rel=1e-5, abs=1e-6)
    np.testing.assert_allclose(solution.z[NV:], z[NV:], atol=2e-2)  # forces, N: the flattest directions
    np.testing.assert_allclose(solution.z[:NV], z[:NV], atol=1e-2)


@given(st.integers(0, 10_000))
def test_solution_moves_the_robot_as_it_says(seed):
    """Torques, contact forces and thrusts of the solution, put through ABA, give its accelerations."""
    q, v, targets = random_case(seed)
    dynamics, problem = built(q, v, targets)
    solution = WarmProxQP(problem, tolerance=1e-9, max_iterations=10_000).solve(problem)
    if not solution.usable:
        return
    z, torque = solution.z, np.empty(6)
    problem.torque(dynamics, v, z, torque)
    drive = torque - ROBOT.model.damping[6:] * v[6:]  # what is left after the joints' friction
    force = dynamics.generalised_force(drive, z[NV : NV + 6].reshape(2, 3), z[NV + 6 :].reshape(2, 3))
    np.testing.assert_allclose(dynamics.acceleration(q, v, force), z[:NV], atol=1e-5)


@given(st.integers(0, 10_000))
def test_solution_respects_every_limit(seed):
    q, v, targets = random_case(seed)
    limits = WholeBodyLimits(mu=MU)
    dynamics, problem = built(q, v, targets, limits)
    solution = WarmProxQP(problem, tolerance=1e-8, max_iterations=10_000).solve(problem)
    if not solution.usable:
        return
    z, torque = solution.z, np.empty(6)
    problem.torque(dynamics, v, z, torque)
    forces, thrusts = z[NV : NV + 6].reshape(2, 3), z[NV + 6 :].reshape(2, 3)
    for k in range(2):
        if targets.held[k]:
            assert np.linalg.norm(forces[k, :2]) <= MU * forces[k, 2] + 1e-6  # the pyramid lies inside the disc
            assert targets.force_range[k, 0] - 1e-6 <= forces[k, 2] <= targets.force_range[k, 1] + 1e-6
            acceleration = dynamics.foot_jacobian[3 * k : 3 * k + 3] @ z[:NV] + dynamics.foot_drift[3 * k : 3 * k + 3]
            np.testing.assert_allclose(acceleration, targets.feet[k], atol=1e-5)
        else:
            np.testing.assert_allclose(forces[k], 0.0, atol=1e-6)
    assert (np.abs(torque) <= ROBOT.torque_limit + 1e-6).all()
    assert (np.linalg.norm(thrusts, axis=1) <= ROBOT.thrust_limit + 1e-6).all()


def test_warm_start_changes_nothing_but_the_work():
    gait = hp.make_gait(ROBOT)
    controller = hp.make_controller("wbc", gait, mu=0.8)
    simulator = hp.Simulator(ROBOT, hp.Ground(mu_s=0.8))
    simulator.reset(*gait.initial_state(sink=simulator.static_sink))
    run = simulator.run(controller, 1.0)
    warm, cold = [], []
    solver = WarmProxQP(controller.problem, tolerance=1e-8, max_iterations=10_000)
    replay = hp.make_controller("wbc", gait, mu=0.8)
    for i in range(0, len(run), 20):
        signals = (run[name][i] for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"))
        state = hp.State(float(run["t"][i]), *signals)
        replay.prepare(state)
        problem = replay.build(state)
        z = solver.solve(problem).z.copy()
        warm.append(solver.solution.iterations)
        fresh = WarmProxQP(problem, tolerance=1e-8, max_iterations=10_000)
        np.testing.assert_allclose(fresh.solve(problem).z, z, atol=1e-2)
        cold.append(fresh.solution.iterations)
    assert sum(warm) < sum(cold)


def test_infeasible_is_reported_and_forgotten():
    """A foot that must push harder than the robot can bear: no usable solution, and the next problem is solved."""
    q, v, targets = random_case(0)
    _, problem = built(q, v, targets)
    solver = WarmProxQP(problem)
    good = solver.solve(problem).z.copy()
    assert solver.solution.usable
    targets.force_range[:] = (3000.0, 3001.0)
    _, impossible = built(q, v, targets)
    assert not solver.solve(impossible).usable
    assert solver.solve(problem).usable
    np.testing.assert_allclose(solver.solution.z, good, atol=5e-2)


@settings(max_examples=5)
@given(st.integers(0, 100))
def test_not_a_number_never_passes_as_a_solution(seed):
    q, v, targets = random_case(4 * seed)
    targets.body[0] = np.nan
    _, problem = built(q, v, targets)
    assert not WarmProxQP(problem).solve(problem).usable


@pytest.mark.parametrize(
    "bad",
    [
        lambda: WholeBodyWeights(body=-1.0),
        lambda: WholeBodyWeights(thrust=0.0),
        lambda: WholeBodyLimits(mu=-0.1),
        lambda: WholeBodyLimits(pyramid=0.0),
        lambda: WholeBodyLimits(lateral_thrust=0.9),
        lambda: WholeBodyLimits(torque_scale=0.0),
    ],
)
def test_bad_input(bad):
    with pytest.raises(hp.InputError):
        bad()
