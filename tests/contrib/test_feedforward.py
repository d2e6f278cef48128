"""Delay and noise: the leg law with feedforward."""

import numpy as np
import pytest
from forward_dynamics import ContactForceMap
from walks import scenario, walked

import harpy_pin as hp
from harpy_pin.controllers.parameters import FeedforwardGains
from harpy_pin.model.dynamics import Dynamics

SOFT = {
    "stance_p": (0.0,) * 3,
    "stance_d": (0.0,) * 3,
    "swing_p": (0.0,) * 3,
    "swing_d": (0.0,) * 3,
}


def half_a_second():
    """The state after half a second of a walk, on one foot."""
    built = hp.build(scenario(controller=hp.Governed(governor="none"), mu_s=0.8, duration=0.5))
    built.run()
    return built.simulator.state


def test_feedforward_alone_makes_the_forces_and_motion_it_asks_for(gait, robot):
    """Without any feedback, on the gait's own state: the force that sticking then demands of the
    foot that carries is the planned one up to what roll, pitch and yaw add, and a foot in the air
    accelerates as the gait asks.
    """
    joints = {"k_p": (0.0,) * 3, "k_i": (0.0,) * 3, "k_d": (0.0,) * 3}
    controller = hp.make_controller(
        "governed",
        gait,
        mu=0.8,
        governor="none",
        legs="feedforward",
        feedforward=SOFT,
        joints=joints,
    )
    state = half_a_second()
    command = controller.step(state)
    target = controller.target
    assert list(target.stance) == [1.0, 0.0]
    # Independent of the kernel: M a + n = S τ + Jᵀ f + J_tᵀ u of the joints, with Dynamics' own
    # terms.
    d = Dynamics(robot)
    d.update(state.q, state.v)
    force = robot.mass * (target.body[6:9] + np.array([0.0, 0.0, 9.81])) - command.thrust.sum(
        axis=0
    )
    acceleration = np.zeros(12)
    acceleration[:3] = d.rotation.T @ target.body[6:9]
    for k in range(2):
        legs = slice(6 + 3 * k, 9 + 3 * k)
        block = d.foot_jacobian[3 * k : 3 * k + 3, legs]
        acceleration[legs] = np.linalg.solve(block, target.foot_acceleration[k])
    desired = d.mass_matrix @ acceleration + d.bias - d.foot_jacobian[:3].T @ force
    np.testing.assert_allclose(command.torque, desired[6:], rtol=1e-9, atol=1e-9)
    # And what it is for: the foot is pressed by about the load that is left.
    contact = ContactForceMap(robot)
    felt = contact.update(d, state.v, command, [True, False])
    assert felt[0, 2] == pytest.approx(force[2], rel=0.1)


def test_gains_follow_the_phase(gait):
    """An error of one joint is answered by the stiffness of its leg's phase."""
    gains = FeedforwardGains(stance_p=(500.0, 400.0, 300.0), swing_p=(90.0, 80.0, 70.0))
    parameters = {
        "legs": "feedforward",
        "joints": {"k_i": (0.0,) * 3},
        "feedforward": {"stance_p": gains.stance_p, "swing_p": gains.swing_p},
    }
    state, stiffness = half_a_second(), []
    for loaded in (True, False):
        torques = []
        for small in (1e-6, -1e-6):
            controller = hp.make_controller("governed", gait, mu=0.8, governor="none", **parameters)
            moved = state.copy()
            moved.q[7:] += small
            if not loaded:
                moved.foot_force[:] = 0.0
            torques.append(controller.step(moved).torque.copy())
        stiffness.append((torques[1] - torques[0]) / 2e-6)
    # The feedforward changes too with the posture; the difference between the phases is that of the
    # gains.
    assert stiffness[0][:3] - stiffness[1][:3] == pytest.approx(
        np.subtract(gains.stance_p, gains.swing_p), abs=1e-2
    )
    assert stiffness[0][3:] == pytest.approx(stiffness[1][3:], abs=1e-2)


@pytest.mark.parametrize("delay", [0.0, 2e-3, 3e-3])
def test_it_walks_where_the_pid_falls(delay):
    """On ground that its gains were not chosen on."""
    how = {"mu_s": 0.8, "delay": delay, "duration": 3.0}
    run = walked(
        controller=hp.Governed(governor="none", limits=True, parameters={"legs": "feedforward"}),
        **how,
    )
    assert run.ending == "completed"
    assert not hp.measure(run).stumbled
    assert np.abs(run["torque"]).max() <= 8.5
    if delay:
        assert walked(controller=hp.Governed(governor="none"), **how).ending != "completed"
