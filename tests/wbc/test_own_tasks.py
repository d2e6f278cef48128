"""Tasks and ranges that a user adds to the whole-body program."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from whole_body_oracle import MU, ROBOT, oracle, random_case, solve_oracle

import harpy_pin as hp
from harpy_pin.wbc import AddedTasks, WholeBodyLimits, make_problem, make_solver

NV = 12
seeds = st.integers(0, 10_000)
LIMITS = WholeBodyLimits(mu=MU)


def draw(seed):
    """A state anywhere, an acceleration, and what the tasks get of them."""
    rng = np.random.default_rng(seed)
    q = pin.integrate(ROBOT.model, pin.neutral(ROBOT.model), rng.uniform(-1.5, 1.5, NV))
    v, a = 3.0 * rng.standard_normal(NV), 10.0 * rng.standard_normal(NV)
    return rng, q, v, a, evaluated(q, v), sample(q, v)


def evaluated(q, v):
    dynamics = hp.Dynamics(ROBOT)
    dynamics.update(q, v)
    return dynamics


def sample(q, v):
    return hp.State(0.0, q, v, *np.zeros((3, 2, 3)))


def pinocchio_frame(name, q, v, a, axes=pin.LOCAL_WORLD_ALIGNED):
    """Placement, and velocity and classical acceleration (linear, angular) of a frame."""
    model, data = ROBOT.model, ROBOT.model.createData()
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    i = model.getFrameId(name)
    velocity = pin.getFrameVelocity(model, data, i, axes).vector
    return (
        data.oMf[i].copy(),
        velocity,
        pin.getFrameClassicalAcceleration(model, data, i, axes).vector,
    )


PARTS = {"position": slice(0, 3), "orientation": slice(3, 6), "both": slice(0, 6)}


@given(
    seeds,
    st.sampled_from(sorted(PARTS)),
    st.booleans(),
    st.sampled_from([f.name for f in ROBOT.model.frames]),
)
def test_frames_accelerate_as_pinocchio_says(seed, part, local, name):
    rng, q, v, a, dynamics, state = draw(seed)
    place, velocity, expected = pinocchio_frame(
        name, q, v, a, pin.LOCAL if local else pin.LOCAL_WORLD_ALIGNED
    )
    axes, rows = "local" if local else "world", PARTS[part]
    matrix, target = hp.FrameTask(name, part=part, axes=axes).rows(dynamics, state)
    np.testing.assert_allclose(
        matrix @ a - target, expected[rows], atol=1e-10 * (1.0 + np.abs(expected).max())
    )

    # The desired acceleration: k_p times the way to go, k_d times the difference of velocity, and
    # what is given.
    way, reference, given_acceleration = (
        rng.standard_normal(3),
        rng.standard_normal(6),
        rng.standard_normal(6),
    )
    turn = rng.uniform(-1.0, 1.0, 3)
    task = hp.FrameTask(
        name,
        part=part,
        axes=axes,
        position=place.translation + (place.rotation @ way if local else way),
        rotation=place.rotation @ pin.exp3(turn) if local else pin.exp3(turn) @ place.rotation,
        velocity=reference[rows],
        acceleration=given_acceleration[rows],
        gains=(50.0, 7.0),
    )
    desired = given_acceleration + 50.0 * np.concatenate((way, turn)) + 7.0 * (reference - velocity)
    np.testing.assert_allclose(task.rows(dynamics, state)[1] - target, desired[rows], atol=1e-9)


NAMES = [f.name for f in ROBOT.model.frames[1:]]


@given(seeds, st.booleans(), st.permutations(NAMES))
def test_one_frame_accelerates_relative_to_another_as_differences_of_poses_say(seed, local, names):
    """Second differences of the pose in the root's axes, along q(t) = q ⊕ (v t + a t² / 2)."""
    rng, q, v, a, dynamics, state = draw(seed)
    name, root, *_ = names

    def pose(t):
        moved = pin.integrate(ROBOT.model, q, v * t + 0.5 * a * t**2)
        frames = [pinocchio_frame(one, moved, v, a)[0] for one in (name, root)]
        return frames[1].actInv(frames[0])

    h, here = 1e-4, pose(0.0)
    steps = [
        np.concatenate(
            (pose(t).translation - here.translation, pin.log3(pose(t).rotation @ here.rotation.T))
        )
        for t in (h, -h)
    ]
    axes, turn = ("local", here.rotation) if local else ("world", np.eye(3))
    velocity, expected = (
        (turn.T @ two.reshape(2, 3).T).T.ravel()
        for two in ((steps[0] - steps[1]) / (2.0 * h), (steps[0] + steps[1]) / h**2)
    )
    matrix, target = hp.FrameTask(name, part="both", root=root, axes=axes).rows(dynamics, state)
    size = 1e-4 * (1.0 + np.abs(expected).max() + np.abs(velocity).max() ** 3)
    np.testing.assert_allclose(matrix @ a - target, expected, atol=size)
    np.testing.assert_allclose(matrix @ v, velocity, atol=size)
    way, turned = 0.5 * rng.standard_normal((2, 3))
    task = hp.FrameTask(
        name,
        part="both",
        root=root,
        axes=axes,
        position=here.translation + turn @ way,
        rotation=turn @ pin.exp3(turned) @ turn.T @ here.rotation,
        gains=(50.0, 7.0),
    )
    desired = 50.0 * np.concatenate((way, turned)) - 7.0 * (matrix @ v)
    np.testing.assert_allclose(task.rows(dynamics, state)[1] - target, desired, atol=1e-8)


@given(seeds)
def test_centre_of_mass_and_momentum_move_as_pinocchio_says(seed):
    rng, q, v, a, dynamics, state = draw(seed)
    model, data = ROBOT.model, ROBOT.model.createData()
    pin.centerOfMass(model, data, q, v, a)
    matrix, target = hp.CentreOfMassTask().rows(dynamics, state)
    np.testing.assert_allclose(matrix @ a - target, data.acom[0], atol=1e-10)
    position, velocity = rng.standard_normal((2, 3))
    held = hp.CentreOfMassTask(
        position=position, velocity=velocity, acceleration=(1.0, 2.0, 3.0), gains=(30.0, 4.0)
    )
    desired = (
        np.array((1.0, 2.0, 3.0))
        + 30.0 * (position - data.com[0])
        + 4.0 * (velocity - data.vcom[0])
    )
    np.testing.assert_allclose(held.rows(dynamics, state)[1] - target, desired, atol=1e-10)

    pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a)
    momentum, rate = data.hg.vector.copy(), data.dhg.vector.copy()
    for part, rows in (("linear", slice(0, 3)), ("angular", slice(3, 6)), ("both", slice(0, 6))):
        matrix, target = hp.wbc.MomentumTask(part=part).rows(dynamics, state)
        np.testing.assert_allclose(matrix @ a - target, rate[rows], atol=1e-9)
        reference, given_rate = rng.standard_normal((2, len(target)))
        task = hp.wbc.MomentumTask(part=part, momentum=reference, rate=given_rate, gain=6.0)
        desired = given_rate + 6.0 * (reference - momentum[rows])
        np.testing.assert_allclose(task.rows(dynamics, state)[1] - target, desired, atol=1e-9)


def test_joints_and_forces_are_picked():
    _, q, v, a, dynamics, state = draw(3)
    names = (ROBOT.joints[4], ROBOT.joints[1])
    position = np.array((0.3, -0.2))
    task = hp.JointTask(
        names, position=position, velocity=(1.0, 2.0), acceleration=(3.0, 4.0), gains=(10.0, 2.0)
    )
    matrix, target = task.rows(dynamics, state)
    np.testing.assert_array_equal(matrix @ a, a[[10, 7]])
    desired = (3.0, 4.0) + 10.0 * (position - q[[11, 8]]) + 2.0 * ((1.0, 2.0) - v[[10, 7]])
    np.testing.assert_allclose(target, desired)
    one = hp.JointTask(names[0], position=0.3, velocity=1.0, acceleration=3.0, gains=(10.0, 2.0))
    np.testing.assert_array_equal(
        one.rows(dynamics, state)[1], target[:1]
    )  # a number will do for one joint
    with pytest.raises(hp.InputError, match="position"):
        hp.JointTask(names, position=0.3, gains=(10.0, 2.0))
    matrix, target = hp.FootForceTask("right_foot", force=(1.0, 2.0, 3.0)).rows(dynamics, state)
    np.testing.assert_array_equal(matrix @ np.arange(18.0), (15.0, 16.0, 17.0))
    np.testing.assert_array_equal(target, (1.0, 2.0, 3.0))


class OnEverything:
    """A task in plain NumPy, on accelerations and forces at once."""

    def __init__(self, rng):
        self.matrix, self.target = rng.standard_normal((2, 18)), 10.0 * rng.standard_normal(2)

    def rows(self, dynamics, state):
        return self.matrix, self.target


def pinocchio_tasks(rng, q, v, a_zero):
    """Each of the tasks with its A and d of A [a; f] + d, from Pinocchio's functions; and what is
    desired.
    """
    model, data = ROBOT.model, ROBOT.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    i = model.getFrameId("left_knee")
    knee = pin.getFrameJacobian(model, data, i, pin.LOCAL_WORLD_ALIGNED)[:3].copy()
    knee_drift = pinocchio_frame("left_knee", q, v, a_zero)[2][:3]
    centre = pin.jacobianCenterOfMass(model, data, q).copy()
    pin.centerOfMass(model, data, q, v, a_zero)
    centre_drift = data.acom[0].copy()
    pin.computeCentroidalMomentumTimeVariation(model, data, q, v, a_zero)
    spin_drift = data.dhg.angular.copy()
    spin = pin.computeCentroidalMap(model, data, q)[3:].copy()
    desired = rng.uniform(-5.0, 5.0, (4, 3))
    force = rng.uniform((-5.0, -5.0, 10.0), (5.0, 5.0, 60.0))
    anything = OnEverything(rng)
    on_force = np.zeros((3, 18))
    on_force[:, 12:15] = np.eye(3)
    return [
        (hp.FrameTask("left_knee", acceleration=desired[0]), knee, knee_drift - desired[0]),
        (hp.CentreOfMassTask(acceleration=desired[1]), centre, centre_drift - desired[1]),
        (hp.wbc.MomentumTask(rate=desired[2]), spin, spin_drift - desired[2]),
        (hp.JointTask(ROBOT.joints[:3], acceleration=desired[3]), np.eye(NV)[6:9], -desired[3]),
        (hp.FootForceTask("left_foot", force=force), on_force, -force),
        (anything, anything.matrix, -anything.target),
    ]


def compare(seed, formulation, *, ranges):
    """Our optimum and that of the independent program, [a; f; u], with random tasks added; None
    where there is none.
    """
    q, v, targets = random_case(seed)
    rng = np.random.default_rng(seed + 1)
    tasks = pinocchio_tasks(rng, q, v, np.zeros(NV))
    tasks = [tasks[k] for k in (rng.integers(5), *rng.permutation(6)[:2])]
    a, b, equality, value, inequality, upper = oracle(q, v, targets, LIMITS)
    problem = make_problem(formulation, ROBOT, None, LIMITS)
    added, entries = AddedTasks(problem), []
    for k, (task, matrix, drift) in enumerate(tasks):
        rows = np.zeros((len(drift), 24))
        rows[:, : matrix.shape[1]] = matrix
        weight = 10.0 ** rng.uniform(-3.0, 0.0, len(drift))
        low, high = np.sort(rng.uniform(-15.0, 15.0, (2, len(drift))), axis=0)
        low[0], high[-1] = -np.inf, np.inf
        limited = ranges and k == 0  # three rows: kernels are compiled for every size
        bounds = {"lower": low, "upper": high} if limited else {}
        entries.append(added.add(task, sample(q, v), weight=weight, **bounds))
        a, b = (
            np.vstack((a, np.sqrt(weight)[:, None] * rows)),
            np.concatenate((b, -np.sqrt(weight) * drift)),
        )
        if limited:
            resting = rows[:, :18].copy()
            resting[:, 12:] *= np.repeat(targets.held, 3)
            for row, offset, least, largest, keep in zip(
                rows, drift, low, high, resting.any(axis=1), strict=True
            ):
                if keep:
                    inequality = np.vstack((inequality, row, -row))
                    upper = np.concatenate(
                        (upper, np.minimum((largest - offset, offset - least), 1e9))
                    )
    z, flag = solve_oracle((a, b, equality, value, inequality, upper))
    dynamics = evaluated(q, v)
    problem.build(dynamics, v, dynamics.rotation, targets)
    added.build(dynamics, sample(q, v), targets.held)
    solution = make_solver("active_set", added.program).solve(added.program)
    if flag < 0 or not solution.usable:
        return flag < 0, not solution.usable, targets
    inputs = np.empty(12)
    problem.inputs(solution.z, inputs)
    added.read(solution.z)
    for entry, (_, matrix, drift) in zip(entries, tasks, strict=True):
        errors = matrix @ z[: matrix.shape[1]] + drift
        np.testing.assert_allclose(entry.matrix[:, : matrix.shape[1]], matrix, atol=1e-12)
        np.testing.assert_allclose(entry.error, errors, atol=1e-4)
    found = np.concatenate(
        (problem.acceleration(solution.z), problem.contact_force(solution.z).ravel(), inputs[:6])
    )
    return found, z, inputs


@given(seeds, st.sampled_from(["input_space", "full"]), st.booleans())
def test_optimum_is_that_of_an_independent_program(seed, formulation, ranges):
    found, expected, _ = compare(seed, formulation, ranges=ranges)
    if isinstance(found, bool):
        assert found == expected
        return
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_many_ranges_are_active_and_some_contradict():
    """So that the test above means something."""
    solved = 0
    changed = 0
    for seed in range(60):
        plain, with_ranges = (
            compare(seed, "input_space", ranges=ranges)[0] for ranges in (False, True)
        )
        if isinstance(with_ranges, bool):
            continue
        solved += 1
        changed += np.abs(plain - with_ranges).max() > 1e-3
    assert 20 < solved < 60
    assert changed > 10


def test_range_of_a_foot_in_the_air_rests():
    """At least 40 N on the left foot: held on the ground, and no contradiction in the air, in every
    formulation.
    """
    for formulation in ("input_space", "full"):
        problem = make_problem(formulation, ROBOT, None, LIMITS)
        for seed in range(4):
            q, v, targets = random_case(seed)
            added = AddedTasks(problem)
            task = added.add(
                hp.FootForceTask("left_foot"), sample(q, v), lower=(-np.inf, -np.inf, 40.0)
            )
            dynamics = evaluated(q, v)
            problem.build(dynamics, v, dynamics.rotation, targets)
            added.build(dynamics, sample(q, v), targets.held)
            solution = make_solver("active_set", added.program).solve(added.program)
            assert solution.usable
            added.read(solution.z)
            force = problem.contact_force(solution.z)[0]
            np.testing.assert_allclose(task.error, force, atol=1e-9)
            assert force[2] > 40.0 - 1e-6 if targets.held[0] else abs(force[2]) < 1e-9


def walk(*, formulation="input_space", solver="proxqp", add=None, duration=1.5):
    made = []

    def controller(gait):
        made.append(hp.make_controller("wbc", gait, mu=0.4, formulation=formulation, solver=solver))
        made.append(None if add is None else add(made[0]))
        return made[0]

    return hp.walk(
        hp.Scenario(ground=hp.Ground(mu_s=0.4), duration=duration), controller=controller
    ), *made


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_walks_with_a_task_and_a_range(formulation):
    """The knee's task changes the walk, the range holds at every tick, and the last active set is
    tried first.
    """
    own = {"formulation": formulation, "solver": "active_set"}
    plain, _, _ = walk(**own)
    heaviest = plain["desired_force"][:, :, 2].max()

    def add(controller):
        controller.add(hp.FrameTask("left_knee", part="orientation", gains=(0.0, 5.0)), weight=1e-3)
        return [
            controller.add(hp.FootForceTask(foot), upper=(np.inf, np.inf, 0.9 * heaviest))
            for foot in ROBOT.feet
        ]

    run, controller, tasks = walk(**own, add=add)
    assert controller.added.tasks[1:] == tasks
    np.testing.assert_array_equal(tasks[0].matrix[:, 12:15], np.eye(3))
    np.testing.assert_allclose(tasks[0].error, run["desired_force"][-1, 0], atol=1e-9)
    assert run.ending == "completed"
    assert controller.failures == 0
    assert run["desired_force"][:, :, 2].max() < 0.9 * heaviest + 1e-6
    assert np.abs(run["q"] - plain["q"]).max() > 1e-6
    assert controller._solver.searched < 0.2 * len(run)


def test_nothing_added_changes_nothing():
    """A task of no weight has the path of added tasks, and leaves every bit of the walk as it
    was.
    """
    plain, controller, _ = walk(solver="active_set")
    assert controller.added is None
    with_nothing, _, _ = walk(
        solver="active_set", add=lambda c: c.add(hp.FrameTask("left_knee"), weight=0.0)
    )
    for name in ("q", "v", "torque", "thrust", "desired_force"):
        np.testing.assert_array_equal(plain[name], with_nothing[name])


def test_weight_and_references_may_be_overwritten():
    task = hp.CentreOfMassTask()
    controller = hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.4)
    entry, other = (
        controller.add(task, weight=1.0),
        controller.add(hp.wbc.MomentumTask(), weight=(0.0, 0.0, 0.1)),
    )
    q, v = controller.gait.initial_state()
    state = hp.State(0.0, q, v, *np.zeros((2, 2, 3)), np.tile((0.0, 0.0, 30.0), (2, 1)))
    controller.step(state)
    before = np.abs(entry.error)
    entry.weight[:] = 1e3
    controller.step(state)
    assert np.linalg.norm(entry.error) < 0.5 * np.linalg.norm(before)
    task.acceleration[:] = (1.0, 0.0, 0.0)
    old = entry.target.copy()
    controller.step(state)
    np.testing.assert_allclose(entry.target - old, (1.0, 0.0, 0.0), atol=1e-12)
    assert np.isfinite(other.error).all()


def test_error_is_no_number_where_there_is_no_solution():
    """A range out of reach: the tick fails, the last command is held, and the error does not
    lie.
    """
    controller = hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.4)
    entry = controller.add(hp.CentreOfMassTask(), lower=-1e3)
    q, v = controller.gait.initial_state()
    state = hp.State(0.0, q, v, *np.zeros((2, 2, 3)), np.tile((0.0, 0.0, 30.0), (2, 1)))
    controller.step(state)
    assert controller.failures == 0
    assert np.isfinite(entry.error).all()
    entry.lower[:] = 1e3
    controller.step(state)
    assert controller.failures == 1
    assert np.isnan(entry.error).all()


class Given:
    """A task that returns what it is told."""

    def __init__(self, *rows):
        self.now = rows

    def rows(self, dynamics, state):
        return self.now


@pytest.mark.parametrize(
    ("task", "how", "match"),
    [
        (
            lambda: hp.FrameTask("tail"),
            {"weight": 1.0},
            "unknown frame 'tail'; valid names: .*left_knee",
        ),
        (lambda: hp.JointTask("tail"), {"weight": 1.0}, "unknown joint 'tail'; valid names: "),
        (
            lambda: hp.FootForceTask("tail"),
            {"weight": 1.0},
            "unknown foot 'tail'; valid names: left_foot, right_foot",
        ),
        (lambda: hp.FrameTask("left_knee"), {}, "needs a weight, a range"),
        (lambda: hp.FrameTask("left_knee"), {"weight": -1.0}, "negative"),
        (lambda: hp.FrameTask("left_knee"), {"weight": 1e9}, "weight must be"),
        (lambda: hp.FrameTask("left_knee"), {"weight": (1.0, 2.0)}, r"shape \(3,\)"),
        (lambda: hp.FrameTask("left_knee"), {"lower": 1.0, "upper": 0.0}, "above upper"),
        (lambda: hp.FrameTask("left_knee"), {"lower": np.nan}, "numbers"),
        (
            lambda: hp.FrameTask("left_knee", gains=(1.0, 0.0)),
            {"weight": 1.0},
            "k_p needs a position",
        ),
        (
            lambda: hp.FrameTask("left_knee", part="orientation", gains=(1.0, 0.0)),
            {"weight": 1.0},
            "needs a rotation",
        ),
        (
            lambda: hp.FrameTask("left_knee", position=(0.0, 0.0, 1.0)),
            {"weight": 1.0},
            r"gain k_p, .*\(100, 20\)",
        ),
        (
            lambda: hp.FrameTask("left_knee", part="both", rotation=np.eye(3)),
            {"weight": 1.0},
            "rotation needs a gain",
        ),
        (
            lambda: hp.JointTask("left_knee", position=1.0, gains=(0.0, 5.0)),
            {"weight": 1.0},
            "position needs a gain",
        ),
        (
            lambda: hp.FrameTask("left_knee", rotation=np.ones((3, 3))),
            {"weight": 1.0},
            "must be a rotation",
        ),
        (
            lambda: hp.FrameTask("left_knee", rotation=np.diag((1.0, 1.0, -1.0))),
            {"weight": 1.0},
            "must be a rotation",
        ),
        (
            lambda: hp.FrameTask("left_knee", root="left_knee"),
            {"weight": 1.0},
            "another frame than 'left_knee'",
        ),
        (lambda: hp.JointTask(()), {"weight": 1.0}, "needs one at least"),
        (lambda: hp.FrameTask("left_knee", part="shape"), {"weight": 1.0}, "unknown part"),
        (lambda: hp.FrameTask("left_knee", axes="body"), {"weight": 1.0}, "unknown axes"),
        (lambda: hp.CentreOfMassTask(position=(0.0, 1.0)), {"weight": 1.0}, r"shape \(3,\)"),
        (
            lambda: Given(np.zeros((1, 5)), np.zeros(1)),
            {"weight": 1.0},
            "rows of Given must have shapes",
        ),
        (
            lambda: Given(np.zeros((2, 12)), np.zeros(1)),
            {"weight": 1.0},
            "rows of Given must have shapes",
        ),
        (lambda: Given(np.full((1, 12), np.nan), np.zeros(1)), {"weight": 1.0}, "finite"),
    ],
)
def test_bad_tasks_are_refused(task, how, match):
    controller = hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.4)
    with pytest.raises(hp.InputError, match=match):
        controller.add(task(), **how)
    assert controller.added is None


def test_rows_that_change_are_refused_in_the_tick():
    controller = hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.4)
    task = Given(np.zeros((1, 12)), np.zeros(1))
    controller.add(task, weight=1.0)
    q, v = controller.gait.initial_state()
    state = sample(q, v)
    controller.step(state)
    task.now = (np.zeros((2, 12)), np.zeros(2))
    with pytest.raises(hp.InputError, match="rows of Given had shapes"):
        controller.step(state)
    task.now = (np.zeros((1, 12)), np.array([np.inf]))
    with pytest.raises(hp.InputError, match="rows of Given must be finite"):
        controller.step(state)
