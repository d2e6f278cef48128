"""ProxQP as the solver of the whole-body QP: that it runs, what it finds, and what follows where it
does not finish.
"""

import itertools
from dataclasses import asdict
from typing import Any

import numpy as np
import proxsuite
import pytest
from random_states import LEGS, draw
from walks import states_of, walked
from whole_body_oracle import ROBOT

import harpy_pin as hp
from harpy_pin.contrib.solvers import QuadprogSolver
from harpy_pin.controllers import WholeBodyParameters
from harpy_pin.model.record import make_record
from harpy_pin.wbc import QPStatus, QuadraticProgram, make_solver
from harpy_pin.wbc.solvers import ProxQPSolver, ScaledProgramRecord, write_scaled

OWN = hp.WholeBody(parameters={"solver": "active_set"})


class Counted:
    """A ``proxsuite`` QP whose solves are counted, in the place of
    ``proxsuite.proxqp.dense.QP``.
    """

    solves = 0

    def __init__(self, *sizes: Any, **more: Any) -> None:
        self._qp = _QP(*sizes, **more)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._qp, name)

    def solve(self) -> None:
        Counted.solves += 1
        self._qp.solve()


_QP = proxsuite.proxqp.dense.QP


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> type[Counted]:
    monkeypatch.setattr(proxsuite.proxqp.dense, "QP", Counted)
    monkeypatch.setattr(Counted, "solves", 0)
    return Counted


@pytest.mark.parametrize(
    "controller", ["wbc", hp.WholeBody(), hp.WholeBody(parameters={"thrust_lag": 0.05})], ids=str
)
def test_every_tick_of_the_default_calls_proxsuite(controller: Any, counted: type[Counted]) -> None:
    run = walked(controller=controller, mu_s=0.8, duration=0.3)
    assert counted.solves >= len(run)
    assert hp.measure(run).solver_fallbacks == 0


@pytest.mark.parametrize("more", [{}, {"thrust_lag": 0.05}, {"formulation": "full"}], ids=str)
def test_the_own_search_never_calls_proxsuite(more: dict[str, Any], counted: type[Counted]) -> None:
    run = walked(
        controller=hp.WholeBody(parameters={"solver": "active_set", **more}), mu_s=0.2, duration=0.3
    )
    assert run.ending == "completed"
    walked(controller="condensed", mu_s=0.2, duration=0.1)
    assert counted.solves == 0


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_commands_are_those_of_active_set_methods(formulation: str, fuzz: int) -> None:
    """At random states, within 1 mN·m of our own search, DAQP and quadprog; they agree on what has
    no solution.
    """
    rng = np.random.default_rng(1)
    names = ("proxqp", "active_set", "daqp", "quadprog")
    made = {
        name: hp.make_controller(
            "wbc", hp.make_gait(ROBOT), mu=0.4, formulation=formulation, solver=name
        )
        for name in names
    }
    solved = limited = 0
    for k in range(150 * fuzz):
        state = draw(ROBOT, rng, legs=LEGS[k % 5])
        commands = {name: controller.step(state) for name, controller in made.items()}
        usable = {name: controller.solution.usable for name, controller in made.items()}
        assert len(set(usable.values())) == 1, (k, usable)
        if not usable["proxqp"]:
            continue
        solved += 1
        limited += bool((np.abs(commands["daqp"].torque) > ROBOT.torque_limit - 1e-6).any())
        for name in names[1:]:
            np.testing.assert_allclose(
                commands["proxqp"].torque, commands[name].torque, rtol=0, atol=1e-3
            )
            np.testing.assert_allclose(
                commands["proxqp"].thrust, commands[name].thrust, rtol=0, atol=1e-3
            )
    assert solved > 50 * fuzz
    assert limited > 10 * fuzz


def test_walks_are_those_of_the_own_search() -> None:
    """Pushed on slippery ground, torques at their limits: the same way to some nanometres, and no
    fallback.
    """
    weak = {"limits": {"torque_scale": 0.3}}
    how = {"mu_s": 0.25, "duration": 1.5, "pushes": (hp.Push(0.6, (0.0, 3.0, 0.0)),)}
    how |= {"actuators": hp.Actuators(torque_share=0.3)}
    runs = [
        walked(controller=hp.WholeBody(parameters={"solver": s, **weak}), **how)
        for s in ("proxqp", "active_set")
    ]
    assert (np.abs(runs[1]["torque"]) > 0.3 * ROBOT.torque_limit - 1e-6).any(axis=1).sum() > 50
    np.testing.assert_allclose(runs[0]["q"], runs[1]["q"], rtol=0, atol=1e-6)
    assert hp.measure(runs[0]).solver_fallbacks == hp.measure(runs[0]).solver_failures == 0


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", ["go2", "g1"])
def test_robots_stand_without_a_fallback_whatever_the_unit_of_the_weights(
    name: str, factor: float
) -> None:
    """The robots' own weights times a common factor; torques are those of DAQP within 1 mN·m."""
    gait = hp.Standing(hp.load_robot(name))
    w = WholeBodyParameters.for_gait(gait).weights
    weights = {task: factor * weight for task, weight in asdict(w).items()}
    made = {
        s: hp.make_controller("wbc", gait, mu=0.6, weights=weights, solver=s)
        for s in ("proxqp", "daqp")
    }
    run = hp.walk(
        hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.6), duration=0.1), gait=gait
    )
    for state in states_of(run):
        commands = [controller.step(state) for controller in made.values()]
        np.testing.assert_allclose(commands[0].torque, commands[1].torque, rtol=0, atol=1e-3)
    assert made["proxqp"].fallbacks == 0


def test_where_proxqp_does_not_finish_the_dual_method_follows_and_is_counted() -> None:
    """One iteration is too few for most programs; the commands are the optimum's all the same."""
    gait = hp.make_gait(ROBOT)
    states = states_of(walked(controller=OWN, mu_s=0.25, duration=0.4))

    def hasty(program: QuadraticProgram) -> ProxQPSolver:
        return ProxQPSolver(program, max_iterations=1, inner_iterations=1)

    one = hp.WholeBodyController(gait, solver=hasty)
    other = hp.make_controller("wbc", gait, mu=one.parameters.limits.mu, solver="active_set")
    for state in states:
        command, expected = one.step(state), other.step(state)
        np.testing.assert_allclose(command.torque, expected.torque, rtol=0, atol=1e-3)
    assert 0 < one.fallbacks <= len(states)
    assert one.telemetry()["qp_fallbacks"] == one.fallbacks
    assert one.failures == 0
    one.reset()
    assert one.fallbacks == 0


def test_programs_without_a_solution_are_bounded_and_fall_back() -> None:
    """A foot that must push harder than the motors can: ProxQP ends, the dual method proves it, the
    command is held.
    """
    settings = {"min_normal_force": 900.0, "max_normal_force": 1000.0}
    gait = hp.make_gait(ROBOT)
    controller = hp.make_controller("wbc", gait, mu=0.5, limits={"give_way": 1.0}, **settings)
    solver = controller._solver
    assert isinstance(solver, ProxQPSolver)
    for k, state in enumerate(states_of(walked(controller=OWN, mu_s=0.5, duration=0.05))):
        command = controller.step(state)
        assert np.isfinite(command.torque).all()
        assert (np.abs(command.torque) <= ROBOT.torque_limit).all()
        assert not controller.solution.usable
        assert solver.solution.iterations <= 20 * 20
        assert (controller.failures, controller.fallbacks) == (k + 1, k + 1)


def small_program(n: int = 6, rows: int = 10, seed: int = 0) -> QuadraticProgram:
    """A random strictly convex program with one-sided rows of both kinds."""
    rng = np.random.default_rng(seed)
    program = QuadraticProgram(n, equalities=1, inequalities=rows, bounded=2)
    root = rng.standard_normal((n, n))
    program.hessian[:], program.gradient[:] = (
        root @ root.T + np.eye(n),
        5.0 * rng.standard_normal(n),
    )
    program.equality[:], program.equality_value[:] = rng.standard_normal((1, n)), 0.1
    program.inequality[2:] = rng.standard_normal((rows, n))
    program.lower[2:7], program.upper[7:] = -0.2, 0.2  # five from below, five from above
    program.lower[:2], program.upper[:2] = -1.0, 1.0
    return program


def test_rows_from_below_become_rows_from_above() -> None:
    program = small_program()
    n, _, rows = program.shape
    record = make_record(ScaledProgramRecord, {"size": n, "rows": rows})
    write_scaled(program._record_, 10.0, record)
    matrix, lower, upper = (record[name][0] for name in ("inequality", "lower", "upper"))
    for z in np.random.default_rng(1).standard_normal((200, n)):
        ours = np.maximum(lower - matrix @ z, matrix @ z - upper)
        given = program.inequality @ z
        np.testing.assert_allclose(
            ours, np.maximum(program.lower - given, given - program.upper), atol=1e-12
        )
    np.testing.assert_array_equal(record["hessian"][0], 10.0 * program.hessian)
    np.testing.assert_array_equal(record["gradient"][0], 10.0 * program.gradient)
    assert (upper < 1e19).all()
    assert (lower[2:] < -1e19).all()


def test_infeasible_rows_from_below_are_seen_by_proxqp_itself() -> None:
    """z ≥ 1 and −z ≥ 1, both as lower bounds, of each variable: ProxQP's own word, without the dual
    method.
    """
    program = QuadraticProgram(3, equalities=0, inequalities=6, bounded=0)
    program.hessian[:] = np.eye(3)
    program.inequality[:3], program.inequality[3:] = np.eye(3), -np.eye(3)
    program.lower[:] = 1.0
    assert make_solver("proxqp", program).solve(program).status is QPStatus.INFEASIBLE


def test_small_programs_are_solved_to_the_optimum_where_proxqp_says_so() -> None:
    """With the duality gap checked: 200 programs, each from the last one's solution, against
    quadprog.
    """
    solver = make_solver("proxqp", small_program())
    exact = QuadprogSolver(small_program())
    optimal = 0
    for seed in range(200):
        program = small_program(seed=seed)
        found, best = solver.solve(program), exact.solve(program)
        if found.status is QPStatus.SOLVED:
            optimal += 1
            assert best.usable, seed
            np.testing.assert_allclose(found.z, best.z, rtol=0, atol=1e-6)
    assert optimal > 50


@pytest.mark.parametrize("where", ["gradient", "row", "bound"])
def test_what_is_not_a_number_never_outlives_its_tick(where: str) -> None:
    program = small_program()
    solver = make_solver("proxqp", program)
    good = solver.solve(program).z.copy()
    bad = small_program()
    {"gradient": bad.gradient, "row": bad.inequality[-1], "bound": bad.upper}[where][-1] = np.nan
    assert not solver.solve(bad).usable
    assert solver.solve(program).usable
    np.testing.assert_allclose(solver.solution.z, good, rtol=0, atol=1e-7)


@pytest.mark.parametrize(("motors", "added"), [*itertools.product((False, True), repeat=2)])
def test_bad_samples_are_answered_as_by_the_own_search(motors: bool, added: bool) -> None:
    """Nothing is solved and nothing remembered, with joint targets and with added tasks, too."""
    settings = {"joint_stiffness": 1.0, "joint_damping": 0.3} if motors else {}
    states = states_of(walked(controller=OWN, mu_s=0.5, duration=0.05))
    made = [
        hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.5, solver=solver, **settings)
        for solver in ("proxqp", "active_set")
    ]
    for controller in made if added else ():
        controller.add(hp.CentreOfMassTask(), weight=1e-3)
    for k, state in enumerate(states):
        if k % 7 == 3:
            bad = state.copy()
            bad.v[2] = np.nan
            state = bad
        one, other = (controller.step(state) for controller in made)
        np.testing.assert_allclose(one.torque, other.torque, rtol=0, atol=1e-3)
        if motors:
            np.testing.assert_allclose(one.law, other.law, rtol=0, atol=1e-3)
    assert made[0].bad_samples == made[1].bad_samples > 0
