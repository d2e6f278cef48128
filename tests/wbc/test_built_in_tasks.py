"""The tasks that every problem has: the compiled objective is that of the same classes that users
add.

| weight | task | when |
|---|---|---|
| ``body`` | ``FrameTask`` of the base, position | always |
| ``orientation`` | ``FrameTask`` of the base, orientation, local axes | always |
| ``swing`` | ``FrameTask`` of a foot, position | the foot is in swing |
| ``posture``, ``arms`` | ``JointTask`` of a joint that moves one foot, or of another one | always |
| ``force`` | ``FootForceTask`` of a foot, towards zero | the foot is in stance |

Where the targets say so, the horizontal part of ``body`` is ``CentreOfMassTask``. A foot in stance
has the ``FrameTask`` of its position as a constraint: its error is zero. The weight ``thrust`` is
on the inputs themselves, which are no part of x = [a; f].
"""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest
from biped_urdf import biped_urdf
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.wbc import Task, WholeBodyTargets, WholeBodyWeights, make_problem
from harpy_pin.wbc.weights import joint_weights

WEIGHTS = WholeBodyWeights(
    body=1.5, orientation=0.2, swing=3.0, posture=0.3, arms=0.7, thrust=5e-3, force=1e-3
)
HARPY = hp.load_harpy()


def built_in_tasks(
    robot: hp.Robot, targets: WholeBodyTargets, held: np.ndarray
) -> Iterator[tuple[float, Task]]:
    """Weight and task of each entry of the table, towards the targets."""
    base, share = robot.model.names[1], targets.joint_share
    entries = [
        (WEIGHTS.body, hp.FrameTask(base), targets.body),
        (
            WEIGHTS.orientation,
            hp.FrameTask(base, part="orientation", axes="local"),
            targets.orientation,
        ),
    ]
    for j, (joint, weight) in enumerate(zip(robot.joints, joint_weights(robot), strict=True)):
        reference = targets.joints[j : j + 1]
        entries.append((getattr(WEIGHTS, weight) * share[j], hp.JointTask(joint), reference))
    for k, foot in enumerate(robot.feet):
        if held[k]:
            yield WEIGHTS.force, hp.FootForceTask(foot)
        else:
            entries.append((WEIGHTS.swing, hp.FrameTask(foot), targets.feet[k]))
    for weight, task, acceleration in entries:
        task.acceleration = acceleration
        yield weight, task


def costs_agree(robot: hp.Robot, formulation: str, seed: int, held: np.ndarray) -> None:
    """Between random z, the objective changes as the costs of the tasks and of the thrusts do."""
    rng = np.random.default_rng(seed)
    model = robot.model
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-0.4, 0.4, model.nv))
    v = rng.standard_normal(model.nv)
    targets = WholeBodyTargets(robot)
    for array in (targets.body, targets.orientation, targets.feet, targets.joints):
        array[:] = rng.uniform(-5.0, 5.0, array.shape)
    targets.joint_share[:] = rng.uniform(0.5, 50.0, len(robot.joints))
    targets.held[:] = held
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    problem = make_problem(formulation, robot, WEIGHTS)
    problem.build(dynamics, v, dynamics.rotation, targets)
    motion, at_zero = problem.motion_map(held)
    state = hp.State(0.0, q, v, *np.zeros((3, len(robot.feet), 3)))

    def cost(z: np.ndarray) -> float:
        x, inputs = motion @ z + at_zero, np.zeros(robot.n_thrust + len(robot.joints))
        problem.inputs(z, inputs)
        total = WEIGHTS.thrust * np.sum(inputs[: robot.n_thrust] ** 2)
        for weight, task in built_in_tasks(robot, targets, held):
            matrix, target = task.rows(dynamics, state)
            error = matrix @ x[: matrix.shape[1]] - target
            total += weight * np.sum(error**2)
        return 0.5 * total

    program = problem.program
    z = rng.standard_normal((2, len(program.gradient)))
    if formulation == "full":  # a swing foot has no force
        first = program.bounded
        z[:, first : first + 3 * len(held)][:, np.repeat(held, 3) == 0.0] = 0.0
    expected = cost(z[1]) - cost(z[0])
    np.testing.assert_allclose(
        program.objective(z[1]) - program.objective(z[0]), expected, rtol=1e-8, atol=1e-8
    )


@given(
    st.integers(0, 10_000), st.sampled_from(("full", "input_space")), st.sampled_from((0, 1, 2, 3))
)
def test_the_compiled_objective_is_that_of_the_table(seed, formulation, support):
    costs_agree(HARPY, formulation, seed, np.array((float(support & 1), float(support >> 1))))


@needs_robots
@pytest.mark.parametrize("name", ["g1", "iris", "solo12"])
@pytest.mark.parametrize("formulation", ["full", "input_space"])
def test_other_robots_have_the_same_table(name, formulation):
    robot = hp.load_robot(name)
    costs_agree(robot, formulation, 1, np.ones(len(robot.feet)))


@pytest.mark.parametrize("formulation", ["input_space", "full"])
def test_a_joint_that_moves_one_foot_weighs_as_a_leg_others_as_an_arm(tmp_path, formulation):
    """A waist is between the base and both feet; its weight holds it against the hips' yaws."""
    file = tmp_path / "biped.urdf"
    arm = (
        '<link name="arm"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
        'ixy="0" ixz="0" '
    )
    arm += (
        'iyz="0"/></inertial></link><joint name="j_arm" type="revolute"><parent '
        'link="base"/><child link="arm"/>'
    )
    arm += '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="9"/></joint>'
    file.write_text(biped_urdf(waist=("waist",), more=arm))
    soles = dict.fromkeys(("L_sole", "R_sole"), hp.FlatFoot(length=0.2, width=0.1))
    robot = hp.load_robot(file, feet=tuple(soles), flat_feet=soles)
    legs = [joint[2:4] in ("L_", "R_") for joint in robot.joints]
    problem = make_problem(formulation, robot, WEIGHTS)
    expected = np.where(legs, WEIGHTS.posture, WEIGHTS.arms)
    np.testing.assert_array_equal(problem.record["w_motion"][0, 6:], expected)
    assert sum(legs) == 12
    assert len(legs) == 14
