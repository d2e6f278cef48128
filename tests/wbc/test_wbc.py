import sys

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import forward_dynamics, generalised_force
from hypothesis import given
from hypothesis import strategies as st
from whole_body_oracle import MU, ROBOT, oracle, random_case, solve_oracle

import harpy_pin as hp
from harpy_pin.contrib.solvers import SOLVERS
from harpy_pin.wbc import FORMULATIONS, WholeBodyLimits, make_problem, make_solver


def built(q, v, targets, limits=None, *, formulation="input_space"):
    dynamics = hp.Dynamics(ROBOT)
    dynamics.update(q, v)
    problem = make_problem(formulation, ROBOT, limits=limits or WholeBodyLimits(mu=MU))
    problem.build(dynamics, v, pin.Quaternion(q[3:7]).matrix(), targets)
    return problem


def solved(solver, program):
    solution = solver.solve(program)
    return solution.z.copy() if solution.usable else None


@given(st.integers(0, 10_000), st.sampled_from(sorted(FORMULATIONS)), st.sampled_from([3, 4, 16]))
def test_solution_is_that_of_an_independent_program(seed, formulation, faces):
    """Against a program written from the formulas."""
    q, v, targets = random_case(seed)
    limits = WholeBodyLimits(mu=MU, faces=faces)
    case = oracle(q, v, targets, limits)
    z, flag = solve_oracle(case)
    problem = built(q, v, targets, limits, formulation=formulation)
    found = solved(make_solver("daqp", problem.program), problem.program)
    if flag < 0:
        assert found is None
        return
    a, b = case[:2]
    acceleration, force = problem.acceleration(found), problem.contact_force(found)
    inputs = np.empty(12)
    problem.inputs(found, inputs)
    ours = np.concatenate((acceleration, force.ravel(), inputs[:6]))
    assert np.sum((a @ ours - b) ** 2) == pytest.approx(
        np.sum((a @ z - b) ** 2), rel=1e-7, abs=1e-8
    )
    np.testing.assert_allclose(ours, z, atol=1e-5)


ACCURACY = {"proxqp": 1e-3, "piqp": 0.1, "osqp": 0.3, "clarabel": 0.1}
ACCURACY |= dict.fromkeys(("active_set", "daqp", "quadprog"), 1e-6)
"""Largest difference of a command, N and N·m, that a solver's own tolerance leaves: the objective
is as flat as 1e-5 per squared newton in some directions.
"""


@pytest.mark.parametrize("formulation", sorted(FORMULATIONS))
@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_every_solver_finds_the_optimum(name, formulation):
    solver = reference = None
    for seed in range(60):
        q, v, targets = random_case(seed)
        program = built(q, v, targets, formulation=formulation).program
        if solver is None:
            solver, reference = make_solver(name, program), make_solver("daqp", program)
        expected, found = solved(reference, program), solved(solver, program)
        if expected is None:
            assert found is None, seed
            continue
        assert found is not None, seed
        assert program.violation(found) == pytest.approx(solver.solution.violation, abs=1e-12)
        assert program.violation(found) < 1e-5
        gap = program.objective(found) - program.objective(expected)
        assert abs(gap) < 1e-4 * max(1.0, abs(program.objective(expected))), seed
        inputs = 12 if formulation == "input_space" else 6
        assert np.abs(found - expected)[:inputs].max() < ACCURACY[name], seed
        solver.reset()
        again = solved(solver, program)
        assert np.abs(again - found)[:inputs].max() < 2.0 * ACCURACY[name], seed


@pytest.mark.parametrize("formulation", sorted(FORMULATIONS))
def test_reused_active_set_is_always_optimal(formulation):
    """From a guess that belongs to quite another program."""
    solver = reference = None
    found_some = 0
    for seed in range(200):
        q, v, targets = random_case(seed)
        program = built(q, v, targets, WholeBodyLimits(mu=0.2), formulation=formulation).program
        if solver is None:
            reference = make_solver("daqp", program)
            solver = make_solver("active_set", program)
        expected, found = solved(reference, program), solved(solver, program)
        if expected is None:
            assert found is None, seed
            continue
        found_some += 1
        np.testing.assert_allclose(
            found, expected, rtol=0, atol=1e-5 * max(1.0, np.abs(expected).max())
        )
    assert found_some > 50
    assert (
        solver.searched < 0.5 * found_some
    )  # it is the exchange that was tested, not the dual method


def test_last_active_set_seldom_needs_help_in_a_walk():
    walk = hp.build(
        hp.Scenario(controller=hp.WholeBody(parameters={"solver": "active_set"}), duration=1.0)
    )
    run, controller = walk.run(), walk.controller
    assert run.metadata["ending"] == "completed"
    assert np.all(run["qp_status"] == 0)
    assert controller._solver.searched < 0.02 * len(run)


@given(st.integers(0, 10_000), st.sampled_from(sorted(FORMULATIONS)))
def test_solution_moves_the_robot_as_it_says(seed, formulation):
    """Torques, contact forces and thrusts of the solution, put through ABA, give its
    accelerations.
    """
    q, v, targets = random_case(seed)
    problem = built(q, v, targets, formulation=formulation)
    z = solved(make_solver("daqp", problem.program), problem.program)
    if z is None:
        return
    inputs = np.empty(12)
    problem.inputs(z, inputs)
    acceleration, force = problem.acceleration(z), problem.contact_force(z)
    dynamics = hp.Dynamics(ROBOT)
    dynamics.update(q, v)
    drive = inputs[6:] - ROBOT.model.damping[6:] * v[6:]  # what is left after the joints' friction
    force = generalised_force(dynamics, drive, force, inputs[:6].reshape(2, 3))
    np.testing.assert_allclose(forward_dynamics(dynamics, q, v, force), acceleration, atol=1e-6)


def test_warm_start_changes_nothing_but_the_work():
    run = hp.walk(hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.8), duration=1.0))
    gait = hp.make_gait(ROBOT)
    warm, cold = [], []
    replay = hp.make_controller("wbc", gait, mu=0.8)
    program = replay.problem.program
    solver, fresh = make_solver("proxqp", program), make_solver("proxqp", program)
    for i in range(0, len(run), 20):
        signals = (
            run[name][i] for name in ("q", "v", "foot_position", "foot_velocity", "foot_force")
        )
        state = hp.State(float(run["t"][i]), *signals)
        replay.prepare(state)
        replay.build(state)
        z = solver.solve(program).z.copy()
        warm.append(solver.solution.iterations)
        fresh.reset()
        np.testing.assert_allclose(fresh.solve(program).z, z, atol=1e-3)
        cold.append(fresh.solution.iterations)
    assert sum(warm) < sum(cold)


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_infeasible_is_reported_and_forgotten(name):
    """A foot that must push harder than the robot can bear: no usable solution, and the next
    problem is solved.
    """
    q, v, targets = random_case(0)
    program = built(q, v, targets).program
    solver = make_solver(name, program)
    good = solved(solver, program)
    targets.force_range[:] = (3000.0, 3001.0)
    assert solved(solver, built(q, v, targets).program) is None
    np.testing.assert_allclose(solved(solver, program), good, atol=ACCURACY[name])


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_not_a_number_never_passes_as_a_solution(name):
    """Wherever it comes in: in the objective, a constraint's row, its value, or a bound."""
    spoil = {
        "gradient": lambda p: p.gradient.__setitem__(0, np.nan),
        "row": lambda p: p.inequality.__setitem__((-1, 0), np.nan),
        "bound": lambda p: p.lower.__setitem__(-1, np.nan),
        "upper": lambda p: p.upper.__setitem__(0, np.nan),
    }
    for formulation in FORMULATIONS:
        for where, put in spoil.items():
            q, v, targets = random_case(4)
            program = built(q, v, targets, formulation=formulation).program
            solver = make_solver(name, program)
            bad = built(q, v, targets, formulation=formulation).program
            put(bad)
            assert not solver.solve(bad).usable, (formulation, where)
            assert solver.solve(program).usable, (formulation, where)
        q, v, targets = random_case(4)
        targets.feet[0, 0] = np.nan
        assert not solver.solve(built(q, v, targets, formulation=formulation).program).usable


def test_unknown_or_absent_solver(monkeypatch):
    q, v, targets = random_case(0)
    program = built(q, v, targets).program
    with pytest.raises(hp.InputError, match="unknown solver 'gurobi'; valid names: active_set, "):
        make_solver("gurobi", program)
    with pytest.raises(hp.InputError, match="unknown formulation"):
        make_problem("sparse", ROBOT)
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(hp.InputError, match=r"no daqp .*: pip install"):
        make_solver("daqp", program)
