"""Plans of an MPC: interpolation beside closed forms, targets beside Pinocchio, and walks whose
planner is late, stops or goes wrong.
"""

import pickle
import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from needs import QUICK_PLANTS, needs_robots
from scipy.spatial.transform import Rotation
from trot_planner import Trot

import harpy_pin as hp
from harpy_pin.wbc import WholeBodyLimits, WholeBodyTargets, make_problem, make_solver
from harpy_pin.wbc.condensed import CondensedSolver

go2 = cache(lambda: hp.load_robot("go2"))
pytestmark = [needs_robots, pytest.mark.filterwarnings("ignore:a plan was refused")]


def plan_of(**changes):
    """A plan of two feet, which walk in turn."""
    rows = {
        "times": [1.0, 1.1, 1.3, 1.4],
        "position": np.zeros((4, 3)),
        "contact": [[1, 0], [1, 1], [0, 1]],
        "foothold": np.arange(18.0).reshape(3, 2, 3),
    }
    return hp.Plan(**rows | changes)


class Changed:
    """Plans of another planner, changed by a function from a time on."""

    def __init__(self, planner, change, after=1.0):
        self.planner, self.change, self.after = planner, change, after

    def plan(self, state):
        plan = self.planner.plan(state)
        return plan if state.t < self.after else self.change(plan, state)


class Late:
    """Plans of another planner, told so much later, s."""

    def __init__(self, planner, delay):
        self.planner, self.delay, self.made = planner, delay, []

    def plan(self, state):
        self.made.append((state.t + self.delay - 1e-9, self.planner.plan(state)))
        ready = [plan for t, plan in self.made if t <= state.t]
        return ready[-1] if ready else None


class Asked(Executor):
    """Its work is done once that was asked so often: a thread beside a walk that is faster than
    real time would be as late as the machine is busy.
    """

    def __init__(self, times):
        self.times = times

    def submit(self, work, /, *given):
        future, left = Future(), iter(range(self.times))
        future.set_result(work(*given))
        future.done = lambda: next(left, None) is None
        return future


def walk(planner, *, plant="compliant", duration, controller="condensed", **options):
    gait = hp.PlannedGait(go2(), planner, **options)
    scenario = hp.Scenario(controller=controller, plant=plant, duration=duration)
    run = hp.walk(scenario, gait=gait)
    assert run.ending == "completed"
    return run, gait


def speed(run, begin):
    """Mean velocity forward from a time on, m/s."""
    k = np.searchsorted(run["t"], begin)
    return (run["q"][-1, 0] - run["q"][k, 0]) / (run["t"][-1] - run["t"][k])


def test_constant_acceleration_is_followed_exactly():
    times, a = np.array([0.0, 0.1, 0.25, 0.3]), np.array([1.0, -2.0, 3.0])
    place, v = np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.0, -1.0])
    spin, bend = np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, -4.0])
    t = times[:, None]
    plan = plan_of(
        times=times,
        position=place + v * t + 0.5 * a * t**2,
        velocity=v + a * t,
        orientation=spin * t + 0.5 * bend * t**2,
        angular_velocity=spin + bend * t,
    )
    for t in np.linspace(0.0, 0.3, 31):
        now = plan.at(t)
        np.testing.assert_allclose(now.position, place + v * t + 0.5 * a * t**2, atol=1e-14)
        np.testing.assert_allclose(now.velocity, v + a * t, atol=1e-14)
        np.testing.assert_allclose(now.acceleration, a, atol=1e-12)
        np.testing.assert_allclose(now.angular_velocity, spin + bend * t, atol=1e-14)
        np.testing.assert_allclose(now.angular_acceleration, bend, atol=1e-12)
    for t in times:
        yaw = 2.0 * t - 2.0 * t**2
        expected = Rotation.from_euler("z", yaw).as_matrix()
        np.testing.assert_allclose(plan.at(t).rotation, expected, atol=1e-14)


def test_orientations_take_the_shortest_rotation():
    rng, times = np.random.default_rng(0), [0.0, 0.2, 0.5]
    angles = rng.uniform(-1.0, 1.0, (3, 3))  # roll, pitch, yaw
    turns = Rotation.from_euler("xyz", angles)
    common = {"times": times, "position": np.zeros((3, 3)), "contact": [1, 1]}
    common["foothold"] = np.zeros((2, 3))
    by_angles = hp.Plan(**common, orientation=angles)
    by_quaternions = hp.Plan(**common, orientation=turns.as_quat())
    for i, s in ((0, 0.0), (0, 0.3), (1, 0.8), (1, 1.0)):
        span = times[i + 1] - times[i]
        way = (turns[i].inv() * turns[i + 1]).as_rotvec()
        expected = turns[i] * Rotation.from_rotvec(s * way)
        for plan in (by_angles, by_quaternions):
            now = plan.at(times[i] + s * span)
            np.testing.assert_allclose(now.rotation, expected.as_matrix(), atol=1e-12)
            if s < 1.0 or i == 1:
                spin = turns[i].apply(way) / span
                np.testing.assert_allclose(now.angular_velocity, spin, atol=1e-12)


def test_inputs_hold_and_feet_land_where_they_stand_next():
    plan = plan_of(force=np.arange(18.0).reshape(3, 2, 3), acceleration=np.eye(3))
    now = plan.at(1.05)
    assert now.contact.tolist() == [True, False]
    np.testing.assert_array_equal(now.foothold, [[0, 1, 2], [9, 10, 11]])  # its next foothold
    assert now.landing[1] == 1.1
    np.testing.assert_array_equal(now.acceleration, [1.0, 0.0, 0.0])
    later = plan.at(1.35)
    np.testing.assert_array_equal(later.foothold, [[12, 13, 14], [15, 16, 17]])
    assert later.landing[0] == 1.4  # with the end of the plan
    np.testing.assert_array_equal(later.force[1], [15, 16, 17])
    np.testing.assert_array_equal(plan.at(9.0).position, plan.position[-1])
    assert "1.000 to 1.400 s, 4 times, 2 feet" in repr(plan)
    again = pickle.loads(pickle.dumps(plan))  # to and from another process
    np.testing.assert_array_equal(again.at(1.35).foothold, later.foothold)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"times": [1.0, 1.1, 1.1, 1.4]}, "must increase"),
        ({"times": [1.0, 1.1, 1.05, 1.4]}, "must increase"),
        ({"times": [1.0, np.nan, 1.3, 1.4]}, "times must be finite"),
        ({"times": [1.0]}, "times must have shape"),
        ({"times": []}, "times must have shape"),
        ({"times": 1.0}, "times must have shape"),
        ({"position": np.full((4, 3), np.inf)}, "position must be finite"),
        ({"position": np.zeros((3, 3))}, "position must have shape"),
        ({"velocity": np.zeros((3, 3))}, "velocity must have shape"),
        ({"contact": 1}, "contact must have shape"),
        ({"contact": "left"}, "contact must be"),
        ({"contact": (1, 0.5)}, "contact must be 0 or 1"),
        ({"contact": (2, 1)}, "contact must be 0 or 1"),
        ({"contact": [[1, 0, 1]] * 4}, "foothold must have shape"),
        ({"force": np.zeros((4, 3, 3))}, "force must have shape"),
        ({"orientation": np.zeros((4, 4))}, "length one"),
        ({"orientation": np.zeros((4, 5))}, "orientation must have shape"),
        ({"centre_of_mass": "yes"}, "centre_of_mass must be"),
    ],
)
def test_bad_plans_are_refused(changes, words):
    with pytest.raises(hp.InputError, match=words):
        plan_of(**changes)


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_feet_that_swing_land_once_without_sliding(plant):
    """A trot at 1 m/s: no foot moves across the ground as it lands, and none is thrown up."""
    run, _ = walk(Trot(go2(), (1.0, 0.0)), plant=plant, duration=3.0)
    late = run["t"] > 1.0
    steps = (np.diff(run["stance"][late], axis=0) > 0.0).sum()
    assert 1e3 * np.ptp(run["slip_path"][late], axis=0).sum() / steps < 0.5
    met = (np.diff((run["foot_force"][late, :, 2] > 0.0).astype(int), axis=0) > 0).sum()
    assert met < 1.3 * steps


def test_whole_body_controllers_ask_for_the_planned_motion():
    """A robot that moves as planned is asked for the planned accelerations, whichever they are."""
    rng, robot = np.random.default_rng(2), go2()
    standing = hp.Standing(robot).initial_state()[0]
    for centre in (False, True):
        q = pin.integrate(robot.model, standing, 0.3 * rng.standard_normal(robot.model.nv))
        v = 0.5 * rng.standard_normal(robot.model.nv)
        turn, data = pin.Quaternion(q[3:7]).matrix(), robot.model.createData()
        pin.centerOfMass(robot.model, data, q, v)
        spin, a, bend = turn @ v[3:6], rng.normal(size=3), rng.normal(size=3)
        place, velocity = (data.com[0], data.vcom[0]) if centre else (q[:3], turn @ v[:3])
        steps = np.array([[0.0], [0.01]])
        plan = hp.Plan(
            times=steps[:, 0],
            position=place + steps * velocity,
            velocity=velocity,
            acceleration=a,
            orientation=np.tile(q[3:7], (2, 1)),
            angular_velocity=spin,
            angular_acceleration=bend,
            contact=np.ones(4),
            foothold=np.zeros((4, 3)),
            centre_of_mass=centre,
        )
        gait = hp.PlannedGait(robot, Changed(None, None))
        gait.planner.plan = lambda state, plan=plan: plan
        controller = hp.make_controller("condensed", gait, mu=0.6)
        dynamics = hp.Dynamics(robot)
        dynamics.update(q, v)
        force = np.tile((0.0, 0.0, 40.0), (4, 1))
        controller.step(hp.State(0.0, q, v, dynamics.foot_position, np.zeros((4, 3)), force))
        assert gait.status == "follows a plan from 0 ms ago"
        np.testing.assert_allclose(controller.targets.body, a, atol=1e-6)
        np.testing.assert_allclose(controller.targets.orientation, turn.T @ bend, atol=1e-6)


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_go2_trots_as_planned(plant):
    run, gait = walk(Trot(go2(), (0.5, 0.0)), plant=plant, duration=5.0)
    assert 0.35 < speed(run, 2.0) < 0.55
    assert gait.refused == 0
    assert gait.taken == 250
    assert run["plan_age"].max() < 0.021
    assert (run["plan_followed"] == 1.0).all()
    air = run["held"].reshape(len(run["t"]), 4) == 0.0
    assert 0.3 < air.mean() < 0.5  # two feet of four


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_plan_late_by_20_ms_stands(plant):
    run, gait = walk(Late(Trot(go2(), (0.5, 0.0)), 0.02), plant=plant, duration=3.0)
    assert gait.refused == 0
    assert run["plan_age"].max() == pytest.approx(0.039, abs=1e-6)
    assert speed(run, 1.0) > 0.3


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_planner_that_stops_ends_in_a_stand(plant):
    run, gait = walk(
        Changed(Trot(go2(), (0.5, 0.0)), lambda plan, state: None), plant=plant, duration=3.3
    )
    followed = run["t"][run["plan_followed"] == 1.0]
    assert followed[-1] == pytest.approx(0.98 + 0.32, abs=2e-3)  # to the end of its last plan
    assert gait.status == "stands without a plan"
    assert np.abs(run["v"][-1]).max() < 0.05
    assert run["q"][-1, 2] > 0.28


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_planner_that_stops_at_1_m_s_walks_to_a_stand(plant):
    """Wherever in the step its last plan ends."""
    for after in (1.0, 1.06, 1.12, 1.18):
        planner = Changed(Trot(go2(), (1.0, 0.0)), lambda plan, state: None, after)
        run, _ = walk(planner, plant=plant, duration=4.0)
        assert np.abs(run["v"][-1]).max() < 0.05


def test_foot_that_lands_goes_where_it_is_going():
    """A foothold that leaps to and fro by 10 cm, every 10 ms, asks for no large accelerations."""
    robot, worst = go2(), 0.0
    q, v = hp.Standing(robot).initial_state()
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    foot, times = dynamics.foot_position.copy(), np.array([0.0, 0.2, 0.4])
    contact = [[0, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1]]

    def leaps(state):
        goal = foot + np.array([0.05 * (-1.0) ** round(100 * state.t), 0.0, 0.0])
        return hp.Plan(times=times, position=q[:3], contact=contact, foothold=goal)

    planner = Changed(None, None)
    planner.plan = leaps
    gait = hp.PlannedGait(robot, planner, rate=100)
    for k in range(199):
        gait.observe(hp.State(1e-3 * k, q, v, foot, np.zeros((4, 3)), np.zeros((4, 3))))
        target = gait.update(1e-3 * k)
        if k > 100:
            worst = max(worst, float(np.abs(target.foot_acceleration[0, :2]).max()))
    assert gait.refused == 0
    assert worst < 500.0  # where it follows to the end: 4870 m/s²


def broken(**changes):
    """Plans with other values of some arguments, by functions of the plan."""

    def change(plan, state):
        rows = {name: getattr(plan, name) for name in ("times", "position", "contact", "foothold")}
        return hp.Plan(**rows | {name: new(plan) for name, new in changes.items()})

    return change


def two_feet(plan, state):
    return hp.Plan(
        times=plan.times, position=plan.position, contact=[1, 1], foothold=np.zeros((2, 3))
    )


WRONG = {
    "raises": (lambda plan, state: {}["no such key"], "KeyError: 'no such key'"),
    "is no plan": (lambda plan, state: 3.0, "plan must be a Plan, got 3.0"),
    "nan": (broken(position=lambda p: p.position * np.nan), "position must be finite"),
    "backwards": (broken(times=lambda p: p.times[::-1]), "times of a plan must increase"),
    "feet": (two_feet, "it has 2 feet, and 'go2' 4"),
    "jump": (broken(position=lambda p: np.add(p.position, (0.2, 0.0, 0.0))), "0.20 m and"),
    "turned": (broken(orientation=lambda p: (0.0, 0.0, 1.0)), "rad from the measured body"),
    "over": (broken(orientation=lambda p: np.linspace((0, 0, 0), (3, 0, 0), 17)), "turns over"),
    "leap": (
        broken(position=lambda p: p.position + 0.3 * (np.arange(17) == 9)[:, None]),
        "positions change by",
    ),
    "far feet": (broken(foothold=lambda p: p.foothold + 3.0), "footholds are"),
    "old": (broken(times=lambda p: p.times - 1.0), "it is for"),
    "early": (broken(times=lambda p: p.times + 1.0), "it is for"),
    "fast": (broken(velocity=lambda p: (0.0, 0.0, 99.0)), "velocity is 99 m/s"),
    "strong": (broken(force=lambda p: np.full((4, 3), 1e9)), "forces are 1.73e\\+09 N"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_followed_ends_in_a_stand(name):
    change, words = WRONG[name]
    run, gait = walk(Changed(Trot(go2(), (0.5, 0.0)), change, 0.5), duration=1.5)
    assert run["plan_followed"][-1] == 0.0
    assert gait.refused == run["plans_refused"][-1] == 50
    assert gait.taken == 25
    with pytest.raises(type(gait.error), match=words.removeprefix("KeyError: ")):
        raise gait.error
    assert gait.status.startswith("stands without a plan; 50 refused: ")


def test_it_goes_on_once_plans_are_good_again():
    def silent(plan, state):
        return plan if state.t > 1.5 else None

    run, gait = walk(Changed(Trot(go2(), (0.5, 0.0)), silent, 0.5), duration=3.5)
    assert run["plan_followed"].min() == 0.0
    assert gait.status == "follows a plan from 19 ms ago"
    assert speed(run, 2.5) > 0.3


def test_first_refusal_is_warned_of():
    with pytest.warns(UserWarning, match="a plan was refused at 0.000 s: KeyError"):
        walk(Changed(Trot(go2(), (0.5, 0.0)), WRONG["raises"][0], 0.0), duration=0.01)


def test_slow_planner_in_a_thread_is_never_waited_for():
    """Its first plan does not come before the walk is over; then each is taken when it is there."""
    gate, inner = threading.Event(), Trot(go2(), (0.5, 0.0))

    class Slow:
        def plan(self, state):
            gate.wait(60.0)
            return inner.plan(state)

    with ThreadPoolExecutor(1) as executor:
        _, gait = walk(Slow(), duration=0.3, executor=executor)
        assert gait.status == "stands without a plan"
        gate.set()
    state = gait._state
    gait.observe(state)
    gait.update(0.3)  # which takes what has come, and finds its executor gone
    assert gait.taken == 1
    assert isinstance(gait.error, RuntimeError)
    _, gait = walk(inner, duration=1.0, executor=Asked(20))
    assert gait.taken > 1


@pytest.mark.parametrize("formulation", ["full", "input_space"])
def test_condensed_and_programs_have_one_optimum_with_planned_forces(formulation):
    """At random states and planned forces, in every support: to a millionth of a newton."""
    robot, rng, limits = go2(), np.random.default_rng(3), WholeBodyLimits(mu=0.6)
    fitting = hp.controllers.WholeBodyParameters.for_gait(hp.Standing(robot)).weights
    weights = replace(fitting, posture=1e-12, force=1e-3)  # the condensed one has no posture task
    condensed = CondensedSolver(robot, weights, limits)
    problem = make_problem(formulation, robot, weights, limits)
    solver, dynamics = make_solver("daqp", problem.program), hp.Dynamics(robot)
    standing, moved = hp.Standing(robot).initial_state()[0], 0
    for k in range(64):
        q = pin.integrate(robot.model, standing, 0.1 * rng.standard_normal(18))
        v, targets = 0.3 * rng.standard_normal(18), WholeBodyTargets(robot)
        targets.held[:] = [(k >> foot) & 1 for foot in range(4)]
        targets.body[:], targets.orientation[:] = 2.0 * rng.standard_normal((2, 3))
        targets.feet[:] = rng.standard_normal((4, 3))
        targets.force_range[:] = (1.0, 200.0)
        dynamics.update(q, v)
        condensed.solve(dynamics, v, targets)
        without = condensed.force.copy()
        targets.force[:] = rng.uniform((-10.0, -10.0, 0.0), (10.0, 10.0, 80.0), (4, 3))
        condensed.solve(dynamics, v, targets)
        problem.build(dynamics, v, dynamics.rotation, targets)
        assert solver.solve(problem.program).usable
        expected = problem.contact_force(solver.solution.z)
        np.testing.assert_allclose(condensed.force, expected, rtol=0, atol=1e-6)
        moved += np.abs(condensed.force - without).max() > 1.0
    assert moved > 30


@pytest.mark.parametrize("controller", ["condensed", "wbc"])
def test_planned_forces_are_followed_where_they_hold_the_robot(controller):
    """Standing, most of the weight on one diagonal and then on the other."""
    robot = go2()
    q, v = hp.Standing(robot).initial_state()
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    centre, weight = pin.centerOfMass(robot.model, robot.model.createData(), q), robot.mass * 9.81
    feet = dynamics.foot_position
    # Loads that hold the weight about the centre of mass, and what may be added to them
    rows = np.vstack((np.ones(4), (feet - centre)[:, :2].T))
    even = np.linalg.lstsq(rows, np.array([weight, 0.0, 0.0]), rcond=None)[0]
    free = np.linalg.svd(rows)[2][-1]

    class Shifts:
        def plan(self, state):
            force = np.zeros((2, 4, 3))
            force[:, :, 2] = even + 30.0 * np.sin(3.0 * state.t) * free
            times = [state.t, state.t + 0.1]
            place = [q[:3], q[:3]]
            return hp.Plan(
                times=times, position=place, contact=np.ones(4), foothold=feet, force=force
            )

    run, _ = walk(Shifts(), duration=1.5, controller=controller)
    late = run["t"] > 0.3
    planned = run["planned_force"].reshape(-1, 4, 3)[late]
    assert np.ptp(planned[:, 0, 2]) > 25.0
    for name in ("desired_force", "foot_force"):
        error = run[name].reshape(-1, 4, 3)[late] - planned
        assert np.sqrt(np.mean(error**2)) < 2.0  # N


def test_it_is_a_gait_like_others():
    gait = hp.PlannedGait(go2(), Trot(go2(), (0.5, 0.0)), rate=25.0)
    with pytest.raises(hp.InputError, match="observe"):
        gait.update(0.0)
    assert repr(gait) == "PlannedGait('go2', Trot, 25 Hz)"
    assert gait.describe()["planner"] == "Trot"
    standing = hp.WalkingGait(go2())
    assert gait.controller_parameters == standing.controller_parameters
    np.testing.assert_array_equal(gait.initial_state()[0], standing.initial_state()[0])
    with pytest.raises(hp.InputError, match="follows no plan"):
        hp.make_controller("governed", gait, mu=0.5)
    with pytest.raises(hp.InputError, match="planner must be a Planner with plan"):
        hp.PlannedGait(go2(), lambda state: None)


def test_bad_samples_are_ignored():
    """Every tenth of them: the planner never sees one, and the robot walks."""
    gait = hp.PlannedGait(go2(), Trot(go2(), (0.5, 0.0)))
    observe, count = gait.observe, iter(range(10_000))

    def spoilt(state):
        state = state.copy()
        bad = next(count)
        if bad % 10 == 5:
            array = (state.q, state.v, state.foot_position)[bad % 3]
            array[...] = (np.nan, 0.0, np.inf)[bad // 10 % 3]
        observe(state)

    gait.observe = spoilt
    run = hp.walk(hp.Scenario(controller="condensed", duration=1.0), gait=gait)
    assert run.ending == "completed"
    assert gait.refused == 0


def test_clock_that_goes_back_begins_anew():
    gait = hp.PlannedGait(go2(), Trot(go2(), (0.5, 0.0)))
    runs = []
    for _ in range(2):
        scenario = hp.Scenario(controller="condensed", duration=0.4)
        runs.append(hp.walk(scenario, gait=gait))
    np.testing.assert_array_equal(runs[0]["q"], runs[1]["q"])
    assert gait.taken == 20
