"""Runs by the preview: fast ones in both plants, turns, stops, pushes, and a planner that fails."""

import warnings
from functools import cache

import numpy as np
import pytest
from needs import QUICK_PLANTS, needs_robots

import harpy_pin as hp
from harpy_pin.contrib.preview import Preview, planner

go2 = cache(lambda: hp.load_robot("go2"))
pytestmark = needs_robots
MOTORS = hp.Actuators(torque_share=1.0, no_load_share=1.0, stall_share=5.0)


def run_of(
    velocity,
    *,
    plant="compliant",
    duration,
    friction=0.8,
    robot=None,
    schedule="trot",
    **disturbances,
):
    robot = go2() if robot is None else robot
    preview = Preview(robot, velocity, mu=friction, gait=schedule)
    gait = hp.PlannedGait(robot, preview, rate=50)
    scenario = hp.Scenario(
        robot=robot,
        plant=plant,
        ground=hp.Ground(mu_s=friction, stiffness=robot.mass * 9.81 / 2e-3),
        disturbances=hp.Disturbances(actuators=MOTORS, **disturbances),
        duration=duration,
    )
    return hp.walk(scenario, gait=gait), gait


def speed(run, begin):
    k = np.searchsorted(run["t"], begin)
    return np.linalg.norm(run["q"][-1, :2] - run["q"][k, :2]) / (run["t"][-1] - run["t"][k])


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_go2_runs_at_2_5_m_s_with_flight(plant):
    run, gait = run_of((2.5, 0.0, 0.0), plant=plant, duration=10.0)
    assert run.ending == "completed"
    assert 2.3 < speed(run, 3.0) < 2.7
    assert gait.refused == 0
    late = run["t"] > 3.0
    flies = run["foot_force"].reshape(len(run["t"]), 4, 3)[late, :, 2].max(axis=1) == 0.0
    assert flies.mean() > 0.1
    assert np.abs(run["torque"]).max() <= go2().torque_limit.max()
    limit = go2().model.velocityLimit[6:]
    assert (np.abs(run["v"][late][:, 6:]) > limit).any(axis=1).mean() < 0.05


def test_commands_change_while_it_goes():
    """Forward and turning, aside, back, and to a stand."""
    script = ((0.0, 1.0, 0.0, 2.0), (2.0, 0.0, 0.5, 0.0), (3.5, -0.7, 0.0, 0.0), (5.0, 0, 0, 0))
    run, gait = run_of(script, duration=7.0)
    assert run.ending == "completed"
    turning = (run["t"] > 1.0) & (run["t"] < 2.0)
    assert run["v"][turning, 5].mean() == pytest.approx(2.0, abs=0.15)
    body = run["v"][(run["t"] > 3.0) & (run["t"] < 3.5)]
    assert body[:, 1].mean() == pytest.approx(0.5, abs=0.1)
    back = run["v"][(run["t"] > 4.5) & (run["t"] < 5.0)]
    assert back[:, 0].mean() == pytest.approx(-0.7, abs=0.1)
    assert np.abs(run["v"][-1]).max() < 0.02
    assert gait.planner.applied.tolist() == [0.0, 0.0, 0.0]


def test_command_may_be_set():
    def stops(t):
        gait.planner.command[:] = (0.8, 0.0, 0.0) if t < 1.0 else 0.0

    robot = go2()
    gait = hp.PlannedGait(robot, Preview(robot), rate=50)
    update = gait.update
    gait.update = lambda t: (stops(t), update(t))[1]
    run = hp.walk(hp.Scenario(robot=robot, ground=hp.Ground(mu_s=0.8), duration=3.0), gait=gait)
    assert run.ending == "completed"
    assert np.abs(run["v"][(run["t"] > 0.8) & (run["t"] < 1.0), 0] - 0.8).max() < 0.15
    assert np.abs(run["v"][-1]).max() < 0.02


@pytest.mark.parametrize("side", range(4))
def test_it_stands_pushes_of_1_m_s(side):
    angle, impulse = 0.5 * np.pi * side, go2().mass
    push = hp.Push(1.5, (impulse * np.cos(angle), impulse * np.sin(angle), 0.0))
    run, _ = run_of((1.0, 0.0, 0.0), duration=3.0, pushes=(push,))
    assert run.ending == "completed"
    assert speed(run, 2.5) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("name", "velocity"), [("anymal_c", 1.5), ("hyq", 2.0), ("solo12", 1.5)])
def test_other_quadrupeds_run(name, velocity):
    robot = hp.load_robot(name)
    run, _ = run_of((velocity, 0.0, 0.0), duration=3.0, robot=robot)
    assert run.ending == "completed"
    assert speed(run, 2.0) == pytest.approx(velocity, rel=0.1)


@pytest.mark.parametrize("plant", QUICK_PLANTS)
@pytest.mark.parametrize(("schedule", "flies"), [("bound", 0.05), ("pronk", 0.4)])
def test_bound_and_pronk_fly(schedule, flies, plant):
    run, gait = run_of((2.0, 0.0, 0.0), plant=plant, duration=3.0, schedule=schedule)
    assert run.ending == "completed"
    assert gait.refused == 0
    assert speed(run, 2.0) == pytest.approx(2.0, abs=0.2)
    late = run["t"] > 1.5
    assert (run["foot_force"][late, :, 2].max(axis=1) == 0.0).mean() > flies
    lifted = (run["stance"] == 0.0)[late].astype(int)  # left front, right front, and behind
    pairs = [(k, m) for k in range(4) for m in range(k) if (lifted[:, k] == lifted[:, m]).all()]
    assert len(pairs) == (2 if schedule == "bound" else 6)


@pytest.mark.parametrize("plant", QUICK_PLANTS)
def test_feet_hardly_slip_at_3_5_m_s(plant):
    run, _ = run_of((3.5, 0.0, 0.0), plant=plant, duration=5.0)
    assert run.ending == "completed"
    late = run["t"] > 2.5
    steps = (np.diff(run["stance"][late], axis=0) > 0.0).sum()
    assert 1e3 * np.ptp(run["slip_path"][late], axis=0).sum() / steps < 0.5


def test_what_the_motion_leaves_open_is_as_planned():
    """On two feet that is the force along their line, which neither moves nor turns the robot."""
    run, _ = run_of((1.0, 0.0, 0.0), duration=3.0)
    errors, late = [], run["t"] > 1.0
    held, stance = run["held"][late], run["stance"][late]
    off = (run["desired_force"] - run["planned_force"])[late]
    for k in np.flatnonzero((held.sum(axis=1) == 2.0) & (held == stance).all(axis=1))[::10]:
        first, second = np.flatnonzero(held[k])
        line = np.diff(run["foot_position"][late][k][[first, second]], axis=0)[0]
        errors.append((off[k, second] - off[k, first]) @ line / np.linalg.norm(line) / 2.0)
    assert len(errors) > 50
    assert np.sqrt(np.mean(np.square(errors))) < 0.1  # N


def test_a_turn_is_within_the_grip():
    """A command whose circle would ask for more than the friction gives is scaled down."""
    robot = go2()
    for mu, most in ((0.8, 0.6 * 0.8 * 9.81), (0.4, 0.6 * 0.4 * 9.81)):
        preview = Preview(robot, (2.5, 0.0, 2.4), mu=mu)
        q, v = hp.Standing(robot).initial_state()
        dynamics = hp.Dynamics(robot)
        dynamics.update(q, v)
        feet = dynamics.foot_position.copy()
        for t in np.arange(0.0, 3.0, 0.02):
            preview.plan(hp.State(t, q, v, feet, np.zeros((4, 3)), np.zeros((4, 3))))
        forward, _, turning = preview.applied
        assert forward * turning == pytest.approx(most, rel=1e-6)
        assert forward / turning == pytest.approx(2.5 / 2.4, rel=1e-6)


def test_a_solver_that_fails_ends_in_a_stand(monkeypatch):
    def fails(program):
        raise hp.HarpyError("the preview has no solution: none")

    monkeypatch.setattr(planner, "solved", fails)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run, gait = run_of((1.0, 0.0, 0.0), duration=0.5)
    assert run.ending == "completed"
    assert gait.status.startswith("stands without a plan; 25 refused: HarpyError")


def test_plans_are_the_motion_of_their_forces():
    """Momentum changes by the impulses of the planned forces, which are inside their cones."""
    robot = go2()
    preview, plans = Preview(robot, (2.0, 0.3, 0.5), mu=0.6), []
    plan = preview.plan
    preview.plan = lambda state: plans.append(plan(state)) or plans[-1]
    hp.walk(
        hp.Scenario(robot=robot, ground=hp.Ground(mu_s=0.6), duration=1.5),
        gait=hp.PlannedGait(robot, preview, rate=50),
    )
    assert len(plans) == 75
    for plan in plans[::5]:
        span, force = np.diff(plan.times), plan.force[:-1]
        impulse = np.einsum("i,ikc->ic", span, force) - np.outer(span, (0, 0, robot.mass * 9.81))
        change = robot.mass * np.diff(plan.velocity, axis=0)
        np.testing.assert_allclose(change, impulse, atol=1e-6)
        place = plan.position[:-1] + 0.5 * span[:, None] * (plan.velocity[:-1] + plan.velocity[1:])
        np.testing.assert_allclose(plan.position[1:], place, atol=1e-9)
        assert (force[~plan.contact[:-1]] == 0.0).all()
        # The pyramid is about the heading, so the cone around it holds whatever that is
        assert (np.hypot(*force.T[:2]) <= 0.75 * 0.6 * np.sqrt(2.0) * force.T[2] + 0.1).all()


def test_it_is_for_quadrupeds_on_points():
    for name in ("bolt", "g1"):
        with pytest.raises(hp.InputError, match="four legs of three joints"):
            Preview(hp.load_robot(name))
    for wrong in ({"mu": 0.0}, {"max_speed": -1.0}, {"velocity": (1.0,)}, {"gait": "hop"}):
        with pytest.raises(hp.InputError):
            Preview(go2(), **wrong)
    assert repr(Preview(go2(), (1.0, 0.0, 0.5))) == "Preview('go2', 1, 0 m/s, 0.5 rad/s)"


def test_a_command_beyond_the_motors_is_scaled_down():
    robot = go2()
    preview = Preview(robot, (4.0, 3.0, 0.0), max_speed=1.0)
    run = hp.walk(
        hp.Scenario(robot=robot, ground=hp.Ground(mu_s=0.8), duration=1.5),
        gait=hp.PlannedGait(robot, preview, rate=50),
    )
    assert run.ending == "completed"
    np.testing.assert_allclose(preview.applied, (0.8, 0.6, 0.0), atol=1e-9)


def test_commands_and_friction_are_checked(go2):
    preview = Preview(go2, (0.5, 0.0, 0.0))
    preview.command = (1.0, 0.0, 0.2)
    assert preview.command.tolist() == [1.0, 0.0, 0.2]
    for bad in ((1.0, 0.0), (np.nan, 0.0, 0.0), "fast"):
        with pytest.raises(hp.InputError, match="command"):
            preview.command = bad
    assert preview.command.tolist() == [1.0, 0.0, 0.2]
    with pytest.raises(hp.InputError, match="a bound falls"):
        Preview(go2, (0.5, 0.0, 0.0), gait="bound", mu=0.65)
