"""The simulator against reference integrations, and its convergence."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scripted import NO_COMMAND, Script, idle, standing

import harpy_pin as hp
from harpy_pin import Command, Ground, Simulator

MASS = 2.0


def walk(controller="governed", governor="none", dt=5e-4, duration=1.5, speed=0.3):
    part = hp.Governed(governor=governor) if controller == "governed" else controller
    gait, ground = hp.Straight(speed=speed), Ground(mu_s=0.8)
    return hp.walk(hp.Scenario(controller=part, gait=gait, ground=ground, dt=dt, duration=duration))


def drop_exactly(ground, height, times):
    """The condensed controller, integrated phase by phase: in the air, going down in the ground,
    coming up in it.
    """

    def slope(_, y):
        inside = -ground.stiffness * y[0] - ground.damping * min(y[1], 0.0)
        return [y[1], -9.81 + (max(inside, 0.0) if y[0] <= 0.0 else 0.0) / MASS]

    found = solve_ivp(
        slope, (0, times[-1]), [height, 0.0], rtol=1e-9, atol=1e-12, max_step=2e-4, t_eval=times
    )
    return found.y.T


def drop(sled, ground, height, dt, times):
    simulator = Simulator(sled, ground, dt=dt)
    q = pin.neutral(sled.model)
    q[2] = height
    simulator.reset(q, np.zeros(6))
    rows = []
    for _ in times:
        rows.append([simulator.q[2], simulator.v[2]])
        simulator.advance(NO_COMMAND, steps=round((times[1] - times[0]) / dt))
    return np.array(rows)


GROUNDS = {k: Ground(stiffness=1e3 * k, mu_s=0.8) for k in (4, 8, 16, 40, 80)}
"""By stiffness in kN/m, from grass to concrete under a rubber foot; the damping ratio is that of
the paper's ground.
"""


@pytest.mark.parametrize(
    "ground", [*(Ground(damping=d) for d in (0.0, 40.0, 268.3)), GROUNDS[4], GROUNDS[80]]
)
def test_drop_converges_to_the_explicit_law_with_order_one(sled, ground):
    """Height and velocity through touchdown, compression and rebound; mean over drop heights, as
    each touchdown falls somewhere in a step.
    """
    times = np.linspace(0.0, 0.16, 81)
    errors = np.zeros((4, 2))
    for height in np.linspace(0.01, 0.03, 7):
        exact = drop_exactly(ground, height, times)
        assert exact[:, 0].min() < -MASS * 9.81 / ground.stiffness  # it did land
        for k, dt in enumerate((2e-4, 1e-4, 5e-5, 2.5e-5)):
            errors[k] += np.abs(drop(sled, ground, height, dt, times) - exact).mean(axis=0)
    ratios = errors[:-1] / errors[1:]
    np.testing.assert_allclose(ratios, 2.0, atol=0.3)
    assert errors[-1, 0] / 7 < 2e-5


@pytest.mark.parametrize("slope", [0.0, np.pi / 6.0])
def test_rest_is_the_static_sink(sled, slope):
    """Of the load normal to the ground; a friction of 1 holds it."""
    gravity = 9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    simulator = Simulator(sled, Ground(mu_s=1.0), dt=1e-3, gravity=gravity)
    q = pin.neutral(sled.model)
    q[2] = 0.01 * (slope == 0.0)
    simulator.reset(q, np.zeros(6))
    simulator.advance(NO_COMMAND, steps=3000)
    assert simulator.static_penetration == pytest.approx(MASS * 9.81 * np.cos(slope) / 8000.0)
    assert simulator.q[2] == pytest.approx(-simulator.static_penetration, abs=1e-9)
    np.testing.assert_allclose(simulator.state.foot_force, [-MASS * gravity], atol=1e-5)


def test_bouncing_never_gains_height(sled):
    ground = Ground(damping=0.0)  # elastic: the worst case
    simulator = Simulator(sled, ground, dt=5e-4)
    q = pin.neutral(sled.model)
    q[2] = 0.05
    simulator.reset(q, np.zeros(6))
    energies = []
    for _ in range(4000):
        simulator.advance(NO_COMMAND)
        z, w = simulator.q[2], simulator.v[2]
        energies.append(
            0.5 * MASS * w**2 + MASS * 9.81 * z + 0.5 * ground.stiffness * min(z, 0.0) ** 2
        )
    # Semi-implicit flight exchanges m g · g dt² / 2 per step at most, contact gives nothing.
    assert np.max(np.diff(energies)) <= 0.5 * MASS * 9.81**2 * 5e-4**2 + 1e-12
    assert np.max(energies) <= energies[0] + 1e-9


@pytest.mark.parametrize("stiffness", [4, 8, 80])
def test_walks_on_every_ground_converge_with_order_one(stiffness):
    ground = GROUNDS[stiffness]
    runs = [
        hp.walk(
            hp.Scenario(controller=hp.Governed(governor="none"), ground=ground, dt=dt, duration=1.5)
        )
        for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4)
    ]
    assert [run.ending for run in runs] == ["completed"] * 4
    assert all(run.metadata["contact_unconverged"] == 0 for run in runs)
    for gaps in (
        [
            np.abs(fine["foot_force"][:, :, 2] - coarse["foot_force"][:, :, 2]).mean()
            for coarse, fine in pairwise(runs)
        ],
        [np.abs(fine["q"][:, :3] - coarse["q"][:, :3]).max() for coarse, fine in pairwise(runs)],
    ):
        assert gaps[1] < 0.65 * gaps[0]
        assert gaps[2] < 0.8 * gaps[1]
    forces = [run["foot_force"][:, :, 2].mean() for run in runs]
    assert abs(forces[1] - forces[3]) < 1e-3 * forces[3]


@pytest.mark.parametrize("controller", ["governed", "wbc"])
def test_stance_feet_of_a_standing_robot_do_not_drift(robot, controller):
    run = walk(controller, duration=2.0, speed=0.0)
    assert run.ending == "completed"
    feet = run["foot_position"][100:, :, :2]
    assert np.abs(feet - feet[0]).max() < 1e-9
    total = run["foot_force"][-1].sum(axis=0) + run["thrust"][-1].sum(axis=0)
    np.testing.assert_allclose(total, [0, 0, robot.mass * 9.81], atol=0.05)


def test_momentum_balance_of_a_walk(robot):
    """Newton for the whole: change of momentum = gravity + contact + thrust, step by step, to order
    one.
    """
    defects = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        gait = hp.make_gait(robot)
        simulator = Simulator(robot, Ground(mu_s=0.8), dt=dt)
        simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
        controller = hp.make_controller("governed", gait, mu=0.8, governor="none")
        data, impulse = robot.model.createData(), np.zeros(3)
        first = pin.computeCentroidalMomentum(
            robot.model, data, simulator.q, simulator.v
        ).linear.copy()
        for i in range(round(0.3 / dt)):
            if i % round(1e-3 / dt) == 0:
                command = controller.step(simulator.state)
            simulator.advance(command)
            force = simulator.state.foot_force.sum(axis=0) + command.thrust.sum(axis=0)
            impulse += dt * (force + robot.mass * np.array([0, 0, -9.81]))
        last = pin.computeCentroidalMomentum(robot.model, data, simulator.q, simulator.v).linear
        defects.append(np.linalg.norm(last - first - impulse))
    assert defects[2] < 0.6 * defects[1] < 0.36 * defects[0]


def test_forces_of_a_walk_are_lawful(robot):
    for cone in ("circular", "per_axis"):
        ground = Ground(mu_s=0.25, cone=cone)
        run = hp.walk(
            hp.Scenario(controller=hp.Governed(governor="none"), ground=ground, duration=1.5)
        )
        force, velocity = run["foot_force"], run["foot_velocity"]
        assert np.all(force[:, :, 2] >= 0.0)
        tangent, slip = force[:, :, :2], velocity[:, :, :2]
        reach = ground.mu_s * force[:, :, 2] + 1e-6
        if cone == "circular":
            size, speed = np.linalg.norm(tangent, axis=2), np.linalg.norm(slip, axis=2)
            assert np.all(size <= reach + 1.01 * ground.mu_v * speed + 1e-3)
        else:
            assert np.all(
                np.abs(tangent) <= reach[:, :, None] + 1.01 * ground.mu_v * np.abs(slip) + 1e-3
            )
        assert np.all(force[run["foot_position"][:, :, 2] > 1e-4] == 0.0)


def test_reset_forgets(robot):
    """The same simulator and controller, after another run and a reset, repeat themselves."""
    simulator, gait = standing(robot)
    controller = hp.make_controller("governed", gait, mu=0.8)
    start = gait.initial_state(penetration=simulator.static_penetration)
    runs = []
    for _ in range(2):
        simulator.reset(*start)
        controller.reset()
        runs.append(simulator.run(controller, 0.2))
    for name in runs[0].signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(runs[0][name], runs[1][name], err_msg=name)


def test_run_in_two_parts_is_the_run(robot):
    """Stopping at a tick and going on changes nothing."""

    def command(tick, state):
        return Command(200.0 * (start[0][7:] - state.q[7:]) - 2.0 * state.v[6:], np.zeros((2, 3)))

    simulator, gait = standing(robot)
    start = gait.initial_state(penetration=simulator.static_penetration)
    whole = simulator.run(Script(command), 0.1)
    simulator.reset(*start)
    parts = [simulator.run(Script(command), 0.06), simulator.run(Script(command), 0.04)]
    np.testing.assert_allclose(np.concatenate([p["t"] for p in parts]), whole["t"], atol=1e-12)
    for name in ("q", "v", "foot_force"):
        joined = np.concatenate([p[name] for p in parts])
        np.testing.assert_allclose(joined, whole[name], atol=1e-9, err_msg=name)


def test_controller_sees_what_is_logged_and_command_is_held(robot):
    """Ticks come at multiples of the period, whatever dt, and the state handed over is the row of
    the log.
    """
    simulator, _ = standing(robot, dt=2.5e-4)
    seen = []
    script = Script(lambda tick, state: (seen.append(state.copy()), idle())[1], period=2e-3)
    run = simulator.run(script, 0.05)
    assert len(run) == len(seen) == 25
    np.testing.assert_allclose(run["t"], 2e-3 * np.arange(25), atol=1e-15)
    for i, state in enumerate(seen):
        assert state.t == run["t"][i]
        np.testing.assert_array_equal(state.q, run["q"][i])
        np.testing.assert_array_equal(state.foot_force, run["foot_force"][i])
