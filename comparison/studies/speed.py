"""Walk quadrupeds ever faster, with and without the preview.

A speed counts where every start stands for the whole walk and reaches nine tenths of it, in both
plants, with motors that keep the model's limits: torques are clipped, and fall to nothing at the
velocity limit of each joint. The starts differ in the velocities of the body; nothing was tuned on
those of seed 0, which are what is walked by default. Needs the extra "robots", and hours.
"""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.study import Job, Rows, Study, Value, View, as_far_as_it_goes, grid, grouped, kept
from harpy_pin.contrib.preview import Preview
from harpy_pin.simulation import GRAVITY

MOTORS = hp.Actuators(torque_share=1.0, no_load_share=1.0, stall_share=5.0)
"""Limits of the model: torques fall in the last fifth of the velocities."""
SINK = 2e-3
"""How deep the feet sink in when the robot stands on two of four, m."""
REACHED = 0.9
"""Share of a speed that is reached, from the middle of the walk on."""
SPEEDS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    **dict.fromkeys(("go2", "go1", "a1"), ((1.0, 1.25, 1.5, 1.75), (2.5, 3.0, 3.5))),
    "solo12": ((1.0, 1.25, 1.5), (1.5, 1.8, 2.2)),
    "anymal_c": ((0.75, 1.0, 1.25), (1.5, 1.75, 2.0)),
    "hyq": ((1.5, 2.0, 2.5), (2.0, 2.5, 3.0)),
}
"""Speeds of the pendulum's walk and of the preview, m/s, by the robot."""
LABELS = {"pendulum": "pendulum", "preview": "preview (MPC)"}


def gait_of(robot: hp.Robot, walker: str, speed: float, friction: float) -> hp.Gait:
    """Who walks; no speed is scaled down."""
    if walker == "preview":
        planner = Preview(robot, (speed, 0.0, 0.0), mu=friction, max_speed=speed)
        return hp.PlannedGait(robot, planner, rate=50)
    fastest = hp.WalkingGait(robot).max_speed
    most = None if speed <= fastest else speed
    return hp.WalkingGait(robot, velocity=(speed, 0.0, 0.0), max_speed=most)


def scenario(job: Job) -> hp.Scenario:
    """What is walked, with a start of its own."""
    robot = hp.load_robot(job["robot"])
    rng = np.random.default_rng([job["seed"], job["start"]])
    start = job["jitter"] * rng.standard_normal(6)
    return hp.Scenario(
        robot=job["robot"],
        plant=job["plant"],
        ground=hp.Ground(mu_s=job["friction"], stiffness=robot.mass * GRAVITY / SINK),
        disturbances=hp.Disturbances(actuators=MOTORS, start_velocity=tuple(start.tolist())),
        duration=job["duration"],
    )


def measured(job: Job) -> dict[str, Any]:
    """What is kept of a walk."""
    robot = hp.load_robot(job["robot"])
    gait = gait_of(robot, job["walker"], job["speed"], job["friction"])
    run = as_far_as_it_goes(lambda: hp.walk(scenario(job), gait=gait))
    row = kept(run, "cost_of_transport")
    half = len(run) // 2
    way = float(np.linalg.norm(run["q"][-1, :2] - run["q"][half, :2]))
    steps = int((np.diff(run["stance"], axis=0) > 0.0).sum())
    fast = np.abs(run["v"][:, 6:]) / robot.model.velocityLimit[6:]
    return row | {
        "stood_s": float(run["t"][-1]),
        "speed_m_s": way / max(float(run["t"][-1] - run["t"][half]), 1e-9),
        "slip_mm": 1e3 * float(run["slip_path"][-1].sum()) / max(steps, 1),
        "torque": float(np.max(np.abs(run["torque"]) / robot.torque_limit)),
        "joint_speed": float(fast.max()),
        "fast": float((fast > 1.0).any(axis=1).mean()),
    }


def _stands(row: dict[str, Any]) -> bool:
    return not row["fell"] and row["speed_m_s"] >= REACHED * row["speed"]


def largest(rows: Rows) -> float | None:
    """The largest speed at which, as at all below, every start stands in every plant."""
    found = None
    for (speed,), mine in sorted(grouped(rows, "speed").items()):
        if not all(map(_stands, mine)):
            break
        found = float(speed)
    return found


def at_largest(name: str, what: Callable[..., Any] = np.median) -> Value:
    """An entry of the walks at that speed."""

    def value(rows: Rows) -> float | None:
        speed = largest(rows)
        if speed is None:
            return None
        return float(what([row[name] for row in rows if row["speed"] == speed]))

    return value


@cache
def _bound(robot: str) -> float:
    return Preview(hp.load_robot(robot)).max_speed


def bound(rows: Rows) -> float | None:
    """Speed at which the stride of the preview asks as much of the motors as it may."""
    return _bound(rows[0]["robot"]) if rows[0]["walker"] == "preview" else None


def _stood(rows: Rows) -> str:
    return f"{sum(map(_stands, rows))} of {len(rows)}"


def _draw(figure: Any, rows: Rows) -> None:
    figure.set_size_inches(6.4, 3.4)
    panel = figure.subplots()
    for (robot, walker), mine in grouped(rows, "robot", "walker").items():
        line = [(mu, largest(some) or 0.0) for (mu,), some in grouped(mine, "friction").items()]
        style = "o-" if walker == "preview" else "s--"
        panel.plot(*zip(*sorted(line), strict=True), style, label=f"{robot}, {LABELS[walker]}")
    panel.set(
        xlabel="friction coefficient of the ground", ylabel="largest speed, m/s", ylim=(0, None)
    )
    panel.set_title("How fast they run", loc="left")
    figure.legend(loc="outside right upper", frameon=False)


def _jobs(s: Any) -> Iterator[Job]:
    for robot, (number, walker) in product(s.robots, enumerate(s.walkers)):
        yield from grid(
            robot=robot,
            walker=walker,
            friction=s.frictions,
            plant=s.plants,
            speed=SPEEDS[robot][number],
            start=range(s.starts),
            jitter=s.jitter,
            seed=s.seed,
            duration=s.duration,
        )


STUDY = Study(
    name="speed",
    help=__doc__,
    example="--only go2 --out go2.jsonl",
    defaults={
        "robots": tuple(SPEEDS),
        "walkers": tuple(LABELS),
        "plants": ("compliant", "mujoco"),
        "frictions": (0.8,),
        "starts": 20,
        "jitter": 0.1,  # standard deviation of each starting velocity, m/s and rad/s
        "duration": 10.0,  # of a walk, s
        "seed": 0,
    },
    quick={"robots": ("go2",), "plants": ("compliant",), "starts": 1, "duration": 2.0},
    jobs=_jobs,
    measure=measured,
    views=[
        View(
            "speed",
            "Largest speeds",
            row=lambda row: f"{row['robot']}, {LABELS[row['walker']]}",
            columns={
                "largest": (largest, "m/s"),
                "motors' bound": (bound, "m/s"),
                "cost of transport": at_largest("cost_of_transport"),
                "slip": (at_largest("slip_mm"), "mm"),
                "peak torque": at_largest("torque", max),
                "peak joint speed": at_largest("joint_speed", max),
                "too fast": at_largest("fast", np.mean),
            },
            note="Largest speed of those tried at which every start stands. At that speed: work "
            "over weight and path, slip of a foot in a step, largest torque and joint speed over "
            "their limits, and share of the time with a joint beyond its speed.",
        ),
        View(
            "speed_stood",
            "Starts that stand",
            row=lambda row: f"{row['robot']}, {LABELS[row['walker']]}, {row['plant']}",
            across="{speed:g} m/s",
            columns=_stood,
        ),
    ],
    draw=_draw,
    only="robots",
)
