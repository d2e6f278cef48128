"""Robots of the catalogue walk where they are told: courses, slippery ground, random commands, pushes, noise and delay.

No setting of the gait was chosen on the random commands and pushes of seed 0, which are what is walked here by default.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.store import kept_rows
from comparison.contenders import label
from comparison.joint_pd.controller import JointPD, JointPDGains
from comparison.joint_pd.search import found_gains
from comparison.measure.walking import Progress, Rows, grouped, walk_as_far_as_it_goes
from comparison.tables import Cell, Table
from comparison.walking_summary import summary_tables
from comparison.walking_ticks import tick_table, ticks_of
from harpy_pin import Disturbances, Ground, Noise, Push, Scenario, Walking, WalkingGait, checks, load_robot, measure

__all__ = ["PD_ROBOTS", "WalkingSettings", "WalkingWalk", "course", "walk_robots", "walked", "walking_tables"]

QUADRUPEDS = ("solo12", "a1", "b1", "go1", "go2", "laikago", "anymal_b", "anymal_c", "hyq")
ON_SOLES = ("g1", "talos", "icub")
BIPEDS = ("bolt", *ON_SOLES)
PD = "joint_pd"
"""Joint PD with feedforward (:mod:`comparison.joint_pd`); it walks everything, but for robots on soles."""
PD_ROBOTS = (*QUADRUPEDS, "bolt")
"""Who has gains for it."""
GRAVITY = 9.81
SINK = 2e-3
"""How deep the feet sink in when the robot stands on two of four, m: it makes the ground's stiffness."""
FRICTION = {
    "course": 0.8,
    "ticks": 0.8,
    "course, friction 0.3": 0.3,
    "friction 0.1": 0.1,
    "crawl": 0.5,
    "pace": 0.5,
    "bound": 0.5,
    "ten metres": 0.5,
}
"""Of the ground, which the controllers know, by what is walked; of the rest it is drawn, or 0.6."""
DRAWN = (0.3, 0.8)
"""Range of the friction under random commands."""
SIDES = 8
PUSH, SOLE_PUSH = 0.6, 0.15
"""Impulse over mass of a push of 0.1 s, m/s, on points and on soles."""
ICE_SPEED = 0.4
"""Speed of quadrupeds at friction 0.1, m/s."""
TEN_METRES = ((0.5, 0.22, 0.0, 0.0), (47.0, 0.11, 0.0, 0.4), (51.0, 0.0, 0.0, 0.0))
"""Of robots on soles: the velocity for more than 10 m forward, a turn by 1.6 rad, and a stop."""
STOPPED = 54.0
"""When they stand again, s."""
DELAY = 3e-3
"""With noise, s."""
LEG_SPEED = 0.99
"""Speed of the course forward, as a share of the gait's largest."""


@dataclass(frozen=True, kw_only=True)
class WalkingSettings:
    """What is walked.

    Attributes:
        robots: names of robots of the catalogue.
        controllers: who walks the courses; the rest is walked by the first one, and by joint PD.
        plants: engines of the courses.
        course: seconds of the course that are walked.
        walks: random sequences of commands for each robot, and as many with noise and delay.
        walks_on_four: random sequences without noise for each quadruped under the first controller.
        pushes: walks with a push from each of eight sides.
        duration: of these walks, s.
        seed: of all that is drawn.
    """

    robots: tuple[str, ...] = QUADRUPEDS + BIPEDS
    controllers: tuple[str, ...] = ("condensed", "wbc", PD)
    plants: tuple[str, ...] = ("compliant", "mujoco")
    course: float = 20.0
    walks: int = 40
    walks_on_four: int = 200
    pushes: int = 3
    duration: float = 6.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in self.robots:
            checks.one_of("robot", name, QUADRUPEDS + BIPEDS)
        for name in ("walks", "walks_on_four", "pushes", "seed"):
            checks.whole(name, getattr(self, name))
        checks.number("course", self.course, low=1.0)
        checks.number("duration", self.duration, low=3.0)

    @classmethod
    def quick(cls) -> WalkingSettings:
        """One robot and few walks: to see whether it works."""
        return cls(
            robots=("solo12",), controllers=("condensed",), plants=("compliant",), course=3.0, walks=1,
            walks_on_four=1, pushes=0, duration=3.0,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class WalkingWalk:
    """One walk.

    Attributes:
        robot: its name.
        what: ``course``, or another kind of walk.
        controller: who walks.
        plant: the engine.
        number: of the sequence, or of the push.
        duration: s.
        seed: of what is drawn.
    """

    robot: str
    what: str
    controller: str = "condensed"
    plant: str = "compliant"
    number: int = 0
    duration: float
    seed: int

    def scenario(self) -> Scenario:
        """What is walked; the same number has the same command, friction and push, whoever walks it."""
        robot = load_robot(self.robot)
        fastest = float(WalkingGait(robot).describe()["max_speed"])
        rng = np.random.default_rng([self.seed, self.number])
        friction, schedule = FRICTION.get(self.what, 0.6), None
        pushes: tuple[Push, ...] = ()
        sensors: dict[str, Any] = {}
        rows = course(LEG_SPEED * fastest)
        if self.what in ("crawl", "pace", "bound"):
            schedule, rows = self.what, ((0.3, 0.3 * fastest, 0.0, 0.0),)
        elif self.what == "ten metres":
            rows = TEN_METRES
        elif self.what == "friction 0.1":
            rows = ((0.3, ICE_SPEED if self.robot in QUADRUPEDS else 0.3 * fastest, 0.0, 0.0),)
        elif self.what == "pushed":
            rows = ((0.3, 0.4 * fastest, 0.0, 0.0),)
            angle, time = 2.0 * np.pi * self.number / SIDES, float(rng.uniform(1.5, 2.5))
            impulse = robot.mass * (SOLE_PUSH if robot.flat_feet else PUSH)
            pushes = (Push(time, (impulse * np.cos(angle), impulse * np.sin(angle), 0.0)),)
        elif self.what.startswith("random"):
            friction = float(rng.uniform(*DRAWN))
            rows = tuple(_sequence(rng, fastest, self.duration))
            if self.what.endswith("delay"):
                sensors = {"noise": Noise.typical(), "delay": DELAY, "seed": self.number}
        return Scenario(
            robot=self.robot,
            controller="condensed" if self.controller == PD else self.controller,
            plant=self.plant,
            gait=Walking(schedule=schedule, velocity=rows),
            ground=Ground(mu_s=friction, stiffness=robot.mass * GRAVITY / SINK),
            disturbances=Disturbances(pushes=pushes, **sensors),
            duration=self.duration,
        )


def course(speed: float) -> tuple[tuple[float, float, float, float], ...]:
    """Forward, a quarter to the left, sideways, back, and stop: 20 s."""
    turn, quarter = 0.6, np.pi / 2.0 / 0.6
    return (
        (0.5, speed, 0.0, 0.0),
        (5.0, 0.5 * speed, 0.0, turn),
        (5.0 + quarter, 0.0, 0.5 * speed, 0.0),
        (11.0, -0.5 * speed, 0.0, 0.0),
        (16.0, 0.0, 0.0, 0.0),
    )


def _sequence(rng: np.random.Generator, fastest: float, duration: float) -> Iterator[tuple[float, float, float, float]]:
    """Any direction up to the largest speed, turning too, anew every 0.2 to 2.5 s."""
    t = 0.3
    while t < duration - 1.0:
        x, y, w = rng.uniform(-1.0, 1.0, 3)
        yield (t, float(x * fastest), float(0.6 * y * fastest), float(1.5 * w))
        t += float(rng.uniform(0.2, 2.5))


def walk_robots(settings: WalkingSettings, progress: Progress | None = None, path: Path | None = None) -> Rows:
    """All walks, in processes of their own where there are many.

    Returns:
        A row for each walk: what it was, and its measures. Ticks are timed after the walks, with nothing beside them.
    """
    jobs, alone = _jobs(settings), [_job(settings, robot, "ticks", settings.course) for robot in settings.robots]
    both = len(jobs) + len(alone)

    def told(before: int) -> Progress | None:
        return None if progress is None else lambda done, _: progress(before + done, both)

    walks = kept_rows({str(job): job for job in jobs}, walked, told(0), path)
    return walks + kept_rows({str(job): job for job in alone}, walked, told(len(jobs)), path)


def _jobs(s: WalkingSettings) -> list[WalkingWalk]:
    jobs: list[WalkingWalk] = []
    for robot in s.robots:
        able = [one for one in s.controllers if one != PD or robot in PD_ROBOTS]
        for plant in s.plants:
            for controller in able:
                for what in ("course", "course, friction 0.3"):
                    jobs.append(_job(s, robot, what, s.course, plant=plant, controller=controller))
            if robot in ON_SOLES:
                jobs.append(_job(s, robot, "ten metres", STOPPED, plant=plant, controller=s.controllers[0]))
        for controller in [one for one in able if one in (s.controllers[0], PD)]:
            jobs.extend(_shorter(s, robot, controller))
    return jobs


def _shorter(s: WalkingSettings, robot: str, controller: str) -> Iterator[WalkingWalk]:
    """What is not walked by everyone."""
    for what in ("friction 0.1", *(("crawl", "pace", "bound") if robot in QUADRUPEDS else ())):
        yield _job(s, robot, what, s.duration, controller=controller)
    plain = s.walks_on_four if robot in QUADRUPEDS and controller == s.controllers[0] else s.walks
    for what, count in {"random": plain, "random, noise and delay": s.walks}.items():
        for number in range(count):
            yield _job(s, robot, what, s.duration, number=number, controller=controller)
    for number in range(SIDES * s.pushes):
        yield _job(s, robot, "pushed", s.duration, number=number, controller=controller)


def _job(s: WalkingSettings, robot: str, what: str, duration: float, **options: Any) -> WalkingWalk:
    return WalkingWalk(robot=robot, what=what, duration=duration, seed=s.seed, **options)


def walked(job: WalkingWalk, gains: JointPDGains | None = None) -> dict[str, Any]:
    """Measures of one walk; a controller that fails counts as a fall at that moment.

    Args:
        job: the walk.
        gains: of joint PD; those that were found by default.
    """
    scenario, own = job.scenario(), None
    if job.what == "ticks":
        return asdict(job) | ticks_of(scenario)
    if job.controller == PD:
        chosen = JointPDGains(**found_gains()[job.robot]["gains"]) if gains is None else gains
        own = partial(JointPD, gains=chosen, mu=scenario.mu)
    run = walk_as_far_as_it_goes(scenario, own)
    error_m = np.linalg.norm(run["centre"][:, :2] - run["path"][:, :2], axis=1)
    return {
        **asdict(job),
        "fell": run.ending != "completed",
        "stood_s": float(run["t"][-1]),
        "path_rms_mm": 1e3 * float(np.sqrt(np.mean(error_m**2))),
        "slip_mm_per_step": 1e3 * float(run["slip_path"][-1].sum()) / max(int(run["steps"][-1]), 1),
        "joint_power_w": measure(run).joint_power_w,
        "speed_m_s": float(np.linalg.norm(run["applied_velocity"][:, :2], axis=1).max()),
    }


def walking_tables(rows: Rows) -> list[Table]:
    """Falls, path and slip of every robot, a table for each kind of walk; then a row for each robot, and its ticks."""
    tables, ticks = [], [row for row in rows if row["what"] == "ticks"]
    walks = [row for row in rows if row["what"] != "ticks"]
    note = (
        "Slip: path of all feet (soles: of all corners) along the ground, per step. Off path: rms. Power: of the "
        "joints, without braking. Medians over the walks."
    )
    for (what, plant, controller), same in grouped(walks, "what", "plant", "controller").items():
        cells = []
        for (robot,), own in grouped(same, "robot").items():
            slips, paths = [row["slip_mm_per_step"] for row in own], [row["path_rms_mm"] for row in own]
            cells.append(Cell(robot, "fell", f"{sum(row['fell'] for row in own)} of {len(own)}"))
            cells.append(Cell(robot, "slip", float(np.median(slips)), "mm"))
            cells.append(Cell(robot, "largest slip", max(slips), "mm"))
            cells.append(Cell(robot, "off path", float(np.median(paths)), "mm"))
            cells.append(Cell(robot, "power", float(np.median([row["joint_power_w"] for row in own])), "W"))
            cells.append(Cell(robot, "speed", max(row["speed_m_s"] for row in own), "m/s"))
        name = f"walking_{what}_{plant}_{controller}".replace(",", "").replace(" ", "_")
        tables.append(Table(name, f"{what}, {plant} plant, {label(controller)}", tuple(cells), note))
    return [*tables, *summary_tables(walks), *([tick_table(ticks)] if ticks else [])]
