"""The condensed solver beside quadratic programs, for any robot in any support."""

import numpy as np

import harpy_pin as hp
from harpy_pin.wbc import WholeBodyTargets, make_problem, make_solver
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus


def same_optimum(robot, states, weights, limits, formulations, *, spread, most):
    """At random targets, a support after the other, with at most so much normal force: the same
    forces and inputs, and always within every limit; returns how often thrusts were at a limit, and
    forces at that of their pyramid.
    """
    dynamics, rng = hp.Dynamics(robot), np.random.default_rng(0)
    law, free = CondensedSolver(robot, weights, limits), robot.n_thrust - len(robot.rotors)
    problems = [make_problem(name, robot, weights, limits) for name in formulations]
    solvers = [make_solver("daqp", problem.program) for problem in problems]
    low, high = np.reshape([rotor.limit for rotor in robot.rotors], (-1, 2)).T
    inputs = np.empty(robot.n_thrust + len(robot.joints))
    saturated = binding = 0
    for i, (q, v) in enumerate(states):
        targets = WholeBodyTargets(robot)
        held = [(i >> k) & 1 for k in range(len(robot.corners))]
        targets.held[:] = np.repeat(held, robot.corners)
        targets.body[:], targets.orientation[:] = spread * rng.standard_normal((2, 3))
        targets.feet[:] = rng.standard_normal(targets.feet.shape)
        targets.force_range[:] = (0.5, most)
        dynamics.update(q, v)
        found = law.solve(dynamics, v, targets)
        for problem, solver in zip(problems, solvers, strict=True):
            problem.build(dynamics, v, dynamics.rotation, targets)
            assert solver.solve(problem.program).usable
            problem.inputs(solver.solution.z, inputs)
            np.testing.assert_allclose(found, inputs, rtol=0, atol=1e-4)
            np.testing.assert_allclose(
                law.force, problem.contact_force(solver.solution.z), rtol=0, atol=1e-4
            )
        force, thrust = law.force[targets.held > 0.0], found[free : robot.n_thrust]
        assert (limits.pyramid @ force.T >= -1e-9).all()
        assert ((force[:, 2] >= 0.5 - 1e-9) & (force[:, 2] <= most + 1e-9)).all()
        assert (law.force[targets.held == 0.0] == 0.0).all()
        assert ((thrust >= low) & (thrust <= high)).all()
        at_limit = bool(((thrust == low) | (thrust == high)).any())
        assert CondensedStatus.SUBOPTIMAL not in law.status
        assert CondensedStatus.THRUST_LIMITED in law.status or not at_limit
        saturated += at_limit
        binding += bool((limits.pyramid @ force.T < 1e-6).any())
    return saturated, binding
