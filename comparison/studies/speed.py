"""Walk quadrupeds ever faster, with and without the preview.

A speed counts where every start stands for the whole walk and reaches nine tenths of it, in both
plants, with motors that keep the model's limits: torques are clipped, and fall to nothing at the
velocity limit of each joint. The starts differ in the velocities of the body.

Go2 also runs on other friction and in other gaits, by random commands up to 70 % of its largest
speed at friction 0.4 to 0.8, on the true state and on the estimate, turns, is pushed, and follows
plans that are late.

Nothing was tuned on starts and commands of seed 0, which are what is walked by default. Needs the
extra "robots", and a quarter of an hour on two cores.
"""

from collections import deque
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.studies.walking import push_from
from comparison.study import (
    Job,
    Rows,
    Study,
    Value,
    View,
    as_far_as_it_goes,
    commands,
    grid,
    grouped,
    kept,
    median,
    most,
    where,
)
from harpy_pin.contrib.preview import Preview
from harpy_pin.gaits.planned import Planner
from harpy_pin.ground.ground import walking_stiffness

MOTORS = hp.Actuators(torque_share=1.0, no_load_share=1.0, stall_share=5.0)
"""Limits of the model: torques fall in the last fifth of the velocities."""
REACHED = 0.9
"""Share of a speed that is reached, from the middle of the walk on."""
SPEEDS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "go2": ((1.25, 1.5), (3.5, 4.0)),
    **dict.fromkeys(("go1", "a1"), ((1.25, 1.5), (2.5, 3.0))),
    "solo12": ((1.25, 1.5), (1.5, 1.8)),
    "anymal_c": ((0.75, 1.0), (1.75, 2.0)),
    "hyq": ((1.5, 2.0), (2.5, 3.0)),
}
"""Speeds of the pendulum's walk and of the preview, m/s, by the robot."""
LABELS = {"pendulum": "pendulum", "preview": "preview (MPC)"}
MEASURED = "go2"
"""Who walks in other ways than at the largest speed."""
FRICTION, SLIPPERY = 0.8, ((0.75, 1.0, 1.25), (2.0, 3.0, 3.5))
"""Friction, and its speeds on other friction, m/s, of pendulum and preview."""
OTHERS: dict[str, tuple[str, tuple[float, ...]]] = {
    "bound": ("bound", (1.0, 2.0, 3.0)),
    "pronk": ("pronk", (1.0, 2.0, 3.0)),
}
"""Its other gaits, and their speeds, m/s."""
FAST = 2.45
"""Largest speed of random commands, m/s: 70 % of 3.5."""
MOST_TURN = 2.0
"""Their largest turning velocity, and that of turns, rad/s."""
DRAWN = (0.4, 0.8)
"""Friction of random commands."""
SIDES, INSTANTS, WALKED = 8, 3, 2.0
"""Sides of pushes, instants of a stride, and time until the first of them, s."""
EVERY = 10
"""Ticks from one look at the forces to the next."""
AGE = 0.02
"""Of late plans, s."""


class Late:
    """A planner whose plans come when they are some time old."""

    def __init__(self, planner: Planner, age: float) -> None:
        self.planner, self.age = planner, age
        self._coming: deque[tuple[float, hp.Plan | None]] = deque()

    def plan(self, state: hp.State) -> hp.Plan | None:
        """The newest plan that is there by now, if it is a new one."""
        self._coming.append((state.t + self.age, self.planner.plan(state)))
        found = None
        while self._coming and self._coming[0][0] < state.t + 1e-9:
            found = self._coming.popleft()[1]
        return found


def _command(rng: np.random.Generator) -> tuple[float, float, float]:
    """A velocity in any direction, mostly ahead, and turning."""
    ahead, left, turning = rng.uniform((-0.3, -0.3, -1.0), (1.0, 0.3, 1.0)).tolist()
    share = FAST / max(1.0, float(np.hypot(ahead, left)))
    return share * ahead, share * left, MOST_TURN * turning


def gait_of(job: Job, friction: float) -> hp.Gait:
    """Who walks; no speed is scaled down."""
    robot, speed, what = hp.load_robot(job["robot"]), job["speed"], job["what"]
    if job["walker"] == "pendulum":
        fastest = hp.WalkingGait(robot).max_speed
        limit = None if speed <= fastest else speed
        return hp.WalkingGait(robot, velocity=(speed, 0.0, 0.0), max_speed=limit)
    velocity: Any = (speed, 0.0, MOST_TURN * (what == "turns"))
    if what in ("commands", "on the estimate"):
        rng = np.random.default_rng([job["seed"], job["start"], 1])
        drawn = commands(rng, job["duration"], _command, least=0.5, most=2.5)
        velocity = [(0.0, 0.0, 0.0, 0.0), *drawn]
    gait = OTHERS[what][0] if what in OTHERS else "trot"
    preview: Any = Preview(robot, velocity, mu=friction, max_speed=speed, gait=gait)
    planner = Late(preview, AGE) if what == "late plans" else preview
    return hp.PlannedGait(robot, planner, rate=50)


def scenario(job: Job) -> hp.Scenario:
    """What is walked, with a start of its own."""
    robot = hp.load_robot(job["robot"])
    rng = np.random.default_rng([job["seed"], job["start"]])
    start = job["jitter"] * rng.standard_normal(6)
    friction = job["friction"] or float(rng.uniform(*DRAWN))
    pushes: tuple[hp.Push, ...] = ()
    if job["what"] == "pushes":
        side, instant = divmod(job["start"], INSTANTS)
        time = round(WALKED + 0.4 * instant / INSTANTS, 3)
        pushes = (push_from((side + 0.5) / SIDES, robot.mass, time),)
    sensed = job["what"] == "on the estimate"
    return hp.Scenario(
        robot=job["robot"],
        plant=job["plant"],
        ground=hp.Ground(mu_s=friction, stiffness=walking_stiffness(robot)),
        disturbances=hp.Disturbances(
            actuators=MOTORS, start_velocity=tuple(start.tolist()), pushes=pushes, seed=job["start"]
        ),
        state="estimated" if sensed else "true",
        sensors=hp.Imu() if sensed else None,
        duration=job["duration"],
    )


def measured(job: Job) -> dict[str, Any]:
    """What is kept of a walk."""
    robot, walked = hp.load_robot(job["robot"]), scenario(job)
    gait = gait_of(job, walked.ground.mu_s)
    run = as_far_as_it_goes(lambda: hp.walk(walked, gait=gait))
    row = kept(run, "cost_of_transport")
    half = len(run) // 2
    late = float(run["t"][-1] - run["t"][half])
    way = float(np.linalg.norm(run["q"][-1, :2] - run["q"][half, :2]))
    steps = int((np.diff(run["stance"], axis=0) > 0.0).sum())
    fast = np.abs(run["v"][:, 6:]) / robot.model.velocityLimit[6:]
    if job["walker"] == "preview":
        row["force_n"], row["free_force_n"] = force_errors(run)
    return row | {
        "stood_s": float(run["t"][-1]),
        "speed_m_s": way / max(late, 1e-9),
        "turning": float(run["v"][half:, 5].mean()),
        "flight": float((run["foot_force"][half:].max(axis=(1, 2)) == 0.0).mean()),
        "slip_mm": 1e3 * float(run["slip_path"][-1].sum()) / max(steps, 1),
        "torque": float(np.max(np.abs(run["torque"]) / robot.torque_limit)),
        "joint_speed": float(fast.max()),
        "fast": float((fast > 1.0).any(axis=1).mean()),
    }


def force_errors(run: hp.Run) -> tuple[float, float]:
    """Root mean squares of the WBC's forces less the planned ones where feet stand, N: of all, and
    of the part that changes neither their sum nor their moment.
    """
    names = ("held", "stance", "foot_position", "desired_force", "planned_force")
    square, free, count = 0.0, 0.0, 0
    for held, stance, place, found, planned in zip(
        *(run[name][::EVERY] for name in names), strict=True
    ):
        feet = np.flatnonzero(held)
        if len(feet) and (held == stance).all():
            off, arms = (found - planned)[feet].ravel(), place[feet] - place[feet[0]]
            both = np.hstack([np.vstack((np.eye(3), pin.skew(arm))) for arm in arms])
            inside = off - np.linalg.pinv(both) @ (both @ off)
            square, free, count = square + off @ off, free + inside @ inside, count + len(off)
    return tuple(np.sqrt(np.array([square, free]) / max(count, 1)).tolist())


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
        found = [row[name] for row in rows if row["speed"] == speed and name in row]
        return float(what(found)) if found else None

    return value


@cache
def _bound(robot: str) -> float:
    return Preview(hp.load_robot(robot)).max_speed


def bound(rows: Rows) -> float | None:
    """Speed at which the stride of the preview asks as much of the motors as it may."""
    return _bound(rows[0]["robot"]) if rows[0]["walker"] == "preview" else None


def _draw(figure: Any, rows: Rows) -> None:
    """The largest speed over the friction."""
    figure.set_size_inches(6.4, 3.4)
    panel = figure.subplots()
    ahead = [row for row in rows if row["what"] == "ahead" and row["robot"] == MEASURED]
    for (walker,), mine in grouped(ahead, "walker").items():
        line = [(mu, largest(some) or 0.0) for (mu,), some in grouped(mine, "friction").items()]
        style = "o-" if walker == "preview" else "s--"
        panel.plot(*zip(*sorted(line), strict=True), style, label=LABELS[walker])
    panel.set(
        xlabel="friction coefficient of the ground", ylabel="largest speed, m/s", ylim=(0, None)
    )
    panel.set_title("How fast Go2 runs", loc="left")
    panel.legend(frameon=False)


def _jobs(s: Any) -> Iterator[Job]:
    same = {"plant": s.plants, "jitter": s.jitter, "seed": s.seed}
    for robot, (number, walker) in product(s.robots, enumerate(s.walkers)):
        who = {"what": "ahead", "robot": robot, "walker": walker, **same, "duration": s.duration}
        starts = range(s.starts if robot == MEASURED else s.others)
        yield from grid(**who, friction=FRICTION, speed=SPEEDS[robot][number], start=starts)
        if robot == MEASURED:
            few = range(s.others)
            yield from grid(**who, friction=s.frictions, speed=SLIPPERY[number], start=few)
    if MEASURED not in s.robots:
        return
    who = {"robot": MEASURED, "walker": "preview", **same}
    for what, speeds, friction, count, duration in (
        *((what, speeds, FRICTION, s.others, s.duration) for what, (_, speeds) in OTHERS.items()),
        ("commands", FAST, None, s.walks, s.duration),
        ("on the estimate", FAST, None, s.walks, s.duration),
        ("turns", 1.0, FRICTION, s.others, s.duration),
        ("late plans", (1.0, 2.5), FRICTION, s.others, s.duration),
        ("pushes", 1.0, FRICTION, s.pushes, WALKED + 3.0),
    ):
        yield from grid(
            what=what, **who, speed=speeds, friction=(friction,), start=range(count),
            duration=duration,
        )  # fmt: skip


_AT_FULL_GRIP = {"what": "ahead", "friction": FRICTION}


STUDY = Study(
    name="speed",
    help=__doc__,
    example="--only go2 --out go2.jsonl",
    defaults={
        "robots": tuple(SPEEDS),
        "walkers": tuple(LABELS),
        "plants": ("compliant", "mujoco"),
        "frictions": (0.2, 0.4, 0.6),  # besides that of all others
        "starts": 20,  # of Go2 at the largest speeds
        "others": 2,  # of all others
        "walks": 20,  # by random commands in each plant, and as many on the estimate
        "pushes": SIDES * INSTANTS,
        "jitter": 0.1,  # standard deviation of each starting velocity, m/s and rad/s
        "duration": 10.0,  # of a walk, s
        "seed": 0,
    },
    quick={
        "robots": (MEASURED,),
        "plants": ("compliant",),
        "frictions": (),
        "starts": 1,
        "others": 1,
        "walks": 1,
        "pushes": 1,
        "duration": 2.0,
    },
    options={"walks": "Random commands in each plant.", "starts": "Of Go2 at its largest speeds."},
    jobs=_jobs,
    measure=measured,
    views=[
        View(
            "speed",
            "Largest speeds",
            row=lambda row: f"{row['robot']}, {LABELS[row['walker']]}",
            columns={
                "starts": lambda rows: max(row["start"] for row in rows) + 1,
                "largest": (largest, "m/s"),
                "motors' bound": (bound, "m/s"),
                "cost of transport": at_largest("cost_of_transport"),
                "slip": (at_largest("slip_mm"), "mm"),
                "flight": at_largest("flight"),
                "peak torque": at_largest("torque", max),
                "peak joint speed": at_largest("joint_speed", max),
                "too fast": at_largest("fast", np.mean),
            },
            note="Largest speed of those tried at which every start stands. At that speed: work "
            "over weight and path, slip of a foot in a step, share of the time without any foot "
            "on the ground, largest torque and joint speed over their limits, and share of the "
            "time with a joint beyond its speed.",
            only=lambda row: _AT_FULL_GRIP.items() <= row.items(),
        ),
        View(
            "speed_stood",
            "Starts that stand",
            row=lambda row: f"{row['robot']}, {LABELS[row['walker']]}, {row['plant']}",
            across="{speed:g} m/s",
            columns=lambda rows: f"{sum(map(_stands, rows))} of {len(rows)}",
            only=lambda row: _AT_FULL_GRIP.items() <= row.items(),
        ),
        View(
            "speed_friction",
            "Largest speeds of Go2, m/s, by friction",
            row=lambda row: LABELS[row["walker"]],
            across="{friction:g}",
            columns=lambda rows: largest(rows) or 0.0,
            only=lambda row: row["what"] == "ahead" and row["robot"] == MEASURED,
        ),
        View(
            "speed_others",
            "Go2 in other ways",
            row="{what}, {speed:g} m/s, {plant}",
            columns={
                "walks": len,
                "fell": lambda rows: sum(row["fell"] for row in rows),
                "slip": (median("slip_mm"), "mm"),
                "worst slip": (most("slip_mm"), "mm"),
                "turning": (where(median("turning"), what="turns"), "rad/s"),
                "flight": median("flight"),
            },
            only=lambda row: row["what"] != "ahead",
        ),
        View(
            "speed_forces",
            "Forces of the WBC less the planned ones, N rms",
            row="{speed:g} m/s",
            columns={
                "all": (median("force_n"), "N"),
                "what the motion leaves open": (median("free_force_n"), "N"),
            },
            only=lambda row: (
                row["what"] in ("ahead", "late plans")
                and "force_n" in row
                and row["robot"] == MEASURED
                and row["friction"] == FRICTION
                and not row["fell"]
            ),
        ),
    ],
    draw=_draw,
    only="robots",
)
