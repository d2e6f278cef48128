"""Targets of a planar gait, and the planar walk as a controller, to which the compiled loop is held."""

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.record import field
from harpy_pin.model.state import Command
from reproduction.gait.planar_gait import planar_targets
from reproduction.gait.planar_walk import PlanarJoints, planar_control, walk_record


class PlanarWalkController:
    """Torques of hips and knees."""

    def __init__(self, model, gait, period=1e-3):
        self.model, self.period = model, period
        self._record = walk_record(gait, PlanarJoints(), period=period)
        self._command = Command(field(self._record, "torque"), np.zeros((len(model.planar.thrusters), 3)))

    def step(self, state):
        _tick(state.t, state.q, state.v, self._record, self.model.record)
        return self._command

    def telemetry(self):
        return {"joint_target": field(self._record, "target")}


@kernel
def _tick(t, q, v, walk, model):
    planar_control(t, q, v, walk[0], model[0])


def targets(gait, t):
    position, velocity, stance = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))
    planar_targets(t, gait.record[0], position, velocity, stance)
    return position, velocity, stance
