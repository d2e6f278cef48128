"""Nothing is ignored in silence: what is assigned has its effect or is refused, and what cannot be
is a bad sample.
"""

import os
import signal
import threading
import time

import numpy as np
import pytest
from guarded_walks import CONTROLLERS, controller_of
from needs import needs_compiler
from walks import started

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.shield import Shield
from harpy_pin.contrib.solvers import SOLVERS
from harpy_pin.controllers.governed import FrictionEstimator
from harpy_pin.kernels import compiler, kernel, library_files
from harpy_pin.model.catalogue import installed_data
from harpy_pin.model.entry import MAX_SAMPLE

needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


@pytest.fixture
def state(robot):
    simulator = started(hp.Simulator(robot), hp.make_gait(robot))
    simulator.advance(hp.Command(np.zeros(6), np.zeros((2, 3))))
    return simulator.state


def test_command_of_a_gait_is_followed_however_it_is_set(robot):
    assigned, written = hp.make_commanded_gait(robot), hp.make_commanded_gait(robot)
    for k in range(300):
        if k == 50:
            assigned.command = (0.2, 0.1, 0.3)
            written.command[:] = (0.2, 0.1, 0.3)
        if k == 200:
            assigned.command = np.zeros(3)
            written.command[:] = 0.0
        bodies = [gait.update(0.01 * k).body.copy() for gait in (assigned, written)]
        np.testing.assert_array_equal(*bodies)
        if k == 199:
            assert assigned.applied[0] > 0.1
    assert not assigned.applied.any()
    for wrong in (0.3, (0.3, 0.0), (np.nan, 0.0, 0.0), "abc", None):
        with pytest.raises(hp.InputError, match="command"):
            assigned.command = wrong


def test_applied_velocity_of_a_walk_is_read_only(robot):
    gait = hp.WalkingGait(robot, posture=hp.make_gait(robot, speed=0.0).initial_state()[0][7:])
    with pytest.raises(hp.InputError, match="applied is read only"):
        gait.applied = np.zeros(4)
    with pytest.raises(ValueError, match="read-only"):
        gait.applied[0] = 1.0


def test_command_that_a_function_gives_is_read_only(robot):
    gait = hp.make_commanded_gait(robot, lambda t: (0.2, 0.0, 0.0))
    with pytest.raises(hp.InputError, match="command is read only"):
        gait.command = (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        gait.command[:] = 0.0
    gait.update(0.1)
    np.testing.assert_array_equal(gait.command, (0.2, 0.0, 0.0))
    for commanded in (gait, hp.make_commanded_gait(robot)):
        with pytest.raises(hp.InputError, match="applied is read only"):
            commanded.applied = (0.1, 0.0, 0.0)


WRONG_COMMANDS = (
    3.0,
    None,
    "abc",
    "123",
    (0.1, 0.2),
    (0.1, 0.2, 0.3, 0.4),
    [[0.1], [0.2], [0.3]],
    (0.1, (0.2, 0.3)),
)


@pytest.mark.parametrize(
    "wrong", [*WRONG_COMMANDS, (1j, 0.0, 0.0), (10**400, 0, 0)], ids=lambda wrong: repr(wrong)[:20]
)
def test_function_of_a_command_returns_three_numbers(robot, wrong):
    gait = hp.make_commanded_gait(robot, lambda t: wrong)
    with pytest.raises(hp.InputError, match="must return \\(forward, sideways, turning\\)"):
        gait.update(0.1)


def test_function_of_a_command_may_return_any_three_numbers(robot):
    for right in ([1, 0, 0], np.array((1.0, 0.0, 0.0), np.float32), np.array([1, 0, 0], object)):
        gait = hp.make_commanded_gait(robot, lambda t, right=right: right)
        gait.update(0.1)
        assert gait.applied[0] > 0.0
    gait = hp.make_commanded_gait(robot, lambda t: (np.nan, 0.0, 0.0))
    gait.update(0.1)
    assert gait.refused == 1


class Own(hp.Gait):
    """A gait of one's own whose targets are assigned, not written in place."""

    def __init__(self, robot, height):
        super().__init__(robot)
        self.inner, self.height = hp.make_gait(robot, speed=0.0), height

    def update(self, t):
        given = self.inner.update(t)
        body = given.body.copy()
        body[2] = self.height
        self.target.body = body
        self.target.foot_position, self.target.stance = given.foot_position, given.stance
        return self.target

    def initial_state(self, *, penetration=0.0):
        return self.inner.initial_state(penetration=penetration)


@pytest.mark.parametrize("name", ["paper", "wbc", "condensed"])
def test_assigned_targets_are_followed(robot, state, name):
    commands = []
    for height in (0.5, 0.7):
        command = controller_of(name, Own(robot, height)).step(state)
        commands.append(np.append(command.torque, command.thrust))
    assert not np.allclose(*commands)
    with pytest.raises(hp.InputError, match="body must"):
        Own(robot, 0.6).target.body = np.zeros(3)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1.01 * MAX_SAMPLE, -1e300])
@pytest.mark.parametrize(
    "target",
    [
        "foot_position",
        "foot_velocity",
        "foot_acceleration",
        "stance",
        "phase",
        "load",
        "world_frame_blend",
    ],
)
@pytest.mark.parametrize("name", ["none", "wbc", "wbc, full", "condensed"])
def test_targets_of_feet_that_are_absurd_are_a_bad_sample(robot, state, name, target, value):
    gait = Own(robot, 0.6)
    controller, update = controller_of(name, gait), gait.update
    held = controller.step(state).torque.copy()

    def absurd(t):
        given = update(t)
        getattr(given, target).reshape(-1)[-1] = value
        return given

    controller.gait.update = absurd
    np.testing.assert_array_equal(controller.step(state).torque, held)
    assert controller.bad_samples == 1


def impossible(state):
    """Copies of a state that no robot can have, by what is wrong."""
    for name in ("q", "v", "foot_force"):
        for value in (1.01 * MAX_SAMPLE, -1e200, 1.7e308):
            bad = state.copy()
            getattr(bad, name).reshape(-1)[-1] = value
            yield f"{name} {value:g}", bad
    for scale in (0.0, 5e-324, 1e-160, 0.5, 2.0, 1e160):
        bad = state.copy()
        bad.q[3:7] *= scale
        yield f"quaternion times {scale:g}", bad
    for t in (1e10, -1e10, 1e200, 1e8):
        bad = state.copy()
        bad.t = t
        yield f"t {t:g}", bad


@pytest.mark.parametrize("name", CONTROLLERS)
def test_states_that_no_robot_can_have_are_bad_samples(robot, state, name):
    controller, clean = (controller_of(name, hp.make_gait(robot)) for _ in range(2))
    held = controller.step(state).torque.copy()
    clean.step(state)
    for count, (what, bad) in enumerate(impossible(state), 1):
        np.testing.assert_array_equal(controller.step(bad).torque, held, err_msg=what)
        assert controller.bad_samples == count, what
        held = controller.step(state).torque.copy()
        np.testing.assert_array_equal(held, clean.step(state).torque)
    edge = state.copy()
    edge.foot_force[0, 0] = MAX_SAMPLE
    edge.q[3:7] *= 1.01
    controller.step(edge)
    assert controller.bad_samples == count


def test_terms_and_filters_say_that_a_state_is_impossible(robot, state):
    dynamics, force_filter = hp.Dynamics(robot), hp.ContactForceFilter(robot)
    shield, count = Shield(robot, mu=0.3), 0
    for what, bad in impossible(state):
        if what.startswith("t "):
            continue
        dynamics.update(bad.q, bad.v)
        assert dynamics.finite == what.startswith("foot_force"), what
        command = hp.Command(np.ones(6), np.ones((2, 3)))
        force_filter.update(bad, command)
        count += 1
        assert force_filter.status.bad_samples == count, what
        np.testing.assert_array_equal(command.torque, 1.0)
        assert "bad state" in shield(bad, command)[1].reasons, what
    governor = hp.ExplicitReferenceGovernor(hp.governors.ForceRows(mass=robot.mass, mu=0.3))
    governor.reset(np.zeros(6))
    governor.update(np.full(9, 1e200), np.zeros(6), 1e-3)
    assert governor.status.bad_samples == 1


def test_gaits_that_look_at_the_state_ignore_bad_samples():
    if installed_data() is None:
        pytest.skip("the robots are the extra robots")
    robot = hp.load_robot("bolt")
    gait, clean = hp.WalkingGait(robot), hp.WalkingGait(robot)
    state = hp.State(0.0, *gait.initial_state(), *np.ones((3, 2, 3)))
    for each in (gait, clean):
        each.observe(state)
        each.update(0.0)
    for what, bad in impossible(state):
        if not what.startswith("t "):
            gait.observe(bad)
    for name in ("body", "foot_position"):
        np.testing.assert_array_equal(
            getattr(gait.update(0.1), name), getattr(clean.update(0.1), name)
        )


def slide(estimator, ratio, ticks=60):
    """Estimates while the left foot slides at a ratio of forces."""
    force, velocity = np.zeros((2, 3)), np.zeros((2, 3))
    force[:, 2], force[0, 0], velocity[0, 0] = 30.0, -30.0 * ratio, 0.1
    return [estimator.update(force, velocity, np.ones(2)).copy() for _ in range(ticks)]


@pytest.mark.parametrize("value", [1e7, 1e160, -1e200, 1.7e308])
@pytest.mark.parametrize("where", [0, 1], ids=["force", "velocity"])
def test_absurd_samples_change_no_friction_estimate(value, where):
    estimator, clean = FrictionEstimator(assumed=0.8), FrictionEstimator(assumed=0.8)
    slide(estimator, 0.2)
    slide(clean, 0.2)
    for axis in (0, 1):
        samples = np.full((2, 2, 3), 0.1)
        samples[0, :, 2] = 30.0
        samples[where, :, axis] = value
        estimator.update(*samples, np.ones(2))
    np.testing.assert_array_equal(slide(estimator, 0.1), slide(clean, 0.1))
    assert estimator.estimate[0] == pytest.approx(0.095, rel=1e-3)


@pytest.mark.parametrize("value", [MAX_SAMPLE, 1e200])
def test_reset_estimate_is_a_new_one(value):
    estimator = FrictionEstimator(assumed=0.8)
    for sign in (1.0, -1.0):
        estimator.update(np.full((2, 3), value), np.full((2, 3), sign * value), np.ones(2))
    estimator.reset()
    np.testing.assert_array_equal(slide(estimator, 0.2), slide(FrictionEstimator(assumed=0.8), 0.2))


class Zero:
    """A row of zeros, whose error is −b whatever the robot does."""

    b = 0.0

    def rows(self, dynamics, state):
        return np.zeros((1, dynamics.model.nv)), np.array([self.b])


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_range_on_a_row_of_zeros_is_hard(robot, state, formulation):
    for solver in SOLVERS:
        parameters = {"solver": solver, "formulation": formulation}
        controller = hp.make_controller("wbc", hp.make_gait(robot), mu=0.3, **parameters)
        task = Zero()
        controller.add(task, lower=-1.0, upper=1.0)
        for b, failures in ((0.0, 0), (0.5, 0), (5.0, 1), (-5.0, 2), (-1.0, 2)):
            task.b = b
            controller.step(state)
            assert controller.failures == failures, (solver, b)
        task.b = 5.0
        with pytest.raises(hp.InputError, match=r"row 0 of Zero is zero.*outside \[-1, 1\]"):
            controller.add(task, lower=-1.0, upper=1.0)


def in_a_child(work, *, after_fork=lambda: None, seconds=600.0):
    """What a forked child's work returns, a number; fails where it does not end. The parent then
    goes on, too.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(writing, repr(float(work())).encode())
        finally:
            os._exit(0)
    after_fork()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if os.waitpid(child, os.WNOHANG)[0]:
            os.close(writing)
            with os.fdopen(reading) as file:
                return float(file.read())
        time.sleep(0.02)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    pytest.fail("the forked child hangs")


@needs_fork
def test_environments_go_on_in_a_forked_child():
    pytest.importorskip("gymnasium")
    from harpy_pin.contrib.gym import HarpyVectorEnv

    env = HarpyVectorEnv(150, threads=2)
    action = np.full((150, 12), 0.1, np.float32)

    def work():
        env.reset(seed=1)
        total = env.step(action)[0].sum()
        env.close()
        return total

    env.reset(seed=1)
    env.step(action)  # the parent's threads are there
    found = in_a_child(work)
    assert found == work()


@needs_fork
def test_batches_go_on_in_a_forked_child(robot, state):
    batch = CondensedBatch(robot, 300, threads=2)
    states = (
        np.tile(state.q, (300, 1)),
        np.tile(state.v, (300, 1)),
        np.tile(state.foot_force, (300, 1, 1)),
    )

    def work():
        return np.abs(batch.step(*states)[0]).sum()

    work()
    batch.reset()
    found = in_a_child(work)
    assert found == work()


@needs_fork
@needs_compiler
@pytest.mark.usefixtures("compiled_ahead")
def test_kernels_that_are_being_compiled_are_compiled_in_a_forked_child(tmp_path, monkeypatch):
    """The parent's threads are not there to end what they have begun."""
    monkeypatch.setattr(library_files, "folder", lambda: tmp_path)
    begun, forked, run = threading.Event(), threading.Event(), compiler.run_compiler

    def run_when_forked(arguments, **given):
        begun.set()
        forked.wait()
        run(arguments, **given)

    monkeypatch.setattr(compiler, "run_compiler", run_when_forked)

    @kernel
    def doubled(x: float) -> float:
        return 2.0 * x

    def work():
        forked.set()
        return doubled(4.0)

    doubled.prepare(1.0)
    begun.wait()  # a thread of the parent is at it
    assert in_a_child(work, after_fork=forked.set) == 8.0
    assert doubled(3.0) == 6.0
