"""Where Harpy stands on slopes: pitch by friction, under every kind of controller, beside what statics allows.

The bound of statics is a linear program of its own: forces in the friction cones about the normal and thrusts within
their limits that balance the upright robot, with joint torques within the motors' limits, wherever its body is along x.
It has two answers: whether that is possible without thrust, and the least sum of thrusts with which it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq, linprog

from comparison.measure.walking import Progress, Rows, grouped, in_processes, walk_as_far_as_it_goes
from comparison.tables import Cell, Table
from harpy_pin import (
    Ground,
    LegGeometry,
    Plane,
    Robot,
    Scenario,
    Straight,
    checks,
    leg_inverse_kinematics,
    load_harpy,
    make_gait,
)
from harpy_pin.model.state import Vector
from harpy_pin.wbc import WholeBodyLimits
from harpy_pin.wbc.weights import thrust_box

__all__ = ["SlopeSettings", "slope_tables", "stand_on_slopes", "static_bound"]

WALKERS: dict[str, tuple[str, dict[str, Any]]] = {
    "no_thrust": ("joint PID, no thrust", {"name": "governed", "governor": "none", "thrust": False, "limits": True}),
    "paper": ("paper's governor", {"name": "governed", "governor": "paper", "limits": True}),
    "filter": ("contact-force filter", {"name": "governed", "governor": "filter", "limits": True}),
    "condensed": ("condensed WBC", {"name": "condensed"}),
    "wbc": ("whole-body QP", {"name": "wbc"}),
}
"""Name in tables and controller of a scenario."""
FACES = 32
"""Of the pyramid inside Coulomb's cone in the bound: its cone is half a per cent narrower."""
REACH, PLACES = 0.2, 21
"""How far ahead of the feet or behind them the body may be, m, and how many places are looked at."""
HELD = 5.0
"""Slip of both feet together up to which a robot stands, mm."""


@dataclass(frozen=True, kw_only=True)
class SlopeSettings:
    """What is stood on.

    Attributes:
        degrees: angles by which the ground rises along x, degrees.
        frictions: static friction coefficients, which the controllers know.
        walkers: of :data:`WALKERS`.
        duration: s.
    """

    degrees: tuple[float, ...] = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0)
    frictions: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    walkers: tuple[str, ...] = tuple(WALKERS)
    duration: float = 3.0

    def __post_init__(self) -> None:
        checks.number("duration", self.duration, low=0.1)
        for walker in self.walkers:
            checks.one_of("walker", walker, WALKERS)

    @classmethod
    def quick(cls) -> SlopeSettings:
        """Few slopes and frictions: to see whether it works."""
        return cls(degrees=(0.0, 15.0, 30.0), frictions=(0.2, 0.8), walkers=("paper", "condensed"), duration=1.0)


def stand_on_slopes(settings: SlopeSettings, progress: Progress | None = None) -> Rows:
    """A row for each angle, friction and controller: the bound, how it ended, slip and thrust."""
    places = list(product(settings.degrees, settings.frictions))
    jobs = [(*place, walker, settings.duration) for walker, place in product(settings.walkers, places)]
    bounds = {place: static_bound(*place) for place in places}
    rows = in_processes(_stand, jobs, progress)
    for row in rows:
        row["without_thrust"], row["least_thrust"] = bounds[row["degrees"], row["friction"]]
    return rows


def _stand(job: tuple[float, float, str, float]) -> dict[str, Any]:
    degrees, friction, walker, duration = job
    scenario = Scenario(
        controller=WALKERS[walker][1],
        gait=Straight(speed=0.0),
        ground=Ground(mu_s=friction, slope=np.radians(degrees)),
        duration=duration,
    )
    run = walk_as_far_as_it_goes(scenario)
    thrust = np.linalg.norm(run["thrust"], axis=2).sum(axis=1)
    return {
        "degrees": degrees,
        "friction": friction,
        "walker": walker,
        "fell": run.ending != "completed",
        "slip_mm": 1e3 * float(run["slip_path"][-1].sum()),
        "thrust_n": float(thrust[len(thrust) // 2 :].mean()),
    }


def static_bound(degrees: float, friction: float) -> tuple[bool, float | None]:
    """What statics allows with an upright body, wherever it is along x above the feet.

    Args:
        degrees: angle of the ground, which rises along x.
        friction: static coefficient.

    Returns:
        Whether the robot stands without thrust, and the least sum of its thrusts' components, N; none where it cannot
        stand with thrust either.
    """
    robot = load_harpy()
    normal = Plane(slope=float(np.radians(degrees))).normal(0.0, 0.0)
    above = brentq(lambda x: _centre(robot, x), -REACH, REACH)  # where the centre of mass is above the feet
    without = _least_thrust(robot, above, normal, friction, thrust=False) is not None
    places = (above, *np.linspace(-REACH, REACH, PLACES))
    found = [_least_thrust(robot, x, normal, friction, thrust=True) for x in places]
    possible = [thrust for thrust in found if thrust is not None]
    return without, min(possible) if possible else None


def _posture(robot: Robot, x: float) -> Vector:
    """The standing posture with the body x ahead of its feet, which are below the origin."""
    q = make_gait(robot, speed=0.0).initial_state()[0]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    for k, name in enumerate(robot.feet):
        foot = data.oMf[robot.frame_id(name)].translation - q[:3]
        leg = LegGeometry.from_robot(robot, name)
        q[7 + 3 * k : 10 + 3 * k] = leg_inverse_kinematics(leg, (-x, foot[1], foot[2]))
    q[0] = x
    return q


def _centre(robot: Robot, x: float) -> float:
    """Where the centre of mass is along x, m."""
    return float(pin.centerOfMass(robot.model, robot.model.createData(), _posture(robot, x))[0])


def _least_thrust(robot: Robot, x: float, normal: Vector, friction: float, *, thrust: bool) -> float | None:
    """Least sum of the thrusts' components with which a posture is in balance, N; none where there is none."""
    model, data, q = robot.model, robot.model.createData(), _posture(robot, x)
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    rows = [
        pin.getFrameJacobian(model, data, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)[:3]
        for name in (*robot.feet, *robot.thrusters)
    ]
    # Forces on the feet, then thrusts as differences of positive parts; torques are what is left of the balance.
    jacobian = np.vstack((*rows, *(-row for row in rows[2:])))
    feet = 3 * len(robot.feet)
    frame = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), normal).matrix()
    angle = 2.0 * np.pi * (np.arange(FACES) + 0.5) / FACES  # an edge of the cone along x
    inscribed = np.full(FACES, -friction * np.cos(np.pi / FACES))
    pyramid = np.column_stack((np.cos(angle), np.sin(angle), inscribed)) @ frame.T
    cones = np.zeros((2 * FACES, len(jacobian)))
    for k in range(2):
        cones[FACES * k : FACES * (k + 1), 3 * k : 3 * k + 3] = pyramid
    legs, limit = jacobian[:, 6:].T, thrust_box(robot, WholeBodyLimits())[1] * thrust
    found = linprog(
        np.concatenate((np.zeros(feet), np.ones(2 * len(limit)))),
        A_ub=np.vstack((cones, -legs, legs)),
        b_ub=np.concatenate((np.zeros(2 * FACES), robot.torque_limit - gravity[6:], robot.torque_limit + gravity[6:])),
        A_eq=jacobian[:, :6].T,
        b_eq=gravity[:6],
        bounds=[(None, None)] * feet + [(0.0, most) for most in (*limit, *limit)],
    )
    return float(found.fun) if found.status == 0 else None


def slope_tables(rows: Rows) -> list[Table]:
    """A map of each controller: its slip, mm, or that it fell; that of statics; and how many places each stands."""
    first = {(row["degrees"], row["friction"]): row for row in rows}
    cells = [
        Cell(f"{degrees:g}°", f"{friction:g}", _whole(row["least_thrust"]))
        for (degrees, friction), row in first.items()
    ]
    note = "Least sum of the thrusts' components with which Harpy can stand, N, by angle and friction coefficient."
    tables = [Table("slopes_statics", "What statics allows", tuple(cells), note)]
    sums: list[Cell] = []
    for (walker,), here in grouped(rows, "walker").items():
        name = WALKERS[walker][0]
        cells = [Cell(f"{row['degrees']:g}°", f"{row['friction']:g}", _how(row)) for row in here]
        note = f"Slip of both feet, mm, by angle and friction coefficient; up to {HELD:g} mm Harpy stands."
        tables.append(Table(f"slopes_{walker}", f"Standing on slopes: {name}", tuple(cells), note))
        stood = [row for row in here if _stands(row)]
        possible = sum(row["least_thrust"] is not None for row in here)
        alone = sum(row["without_thrust"] for row in here)
        thrust = [row["thrust_n"] for row in stood]
        sums.append(Cell(name, "stands", f"{len(stood)} of {len(here)}"))
        sums.append(Cell(name, "statics allow", possible))
        sums.append(Cell(name, "without thrust", alone))
        sums.append(Cell(name, "mean thrust", float(np.mean(thrust)) if thrust else None, "N"))
    note = "Mean thrust is the sum of both thrusts in the last half, where it stands."
    return [*tables, Table("slopes", "Where Harpy stands on slopes", tuple(sums), note)]


def _stands(row: dict[str, Any]) -> bool:
    return not row["fell"] and row["slip_mm"] <= HELD


def _how(row: dict[str, Any]) -> str:
    return "falls" if row["fell"] else _whole(row["slip_mm"])


def _whole(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"
