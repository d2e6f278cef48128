"""The planar gait in three dimensions: the same curves, with the feet to the side and a swaying
body.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.gaits.straight import GaitParameters, StraightGait, make_gait
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from reproduction.gait.planar_gait import PAPER_CURVES_GAIT, SPACE_GAIT, PlanarGait, load_gait
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.planar_walk import PlanarWalk

REFERENCES = ("constant", "planar")
SWAY = 0.025
"""Amplitude of the body's lateral motion, m, in the period of two steps: the paper's."""
SAMPLES = 301
"""Rows of the table of the body's own motion over two steps."""


class SpatialGait(StraightGait, constant=True):
    """A planar gait for the walk in space.

    Feet follow the planar curves at a fixed width from the path; the body's target sways.

    Args:
        robot: a biped of Harpy's kind on its free flyer.
        planar: the planar gait.
        width: lateral distance of each foot from the path, m; the paper's is 0.15, narrower slips
            less.
        reference: what the body's target does along x and z: ``constant`` is the gait's speed and
            height (the paper), ``planar`` the motion that the planar walk settles into, so that
            thrust along x and z only corrects.
        settle: steps of the planar walk before that motion is read.
        friction: static friction coefficient of the planar walk that it is read from.

    Raises:
        InputError: unknown reference, a target is out of reach, or the planar walk falls before it
            has settled.
    """

    @checked
    def __init__(
        self,
        robot: Robot,
        planar: PlanarGait,
        *,
        width: float = 0.1,
        reference: str = "constant",
        settle: int = 20,
        friction: float = 0.25,
    ) -> None:
        checks.one_of("reference of the body", reference, REFERENCES)
        self.planar = planar
        self._table: Vector | None = None
        self._start: tuple[Vector, Vector] | None = None
        parameters = GaitParameters(
            speed=planar.speed,
            step_duration=planar.step_duration,
            double_support=planar.double_support,
            height=planar.height,
            width=width,
            sway=SWAY,
            clearance=max(0.375 * (planar.end_height - planar.swing_mid_height), 0.0),
            penetration_offset=0.0,
        )
        super().__init__(robot, parameters)
        for curve, points in zip((self.stance_curve, self.swing_curve), planar.curves, strict=True):
            curve[:, ::2] = points  # in the place of the hand-made ones
        self._check_reach()
        if reference == "planar":
            settle = int(checks.number("settle", settle, low=1))
            self._read_motion(robot, settle + settle % 2, friction)

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`."""
        target = super().update(t)
        target.world_frame_blend[:] = 0.0  # both feet follow the body, as in the paper
        if self._table is not None:
            period = 2.0 * self.parameters.step_duration
            place = (t % period) / period * (SAMPLES - 1)
            row = min(int(place), SAMPLES - 2)
            share = place - row
            now = (1.0 - share) * self._table[row] + share * self._table[row + 1]
            drift = self._drift
            target.body[0], target.body[2] = drift * t + now[0], now[1]
            target.body[3], target.body[5] = now[2], now[3]
            target.body[6], target.body[8] = 0.0, 0.0
        return target

    def calls(self, state: State) -> None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.calls`: its targets are not those of the kernel
        alone.
        """

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`: the planar walk's, with the
        sideways part added.
        """
        model, p = self.robot.model, self.planar
        pitch, speeds = p.start_pitch, np.array([p.start_vx, p.start_vz, p.start_pitch_rate])
        x = 0.0
        if self._start is not None:
            section, velocity = self._start
            pitch, speeds, x = float(section[2]), velocity[:3], float(self.update(0.0).body[0])
        target = self.update(0.0)
        q, v = pin.neutral(model), np.zeros(model.nv)
        rotation = pin.rpy.rpyToMatrix(0.0, pitch, 0.0)
        q[0], q[1] = x, target.body[1]
        q[3:7] = pin.Quaternion(rotation).coeffs()
        v[:3] = rotation.T @ np.array([speeds[0], target.body[4], speeds[1]])
        v[4] = speeds[2]
        self._place_legs(target, q, v)
        q[2] = -min(float((rotation @ foot)[2]) for foot in target.foot_position) - penetration
        return q, v

    def _read_motion(self, robot: Robot, settle: int, friction: float) -> None:
        """Table of x (less its drift), z, ẋ, ż over two steps of the settled planar walk, as a
        periodic motion.
        """
        walk = PlanarWalk(PlanarModel.from_robot(robot), self.planar, ground=Ground(mu_s=friction))
        summary = walk.run(settle * self.parameters.step_duration)
        if not summary.fell:
            self._start = (walk.q.copy(), walk.v.copy())
            summary = walk.run(2.0 * self.parameters.step_duration, log=True)
        if summary.fell:
            raise InputError(
                f"the planar walk falls before it has settled for {settle} steps", name="planar"
            )
        period = 2.0 * self.parameters.step_duration
        t, q, v = walk.log[:, 0], walk.log[:, 1:8], walk.log[:, 8:15]
        t, x = t - t[0], np.append(q[:, 0], walk.q[0])
        self._drift = float((x[-1] - x[0]) / period)
        rows = np.linspace(0.0, period, SAMPLES)
        columns = (q[:, 0] - q[0, 0] - self._drift * t, q[:, 1], v[:, 0], v[:, 1])
        self._table = np.stack(
            [np.interp(rows, t, column, period=period) for column in columns], axis=1
        )


GAITS = ("hand", "optimised", "paper-curves")
"""``hand``: the library's own straight walk. ``optimised``: a planar gait that walks without
thrust, refined for the governed walk in space. ``paper-curves``: one with the paper's own curve
shape, P1 = P0 and P3 = P4, found for friction 0.8, in space as the paper prints it: feet at ±0.15
m, the body's target at constant speed and height.
"""


def make_named_gait(robot: Robot, name: str) -> StraightGait:
    """A gait in space by name, at 0.3 m/s.

    Args:
        robot: a biped of Harpy's kind.
        name: one of :data:`GAITS`.

    Raises:
        InputError: unknown name.
    """
    checks.one_of("gait", name, GAITS)
    if name == "hand":
        return make_gait(robot)
    if name == "paper-curves":
        return SpatialGait(
            robot, load_gait(PAPER_CURVES_GAIT).gait, width=0.15, reference="constant"
        )
    return SpatialGait(robot, load_gait(SPACE_GAIT).gait, width=0.125, reference="planar")
