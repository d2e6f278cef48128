import numpy as np
import pinocchio as pin
import pytest
from walks import OWN_SEARCH, started, states_of, walked

import harpy_pin as hp
from harpy_pin.controllers import (
    GovernedController,
    JointGains,
    WholeBodyController,
    WholeBodyParameters,
)
from harpy_pin.wbc import QPStatus


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("governed", {"governor": "none"}),
        ("governed", {"governor": "paper", "evaluate_at": "measured"}),
        ("governed", {"governor": "paper", "evaluate_at": "tracked"}),
        ("governed", {"governor": "paper", "limits": True}),
        ("wbc", {}),
        ("wbc", {"parameters": OWN_SEARCH}),
    ],
)
@pytest.mark.parametrize("speed", [0.3, 0.0])
def test_walks_and_stands(robot, name, options, speed):
    """Six seconds at friction 0.8: the distance within 5 %, the body upright."""
    part = {"name": name, "mu": 0.8, **options}
    run = walked(gait=hp.Straight(speed=speed), controller=part, mu_s=0.8, duration=6.0)
    measures = hp.measure(run)
    assert run.ending == "completed"
    assert measures.distance_m == pytest.approx(6.0 * speed, rel=0.05, abs=0.02)
    assert max(measures.roll_max_rad, measures.pitch_max_rad, measures.yaw_max_rad) <= 0.25
    assert measures.solver_failures == 0
    if name == "wbc":
        assert np.abs(run["torque"]).max() <= robot.torque_limit.max() + 1e-3
        assert measures.thrust_max_n <= robot.thrust_limit
    if options.get("limits"):
        assert (np.abs(run["torque"]) <= robot.torque_limit).all()


@pytest.mark.parametrize(("solver", "within"), [("active_set", 1e-9), ("proxqp", 1e-6)])
def test_the_qps_step_is_the_chain_of_its_phases(robot, solver, within):
    """The phases called apart give the same commands as step, on the same states."""
    run = walked(controller=hp.WholeBody(parameters={"solver": solver}), mu_s=0.8, duration=0.3)
    whole, apart = (
        hp.make_controller("wbc", hp.make_gait(robot), mu=0.8, solver=solver) for _ in range(2)
    )
    for i, state in enumerate(states_of(run)):
        command = whole.step(state)
        np.testing.assert_allclose(command.torque, run["torque"][i], atol=within)
        apart.prepare(state)
        apart.build(state)
        apart.solve()
        again = apart.finish(state)
        # ProxQP's vectorised sums depend on where its memory lies: equal to rounding, not to the
        # bit.
        np.testing.assert_allclose(again.torque, command.torque, atol=within)
        np.testing.assert_allclose(again.thrust, command.thrust, atol=within)


def test_governed_tick_against_its_formulas(gait, robot):
    """Thrust and torque of one tick, written out in vectors."""
    rng = np.random.default_rng(1)
    q, v = gait.initial_state()
    q, v = (
        pin.integrate(robot.model, q, 0.02 * rng.standard_normal(12)),
        v + 0.1 * rng.standard_normal(12),
    )
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    force = np.array([[0.0, 0.0, 25.0], [1.0, 2.0, 15.0]])
    state = hp.State(0.4, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force)
    controller = GovernedController(gait)
    command = controller.step(state)
    target = gait.update(0.4)

    rotation = pin.Quaternion(q[3:7]).matrix()
    velocity = rotation @ v[:3]
    centre = 400.0 * (target.body[:3] - q[:3]) + 40.0 * (target.body[3:6] - velocity)
    np.testing.assert_allclose(command.thrust.sum(axis=0), centre, atol=1e-9)

    k_p, k_i, k_d = (np.tile(g, 2) for g in (JointGains().k_p, JointGains().k_i, JointGains().k_d))
    angles, rates = np.zeros(6), np.zeros(6)
    for k, geometry in enumerate(gait.geometry):
        level = target.world_frame_blend[k]
        p, p_dot = target.foot_position[k], target.foot_velocity[k]
        held = rotation.T @ (target.body[:3] + p - q[:3])
        moving = rotation.T @ (target.body[3:6] + p_dot - velocity) - np.cross(v[3:6], held)
        point = (1 - level) * p + level * held
        angles[3 * k : 3 * k + 3] = hp.model.leg_inverse_kinematics(geometry, point)
        step = 1e-6
        moved = (1 - level) * p_dot + level * moving
        ahead = hp.model.leg_inverse_kinematics(geometry, point + step * moved)
        behind = hp.model.leg_inverse_kinematics(geometry, point - step * moved)
        rates[3 * k : 3 * k + 3] = (ahead - behind) / (2 * step)
    error = angles - q[7:]
    torque = k_p * error + np.clip(k_i * error * 1e-3, -4, 4) + k_d * (rates - v[6:])
    np.testing.assert_allclose(command.torque, torque, atol=1e-4)
    # Centre of pressure: mean of the feet, weighted by their normal forces.
    centre_of_pressure = (25.0 * state.foot_position[0] + 15.0 * state.foot_position[1]) / 40.0
    np.testing.assert_allclose(
        controller.telemetry()["centre_of_pressure"], centre_of_pressure, atol=1e-12
    )


def test_centre_of_pressure_is_held_in_flight(gait):
    controller = GovernedController(gait)
    q, v = gait.initial_state()
    feet = np.array([[0.1, 0.1, 0.0], [-0.1, -0.1, 0.0]])
    state = hp.State(
        0.0, q, v, feet, np.zeros((2, 3)), np.array([[0.0, 0.0, 30.0], [0.0, 0.0, 10.0]])
    )
    controller.step(state)
    before = np.array(controller.telemetry()["centre_of_pressure"])
    state.foot_force[:] = 0.0
    state.foot_position[:] += 0.5
    controller.step(state)
    np.testing.assert_array_equal(controller.telemetry()["centre_of_pressure"], before)


def test_target_out_of_reach_is_reported(gait, robot):
    """A body far from its target would need longer legs: the distance is logged, nothing is not a
    number.
    """
    controller = GovernedController(gait)
    q, v = gait.initial_state()
    q[2] += 1.0
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    command = controller.step(
        hp.State(
            0.7,
            q,
            v,
            dynamics.foot_position.copy(),
            dynamics.foot_velocity.copy(),
            np.zeros((2, 3)),
        )
    )
    assert np.isfinite(command.torque).all()
    assert np.max(controller.telemetry()["out_of_reach"]) > 0.5


@pytest.mark.parametrize("solver", ["active_set", "proxqp"])
def test_failed_solves_fall_back_as_stated(robot, solver):
    """The last good command is held, then the joints go soft without thrust; the failures are
    counted.
    """
    gait = hp.make_gait(robot, speed=0.0)
    controller = WholeBodyController(
        gait, WholeBodyParameters.for_gait(gait, hold_ticks=3, solver=solver)
    )
    simulator = started(hp.Simulator(robot, hp.Ground(mu_s=0.8)), gait)
    for _ in range(5):
        command = controller.step(simulator.state)
        simulator.advance(command)
    good = (command.torque.copy(), command.thrust.copy())
    assert np.abs(good[1]).max() > 0.0
    for attempt in range(1, 6):
        state = simulator.state
        controller.prepare(state)
        controller.build(state)
        program = controller.problem.program
        row = program.bounded + 4
        program.upper[row] = program.lower[row] - 1.0  # f_max below f_min: infeasible
        assert controller.solve().status > QPStatus.INACCURATE
        command = controller.finish(state)
        if attempt <= 3:
            np.testing.assert_array_equal(command.torque, good[0])
            np.testing.assert_array_equal(command.thrust, good[1])
        else:
            assert np.all(command.thrust == 0.0)
            assert (np.abs(command.torque) <= robot.torque_limit).all()
    assert controller.failures == 5
    controller.step(simulator.state)
    assert controller.solution.usable
