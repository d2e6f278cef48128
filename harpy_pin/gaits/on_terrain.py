"""A gait of flat ground, laid over ground that is not flat.

On a slope that is too steep for friction the body is downhill of its feet. Thrust then holds what
friction does not, and it acts high above the feet, so that it tips the robot uphill. The weight
balances that where the centre of mass is downhill of the feet. With the thrust T along the slope of
angle a, at the height h above the feet and the distance l uphill of them, the moments about the
feet are zero where the centre of mass is downhill by

    (T / W) (h cos a − l sin a),   T = W (sin a − μ cos a)

A body that moves along the slope changes neither side but by its legs, which move half as far.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.gaits.gait import Gait, GaitTarget, own_target
from harpy_pin.gaits.straight import StraightGait
from harpy_pin.gaits.terrain_targets import OnTerrainRecord, fit_plane, lay_over
from harpy_pin.ground.terrain import Plane, Terrain
from harpy_pin.kernels.calls import Call
from harpy_pin.model.posed import Posed
from harpy_pin.model.record import make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector

STEPS, DAMPING = 100, 1e-6
"""Steps and damping of the iteration that finds the legs' joints at the start."""
LEAST_REACH = 0.15
"""Half the side of the square whose plane the body follows, at least, m."""
LEANING = 4
"""Feet from which on a robot leans with the ground: legs before and behind the body would differ in
length otherwise. Robots on two feet stay upright.
"""
FRICTION_SHARE = 0.6
"""Share of the friction that the body's place on a steep slope counts on: controllers leave some of
it for errors.
"""
DOWNHILL_STEPS = 4
"""Steps of the iteration that finds this place; each leaves a sixth of the error."""
LOWERED, LOWER, CLOSE = 10, 0.02, 2e-3
"""How often the body of a robot on soles is lowered at most until they are where they should be, by
which share of its height, and how near that is, m: legs of humanoids are nearly straight.
"""


class OnTerrain(Gait):
    """A gait of flat ground whose feet stay on the ground, and whose body stays as high above it.

    Heights are all that changes: of a foot by that of the ground below it, of the body by that of
    the plane which fits the ground around it best. Normals are those of the ground below each foot.
    The body of a robot on four feet leans with that plane.

    Args:
        gait: of flat ground.
        terrain: that it is laid over.
        normal_error: of the normals in its targets, an angle about y, rad.
        friction: static coefficient. On a plane that is too steep for it a robot with thrusters is
            downhill of its feet (:func:`downhill`). Where it is not given, it is enough.

    Attributes:
        gait: of flat ground.
    """

    terrain: Terrain

    @checked
    def __init__(
        self,
        gait: Gait,
        terrain: Terrain,
        *,
        normal_error: float = 0.0,
        friction: float | None = None,
    ) -> None:
        super().__init__(gait.robot)
        self.gait, self.terrain, self.walks = own_target(gait), terrain, gait.walks
        self.controller_parameters = gait.controller_parameters
        self.double_support = self.gait.double_support
        q = self.gait.initial_state(penetration=0.0)[0]
        feet = self._feet(q)[0]
        apart = (
            np.linalg.norm((feet - feet.mean(axis=0))[:, :2], axis=1).max() if len(feet) else 0.0
        )
        self._record = make_record(
            OnTerrainRecord,
            {"feet": len(self.robot.feet)},
            terrain=terrain.record,
            reach=max(float(apart), LEAST_REACH),
            own_swings=np.int64(0),
            leans=np.int64(len(self.robot.corners) >= LEANING),
            normal_error=checks.number("normal_error", normal_error, low=-1.0, high=1.0),
        )
        if friction is not None and isinstance(terrain, Plane):
            friction = checks.number("friction", friction, low=0.0, high=checks.MAX_FRICTION)
            slope = terrain.record["slope"][0]
            self._record["offset"][0] = downhill(self.robot, self._with_offset, slope, friction)
        self.lay_over(terrain)
        if (
            type(self.gait) is StraightGait and not self.gait.standing
        ):  # where its feet land is known
            ahead, aside = self.gait.swing_curve[-1, :2]
            self._record["swing_time"] = self.step_duration * (1.0 - self.double_support)
            self._record["landing"][0] = (ahead, aside), (ahead, -aside)
        lay_over.prepare(0.0, self._record, self.gait.target._record_, self.target._record_)

    def __repr__(self) -> str:
        return f"OnTerrain({self.gait!r}, {self.terrain!r})"

    @checked
    def lay_over(self, terrain: Terrain) -> None:
        """Other ground from the next update on; the body stays as far from its feet as it was.

        Args:
            terrain: from then on.
        """
        self.terrain, self._record["terrain"] = terrain, terrain.record
        reach = float(self._record["reach"][0])
        self._record["own_swings"] = self.gait.expect_terrain(terrain, reach=reach)
        self.step_duration = self.gait.step_duration

    def observe(self, state: State) -> None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.observe`; the state goes to the gait."""
        self.gait.observe(state)

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`."""
        lay_over(t, self._record, self.gait.update(t)._record_, self.target._record_)
        return self.target

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.calls`."""
        calls = self.gait.calls(state)
        if type(self) is not OnTerrain or calls is None:
            return None
        return *calls, Call(
            lay_over, 0.0, self._record, self.gait.target._record_, self.target._record_
        )

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`; body and feet are as high above the
        ground as there.
        """
        q, v = self.gait.initial_state(penetration=penetration)
        flat, speed = self._feet(q)[0], self._feet(q)[1] @ v
        reach = float(self._record["reach"][0])
        height, along, across = fit_plane(self._record["terrain"], float(q[0]), float(q[1]), reach)
        q = q.copy()
        q[2] += height
        q[:3] += self._record["offset"][0]
        if self._record["leans"][0]:
            turn = pin.Quaternion.FromTwoVectors(
                np.array((0.0, 0.0, 1.0)), np.array((-along, -across, 1.0))
            )
            q[3:7] = (turn * pin.Quaternion(*q[[6, 3, 4, 5]])).coeffs()
        desired = flat.copy()
        desired[:, 2] += self.terrain.height(flat[:, 0], flat[:, 1])
        begin, lower = q.copy(), LOWER * q[2]
        for _ in range(LOWERED if len(flat) else 0):
            q = self._reach(begin, desired)
            if not self.robot.flat_feet or np.abs(desired - self._feet(q)[0]).max() < CLOSE:
                break
            begin[2] -= lower
        v = v.copy()
        v[2] += along * v[0] + across * v[1]
        if len(flat):
            legs = self._feet(q)[1]
            v[6:] += np.linalg.lstsq(legs[:, 6:], speed - legs @ v, rcond=1e-6)[0]
        return q, v

    def _reach(self, q: Vector, desired: Vector) -> Vector:
        """The configuration near q in which the legs bring the feet to places (feet, 3), m."""
        for _ in range(STEPS):
            feet, jacobian = self._feet(q)
            legs = jacobian[:, 6:]
            step = legs.T @ np.linalg.solve(
                legs @ legs.T + DAMPING * np.eye(len(legs)), (desired - feet).ravel()
            )
            q = self.robot.integrate(q, np.concatenate((np.zeros(6), step)))
        return q

    def _with_offset(self, offset: Vector) -> Vector:
        """Take an offset of the body; returns the configuration at the start."""
        self._record["offset"][0] = offset
        return self.initial_state()[0]

    def _feet(self, q: Vector) -> tuple[Vector, Vector]:
        """Places of the feet, and their Jacobian, world axes."""
        posed, feet = Posed(self.robot, q), self.robot.feet
        places = np.array([posed.frame(name).translation for name in feet]).reshape(-1, 3)
        rows = [posed.jacobian(name)[:3] for name in feet]
        return places, np.vstack([np.zeros((0, self.robot.nv)), *rows])

    def describe(self) -> Mapping[str, Any]:
        """Parameters of the gait, and the terrain."""
        numbers = {name: self._record[name][0].tolist() for name in ("normal_error", "offset")}
        return {
            **self.gait.describe(),
            "on_terrain": {"terrain": self.terrain.to_dict(), **numbers},
        }

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The gait's signals."""
        return self.gait.telemetry()


def downhill(
    robot: Robot, posture: Callable[[Vector], Vector], slope: Vector, friction: float
) -> Vector:
    """How far the body of a robot with free thrusters goes from its place, along the slope.

    Args:
        robot: who stands.
        posture: from an offset of the body, (3,) in m, to the configuration that has it, with the
            feet in their places.
        slope: (2,) rise of the ground per metre along x and y.
        friction: static coefficient.

    Returns:
        (3,) offset in world axes, m; zero where friction is enough.
    """
    offset, steep = np.zeros(3), float(np.hypot(*slope))
    short = steep - FRICTION_SHARE * friction
    if short <= 0.0 or not robot.thrusters or robot.rotors:
        return offset
    share = short / (1.0 + steep * steep)  # (T / W) cos a
    along = slope / steep
    for _ in range(DOWNHILL_STEPS):
        posed = Posed(robot, posture(offset))
        feet, thrusters = (
            np.mean([posed.frame(name).translation for name in names], axis=0)
            for names in (robot.feet, robot.thrusters)
        )
        arm = thrusters - feet
        uphill = along @ (posed.centre - feet)[:2] + share * (arm[2] - steep * (along @ arm[:2]))
        offset -= uphill * np.array((*along, steep))
    return offset
