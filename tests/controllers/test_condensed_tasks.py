"""Tasks of one's own in the condensed controller: the optimum is that of the QP with the same ones,
and they hold while robots walk.
"""

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from comparison.measure.optimum_cases import GRIPPER, b1_with_arm
from harpy_pin.gaits.gait import Gait

HAND, OTHER = "left_wrist_yaw_link", "right_wrist_yaw_link"


def place_of(robot: hp.Robot, frame: str, q: np.ndarray) -> pin.SE3:
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.frame_id(frame)].copy()


def states(gait: Gait, controller: str, duration: float) -> list[hp.State]:
    scenario = hp.Scenario(controller=controller, ground=hp.Ground(mu_s=0.6), duration=duration)
    run = hp.walk(scenario, gait=gait)
    names = ("t", "q", "v", "foot_position", "foot_velocity", "foot_force")
    rows = zip(*(run[name] for name in names), strict=True)
    return [hp.State(float(t), *(row.copy() for row in rest)) for t, *rest in rows]


class Swaying(hp.CentreOfMassTask):
    """Rows of one's own, which are Python's."""

    def rows(self, dynamics, state):
        return super().rows(dynamics, state)


def both(make_gait, tasks: list, weights: list, along: list[hp.State]) -> tuple:
    """Largest difference of the torques of the condensed controller and of the QP at states, and
    the largest torque; each gets tasks of its own.
    """
    condensed = hp.make_controller("condensed", make_gait(), mu=0.6)
    program = hp.make_controller(
        "wbc", make_gait(), mu=0.6, formulation="full", solver="active_set"
    )
    for make, weight in zip(tasks, weights, strict=True):
        condensed.add(make(), weight=weight)
        program.add(make(), weight=weight)
    worst = largest = 0.0
    for state in along:
        found, expected = condensed.step(state).torque, program.step(state).torque
        worst = max(worst, np.abs(found - expected).max())
        largest = max(largest, np.abs(expected).max())
    assert program.failures == 0
    return worst, largest


def test_harpy_has_the_optimum_of_the_program(gait, robot):
    along = states(gait, "condensed", 1.2)[::7]
    tasks = [
        lambda: hp.FrameTask("base", part="orientation", rotation=np.eye(3), gains=(40.0, 8.0)),
        lambda: hp.JointTask(robot.joints[:2], gains=(0.0, 5.0)),
        lambda: hp.CentreOfMassTask(position=(0.1, 0.0, 0.4), gains=(20.0, 5.0)),
        lambda: hp.wbc.MomentumTask(part="angular", gain=2.0),
    ]
    worst, largest = both(lambda: hp.make_gait(robot), tasks, [0.3, 0.02, 0.5, 0.4], along)
    assert worst < 1e-4 * largest  # the program has a posture for the left leg, too


@needs_robots
def test_a_humanoids_hands_have_the_optimum_of_the_program(g1):

    def walks() -> Gait:
        return hp.WalkingGait(g1, velocity=(0.3, 0.0, 0.1))

    along = states(walks(), "condensed", 0.7)[::20]
    goal, other = (place_of(g1, hand, walks().initial_state()[0]) for hand in (HAND, OTHER))
    held = other.actInv(goal)
    tasks = [
        lambda: hp.FrameTask(
            HAND,
            part="both",
            root=OTHER,
            position=held.translation,
            rotation=held.rotation,
            gains=(40.0, 12.0),
        ),
        lambda: hp.FrameTask(
            HAND, part="both", position=goal.translation, rotation=goal.rotation, gains=(40.0, 12.0)
        ),
    ]
    worst, largest = both(walks, tasks, [2.0, 5.0], along)
    assert worst < 1e-3 * largest  # forces at the corners of soles are redundant


@needs_robots
@pytest.mark.parametrize(
    ("name", "frame", "millimetres"), [("g1", HAND, 1.0), ("b1 with arm", GRIPPER, 1.0)]
)
def test_what_is_held_stays_where_the_body_carries_it(name, frame, millimetres):
    """While the robot walks, with the weights of the page: within so much, and 1°."""
    robot = hp.load_robot("g1") if name == "g1" else b1_with_arm()
    gait = hp.WalkingGait(robot, velocity=(0.4, 0.0, 0.0))
    plant = hp.Simulator(robot, hp.Ground(mu_s=0.6).fitted(robot, walks=True))
    plant.reset(*gait.initial_state(penetration=plant.static_penetration))
    start = place_of(robot, frame, plant.q)
    task = hp.FrameTask(
        frame, part="both", position=start.translation, rotation=start.rotation, gains=(400.0, 40.0)
    )
    controller = hp.make_controller("condensed", gait, mu=0.6)
    controller.add(task, weight=10.0)
    ahead, far, turned = start.translation - plant.q[:3], [], []
    controller.step(plant.state)
    while plant.t < 3.0:
        body = controller.target.body
        task.acceleration[:3] = (body[3:6] - task.velocity[:3]) / 1e-3
        task.position[:], task.velocity[:3] = body[:3] + ahead, body[3:6]
        plant.advance(controller.step(plant.state), steps=2)
        now = place_of(robot, frame, plant.q)
        far.append(np.linalg.norm(now.translation - task.position))
        turned.append(np.linalg.norm(pin.log3(start.rotation.T @ now.rotation)))
    assert plant.q[0] > 0.8
    assert max(far) < 1e-3 * millimetres
    assert np.degrees(max(turned)) < 1.0


def test_what_is_refused_changes_nothing(gait, robot):
    along = states(gait, "condensed", 0.3)[::30]
    controller, same = (hp.make_controller("condensed", gait, mu=0.6) for _ in range(2))
    task = hp.JointTask(robot.joints[:2], gains=(0.0, 5.0))
    for one in (controller, same):
        one.add(hp.JointTask(robot.joints[:2], gains=(0.0, 5.0)), weight=0.1)
    for bad, weight, says in (
        (hp.wbc.FootForceTask("right_foot"), 1.0, "tasks must be FrameTask"),
        (Swaying(), 1.0, "rows of one's own, as of Swaying"),
        (hp.FrameTask("nose", part="position"), 1.0, "nose"),
        (hp.JointTask(("nose",)), 1.0, "nose"),
        (task, -1.0, "weight"),
        (task, np.nan, "weight"),
        (task, [1.0, 2.0, 3.0], "weight"),
    ):
        with pytest.raises(hp.InputError, match=says):
            controller.add(bad, weight=weight)
    with pytest.raises(hp.InputError, match=r"a range .* whole-body QP"):
        controller.add(hp.CentreOfMassTask(), weight=1.0, lower=-1.0)
    assert [*map(type, controller.added)] == [hp.JointTask]
    for state in along:
        np.testing.assert_array_equal(controller.step(state).torque, same.step(state).torque)


def test_a_reference_that_is_no_number_is_said(gait):
    along = states(gait, "condensed", 0.2)[::20]
    controller, task = hp.make_controller("condensed", gait, mu=0.6), hp.CentreOfMassTask()
    weight = controller.add(task, weight=1e-3)
    controller.step(along[0])
    for numbers in (task.acceleration, weight):
        before = numbers.copy()
        numbers[1] = np.nan
        with pytest.warns(UserWarning, match="or weight of a CentreOfMassTask is not finite"):
            controller.step(along[1])
        numbers[:] = before
    controller.step(along[2])
    assert controller.solver.status == 0


def test_a_weight_may_be_changed_in_place(gait):
    state = states(gait, "condensed", 0.2)[-1]
    controller, without = (hp.make_controller("condensed", gait, mu=0.6) for _ in range(2))
    weight = controller.add(
        hp.FrameTask("base", part="orientation", rotation=np.eye(3), gains=(100.0, 20.0)),
        weight=9.0,
    )
    free = without.step(state).torque.copy()
    assert np.abs(controller.step(state).torque - free).max() > 1e-3
    weight[:] = 0.0
    controller.step(state)
    np.testing.assert_allclose(controller.step(state).torque, free, rtol=0, atol=1e-9)
