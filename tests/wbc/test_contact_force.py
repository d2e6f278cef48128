"""The whole-body program in contact forces alone, beside the formulations that keep the thrusts as variables."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from condensed_cases import ROBOT, WEIGHTS, random_case

import harpy_pin as hp
from harpy_pin.wbc import WholeBodyLimits, make_problem, make_solver

BOX = np.tile([0.4 * 53.0, 0.4 * 53.0, 53.0 * np.sqrt(0.68)], 2)


def test_optimum_is_that_of_the_general_program_unless_a_motor_is_at_its_limit(fuzz):
    """With thrusts or torques at their limits its solution is feasible for the general program, and costs more."""
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(0)
    limits = WholeBodyLimits(mu=0.3, torque_scale=0.6, give_way=1.0)
    general, force = (make_problem(name, ROBOT, WEIGHTS, limits) for name in ("input_space", "contact_force"))
    solvers = [make_solver("daqp", problem.program) for problem in (general, force)]
    equal = cone_bound = torque_bound = thrust_bound = refused = 0
    for _ in range(1000 * fuzz):
        q, v, targets = random_case(rng, spread=0.1)
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
