"""The simulator: rest, convergence, momentum and energy, and what a run is made of."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scripted import NO_COMMAND, Script, idle, standing
from walks import put, started, walked

import harpy_pin as hp
from harpy_pin import Command, Ground, Simulator

MASS = 2.0


@pytest.mark.parametrize("slope", [0.0, np.pi / 6.0])
def test_rest_is_the_static_sink(sled, slope):
    """Of the load normal to the ground; a friction of 1 holds it."""
    gravity = 9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    simulator = put(Simulator(sled, Ground(mu_s=1.0), dt=1e-3, gravity=gravity), z=0.01 * (slope == 0.0))
    simulator.advance(NO_COMMAND, steps=3000)
    assert simulator.static_penetration == pytest.approx(MASS * 9.81 * np.cos(slope) / 8000.0)
    assert simulator.q[2] == pytest.approx(-simulator.static_penetration, abs=1e-9)
    np.testing.assert_allclose(simulator.state.foot_force, [-MASS * gravity], atol=1e-5)


def test_bouncing_never_gains_height(sled):
    ground = Ground(damping=0.0)  # elastic: the worst case
    simulator, energies = put(Simulator(sled, ground, dt=5e-4), z=0.05), []
    for _ in range(4000):
        simulator.advance(NO_COMMAND)
        z, w = simulator.q[2], simulator.v[2]
        energies.append(0.5 * MASS * w**2 + MASS * 9.81 * z + 0.5 * ground.stiffness * min(z, 0.0) ** 2)
    # Semi-implicit flight exchanges m g · g dt² / 2 per step at most, contact gives nothing.
    assert np.max(np.diff(energies)) <= 0.5 * MASS * 9.81**2 * 5e-4**2 + 1e-12
    assert np.max(energies) <= energies[0] + 1e-9


@pytest.mark.parametrize("stiffness", [4, 8, 80])
def test_walks_on_every_ground_converge_with_order_one(stiffness):
    """From grass to concrete under a rubber foot, kN/m; the damping ratio is that of the paper's ground."""
    ground = Ground(stiffness=1e3 * stiffness, mu_s=0.8)
    ungoverned = hp.Governed(governor="none")
    runs = [walked(controller=ungoverned, ground=ground, dt=1e-3 / n, duration=1.5) for n in (1, 2, 4, 8)]
    assert [run.ending for run in runs] == ["completed"] * 4
    assert all(run.metadata["contact_unconverged"] == 0 for run in runs)
    for gaps in (
        [np.abs(fine["foot_force"][:, :, 2] - coarse["foot_force"][:, :, 2]).mean() for coarse, fine in pairwise(runs)],
        [np.abs(fine["q"][:, :3] - coarse["q"][:, :3]).max() for coarse, fine in pairwise(runs)],
    ):
        assert gaps[1] < 0.65 * gaps[0]
        assert gaps[2] < 0.8 * gaps[1]
    forces = [run["foot_force"][:, :, 2].mean() for run in runs]
    assert abs(forces[1] - forces[3]) < 1e-3 * forces[3]


@pytest.mark.parametrize("controller", ["governed", "wbc"])
def test_stance_feet_of_a_standing_robot_do_not_drift(robot, controller):
    part = hp.Governed(governor="none") if controller == "governed" else controller
    run = walked(controller=part, gait=hp.Straight(speed=0.0), mu_s=0.8, duration=2.0)
    assert run.ending == "completed"
    feet = run["foot_position"][100:, :, :2]
    assert np.abs(feet - feet[0]).max() < 1e-9
    total = run["foot_force"][-1].sum(axis=0) + run["thrust"][-1].sum(axis=0)
    np.testing.assert_allclose(total, [0, 0, robot.mass * 9.81], atol=0.05)


def test_momentum_balance_of_a_walk(robot):
    """Newton for the whole: change of momentum = gravity + contact + thrust, step by step, to order one."""
    defects = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        gait = hp.make_gait(robot)
        simulator = started(Simulator(robot, Ground(mu_s=0.8), dt=dt), gait)
        controller = hp.make_controller("governed", gait, mu=0.8, governor="none")
        data, impulse = robot.model.createData(), np.zeros(3)
        first = pin.computeCentroidalMomentum(robot.model, data, simulator.q, simulator.v).linear.copy()
        for i in range(round(0.3 / dt)):
            if i % round(1e-3 / dt) == 0:
                command = controller.step(simulator.state)
            simulator.advance(command)
            force = simulator.state.foot_force.sum(axis=0) + command.thrust.sum(axis=0)
            impulse += dt * (force + robot.mass * np.array([0, 0, -9.81]))
        last = pin.computeCentroidalMomentum(robot.model, data, simulator.q, simulator.v).linear
        defects.append(np.linalg.norm(last - first - impulse))
    assert defects[2] < 0.6 * defects[1] < 0.36 * defects[0]


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
    """Ticks come at multiples of the period, whatever dt, and the state handed over is the row of the log."""
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
