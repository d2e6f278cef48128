"""Walks, their parts, and what is measured of them."""

from dataclasses import fields

import numpy as np
import pinocchio as pin

import harpy_pin as hp

PARTS = {"ground": hp.Ground, "disturbances": hp.Disturbances}
SETTINGS = {field.name: part for part, kind in PARTS.items() for field in fields(kind)}

OWN_SEARCH = {"solver": "active_set"}
"""Settings with which a tick of the whole-body QP is one kernel."""


def own_search(controller):
    """Further settings of a controller by name: the whole-body QP by this library's own search."""
    return OWN_SEARCH if controller == "wbc" else {}


def scenario(**settings):
    """A scenario; settings of its ground and of its disturbances stand beside the others."""
    for part, kind in PARTS.items():
        own = {name: settings.pop(name) for name in [*settings] if SETTINGS.get(name) == part}
        if own:
            settings[part] = kind(**own)
    return hp.Scenario(**settings)


def walked(own_gait=None, *, make=None, on_tick=None, **settings):
    """A walk of such a scenario, with a gait of one's own, or a controller that a function makes of
    the gait.
    """
    return hp.walk(scenario(**settings), gait=own_gait, controller=make, on_tick=on_tick)


def started(plant, gait):
    """The plant, with its robot where the gait begins."""
    plant.reset(*gait.initial_state(penetration=plant.static_penetration))
    return plant


def put(plant, *, x=0.0, z=None, v=None):
    """The plant, with its robot in its neutral posture: as deep in the ground as it sinks, or at a
    height, m.
    """
    q = pin.neutral(plant.robot.model)
    q[0], q[2] = x, -plant.static_penetration if z is None else z
    plant.reset(q, np.zeros(plant.robot.model.nv) if v is None else np.array(v))
    return plant


def states_of(run):
    """The logged states."""
    names = ("t", "q", "v", "foot_position", "foot_velocity", "foot_force")
    return [
        hp.State(float(t), *rest) for t, *rest in zip(*(run[name] for name in names), strict=True)
    ]


def assert_same(run, other):
    """Two logs have the same signals, and the same digits but for the times that ticks took."""
    assert run.signals.keys() == other.signals.keys()
    for name in run.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(run[name], other[name], err_msg=name)


def walk(
    gait,
    *,
    mu=0.6,
    duration=3.0,
    plant="compliant",
    terrain=None,
    pushes=(),
    on_tick=None,
    **disturbances,
):
    """A walk to its end on ground into which the robot sinks by 2 mm; pushes are (time, velocity
    that they would give).
    """
    mass = gait.robot.mass
    shoves = tuple(hp.Push(t, tuple(mass * np.array(velocity))) for t, velocity in pushes)
    ground = {"mu_s": mu, "stiffness": mass * 9.81 / 2e-3, "terrain": terrain}
    settings = {"duration": duration, "plant": plant, "pushes": shoves, **ground, **disturbances}
    run = walked(gait, on_tick=on_tick, **settings)
    assert run.ending == "completed"
    return run


def slip_per_step(run):
    """Path of all feet along the ground, mm per step."""
    return 1e3 * run["slip_path"][-1].sum() / max(run["steps"][-1], 1)


def path_error(run):
    """Root mean square distance of the centre of mass from the path, m."""
    return np.sqrt(np.mean(np.sum((run["centre"][:, :2] - run["path"][:, :2]) ** 2, axis=1)))


def gap_of_rectangles(corner):
    """Distance along an edge's normal of two rectangles with these (2, 4, 2) corners, m; negative
    if they overlap.
    """
    apart = -np.inf
    for rectangle in corner:
        sides = rectangle[1:] - rectangle[0]
        for side in sides[np.argsort(np.linalg.norm(sides, axis=1))[:2]]:
            one, other = corner @ np.array((-side[1], side[0])) / np.linalg.norm(side)
            apart = max(apart, other.min() - one.max(), one.min() - other.max())
    return apart


def gap_of_soles(run, robot):
    """Least distance of two soles seen from above in a walk, m."""
    model, data, gaps = robot.model, robot.model.createData(), []
    for q in run["q"][::5]:
        pin.framesForwardKinematics(model, data, q)
        corner = np.array([data.oMf[robot.frame_id(name)].translation[:2] for name in robot.feet])
        gaps.append(gap_of_rectangles(corner.reshape(2, 4, 2)))
    return min(gaps)


def made_state(gait, *, force=0.0, height=0.0):
    """The posture with a force on every foot, N, and the body higher than it stands, m."""
    q, v = gait.initial_state()
    q[2] += height
    feet = np.zeros((len(gait.robot.feet), 3))
    load = feet.copy()
    load[:, 2] = force
    return hp.State(0.0, q, v, feet, feet, load)
