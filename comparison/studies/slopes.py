"""Stand robots on slopes, angle by friction.

From 0 to 45 degrees, at friction 0.1 to 1.0: Harpy under a joint PID without a governor, without
and with thrust, the paper's governor, the contact-force filter, the condensed controller and the
whole-body QP by own search, and Go2 and G1, which have no thrusters, under the condensed
controller. Beside them is the bound of statics, a linear program: forces in the friction cones
about the normal and thrusts within their limits balance the robot, with joint torques within the
motors' limits, wherever its body is along x. Robots on four feet lean with the slope, others are
upright. Needs the extra "robots". This takes many minutes.
"""

import math
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq, linprog

import harpy_pin as hp
from comparison.contenders import LIMITED, OWN, OWN_PART
from comparison.study import (
    Job,
    Rows,
    Study,
    View,
    grid,
    grouped,
    kept,
    mean,
    walk_as_far_as_it_goes,
)
from harpy_pin.ground.ground import walking_stiffness
from harpy_pin.model.source import loaded_robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import CONTACT, SLIDING, THRUST
from harpy_pin.wbc.weights import thrust_box

FACES = 32
"""Of the pyramid inside Coulomb's cone: its cone is half a per cent narrower."""
REACH, PLACES = 0.4, 41
"""How far ahead of the feet or behind them the body may be, m, and how many places are looked
at.
"""
STEPS, DAMPING, FOUND = 50, 1e-8, 1e-3
"""Of the iteration that brings feet to their places, and how far they may be away, m."""


@cache
def static_bound(degrees: float, friction: float, name: str = "harpy") -> tuple[bool, float | None]:
    """What statics allows, wherever the body is along x above the feet.

    Args:
        degrees: angle of the ground, which rises along x.
        friction: static coefficient.
        name: of the robot.

    Returns:
        Whether the robot stands without thrust, and the least sum of its thrusts' components, N;
        none where it cannot stand with thrust either.
    """
    robot, normal = _robot(name), hp.ground.Plane(slope=float(np.radians(degrees))).normal(0.0, 0.0)
    found: dict[bool, list[float]] = {}
    for thrust in {False, bool(robot.thrusters)}:
        every = (
            _least_thrust(robot, q, normal, friction, thrust=thrust)
            for q in _postures(name, degrees)
        )
        found[thrust] = [least for least in every if least is not None]
    possible = found[bool(robot.thrusters)]
    return bool(found[False]), min(possible) if possible else None


_robot = cache(loaded_robot)


@cache
def _postures(name: str, degrees: float) -> list[Vector]:
    """The standing posture with the body at several places along x, level and along the slope, as
    far as legs reach.
    """
    robot, slope = _robot(name), float(np.radians(degrees))
    gait = hp.make_gait(robot, speed=0.0) if name == "harpy" else hp.Standing(robot)
    start = hp.OnTerrain(gait, hp.ground.Plane(slope=slope)).initial_state()[0]
    feet = _feet(robot, start)[0]

    def above(x: float) -> float:
        """How far the centre of mass is ahead of the feet, m."""
        q = _moved(robot, start, x, 0.0)
        return float(
            pin.centerOfMass(robot.model, robot.model.createData(), q)[0] - feet[:, 0].mean()
        )

    places = [
        (x, rise)
        for x in np.linspace(-REACH, REACH, PLACES).tolist()
        for rise in (0.0, x * np.tan(slope))
    ]
    if len(robot.feet) == 2:  # on two points there is one place for the centre of mass
        places.append((float(brentq(above, -REACH, REACH)), 0.0))
    postures = []
    for x, rise in places:
        q = _moved(robot, start, x, rise)
        reached = np.abs(_feet(robot, q)[0] - feet).max() < FOUND
        if reached and (q[7:] >= robot.joint_lower).all() and (q[7:] <= robot.joint_upper).all():
            postures.append(q)
    return postures


def _moved(robot: hp.Robot, start: Vector, x: float, rise: float) -> Vector:
    """A posture with the body moved ahead and up, and the feet where they are."""
    goal, q = _feet(robot, start)[0], start.copy()
    q[:3] += (x, 0.0, rise)
    for _ in range(STEPS):
        feet, jacobian = _feet(robot, q)
        legs = jacobian[:, 6:]
        step = legs.T @ np.linalg.solve(
            legs @ legs.T + DAMPING * np.eye(len(legs)), (goal - feet).ravel()
        )
        q[7:] += step
    return q


def _feet(robot: hp.Robot, q: Vector) -> tuple[Vector, Vector]:
    """Places of the feet, and their Jacobian, world axes."""
    jacobians, data = _jacobians(robot, q, robot.feet), _data(robot)
    return np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet]), np.vstack(
        jacobians
    )


@cache
def _data(robot: hp.Robot) -> pin.Data:
    """Work space of Pinocchio, overwritten by the next call."""
    return robot.model.createData()


def _jacobians(robot: hp.Robot, q: Vector, frames: tuple[str, ...]) -> list[Vector]:
    """(3, nv) of each frame, world axes."""
    model, data = robot.model, _data(robot)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    return [
        pin.getFrameJacobian(model, data, robot.frame_id(name), pin.LOCAL_WORLD_ALIGNED)[:3]
        for name in frames
    ]


def _least_thrust(
    robot: hp.Robot, q: Vector, normal: Vector, friction: float, *, thrust: bool
) -> float | None:
    """Least sum of the thrusts' components with which a posture is in balance, N; none where there
    is none.
    """
    model, data = robot.model, robot.model.createData()
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    rows = _jacobians(robot, q, (*robot.feet, *robot.thrusters))
    # Forces on the feet, then thrusts as differences of positive parts; torques are what is left of
    # the balance.
    jacobian = np.vstack((*rows, *(-row for row in rows[len(robot.feet) :])))
    feet = 3 * len(robot.feet)
    frame = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), normal).matrix()
    angle = 2.0 * np.pi * (np.arange(FACES) + 0.5) / FACES  # an edge of the cone along x
    inscribed = np.full(FACES, -friction * np.cos(np.pi / FACES))
    pyramid = np.column_stack((np.cos(angle), np.sin(angle), inscribed)) @ frame.T
    cones = np.zeros((len(robot.feet) * FACES, len(jacobian)))
    for k in range(len(robot.feet)):
        cones[FACES * k : FACES * (k + 1), 3 * k : 3 * k + 3] = pyramid
    limit = (
        thrust_box(robot, hp.wbc.WholeBodyLimits())[1] * thrust if robot.thrusters else np.zeros(0)
    )
    legs = jacobian[:, 6:].T
    found = linprog(
        np.concatenate((np.zeros(feet), np.ones(2 * len(limit)))),
        A_ub=np.vstack((cones, -legs, legs)),
        b_ub=np.concatenate(
            (
                np.zeros(len(cones)),
                robot.torque_limit - gravity[6:],
                robot.torque_limit + gravity[6:],
            )
        ),
        A_eq=jacobian[:, :6].T,
        b_eq=gravity[:6],
        bounds=[(None, None)] * feet + [(0.0, most) for most in (*limit, *limit)],
    )
    return float(found.fun) if found.status == 0 else None


@dataclass(frozen=True)
class Walker:
    """Who is on the slope."""

    name: str  # in tables
    controller: dict[str, Any] = field(
        default_factory=lambda: {"name": "condensed"}
    )  # of the scenario
    robot: str = "harpy"  # of the catalogue, or Harpy
    speed: float = 0.0  # along x, m/s; zero stands
    heading: float = 0.0  # direction in which the ground rises, rad


SPEED = 0.3
WALKERS: dict[str, Walker] = {
    "no_thrust": Walker("no governor, no thrust", LIMITED["none"] | {"thrust": False}),
    "none": Walker("no governor", LIMITED["none"]),
    "paper": Walker("paper's governor", LIMITED["paper"]),
    "filter": Walker("contact-force filter", LIMITED["filter"]),
    "condensed": Walker("condensed WBC"),
    OWN: Walker("whole-body QP, own search", dict(OWN_PART)),
    "up": Walker("walking uphill", speed=SPEED),
    "down": Walker("walking downhill", speed=SPEED, heading=math.pi),
    "across": Walker("walking across", speed=SPEED, heading=0.5 * math.pi),
    "go2": Walker("Go2", robot="go2"),
    "g1": Walker("G1", robot="g1"),
}
"""By short name; those that walk do so at 0.3 m/s under the condensed controller."""
HELD = 5.0
"""Slip up to which a robot stands or walks, mm: of all feet together, and of one that walks in a
step.
"""
USUAL = 30.0
"""Angle up to which a robot should stand wherever statics allow it, degrees."""


def _measured(job: Job) -> dict[str, Any]:
    """The bound, how it ended, slip and thrust."""
    degrees, friction, who = job["degrees"], job["friction"], WALKERS[job["walker"]]
    without_thrust, least_thrust = static_bound(degrees, friction, who.robot)
    given: dict[str, Any] = {"gait": hp.Straight(speed=who.speed)}
    points, stiffness = 1, hp.Ground.stiffness
    if who.robot != "harpy":
        robot = hp.load_robot(who.robot)
        points, stiffness = len(robot.feet) // len(robot.corners), walking_stiffness(robot)
        given = {"robot": who.robot, "gait": hp.scenario.Stand()}
    ground = hp.Ground(
        mu_s=friction,
        terrain=hp.ground.Plane(slope=np.radians(degrees), heading=who.heading),
        stiffness=stiffness,
    )
    run = walk_as_far_as_it_goes(
        hp.Scenario(**given, controller=who.controller, ground=ground, duration=job["duration"])
    )
    thrust = np.linalg.norm(run["thrust"], axis=2).sum(axis=1)
    slip = 1e3 * float(run["slip_path"][-1].sum()) / points  # of a sole the mean of its corners
    found = kept(run, "slip_mm_per_step")
    return {
        "fell": found["fell"],
        "slip_mm": float(found["slip_mm_per_step"]) if who.speed else slip,
        "thrust_n": float(thrust[len(thrust) // 2 :].mean()) if who.robot == "harpy" else 0.0,
        "without_thrust": without_thrust,
        "least_thrust": least_thrust,
    }


def how_it_stands(row: dict[str, Any]) -> str:
    """Whether it ``stands``, ``slides`` or ``falls``."""
    if row["fell"]:
        return "falls"
    return "stands" if row["slip_mm"] <= HELD else "slides"


def _whole(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"


def _standing(rows: Rows) -> Rows:
    return [row for row in rows if how_it_stands(row) == "stands"]


def _named(who: Walker) -> str:
    return "Harpy" if who.robot == "harpy" else who.name


def _stand(steepest: float, rows: Rows) -> str:
    level = [row for row in rows if row["degrees"] <= steepest]
    return f"{len(_standing(level))} of {len(level)}"


COLOURS = {"stands": CONTACT, "slides": THRUST, "falls": SLIDING, "not possible": "#d9dee4"}
"""Of what happens; the last one where statics do not allow to stand, and it does not."""
COLUMNS = 5
"""Panels in a row."""


def _draw(figure: Any, rows: Rows) -> None:
    """A panel for each walker."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    walkers = grouped(rows, "walker")
    down = -(-len(walkers) // COLUMNS)
    figure.set_size_inches(8.4, 0.6 + 2.3 * down)
    panels = figure.subplots(
        down, min(COLUMNS, len(walkers)), sharex=True, sharey=True, squeeze=False
    )
    names = list(COLOURS)
    for panel in panels.ravel()[len(walkers) :]:
        panel.axis("off")
    for panel, ((walker,), here) in zip(panels.ravel(), walkers.items(), strict=False):
        degrees, frictions = (
            sorted({row[name] for row in here}) for name in ("degrees", "friction")
        )
        cells = np.zeros((len(degrees), len(frictions)))
        for row in here:
            place = degrees.index(row["degrees"]), frictions.index(row["friction"])
            cells[place] = names.index(what_happens(row))
        colours = ListedColormap(list(COLOURS.values()))
        panel.pcolormesh(
            frictions,
            degrees,
            cells,
            cmap=colours,
            vmin=-0.5,
            vmax=len(names) - 0.5,
            edgecolor="white",
        )
        panel.set_title(WALKERS[walker].name, fontsize=9)
    for panel in panels[:, 0]:
        panel.set_ylabel("angle, degrees")
    for panel in panels[-1]:
        panel.set_xlabel("friction")
    handles = [Patch(color=colour, label=name) for name, colour in COLOURS.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False)


def what_happens(row: dict[str, object]) -> str:
    """A name of :data:`COLOURS`; a walker without thrust is measured by what statics allow without
    it.
    """
    seen = how_it_stands(row)
    possible = (
        row["without_thrust"] if row["walker"] == "no_thrust" else row["least_thrust"] is not None
    )
    return seen if seen == "stands" or possible else "not possible"


STUDY = Study(
    name="slopes",
    help=__doc__,
    example="--out slopes.jsonl --figure slopes.png",
    defaults={
        "degrees": (
            0.0,
            5.0,
            10.0,
            15.0,
            20.0,
            25.0,
            30.0,
            35.0,
            40.0,
            45.0,
        ),  # by which the ground rises along x
        "frictions": (
            0.1,
            0.2,
            0.3,
            0.4,
            0.5,
            0.6,
            0.7,
            0.8,
            0.9,
            1.0,
        ),  # which the controllers know
        "walkers": tuple(WALKERS),
        "duration": 3.0,  # s
    },
    quick={
        "degrees": (0.0, 15.0, 30.0),
        "frictions": (0.2, 0.8),
        "walkers": ("paper", "condensed"),
        "duration": 1.0,
    },
    jobs=lambda s: grid(
        walker=s.walkers, degrees=s.degrees, friction=s.frictions, duration=s.duration
    ),
    measure=_measured,
    views=[
        View(
            lambda row: f"slopes_statics_{WALKERS[row['walker']].robot}",
            lambda row: f"What statics allows: {_named(WALKERS[row['walker']])}",
            row="{degrees:g}°",
            across="{friction:g}",
            columns=lambda rows: _whole(rows[0]["least_thrust"]),
            note="Least sum of the thrusts' components with which it can stand, N, by angle and "
            "friction coefficient.",
        ),
        View(
            "slopes_{walker}",
            lambda row: f"On slopes: {WALKERS[row['walker']].name}",
            row="{degrees:g}°",
            across="{friction:g}",
            columns=lambda rows: "falls" if rows[0]["fell"] else _whole(rows[0]["slip_mm"]),
            note=f"Slip of all feet, mm, of one that walks in a step; up to {HELD:g} mm it stands.",
        ),
        View(
            "slopes",
            "Where robots stand on slopes",
            row=lambda row: WALKERS[row["walker"]].name,
            columns={
                "stands": partial(_stand, math.inf),
                f"up to {USUAL:g}°": partial(_stand, USUAL),
                "statics allow": lambda rows: sum(row["least_thrust"] is not None for row in rows),
                "without thrust": lambda rows: sum(row["without_thrust"] for row in rows),
                "mean thrust": (lambda rows: mean("thrust_n")(_standing(rows)), "N"),
            },
            note="Mean thrust is the sum of both thrusts in the last half, where it stands.",
        ),
    ],
    only="walkers",
    draw=_draw,
)
