"""Coulomb's disc in the condensed controller: the exact optimum, its promise, and its use of few programs."""

from __future__ import annotations

import numpy as np
import pytest
from condensed_cases import ROBOT, WEIGHTS, random_case

import harpy_pin as hp
from harpy_pin.wbc import FORMULATIONS, WholeBodyLimits, WholeBodyWeights, make_problem, make_solver
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus
from harpy_pin.wbc.condensed.disc import PROGRAMS

FACES = 16


def touch_the_disc(problem, limits, held, force):
    """Replace the pyramids of a program just built by ones around the disc that touch it at the given forces."""
    program = problem.program
    at_zero = problem.contact_force(np.zeros(len(program.gradient)))
    force_of = [problem.contact_force(unit) - at_zero for unit in np.eye(len(program.gradient))]
    for k in np.flatnonzero(held):
        angle = np.arctan2(force[k, 1], force[k, 0]) + 2.0 * np.pi * np.arange(FACES) / FACES
        rows = np.column_stack((-np.cos(angle), -np.sin(angle), np.full(FACES, limits.friction_share * limits.mu)))
        first = program.bounded + (FACES + 1) * k
        program.inequality[first : first + FACES] = rows @ np.array([column[k] for column in force_of]).T
        program.lower[first : first + FACES] = -rows @ at_zero[k]


@pytest.mark.parametrize("torque_scale", [1.0, 0.5])
@pytest.mark.parametrize("mu", [0.0, 0.15, 0.6])
def test_optimum_in_the_disc(mu, torque_scale, fuzz):
    """Where a pyramid around the disc has its optimum in the disc, that is the disc's optimum too; and where the law's
    forces are the disc's optimum, the pyramid that touches it there has the same. So another solver must find them."""
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(12)
    limits = WholeBodyLimits(mu=mu, torque_scale=torque_scale, give_way=1.0, cone="disc")
    law = CondensedSolver(ROBOT, WEIGHTS, limits)
    problem = make_problem(
        "input_space", ROBOT, WEIGHTS, WholeBodyLimits(mu=mu, torque_scale=torque_scale, faces=FACES)
    )
    solver = make_solver("daqp", problem.program)
    seen = CondensedStatus.OPTIMAL
    on_the_disc = compared = 0
    for _ in range(300 * fuzz):
        q, v, targets = random_case(rng, spread=0.05)
        dynamics.update(q, v)
        law.solve(dynamics, v, dynamics.rotation, targets)
        held = targets.held > 0.0
        used = np.hypot(law.force[:, 0], law.force[:, 1])
        limit = limits.friction_share * mu * law.force[:, 2]
        assert (used <= limit + 1e-12 * (1.0 + limit)).all()
        if law.status & (CondensedStatus.SUBOPTIMAL | CondensedStatus.TORQUE_CLIPPED):
            continue
        problem.build(dynamics, v, dynamics.rotation, targets)
        touch_the_disc(problem, limits, held, law.force)
        solution = solver.solve(problem.program)
        if not solution.usable:
            continue
        compared += 1
        on_the_disc += bool((used[held] > limit[held] - 1e-6).any())
        seen |= law.status
        scale = 1.0 + np.abs(solution.z).max()
        np.testing.assert_allclose(law.force, problem.contact_force(solution.z), rtol=0, atol=2e-5 * scale)
    assert compared > 270 * fuzz
    assert on_the_disc > 50
    assert {CondensedStatus.THRUST_LIMITED, CondensedStatus.TORQUE_LIMITED} <= {
        status for status in CondensedStatus if status & seen
    }


def test_lies_between_the_pyramids_inside_and_outside():
    """One foot that is asked for more sideways than it has: the disc gives its whole radius in every direction."""
    dynamics = hp.Dynamics(ROBOT)
    q, v, targets = random_case(np.random.default_rng(3), spread=0.0)
    dynamics.update(q, v)
    targets.held[:] = (1.0, 0.0)
    targets.orientation[:] = targets.feet[:] = 0.0
    weights = WholeBodyWeights(posture=1e-10, thrust=1e4, orientation=1e-5)
    disc = CondensedSolver(ROBOT, weights, WholeBodyLimits(cone="disc"))
    inside = CondensedSolver(ROBOT, weights, WholeBodyLimits())
    for angle in np.linspace(0.0, 2.0 * np.pi, 33):
        targets.body[:] = (30.0 * np.cos(angle), 30.0 * np.sin(angle), 0.0)
        shares = []
        for law in (disc, inside):
            law.solve(dynamics, v, dynamics.rotation, targets)
            force = law.force[0]
            shares.append(np.hypot(force[0], force[1]) / (0.75 * 0.25 * force[2]))
        assert shares[0] == pytest.approx(1.0, abs=1e-6)
        assert np.cos(np.pi / 8.0) - 1e-6 <= shares[1] <= 1.0 + 1e-6


def test_walks_with_few_programs():
    """Every tick ends with the optimum; from the last tick's direction it takes about two programs."""
    scenario = hp.Scenario(
        controller=hp.Condensed(parameters={"limits": {"cone": "disc"}}),
        ground=hp.Ground(mu_s=0.2),
        duration=2.0,
        disturbances=hp.Disturbances(pushes=(hp.Push(0.9, (0.0, 3.0, 0.0)),)),
    )
    run = hp.walk(scenario)
    assert run.ending == "completed"
    assert (run["condensed_status"] < CondensedStatus.SUBOPTIMAL).all()
    assert run["law_systems"].mean() < 4.0
    assert run["law_systems"].max() < 5 * PROGRAMS
    assert hp.Scenario.of(run) == scenario


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_quadratic_programs_refuse_the_disc(formulation):
    with pytest.raises(hp.InputError, match="disc"):
        make_problem(formulation, ROBOT, WEIGHTS, WholeBodyLimits(cone="disc"))
    with pytest.raises(hp.InputError, match="friction cone"):
        WholeBodyLimits(cone="cube")
