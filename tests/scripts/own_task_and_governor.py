"""A task in the QP, rows in a governor, the governor of the true force and the shield behind a
controller.
"""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield, ShieldReport

Vector = NDArray[np.float64]


class SlowYaw:
    """Damps the body's yaw."""

    def rows(self, dynamics: hp.Dynamics, state: hp.State) -> tuple[Vector, Vector]:
        return np.eye(6, len(state.v))[5:], -5.0 * state.v[5:6]


class SpeedRow:
    """h = v_max − ẋ_w ≥ 0."""

    names: tuple[str, ...] = ("forward speed",)

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        h[0] = 0.4 - w[3]
        jacobian[0] = (0.0, 0.0, 0.0, -1.0, 0.0, 0.0)


robot = hp.load_harpy()
gait = hp.make_gait(robot)

controller = hp.make_controller("wbc", gait, mu=0.25)
assert_type(controller, hp.WholeBodyController)
added = controller.add(SlowYaw(), weight=0.1)
assert_type(added, hp.wbc.AddedTask)
assert_type(added.error, Vector)
controller.add(hp.FootForceTask("left_foot", force=(0.0, 0.0, 25.0)), weight=0.01)

rows = hp.governors.StackedRows([hp.governors.ForceRows(mass=robot.mass, mu=0.4), SpeedRow()])
governor: hp.governors.Governor = hp.ExplicitReferenceGovernor(rows)
governor.reset(np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0]))
applied = governor.update(
    np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    np.array([0.0, 0.0, 0.6, 0.8, 0.0, 0.0]),
    1e-3,
)
assert_type(applied, Vector)
assert_type(governor.status.active, tuple[str, ...])

simulator = hp.Simulator(robot, hp.Ground(mu_s=0.25))
simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
state = simulator.state
assert_type(state, hp.State)
command = controller.step(state)
assert_type(command, hp.Command)
behind = hp.ContactForceFilter(robot, hp.ContactForceFilterParameters(mu=0.25), period=1e-3)
assert_type(behind.update(state, command), hp.Command)
safe, report = Shield(robot, mu=0.25)(state, command)
assert_type(safe, hp.Command)
assert_type(report, ShieldReport)

problem = hp.wbc.make_problem("input_space", robot)
assert_type(problem, hp.wbc.WholeBodyProblem)
assert_type(problem.program, hp.wbc.QuadraticProgram)
assert_type(problem.program.hessian, Vector)
