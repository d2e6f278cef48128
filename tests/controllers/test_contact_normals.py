"""Whole-body control on ground that is not level: against a program of the test's own with cones
about the normals.
"""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import constrained_dynamics, frame_terms, mass_matrix
from hypothesis import given, settings
from hypothesis import strategies as st
from optimality import Programs, optima_from
from tilted_cases import (
    GivenTargets,
    fill,
    parameters,
    random_state,
    sloped_case,
    smallest_rotation,
)
from whole_body_oracle import MU, NV, ROBOT, solve_oracle

from harpy_pin.controllers import CondensedController, WholeBodyController
from harpy_pin.governors import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.model.state import Command
from harpy_pin.wbc import FORMULATIONS, FootForceTask, WholeBodyLimits

LIMITS = WholeBodyLimits(mu=MU, give_way=1.0)
seeds = st.integers(0, 2**32 - 1)


def inputs_of(q, v, z):
    """Thrusts and torques of a solution [a; f; u], by Pinocchio."""
    model = ROBOT.model
    force = (
        mass_matrix(model, q) @ z[:NV]
        + pin.nle(model, model.createData(), q, v)
        + model.damping * v
    )
    jacobian, _ = frame_terms(model, (*ROBOT.feet, *ROBOT.thrusters), q, v)
    force -= jacobian.reshape(-1, NV).T @ z[NV:]
    np.testing.assert_allclose(force[:6], 0.0, atol=1e-6)
    return z[NV + 6 :], force[6:]


@pytest.mark.parametrize("name", FORMULATIONS)
def test_commands_are_those_of_an_independent_program(name, fuzz):
    """The QP's; those of the condensed controller are looked at in ``test_optima_on_slopes.py``."""
    controller = WholeBodyController(
        GivenTargets(), parameters(LIMITS, formulation=name, solver="active_set")
    )
    rng = np.random.default_rng(5)
    compared = binding = 0
    for _ in range(60 * fuzz):
        state, command, case = sloped_case(controller, rng)
        np.testing.assert_array_equal(controller.targets.held, controller.gait.target.stance)
        z, flag = solve_oracle(case)
        optimum = optima_from(Programs.of([case]), z[None]) if flag > 0 else None
        if optimum is None or not optimum.fits[0]:
            continue
        z = optimum.z[0]  # to rounding: the equations of its active set, solved densely
        thrust, torque = inputs_of(state.q, state.v, z)
        compared += 1
        scale = 1.0 + np.abs(z).max()
        binding += bool((case[4][:16] @ z > case[5][:16] - 1e-6).any())
        tolerance = 2e-6 * scale  # DAQP's own
        np.testing.assert_allclose(command.thrust.ravel(), thrust, atol=tolerance)
        np.testing.assert_allclose(command.torque, torque, atol=tolerance)
        np.testing.assert_allclose(
            np.reshape(controller.telemetry()["desired_force"], (2, 3)),
            z[NV : NV + 6].reshape(2, 3),
            atol=tolerance,
        )
    assert compared > 30 * fuzz
    assert binding > 10 * fuzz


@given(seed=seeds)
@settings(max_examples=15)
def test_normals_that_are_vertical_change_no_bit(seed):
    results = []
    for normal in (None, (0.0, 0.0, 1.0), (-0.0, 0.0, 1.0)):
        controller, own = (
            CondensedController(GivenTargets(), parameters(LIMITS)),
            np.random.default_rng(seed),
        )
        fill(controller.gait.target, own, steepest=0.0)
        controller.gait.target.normal[:] = (0.0, 0.0, 1.0)
        state = random_state(own, controller.gait.target)
        if normal is not None:
            controller.gait.target.normal[:] = normal
        command = controller.step(state)
        results.append(np.concatenate((command.torque, command.thrust.ravel())).tobytes())
    assert len(set(results)) == 1


def test_a_task_on_a_force_is_in_world_axes():
    """With a large weight the foot's force is the one asked for, where the cone allows it."""
    controller = WholeBodyController(GivenTargets(), parameters(LIMITS, solver="active_set"))
    target = controller.gait.target
    rng = np.random.default_rng(8)
    desired = np.array([1.0, -2.0, 18.0])
    controller.add(FootForceTask(ROBOT.feet[0], force=desired), weight=1e3)
    fill(target, rng, steepest=0.2, size=0.1)
    target.stance[:] = 1.0
    controller.step(random_state(rng, target, spread=0.01))
    np.testing.assert_allclose(
        np.reshape(controller.telemetry()["desired_force"], (2, 3))[0], desired, atol=0.02
    )


def test_the_filter_keeps_forces_in_cones_about_the_normals(fuzz):
    """Against the rigid robot's forces by one dense system in world axes."""
    rng = np.random.default_rng(9)
    mu = 0.4
    contact_filter = ContactForceFilter(
        ROBOT,
        ContactForceFilterParameters(mu=mu, lag=0.0, thrust_authority=1e6, torque_authority=1e6),
    )
    target, changed, held = GivenTargets().target, 0, 0
    for _ in range(300 * fuzz):
        fill(target, rng)
        target.stance[:] = 1.0
        state = random_state(rng, target, spread=0.05)
        state.v[:] *= 10.0 ** rng.uniform(-3.0, 0.0)
        contact_filter.reset()
        contact_filter.normal[:] = target.normal
        command = contact_filter.update(
            state, Command(rng.normal(0.0, 3.0, 6), rng.normal(0.0, 3.0, (2, 3)))
        )
        changed += bool(np.abs(contact_filter.bend).max() > 1e-6)
        damping = contact_filter.parameters.contact_damping
        force, _ = constrained_dynamics(ROBOT, state.q, state.v, command, (1, 1), damping=damping)
        np.testing.assert_allclose(
            contact_filter.force, force, atol=1e-6 * (1.0 + np.abs(force).max())
        )
        own = np.array(
            [smallest_rotation(n).T @ f for n, f in zip(target.normal, force, strict=True)]
        )
        jacobian, _ = frame_terms(ROBOT.model, ROBOT.feet, state.q, state.v)
        speed = np.linalg.norm(jacobian @ state.v, axis=1).max()
        if speed < contact_filter.parameters.sliding_speed:
            held += 1
            assert (np.hypot(own[:, 0], own[:, 1]) <= mu * own[:, 2] + 1e-6).all()
    assert held > 50 * fuzz
    assert changed > 50 * fuzz


@pytest.mark.parametrize(
    "normal", [(0.1, 0.0, 1.0), (0.0, 1.0, 0.0), (0.6, 0.0, -0.8), (float("nan"), 0.0, 1.0)]
)
def test_a_normal_that_is_none_is_a_bad_sample(normal):
    controller = CondensedController(GivenTargets(), parameters(LIMITS))
    rng = np.random.default_rng(0)
    fill(controller.gait.target, rng)
    state = random_state(rng, controller.gait.target)
    first = controller.step(state).torque.copy()
    controller.gait.target.normal[0] = normal
    np.testing.assert_array_equal(controller.step(state).torque, first)
    assert controller.bad_samples == 1
