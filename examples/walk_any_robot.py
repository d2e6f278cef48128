"""Robots of the catalogue walk (extra robots): python examples/walk_any_robot.py go2 bolt g1."""

import sys
from typing import Any

import numpy as np

import harpy_pin as hp

TURN = np.pi / 2 / 0.6  # s: a quarter turn at 0.6 rad/s
COURSE = ((0.5, 1, 0, 0), (3, 0.5, 0, 0.6), (3 + TURN, 0, 0.5, 0), (8, -0.5, 0, 0), (10, 0, 0, 0))


def walk(
    robot: hp.Robot,
    schedule: str | None = None,
    velocity: Any = (0.5, 0.0, 0.0),
    mu: float = 0.6,
    push: tuple[float, ...] = (0.0, 0.0, 0.0),
    duration: float = 4.0,
    delay: float = 0.0,
) -> str:
    """A line on one walk; velocities are of quadrupeds, humanoids walk at 0.4 of them."""
    scale = 0.4 if robot.flat_feet else 1.0
    rows = np.array(velocity, dtype=float)
    rows[..., -3:-1] *= scale
    gait = hp.WalkingGait(robot, schedule, rows)
    x, y, z = robot.mass * (0.25 if robot.flat_feet else 1.0) * np.array(push)
    scenario = hp.Scenario(
        controller=hp.Condensed(),
        ground=hp.Ground(mu_s=mu, stiffness=robot.mass * 9.81 / 2e-3),
        disturbances=hp.Disturbances(pushes=(hp.Push(2.0, (x, y, z)),), delay=delay),
        duration=duration,
    )
    run = hp.walk(scenario, gait=gait)
    slip = 1e3 * run["slip_path"][-1].sum() / max(run["steps"][-1], 1)
    error = 1e3 * np.sqrt(np.mean(np.sum((run["centre"][:, :2] - run["path"][:, :2]) ** 2, axis=1)))
    tilt = hp.measure(run).tilt_max_rad
    kept = f"slip {slip:5.2f} mm per step, path {error:4.0f} mm off, tilt {tilt:.3f} rad"
    return f"{run.ending:10} {kept}"


for name in sys.argv[1:] or ["go2"]:
    robot = hp.load_robot(name)
    walks: dict[str, dict[str, Any]] = {
        "forward": {},
        "course": {"velocity": COURSE, "duration": 11.0},
        "friction 0.2": {"mu": 0.2} if not robot.flat_feet else {"mu": 0.3},
        "pushed": {"push": (0.0, 0.6, 0.0)},
        "2 ms of delay": {"delay": 2e-3},
    }
    if len(robot.corners) == 4:
        walks |= {
            schedule: {"schedule": schedule, "velocity": (0.2, 0, 0)}
            for schedule in ("crawl", "pace", "bound")
        }
    for what, settings in walks.items():
        print(f"{name:9} {what:14} {walk(robot, **settings)}", flush=True)
