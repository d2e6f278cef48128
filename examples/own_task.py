"""Tasks of one's own in the whole-body QP: a foot's force, a frame, a range, and rows in NumPy."""

import numpy as np

import harpy_pin as hp
from harpy_pin.model import Vector


class SlowYaw:
    """Damps the body's yaw; a task has ``rows``, of A a ≈ b in the generalised acceleration a."""

    def rows(self, dynamics: hp.Dynamics, state: hp.State) -> tuple[Vector, Vector]:
        return np.eye(6, len(state.v))[5:], -5.0 * state.v[5:6]


def with_tasks(gait: hp.Gait) -> hp.Controller:
    controller = hp.make_controller("wbc", gait, mu=0.25, formulation="full")

    # A foot's force: while the left foot is on the ground, 25 N upward and nothing sideways.
    force = hp.FootForceTask("left_foot", force=(0.0, 0.0, 25.0))
    added["force"] = controller.add(force, weight=0.01)

    # A frame: the right shank turns as little as the other tasks allow.
    shank = hp.FrameTask("right_knee", part="orientation", gains=(0.0, 5.0))
    added["shank"] = controller.add(shank, weight=1e-3)

    # A range, no weight: the centre of mass accelerates up or down by at most 3 m/s².
    most = np.array((np.inf, np.inf, 3.0))
    added["centre"] = controller.add(hp.CentreOfMassTask(), lower=-most, upper=most)

    controller.add(SlowYaw(), weight=0.1)
    return controller


added: dict[str, hp.wbc.AddedTask] = {}
run = hp.walk(hp.Scenario(ground=hp.Ground(mu_s=0.25), duration=2.0), controller=with_tasks)
left = run["desired_force"][run["held"].all(axis=1), 0, 2].mean()
# Without the tasks it is about 21 N.
print(f"{run.ending}: left foot with {left:.1f} N on average while both are held")
for name, task in added.items():
    print(f"{name}: target {task.target.round(2)}, error in the last tick {task.error.round(2)}")
