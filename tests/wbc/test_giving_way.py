"""Tasks that give way where torques reach their limits: the definition, both controllers, and
walks.
"""

import numpy as np
import pytest
from forward_dynamics import demand_of_centre
from walks import started, walked
from whole_body_oracle import ROBOT, WEIGHTS, wild_case

import harpy_pin as hp
from harpy_pin.controllers import CondensedController, WholeBodyController, WholeBodyParameters
from harpy_pin.wbc import WholeBodyLimits, make_problem, make_solver
from harpy_pin.wbc.active_set import VIOLATION
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus
from harpy_pin.wbc.giving_way import SPAN

DAMPED = hp.Actuators(viscous_friction=4.9).damped(ROBOT)


def give_way(problem, solver, dynamics, v, targets):
    """The solution by definition: without limits, then with limits about it; whether torques were
    beyond.
    """
    problem.build(dynamics, v, dynamics.rotation, targets)
    problem.kernels.limit(problem.record, problem.terms, problem.program.record, False)
    free = solver.solve(problem.program)
    inputs = np.zeros(12)
    problem.inputs(free.z, inputs)
    beyond = bool((np.abs(inputs[6:]) > problem.limits.torque_scale * ROBOT.torque_limit).any())
    problem.kernels.limit(problem.record, problem.terms, problem.program.record, True)
    if beyond and problem.limits.give_way < 1.0:
        problem.kernels.give_way(*problem._records(dynamics, targets), free.z.copy())
    return solver.solve(problem.program), beyond


@pytest.mark.parametrize(
    ("formulation", "mu", "torque_scale", "share"),
    [
        *(
            (formulation, 0.4, 0.5, WholeBodyLimits().give_way)
            for formulation in ("input_space", "full")
        ),
        *(
            ("input_space", mu, torque_scale, 1.0)
            for mu in (0.15, 0.6)
            for torque_scale in (1.0, 0.5)
        ),
    ],
)
def test_condensed_and_programs_have_the_same_optimum(formulation, mu, torque_scale, share, fuzz):
    """Forces, torques and thrusts at random states with targets far beyond reach, whatever is at a
    limit; where the share is one, nothing gives way. Every other time the body's target is the
    centre of mass's.
    """
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(2)
    limits = WholeBodyLimits(mu=mu, torque_scale=torque_scale, give_way=share)
    condensed, problem = (
        CondensedSolver(ROBOT, WEIGHTS, limits),
        make_problem(formulation, ROBOT, WEIGHTS, limits),
    )
    solver, expected = make_solver("daqp", problem.program), np.zeros(12)
    seen = dict.fromkeys(("compared", "beyond", "optimal", "thrust", "torque", "cone"), 0)
    for k in range(300 * fuzz):
        q, v, targets = wild_case(rng, spread=0.05)
        dynamics.update(q, v)
        if k % 2:
            demand_of_centre(targets, dynamics)
        given_range = targets.force_range.copy()
        inputs = condensed.solve(dynamics, v, targets)
        assert (np.abs(inputs[6:]) <= torque_scale * ROBOT.torque_limit).all()
        assert (targets.force_range == given_range).all()
        solution, beyond = give_way(problem, solver, dynamics, v, targets)
        if not solution.usable or condensed.status & (
            CondensedStatus.SUBOPTIMAL | CondensedStatus.TORQUE_CLIPPED
        ):
            continue
        problem.inputs(solution.z, expected)
        contact, scale = problem.contact_force(solution.z), 1.0 + np.abs(expected).max()
        np.testing.assert_allclose(inputs, expected, rtol=0, atol=2e-5 * scale)
        np.testing.assert_allclose(condensed.force, contact, rtol=0, atol=2e-5 * scale)
        seen["compared"] += 1
        seen["beyond"] += beyond
        seen["optimal"] += condensed.status == CondensedStatus.OPTIMAL
        seen["thrust"] += condensed.status == CondensedStatus.THRUST_LIMITED
        seen["torque"] += bool(condensed.status & CondensedStatus.TORQUE_LIMITED)
        seen["cone"] += bool((limits.pyramid @ contact[targets.held > 0].T < 1e-6).any())
    assert seen["beyond"] > 0.1 * seen["compared"] > 10
    assert seen["optimal"] > 50
    assert min(seen.values()) > 5


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_objective_and_least_forces_are_the_ones_defined(formulation):
    """The objective falls by ½ (1 − σ) w ‖a − a_d‖² of the swing feet; normal forces have another
    bound.
    """
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(4)
    limits = WholeBodyLimits(mu=0.4, torque_scale=0.3)
    problem = make_problem(formulation, ROBOT, WEIGHTS, limits)
    peak, swung = 0.3 * ROBOT.torque_limit, 0
    for _ in range(100):
        q, v, targets = wild_case(rng, spread=0.05)
        dynamics.update(q, v)
        problem.build(dynamics, v, dynamics.rotation, targets)
        size = len(problem.program.gradient)
        at, other = rng.standard_normal(size), 5.0 * rng.standard_normal(size)
        before, bound = (
            problem.program.objective(at) - problem.program.objective(other),
            problem.program.lower.copy(),
        )
        problem.kernels.give_way(*problem._records(dynamics, targets), other)
        after = problem.program.objective(at) - problem.program.objective(other)
        torque = np.zeros(12)
        problem.inputs(other, torque)
        errors = [
            dynamics.foot_jacobian @ problem.acceleration(z)
            + dynamics.foot_drift
            - targets.feet.reshape(-1)
            for z in (at, other)
        ]
        less = 0.0
        for k in np.flatnonzero(targets.held == 0.0):
            legs = slice(3 * k, 3 * k + 3)
            excess = max((np.abs(torque[6:]) / peak)[legs].max() - 1.0, 0.0)
            change = errors[0][legs] @ errors[0][legs] - errors[1][legs] @ errors[1][legs]
            less += 0.5 * (1.0 - limits.give_way) * min(excess / SPAN, 1.0) * WEIGHTS.swing * change
        assert before - after == pytest.approx(less, rel=1e-8, abs=1e-7)
        swung += int(less != 0.0)
        for k in np.flatnonzero(targets.held):
            legs = slice(3 * k, 3 * k + 3)
            share = min(1.0, (peak[legs] / np.abs(torque[6:][legs])).min())
            row = problem.program.bounded + problem.foot_rows * k + problem.foot_rows - 1
            change = problem.program.lower[row] - bound[row]
            assert change == pytest.approx((share - 1.0) * targets.force_range[k, 0], abs=1e-9)
    assert swung > 30


def test_nothing_changes_where_no_limit_is_near():
    """Bit by bit."""
    dynamics, rng = hp.Dynamics(ROBOT), np.random.default_rng(5)
    controllers = [
        CondensedSolver(ROBOT, WEIGHTS, WholeBodyLimits(mu=0.4, give_way=share))
        for share in (0.003, 1.0)
    ]
    same = differ = 0
    for _ in range(500):
        q, v, targets = wild_case(rng, spread=0.05)
        dynamics.update(q, v)
        for condensed in controllers:
            condensed.reset()
        one, other = (condensed.solve(dynamics, v, targets) for condensed in controllers)
        if any(condensed.status & CondensedStatus.TORQUE_LIMITED for condensed in controllers):
            differ += not np.array_equal(one, other)
        elif all(
            condensed.status & CondensedStatus.THRUST_LIMITED == 0 for condensed in controllers
        ):
            assert np.array_equal(one, other)
            same += 1
    assert same > 100
    assert differ > 30


@pytest.mark.parametrize(
    ("solver", "formulation", "within"),
    [
        ("active_set", "input_space", 1e-4),
        ("active_set", "full", 1e-4),
        ("proxqp", "input_space", 1e-3),
    ],
)
def test_controllers_agree_on_a_walk(solver, formulation, within):
    """On the states of a walk with the damping of the paper authors' model, whose torques are often
    at their limits.

    ProxQP ends within 1 mN·m of the optimum, and up to its tolerance of 1e-8 beyond a limit; the
    own search leaves ``VIOLATION``, and as much again for rounding where accelerations are large.
    """
    gait = hp.make_gait(DAMPED)
    limits = WholeBodyLimits(mu=0.8)
    condensed = CondensedController(gait, WholeBodyParameters.for_gait(gait, limits=limits))
    how = {"formulation": formulation, "solver": solver, "weights": WEIGHTS}
    parameters = WholeBodyParameters.for_gait(gait, limits=limits, **how)
    general = WholeBodyController(gait, parameters)
    simulator = started(hp.Simulator(DAMPED, hp.Ground(mu_s=0.8)), gait)
    limited = 0
    for n in range(1000):
        simulator.t = 1e-3 * n
        state = simulator.state
        command = condensed.step(state)
        other = general.step(state)
        np.testing.assert_allclose(other.torque, command.torque, rtol=0, atol=within)
        np.testing.assert_allclose(other.thrust, command.thrust, rtol=0, atol=within)
        assert (
            np.abs(other.torque)
            <= DAMPED.torque_limit + (2e-8 if solver == "proxqp" else 2.0 * VIOLATION)
        ).all()
        limited += bool(condensed.solver.status & CondensedStatus.TORQUE_LIMITED)
        simulator.advance(command, steps=2)
    assert limited > 200


@pytest.mark.parametrize("friction", [0.8, 0.3])
def test_stands_with_strong_damping(friction):
    """At friction 0.8 the condensed controller in which nothing gives way falls."""
    ends = []
    for share in (0.003, 1.0):
        part = hp.Condensed(parameters={"limits": {"give_way": share}})
        run = walked(hp.make_gait(DAMPED), controller=part, mu_s=friction, duration=3.0)
        ends.append(run.ending)
        if share < 1.0:
            assert hp.measure(run).slip_mm_per_step < 1.0
            assert (np.abs(run["torque"]) <= DAMPED.torque_limit).all()
    assert ends[0] == "completed"
    assert friction < 0.8 or ends[1] == "fell"


@pytest.mark.parametrize("name", ["condensed", "wbc"])
def test_stands_with_weak_motors(name):
    part = {"name": name, "parameters": {"limits": {"torque_scale": 0.3}}}
    run = walked(controller=part, actuators=hp.Actuators(torque_share=0.3), duration=2.0)
    assert run.ending == "completed"
    assert (
        np.abs(run["torque"]) <= 0.3 * ROBOT.torque_limit + (2e-8 if name == "wbc" else 1e-9)
    ).all()
    assert hp.measure(run).slip_mm_per_step < 1.0
