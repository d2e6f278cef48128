"""The whole-body program in contact forces alone, beside the formulations that keep the thrusts as variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from condensed_cases import NV, ROBOT, STANDING, SUPPORTS, WEIGHTS

import harpy_pin as hp
from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.wbc import WholeBodyLimits, WholeBodyTargets, make_problem, make_solver

BOX = np.tile([0.4 * 53.0, 0.4 * 53.0, 53.0 * np.sqrt(0.68)], 2)


def random_case(rng, *, spread=0.1):
    q = pin.integrate(ROBOT.model, STANDING, spread * rng.standard_normal(NV))
    v = 0.5 * rng.standard_normal(NV)
    targets = WholeBodyTargets(ROBOT)
    size = 10.0 ** rng.uniform(-0.5, 1.5)
    targets.body[:] = size * rng.standard_normal(3)
    targets.orientation[:] = size * rng.standard_normal(3)
    targets.feet[:] = size * rng.standard_normal((2, 3))
    targets.held[:] = SUPPORTS[rng.integers(4)]
    targets.force_range[:] = (5.0, 200.0)
    return q, v, targets


def test_optimum_is_that_of_the_general_program_unless_a_motor_is_at_its_limit(fuzz):
    """With thrusts or torques at their limits its solution is feasible for the general program, and costs more."""
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(0)
    limits = WholeBodyLimits(mu=0.3, torque_scale=0.6, give_way=1.0)
    general, force = (make_problem(name, ROBOT, WEIGHTS, limits) for name in ("input_space", "contact_force"))
    solvers = [make_solver("daqp", problem.program) for problem in (general, force)]
    equal = cone_bound = torque_bound = thrust_bound = refused = 0
    for _ in range(1000 * fuzz):
        q, v, targets = random_case(rng)
        dynamics.update(q, v)
        rotation = pin.Quaternion(q[3:7]).matrix()
        for problem in (general, force):
            problem.build(dynamics, v, rotation, targets)
        a, b = (solver.solve(problem.program) for solver, problem in zip(solvers, (general, force), strict=True))
        if not a.usable:
            # What is feasible in forces is feasible in general.
            assert not b.usable or not targets.held.any()
            continue
        inputs = np.empty(12)
        thrust = bool((np.abs(a.z[:6]) > BOX - 1e-6).any())
        torque = bool((np.abs(a.z[6:]) > 0.6 * ROBOT.torque_limit - 1e-6).any())
        if not b.usable:
            assert thrust or torque
            refused += 1
            continue
        force.inputs(b.z, inputs)
        if not targets.held.any():  # nothing was chosen: limits are clipped
            assert (np.abs(inputs[:6]) <= BOX + 1e-9).all()
            assert (np.abs(inputs[6:]) <= 0.6 * ROBOT.torque_limit + 1e-9).all()
        else:
            assert force.program.violation(b.z) < 1e-6
            assert general.program.violation(inputs) < 1e-5 * (1.0 + np.abs(inputs).max())
        if thrust or torque:
            if not targets.held.any():
                continue
            thrust_bound += thrust
            torque_bound += torque and not thrust
            gap = general.program.objective(inputs) - general.program.objective(a.z)
            assert gap > -1e-6 * (1.0 + abs(general.program.objective(a.z)))
            continue
        equal += 1
        contact = force.contact_force(b.z)
        cone_bound += bool((limits.pyramid @ contact[targets.held > 0].T < 1e-6).any())
        scale = 1.0 + np.abs(a.z).max()
        np.testing.assert_allclose(inputs, a.z, rtol=0, atol=1e-6 * scale)
        np.testing.assert_allclose(contact, general.contact_force(a.z), rtol=0, atol=1e-6 * scale)
        acceleration = general.acceleration(a.z)
        scale = 1.0 + np.abs(acceleration).max()
        np.testing.assert_allclose(force.acceleration(b.z), acceleration, rtol=0, atol=1e-6 * scale)
    assert equal > 325 * fuzz
    assert min(torque_bound, cone_bound, thrust_bound) > 7 * fuzz


def test_moves_the_robot_as_it_says():
    """Forces, thrusts and torques put through ABA give its accelerations, and held feet those prescribed."""
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(1)
    problem = make_problem("contact_force", ROBOT, WEIGHTS, WholeBodyLimits(mu=0.5))
    solver = make_solver("daqp", problem.program)
    inputs, usable = np.empty(12), 0
    for _ in range(300):
        q, v, targets = random_case(rng)
        dynamics.update(q, v)
        problem.build(dynamics, v, pin.Quaternion(q[3:7]).matrix(), targets)
        z = solver.solve(problem.program).z
        if not solver.solution.usable or not targets.held.any():
            continue
        usable += 1
        problem.inputs(z, inputs)
        drive = inputs[6:] - ROBOT.model.damping[6:] * v[6:]
        total = dynamics.generalised_force(drive, problem.contact_force(z), inputs[:6].reshape(2, 3))
        acceleration = problem.acceleration(z)
        scale = 1.0 + np.abs(acceleration).max()
        np.testing.assert_allclose(dynamics.acceleration(q, v, total), acceleration, atol=1e-9 * scale)
        for k in np.flatnonzero(targets.held):
            rows = slice(3 * k, 3 * k + 3)
            foot = dynamics.foot_jacobian[rows] @ acceleration + dynamics.foot_drift[rows]
            np.testing.assert_allclose(foot, targets.feet[k], atol=1e-9 * scale)
    assert usable > 150


@pytest.mark.parametrize(("friction", "push"), [(0.25, 0.0), (0.15, 3.0)])
def test_agrees_on_the_states_of_a_pushed_walk(friction, push):
    """Every tick of a walk: the commands of the general program, wherever it has no motor at its limit."""
    pushes = (hp.Push(0.6, (0.0, push, 0.0)),) if push else ()
    run = hp.walk(
        hp.Scenario(
            controller="wbc", ground=hp.Ground(mu_s=friction), duration=2.0, disturbances=hp.Disturbances(pushes=pushes)
        )
    )
    gait = hp.make_gait(ROBOT)
    settings = WholeBodyParameters(weights=WEIGHTS, limits=WholeBodyLimits(mu=friction), solver="daqp")
    general, force = (
        WholeBodyController(gait, replace(settings, formulation=name)) for name in ("input_space", "contact_force")
    )
    compared = 0
    for i in range(len(run)):
        state = hp.State(
            float(run["t"][i]), *(run[name][i] for name in ("q", "v", "foot_position", "foot_velocity", "foot_force"))
        )
        expected, found = general.step(state), force.step(state)
        assert force.solution.usable
        if (np.abs(expected.thrust.ravel()) > BOX - 1e-6).any():
            continue
        if (np.abs(expected.torque) > ROBOT.torque_limit - 1e-6).any():
            continue
        compared += 1
        scale = 1.0 + np.abs(expected.torque).max()
        np.testing.assert_allclose(found.torque, expected.torque, rtol=0, atol=3e-5 * scale)
        np.testing.assert_allclose(found.thrust, expected.thrust, rtol=0, atol=3e-5 * scale)
    assert compared > 0.95 * len(run)


def test_walks_like_the_explicit_law():
    """The same program, solved in two ways, on a walk on which no motor comes to its limit: there they differ."""
    runs = []
    for controller, parameters in (("condensed", {}), ("wbc", {"formulation": "contact_force"})):
        scenario = hp.Scenario(
            controller={"name": controller, "parameters": parameters},
            ground=hp.Ground(mu_s=0.15),
            duration=2.0,
            disturbances=hp.Disturbances(pushes=(hp.Push(0.6, (0.0, 1.5, 0.0)),)),
        )
        runs.append(hp.walk(scenario))
    assert not runs[0]["condensed_status"].any()
    assert runs[0].ending == runs[1].ending == "completed"
    np.testing.assert_allclose(runs[0]["q"], runs[1]["q"], rtol=0, atol=1e-5)


def test_slack_is_that_of_the_general_program():
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(2)
    limits = WholeBodyLimits(mu=0.3, slack=1.0)
    general, force = (make_problem(name, ROBOT, WEIGHTS, limits) for name in ("input_space", "contact_force"))
    solvers = [make_solver("daqp", problem.program) for problem in (general, force)]
    slack, compared = 0.0, 0
    for _ in range(700):
        q, v, targets = random_case(rng)
        dynamics.update(q, v)
        for problem in (general, force):
            problem.build(dynamics, v, pin.Quaternion(q[3:7]).matrix(), targets)
        a, b = (solver.solve(problem.program) for solver, problem in zip(solvers, (general, force), strict=True))
        if not (a.usable and b.usable and targets.held.any()):
            continue
        if (np.abs(a.z[:12]) > np.concatenate((BOX, ROBOT.torque_limit)) - 1e-6).any():
            continue
        compared += 1
        slack = max(slack, b.z[:2].max())
        scale = 1.0 + np.abs(a.z).max()
        np.testing.assert_allclose(b.z[:2], a.z[12:], rtol=0, atol=1e-6 * scale)
        np.testing.assert_allclose(force.contact_force(b.z), general.contact_force(a.z), rtol=0, atol=1e-6 * scale)
    assert compared > 150
    assert slack > 1.0


def test_other_limbs_are_refused():
    model = ROBOT.model.copy()
    frame = model.frames[ROBOT.frame_id("left_foot")]
    model.addFrame(pin.Frame("left_heel", frame.parentJoint, frame.placement, pin.FrameType.OP_FRAME))
    with pytest.raises(hp.InputError, match="limbs must not share joints"):
        make_problem("contact_force", replace(ROBOT, model=model, feet=("left_foot", "left_heel")))
