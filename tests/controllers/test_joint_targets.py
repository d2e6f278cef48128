"""Joint targets of the whole-body controllers: the integrator, a rigid world, condensed and QP, and
what cannot be.
"""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import ContactForceMap, constrained_dynamics, mass_matrix
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots
from walks import scenario, states_of

import harpy_pin as hp
from harpy_pin.controllers import WholeBodyParameters
from harpy_pin.controllers.joint_targets import (
    MAX_RATE,
    JointTargetsRecord,
    add_lacking,
    joint_gains,
    move_targets,
)
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import FADE, HOLD_TICKS
from harpy_pin.model.record import make_record
from harpy_pin.wbc.condensed import CondensedStatus

ROBOT = hp.load_harpy()
MOTORS = {"joint_stiffness": 1.0, "joint_damping": 0.3}


def make(name, **more):
    return hp.make_controller(name, hp.make_gait(ROBOT), mu=0.25, **MOTORS, **more)


def record(*, leak=0.0, period=1e-3):
    share = -np.expm1(-leak * period)
    values = {
        "period": period,
        "share": share,
        "lead": 0.5 * period,
        "gains": np.array([[10.0], [2.0]]),
    }
    return make_record(JointTargetsRecord, {"joints": 1, "nv": 7, "feet": 1}, **values)


def tick(m, *, a, angle, speed, usable=True):
    q, v, acceleration = np.zeros(8), np.zeros(7), np.zeros(7)
    q[7], v[6], acceleration[6] = angle, speed, a
    move_targets(m, acceleration, usable, q, v)
    return m["law"][0, :, 0]


numbers = st.floats(-50.0, 50.0)


@given(numbers, numbers, numbers, st.integers(1, 50))
def test_without_a_leak_targets_are_those_of_a_constant_acceleration(a, angle, speed, n):
    """The command has them half a tick later than the tick begins; what is measured after the first
    tick is nothing.
    """
    m = record()
    for k in range(n):
        law = tick(m, a=a, angle=angle if k == 0 else 1e3, speed=speed if k == 0 else -1e3)
    t = (n - 0.5) * 1e-3
    expected = [angle + speed * t + 0.5 * a * t * t, speed + a * t, 10.0, 2.0]
    np.testing.assert_allclose(law, expected, rtol=1e-12, atol=1e-11)


@given(numbers, st.floats(1.0, 400.0), st.integers(1, 80))
def test_the_leak_is_a_low_pass(a, leak, n):
    """Of a joint that does not move, whatever is intended: in the end the speed is that of a h / ρ,
    nearly a / λ.
    """
    m = record(leak=leak)
    for _ in range(n):
        tick(m, a=a, angle=0.0, speed=0.0)
    keep = np.exp(-leak * 1e-3)
    w = a * 1e-3 * (1.0 - keep**n) / (1.0 - keep)
    x = (0.5e-6 * a + 1e-6 * a / (1.0 - keep)) * (1.0 - keep**n) / (1.0 - keep)
    x -= 1e-6 * a / (1.0 - keep) * n * keep ** (n - 1)
    np.testing.assert_allclose(m["target"][0, :, 0], [x, w], rtol=1e-7, atol=1e-9)


def test_without_a_solution_targets_are_what_is_measured():
    weak = {"name": "condensed", "limits": {"torque_scale": 0.005}, **MOTORS}
    run = hp.walk(hp.Scenario(controller=weak, duration=0.5))
    none = run["condensed_status"].astype(int) & CondensedStatus.TORQUE_CLIPPED != 0
    assert none.any()
    np.testing.assert_array_equal(run["motor_law"][none, 1], run["v"][none, 6:])
    m = record()
    tick(m, a=5.0, angle=0.0, speed=1.0)
    np.testing.assert_allclose(
        tick(m, a=1e9, angle=0.7, speed=0.2, usable=False), [0.7001, 0.2, 10.0, 2.0]
    )
    np.testing.assert_allclose(tick(m, a=0.0, angle=-0.3, speed=0.0), [-0.3, 0.0, 10.0, 2.0])


class Rigid:
    """Harpy whose stance feet are fixed to the ground, by Pinocchio; motors evaluate their law all
    the time.
    """

    def __init__(self, q, v, held):
        self.q, self.held, self.dynamics = q, held, Dynamics(ROBOT)
        self.dynamics.update(q, v)
        jacobian = self.dynamics.foot_jacobian[np.repeat(held, 3) != 0.0]
        across = np.linalg.solve(mass_matrix(ROBOT.model, q), jacobian.T)
        self.v = v - across @ np.linalg.solve(
            jacobian @ across, jacobian @ v
        )  # stance feet are at rest
        self.force = np.full((2, 3), 30.0) * np.reshape(held, (2, 1))

    def solve(self, torque, thrust):
        """Accelerations and contact forces."""
        self.force, a = constrained_dynamics(
            ROBOT, self.q, self.v, hp.Command(torque, thrust), self.held
        )
        return a

    def advance(self, command, period, steps=16):
        """Returns the mean torque that the law has added."""
        added, h = np.zeros(6), period / steps
        q, v, k_p, k_d = command.law
        for _ in range(steps):
            law = k_p * (q - self.q[7:]) + k_d * (v - self.v[6:])
            a = self.solve(command.torque + law, command.thrust)
            self.q = pin.integrate(ROBOT.model, self.q, h * (self.v + 0.5 * h * a))
            self.v = self.v + h * a
            added += law / steps
        return added


def rigid_walk(period, state, held):
    """Largest q* − q, in the law and at the beginning of a tick, and largest mean torque of the law
    in a tick.
    """
    controller, worst = make("condensed", period=period, joint_learning=0.0), np.zeros(2)
    world = Rigid(state.q, state.v, held)
    for k in range(round(0.048 / period)):
        measured = (
            world.q,
            world.v,
            *np.zeros((2, 2, 3)),
            world.force,
        )  # of the feet it looks at forces alone
        command = controller.step(hp.State(state.t + k * period, *measured))
        np.testing.assert_array_equal(controller.targets.held, held)
        off = np.abs(command.law[0] - 0.5 * period * command.law[1] - world.q[7:]).max()
        added = np.abs(world.advance(command, period)).max()
        worst = np.maximum(worst, (off, added))
    return worst, np.abs(command.torque).max()


def test_in_a_rigid_world_the_law_adds_next_to_nothing():
    """There the accelerations of the optimum come true, but for their change within a tick: of
    first order in it.
    """
    run = hp.walk(hp.Scenario(controller="condensed", duration=1.2))
    at = next(
        i
        for i in range(1050, 1200)
        if run["held"][i].sum() == 1.0 and run["held"][i - 20].sum() == 1.0
    )
    state = hp.State(float(run["t"][at]), run["q"][at], run["v"][at], *np.zeros((3, 2, 3)))
    found, torques = zip(
        *(rigid_walk(period, state, run["held"][at]) for period in (4e-3, 2e-3, 1e-3)), strict=True
    )
    assert all((short < long / 1.8).all() for long, short in pairwise(found))
    assert (found[-1] < (3e-5, 1e-3 * torques[-1])).all()


def learned(inertia, damping, *, held=0.0, seconds=20.0, period=1e-3, limit=1e3):
    """What is learned of a joint that has an inertia and a damping beyond the model's 0.05 kg·m²,
    and swings.
    """
    gains, model = np.array([[15.0], [0.9]]), 0.05
    values = {
        "share": 1.0 - np.exp(-40.0 * period),
        "lead": 0.5 * period,
        "learning": 1.0 - np.exp(-period),
    }
    more = {
        "still": np.array([5.0, 1.0]),
        "most": np.full(2, 1.0),
        "moves": np.ones((1, 1)),
        "limit": [limit],
    }
    sizes = {"joints": 1, "nv": 7, "feet": 1}
    m = make_record(JointTargetsRecord, sizes, period=period, gains=gains, **values, **more)
    q, v, acceleration, torque = np.zeros(8), np.zeros(7), np.zeros(7), np.zeros(1)
    for k in range(round(seconds / period)):
        phase = 2.0 * np.pi * 2.5 * k * period
        place, speed = (
            np.sin(phase) + 0.3 * np.sin(3.0 * phase),
            np.cos(phase) + 0.9 * np.cos(3.0 * phase),
        )
        a = -((2.0 * np.pi * 2.5) ** 2) * (np.sin(phase) + 2.7 * np.sin(3.0 * phase)) * 0.3
        a += 400.0 * (0.3 * place - q[7]) + 40.0 * (0.3 * 2.0 * np.pi * 2.5 * speed - v[6])
        acceleration[6], torque[0] = a, model * a
        add_lacking(m, np.array([held]), acceleration, True, v, torque)
        assert abs(torque[0]) <= limit
        move_targets(m, acceleration, True, q, v)
        for _ in range(4):
            law = gains[:, 0] @ (m["law"][0, 0, 0] - q[7], m["law"][0, 1, 0] - v[6])
            v[6] += 0.25 * period * (torque[0] + law - damping * v[6]) / (model + inertia)
            q[7] += 0.25 * period * v[6]
    return m["lacking"][0, :, 0]


@pytest.mark.parametrize(("inertia", "damping"), [(0.04, 0.2), (0.01, 0.0), (0.0, 0.5), (0.0, 0.0)])
def test_what_a_swinging_joint_lacks_is_learned(inertia, damping):
    """To 5 %, and 1 % of the inertia of the model and of the damping of the motor."""
    found = learned(inertia, damping) - (inertia, damping)
    assert (np.abs(found) < 0.05 * np.array((inertia, damping)) + (5e-4, 9e-3)).all(), found


def test_what_is_added_stays_within_the_torque_of_the_motor():
    learned(0.04, 0.2, seconds=2.0, limit=3.0)


def test_a_joint_whose_foot_is_held_learns_nothing():
    assert not learned(0.04, 0.2, held=1.0, seconds=1.0).any()


def walked():
    return states_of(
        hp.walk(scenario(duration=0.8, pushes=(hp.Push(0.3, (0.0, 2.0, 0.0)),), mu_s=0.25))
    )


def added(command, state):
    q, v, k_p, k_d = command.law
    return k_p * (q - state.q[7:]) + k_d * (v - state.v[6:])


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_the_law_of_the_condensed_controller_is_that_of_the_qp(formulation):
    """To 1e-7 of the largest torque."""
    one, other = make("condensed"), make("wbc", formulation=formulation, weights={"posture": 1e-10})
    largest = worst = 0.0
    for state in walked():
        a, b = one.step(state), other.step(state)
        intended = other.problem.acceleration(other.solution.z)
        np.testing.assert_allclose(
            other._record_["acceleration"][0], intended, rtol=1e-9, atol=1e-9
        )
        largest = max(largest, np.abs(added(a, state)).max())
        worst = max(worst, np.abs(added(a, state) - added(b, state)).max() / np.abs(a.torque).max())
    assert largest > 0.1
    assert worst < 1e-7


@pytest.mark.parametrize(
    ("name", "more"), [("condensed", {}), ("wbc", {"solver": "active_set"}), ("wbc", {})]
)
def test_bad_samples_are_held_then_fade_and_targets_begin_anew(name, more):
    """Also where another solver's tick is Python's."""
    controller = make(name, **more)
    states = walked()[:20]
    for state in states:
        law = controller.step(state).law.copy()
    bad = states[-1].copy()
    bad.q[9] = np.nan
    for k in range(HOLD_TICKS + 3):
        fading = FADE ** max(k + 1 - HOLD_TICKS, 0)
        np.testing.assert_allclose(
            controller.step(bad).law, law * [[1], [1], [fading], [fading]], rtol=1e-12
        )
    law = controller.step(states[-1]).law
    np.testing.assert_allclose(law[0], states[-1].q[7:] + 5e-4 * law[1], atol=1e-4)
    controller.reset()
    assert not controller.step(bad).law.any()


@needs_robots
def test_gains_are_in_units_of_the_robot_and_light_joints_have_less():
    for name, unit in (("go2", 16.09 * 9.81 * 0.426 / 4), ("g1", 33.34 * 9.81 * 0.561 / 4)):
        robot = hp.load_robot(name)
        standing = hp.Standing(robot)
        q = standing.initial_state()[0]
        stiffness, damping = joint_gains(robot, WholeBodyParameters.for_gait(standing, **MOTORS), q)
        assert stiffness.max() == pytest.approx(unit, rel=2e-3)
        np.testing.assert_allclose(
            damping, 0.3 * stiffness * np.sqrt(4 * unit / robot.mass) / 9.81, rtol=2e-3
        )
        inverse = np.diag(np.linalg.inv(mass_matrix(robot.model, q)))[6:]
        assert (damping * inverse <= MAX_RATE * (1.0 + 1e-9)).all()
        assert (stiffness < 0.5 * unit).any() == (name == "g1")


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_a_law_changes_contact_forces_by_its_torques_times_the_map(seed):
    """At any state, for any errors: δf = −Λ J M⁻¹ S (k_p e + k_d ė) where feet stick; a foot's is
    bounded by norms.
    """
    rng = np.random.default_rng(seed)
    q = pin.integrate(
        ROBOT.model, hp.make_gait(ROBOT).initial_state()[0], 0.15 * rng.standard_normal(12)
    )
    held = [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)][seed % 3]
    world = Rigid(q, rng.standard_normal(12), held)
    torque, thrust, errors = (
        5.0 * rng.standard_normal(6),
        rng.standard_normal((2, 3)),
        rng.standard_normal((2, 6)),
    )
    stiffness, damping = joint_gains(
        ROBOT, WholeBodyParameters.for_gait(hp.make_gait(ROBOT), **MOTORS), q
    )
    law = 0.01 * stiffness * errors[0] + 0.1 * damping * errors[1]
    world.solve(torque, thrust)
    before = world.force
    world.solve(torque + law, thrust)
    contacts = ContactForceMap(ROBOT)
    world.dynamics.update(q, world.v)
    contacts.update(world.dynamics, world.v, hp.Command(torque, thrust), held)
    np.testing.assert_allclose(
        (world.force - before).ravel(), contacts.torque_gain @ law, rtol=1e-6, atol=1e-8
    )
    size = stiffness.max() * np.linalg.norm(0.01 * errors[0]) + damping.max() * np.linalg.norm(
        0.1 * errors[1]
    )
    most = np.linalg.norm(contacts.torque_gain.reshape(2, 3, 6), 2, axis=(1, 2)) * size
    assert (np.linalg.norm(world.force - before, axis=1) <= most * (1.0 + 1e-9) + 1e-12).all()


@needs_robots
def test_a_robot_without_legs_has_no_law():
    with pytest.raises(InputError, match="'iris' has no legs"):
        hp.make_controller("condensed", hp.Hovering(hp.load_robot("iris")), mu=0.5, **MOTORS)
