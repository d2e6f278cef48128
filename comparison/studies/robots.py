"""Stand the robots that are known by name, and push them.

They also shift their weight; a biped on point feet steps in place. Under the whole-body QP by own
search and the condensed controller, on compliant ground. Gains and weights are the library's;
ranges of force and the weight on forces follow from the mass, and so do the ground's stiffness and
the pushes. One setting was chosen here: the damping of held soles, on G1 at rest on this ground,
without a push. Needs the extra "robots".
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.contenders import OWN_PART
from comparison.measure.replay import time_ticks
from comparison.measure.walking import standing_ground
from comparison.study import Job, Study, Value, View, grid, shown, where
from harpy_pin.model.state import Vector

LEAN = 0.3
"""Share of the way from above the middle to above the first foot, by which the weight is
shifted.
"""
LEAN_AT, PUSH_AT = 0.3, 0.5
"""Times of shift and push, s."""
CONTROLLERS: dict[str, Any] = {"QP, own search": OWN_PART, "condensed": "condensed"}
"""Controllers of a scenario by the name of their rows."""
SIDES = {"sideways": (0.0, 1.0, 0.0), "forward": (1.0, 0.0, 0.0)}
LOADED = 0.05
"""Normal force of a foot, as a share of the weight, from which on its friction counts."""


def _measured(job: Job) -> dict[str, Any]:
    """What a robot is, and what happened under the controller; with a reason where something did
    not.
    """
    try:
        robot = hp.load_robot(job["robot"])
    except hp.HarpyError as error:
        return {"loads": False, "reason": str(error).splitlines()[0]}
    feet = f"{len(robot.corners)} {'flat_feet' if robot.flat_feet else 'points'}"
    row: dict[str, Any] = {"loads": True, "mass_kg": robot.mass, "dof": int(robot.nv), "feet": feet}
    row["terms_error"] = terms_error(robot, np.random.default_rng(job["seed"]))
    try:
        return row | _stand(robot, CONTROLLERS[job["controller"]], job)
    except hp.HarpyError as error:
        return row | {"stands": None, "reason": str(error).splitlines()[0]}


def terms_error(robot: hp.Robot, rng: np.random.Generator, *, states: int = 10) -> float:
    """Largest difference of mass matrix and bias from Pinocchio's, relative to their largest
    entries; of a robot with closed loops near where it stands, and at rest.
    """
    model, dynamics = robot.model, hp.Dynamics(robot)
    data, worst = model.createData(), 0.0
    for _ in range(states):
        near, moving = (1.0, 1.0) if robot.loops is None else (0.1, 0.0)
        q = robot.integrate(robot.reference, near * rng.standard_normal(robot.nv))
        v = moving * rng.standard_normal(robot.nv)
        dynamics.update(q, v)
        tree, spread = robot.closed(q), robot.velocity_map(q)
        upper = np.triu(pin.crba(model, data, tree))
        matrix = spread.T @ (upper + np.triu(upper, 1).T) @ spread
        bias = spread.T @ pin.rnea(model, data, tree, spread @ v, np.zeros(model.nv))
        for ours, theirs in ((dynamics.mass_matrix, matrix), (dynamics.bias, bias)):
            worst = max(worst, float(np.abs(ours - theirs).max() / np.abs(theirs).max()))
    return worst


def run_standing(
    robot: hp.Robot,
    controller: Any,
    *,
    friction: float = 0.5,
    duration: float = 3.0,
    lean: float = 0.0,
    push: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[hp.Run, Vector]:
    """Stand, or step in place on two points, on compliant ground, with the weight shifted or with a
    push.

    ``lean`` is the share of the way over the first foot; a robot that steps does not shift its
    weight besides. ``push`` is the impulse over mass, m/s, ``controller`` that of a scenario.

    Returns:
        The run, and the ticks' times, µs of this thread.
    """
    gait = (
        hp.Standing(robot)
        if robot.corners != (1, 1)
        else hp.WalkingGait(robot, "step", (0.0, 0.0, 0.0))
    )
    x, y, z = (robot.mass * part for part in push)
    scenario = hp.Scenario(
        controller=controller,
        ground=standing_ground(robot, friction),
        disturbances=hp.Disturbances(pushes=(hp.Push(PUSH_AT, (x, y, z)),) if any(push) else ()),
        duration=duration,
    )
    built = hp.build(scenario, gait=gait)
    if lean and isinstance(gait, hp.Standing):
        gait.move(lean * gait.over(0), t=LEAN_AT, duration=min(1.0, duration - LEAN_AT))
    run, times, _ = time_ticks(built)
    return run, times[:, 0]


def _stand(robot: hp.Robot, controller: Any, job: Job) -> dict[str, Any]:
    """What one controller does with a robot."""
    common: dict[str, Any] = {"friction": job["friction"], "duration": job["duration"]}
    shifted, all_ticks = run_standing(robot, controller, lean=LEAN, **common)
    result: dict[str, Any] = {
        "stands": stood(shifted),
        "slip_mm": _slip(shifted),
        **dict.fromkeys(SIDES, 0.0),
    }
    result["friction_used"] = friction_used(shifted, robot)
    for side, direction in SIDES.items():
        for speed in job["pushes"]:
            run, ticks = run_standing(
                robot, controller, push=[speed * part for part in direction], **common
            )
            if not stood(run):
                break
            if speed == job["pushes"][0]:
                result[f"{side}_slip_mm"] = _slip(run)
                all_ticks = np.append(all_ticks, ticks)
            result[side] = speed
    if not result["stands"]:
        result["reason"] = f"{shifted.ending} at {shifted['t'][-1]:.2f} s"
    return result | {"tick_us": float(np.median(all_ticks)), "worst_us": float(all_ticks.max())}


def stood(run: hp.Run) -> bool:
    """Whether the robot came through: no fall, and never a tilt of more than 0.5 rad."""
    return run.ending == "completed" and not hp.measure(run).stumbled


def _slip(run: hp.Run) -> float:
    """Way along the ground in the whole run, mean of all contact points, mm."""
    return float(1e3 * run["slip_path"][-1].mean())


def friction_used(run: hp.Run, robot: hp.Robot) -> float:
    """Largest horizontal over normal force of a foot, all its corners together, in stance."""
    starts = np.cumsum((0, *robot.corners))[:-1]
    force = np.add.reduceat(run["foot_force"], starts, axis=1)
    loaded = force[..., 2] > LOADED * robot.mass * hp.model.GRAVITY
    ratio = np.linalg.norm(force[..., :2], axis=-1)[loaded] / force[..., 2][loaded]
    return float(ratio.max(initial=0.0))


def _whether(entry: str) -> Value:
    """Yes; or no, with the reason."""
    return lambda rows: "yes" if rows[0].get(entry) else f"no: {rows[0]['reason']}"


_OF_EACH: dict[str, Any] = {}
for _name in CONTROLLERS:
    _OF_EACH[f"stands, {_name}"] = where(_whether("stands"), controller=_name, loads=True)
    _OF_EACH |= {
        f"{side}, {_name}": (where(shown(side), controller=_name), "m/s") for side in SIDES
    }
STUDY = Study(
    name="robots",
    help=__doc__,
    example="--only g1 --json g1.json",
    defaults={
        "robots": tuple(hp.model.CATALOGUE),
        "friction": 0.5,  # of the ground, which the controllers know
        "duration": 3.0,  # of a run, s
        "pushes": (
            0.1,
            0.2,
            0.3,
            0.4,
        ),  # of 0.1 s, impulse over mass, m/s: each if the one before was stood
        "seed": 0,  # of the states at which the terms are compared with Pinocchio's
    },
    quick={"robots": ("solo12", "g1"), "duration": 1.5, "pushes": (0.1,)},
    timed=lambda s: grid(
        robot=s.robots,
        controller=CONTROLLERS,
        friction=s.friction,
        duration=s.duration,
        pushes=[list(s.pushes)],
        seed=s.seed,
    ),
    measure=_measured,
    views=[
        View(
            "robots",
            "Robots that stand and take pushes",
            row="{robot}",
            columns={
                "loads": _whether("loads"),
                "mass": (shown("mass_kg"), "kg"),
                "DoF": shown("dof"),
                "feet": shown("feet"),
                "terms' error": shown("terms_error"),
                **_OF_EACH,
            },
            note="Standing on all feet with the weight shifted by 30 % of the way over the first "
            "foot; on two points, "
            "stepping in place. Sideways and forward: the largest push on the base that was stood, "
            "impulse over mass; "
            "0 where the weakest was not. Terms' error: mass matrix and bias beside Pinocchio's, "
            "relative.",
        ),
        View(
            "robots_ticks",
            "Their slip and their ticks",
            row="{robot}, {controller}",
            columns={
                "slip, shift": (shown("slip_mm"), "mm"),
                **{f"slip, {side}": (shown(f"{side}_slip_mm"), "mm") for side in SIDES},
                "friction used": shown("friction_used"),
                "tick": (shown("tick_us"), "µs"),
                "worst": (shown("worst_us"), "µs"),
            },
            note="Slip: mean way of the contact points along the ground in the run, with the "
            "weight shifted and with "
            "the weakest push. Friction used: largest horizontal over normal force of a foot while "
            "the weight is "
            "shifted. Ticks in time of the thread, over the same three runs.",
            only=lambda row: row.get("stands") is not None,
        ),
    ],
    only="robots",
)
