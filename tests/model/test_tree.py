"""Kernels over the tree against Pinocchio, for every kind of joint; and many physics steps in one
crossing.
"""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import mass_matrix
from hypothesis import given, settings
from hypothesis import strategies as st
from random_trees import BODIES, random_model, random_state
from walks import started

import harpy_pin as hp
from harpy_pin.errors import RobotError
from harpy_pin.kernels import kernel
from harpy_pin.model.terms import integrate, inverse_dynamics, joint_space_terms, place_bodies
from harpy_pin.model.tree import tree_record

seeds = st.integers(0, 2**32 - 1)


@kernel
def terms(tree, q, v, mass_matrix, bias):
    place_bodies(tree, q, v)
    joint_space_terms(tree, v, mass_matrix, bias)


@kernel
def forces(tree, q, v, acceleration, out):
    place_bodies(tree, q, v)
    inverse_dynamics(tree, v, acceleration, out)


@kernel
def moved(tree, q, displacement):
    integrate(tree, q, displacement)


@settings(max_examples=80)
@given(seed=seeds, far=st.sampled_from([1.0, 1e3]))
def test_terms_are_pinocchios(seed, far):
    """Also a kilometre from the world's origin: the kernel's numbers are relative to the base."""
    model, rng = random_model(seed)
    q, v = random_state(model, rng, far=far)
    tree, matrix, bias = tree_record(model), np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    terms(tree, *random_state(model, rng), matrix, bias)  # nothing may be left of an earlier state
    terms(tree, q, v, matrix, bias)
    data = model.createData()
    near = q.copy()
    near[:3] = 0.0  # neither depends on where the robot is
    expected = mass_matrix(model, near)
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    force = pin.nonLinearEffects(model, data, near, v)
    np.testing.assert_allclose(bias, force, rtol=0, atol=1e-11 * max(1.0, np.abs(force).max()))
    pin.forwardKinematics(model, data, near, v)
    for i in range(BODIES):
        placement = data.oMi[1].actInv(data.oMi[i + 1])
        np.testing.assert_allclose(tree["axes"][0, i], placement.rotation, rtol=0, atol=1e-13)
        np.testing.assert_allclose(
            tree["position"][0, i], placement.translation, rtol=0, atol=1e-12
        )
        np.testing.assert_allclose(
            tree["twist"][0, i],
            data.oMi[1].actInv(data.oMi[i + 1].act(data.v[i + 1])).vector,
            rtol=0,
            atol=1e-11,
        )


@settings(max_examples=40)
@given(seed=seeds)
def test_inverse_dynamics_is_pinocchios(seed):
    model, rng = random_model(seed)
    q, v = random_state(model, rng)
    a, tree, out = rng.normal(size=model.nv), tree_record(model), np.zeros(model.nv)
    forces(tree, *random_state(model, rng), a, out)  # nothing may be left of an earlier state
    forces(tree, q, v, a, out)
    expected = mass_matrix(model, q) @ a + pin.nonLinearEffects(model, model.createData(), q, v)
    np.testing.assert_allclose(out, expected, rtol=0, atol=1e-11 * max(1.0, np.abs(expected).max()))


@settings(max_examples=120)
@given(seed=seeds, exponent=st.floats(-9.0, 0.7))
def test_integration_is_pinocchios(seed, exponent):
    """From displacements of rounding's size to turns of more than half a circle."""
    model, rng = random_model(seed)
    q, v = random_state(model, rng)
    displacement = 10.0**exponent * v
    tree, here = tree_record(model), q.copy()
    moved(tree, here, displacement)
    np.testing.assert_allclose(
        here, pin.integrate(model, q, displacement), rtol=0, atol=1e-13 * max(1.0, 10.0**exponent)
    )


@pytest.mark.parametrize(
    "kind",
    [
        pin.JointModelSpherical(),
        pin.JointModelPlanar(),
        pin.JointModelHelicalUnaligned(np.array([0, 0, 1.0]), 0.1),
    ],
)
def test_other_joints_are_refused_by_name(kind):
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.addJoint(root, kind, pin.SE3.Identity(), "odd")
    with pytest.raises(RobotError, match="joint 'odd'"):
        tree_record(model)


def test_other_roots_are_refused():
    model = pin.Model()
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    with pytest.raises(RobotError, match="free flyer"):
        tree_record(model)


def test_many_steps_are_one_after_the_other(gait, robot):
    """With a push that begins and ends between them."""
    pushes = (hp.Push(0.0012, (0.3, -0.2, 0.1), duration=0.0021),)
    rng, ends = np.random.default_rng(3), []
    command = hp.Command(rng.uniform(-3, 3, 6), rng.uniform(-9, 9, (2, 3)))
    for steps in (1, 4, 12):
        simulator = started(hp.Simulator(robot), gait)
        for _ in range(12 // steps):
            simulator.advance(command, pushes, steps=steps)
        ends.append((simulator.q.copy(), simulator.v.copy(), simulator.state.foot_force))
        assert simulator.t == pytest.approx(12 * simulator.dt)
    for end in ends[1:]:
        for one, many in zip(ends[0], end, strict=True):
            np.testing.assert_allclose(many, one, rtol=0, atol=1e-13 * max(1.0, np.abs(one).max()))


def test_push_gives_its_impulse(robot):
    """In free flight the momentum changes by the impulse, and by what it turns about the centre of
    mass; the step's own error is of second order in so small an impulse.
    """
    simulator = hp.Simulator(robot, gravity=(0.0, 0.0, 0.0))
    q = hp.make_gait(robot).initial_state()[0]
    q[2] += 10.0
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.3, -0.2, 0.5]))).coeffs()
    simulator.reset(q, np.zeros(12))
    impulse = 1e-3 * np.array([0.5, -0.4, 0.2])
    before = simulator.q[:3] - pin.centerOfMass(robot.model, robot.model.createData(), simulator.q)
    simulator.advance(
        hp.Command(np.zeros(6), np.zeros((2, 3))),
        (hp.Push(0.0, tuple(impulse), duration=1e-3),),
        steps=2,
    )
    momentum = pin.computeCentroidalMomentum(
        robot.model, robot.model.createData(), simulator.q, simulator.v
    )
    np.testing.assert_allclose(momentum.linear, impulse, atol=1e-9)
    np.testing.assert_allclose(momentum.angular, np.cross(before, impulse), atol=1e-9)
