"""Contact models that are not ours: who falls, how far feet slip on each, and how much of it the model itself makes.

MuJoCo's friction creeps: a foot inside the cone moves with a velocity that its force sets. This part of
the slip is known in closed form, and taken apart from the rest. Friction, and the stiffness that the weight finds, are
known to controllers and gait.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from comparison.contenders import BEST, controller_part, label
from comparison.measure.walking import Rows, as_far_as_it_goes
from comparison.study import STARTS, Job, Study, Value, View, grid, shown, start_velocity
from comparison.tables import Cell, cell_text
from harpy_pin import Disturbances, Ground, Mujoco, Run, Scenario, Straight, Walking, build
from harpy_pin.gaits import GaitParameters
from harpy_pin.model.catalogue import installed_data
from harpy_pin.model.state import Vector
from harpy_pin.scenario import Compliant, PlantPart
from harpy_pin.simulation.mujoco import MujocoPlant, installed_version
from harpy_pin.simulation.plant import Plant

CONTACTS: dict[str, PlantPart] = {
    "ours": Compliant(),
    "MuJoCo stiff": Mujoco("stiff"),
    "MuJoCo default": Mujoco("default"),
    "default, 5 mm": Mujoco("default", foot_radius=0.005),
    "default, 10 mm": Mujoco("default", foot_radius=0.01),
    "default, 20 mm": Mujoco("default", foot_radius=0.02),
    "MuJoCo elliptic": Mujoco("elliptic"),
    "menagerie, 20 mm": Mujoco("menagerie", foot_radius=0.02),
}
"""Contact models by name; lengths are the radius of the feet, which are points otherwise."""
SOFT, MENAGERIE = "ours, as soft", "menagerie, 22 mm"
LANDINGS: dict[str, PlantPart] = {
    "ours": Compliant(),
    SOFT: Compliant(),
    "elliptic, 22 mm": Mujoco("elliptic", foot_radius=0.022),
    MENAGERIE: Mujoco("menagerie", foot_radius=0.022),
    "menagerie, points": Mujoco("menagerie"),
}
"""Those of Go2. MuJoCo's have the same cone, ``impratio`` and time constant, and another impedance."""
CAREFUL = 0.4
"""Share of the ground's friction that :data:`GENTLE` assumes."""
GENTLE = "condensed/gentle"
WALKERS = ("governed/none", "governed/paper", BEST, "governed/filter", "condensed", "wbc", GENTLE)
ON_FOUR = {"condensed": "condensed WBC", "wbc": "WBC QP"}
SLIDING = 5e-3
"""Speed beyond the creep from which on a foot counts as sliding, m/s."""
LANDING = 0.05
"""First part of a stance, s."""
STIFFNESS = 79e3
"""Of our ground: two feet sink in by 1 mm under Go2, N/m."""
HELD = 1e-9
"""Forces below do not count, N."""


def _jobs(s: Any) -> Iterator[Job]:
    """Every controller on every contact that is installed."""
    landings = _installed(LANDINGS, tuple(LANDINGS)) if installed_data() is not None else []
    contacts, starts = _installed(CONTACTS, s.contacts), range(s.starts)
    cases = {
        "harpy": grid(contact=contacts, friction=s.frictions, walker=s.walkers, start=starts),
        "go2": grid(contact=landings, friction=(0.6, 0.25), walker=ON_FOUR, start=[0]),
    }
    for robot in s.robots:
        for case in cases[robot]:
            yield {"robot": robot, **case, "duration": s.duration, "jitter": s.jitter, "seed": s.seed}


def _installed(plants: Mapping[str, PlantPart], contacts: tuple[str, ...]) -> list[str]:
    return [name for name in contacts if not isinstance(plants[name], Mujoco) or installed_version() is not None]


def _measured(job: Job) -> dict[str, Any]:
    """How a walk ended, and per step of the walk ``path_mm``, ``creep_mm``.

    Of Harpy also ``end_time_s``, ``net_mm`` and ``sliding``, the share of the time on the ground; of Go2 see
    :func:`landing_row`.
    """
    friction, walker = job["friction"], job["walker"]
    if job["robot"] == "go2":
        built = build(landing_scenario(job["contact"], friction, walker, job["duration"]))
        run = built.run()
        return landing_row(run, _creep_speed(run, built.simulator))
    scenario = Scenario(
        gait=Straight(stiffness=_stiffness(job["contact"], friction)),
        controller=controller_part(*(("condensed", CAREFUL * friction) if walker == GENTLE else (walker,))),
        plant=CONTACTS[job["contact"]],
        ground=Ground(mu_s=friction),
        disturbances=Disturbances(start_velocity=start_velocity(job)),
        duration=job["duration"],
    )
    built = build(scenario)
    return _kept(as_far_as_it_goes(built.run), built.simulator)


@cache
def _stiffness(contact: str, friction: float) -> float:
    """Of the ground as the weight finds it, N/m."""
    return build(Scenario(plant=CONTACTS[contact], ground=Ground(mu_s=friction))).simulator.ground.stiffness


def _kept(run: Run, plant: Plant) -> dict[str, Any]:
    """What is kept of a walk."""
    end, period = float(run.metadata["end_time"]), float(run.metadata["control_period"])
    steps = max(end / GaitParameters().step_duration, 1.0)
    touching = run["foot_force"][1:, :, 2] > HELD
    creep = _creep_speed(run, plant) * touching
    way = np.diff(run["slip_path"], axis=0)
    sliding = (way / period - creep > SLIDING) & touching
    return {
        "ending": run.ending,
        "end_time_s": end,
        "path_mm": 1e3 * float(run["slip_path"][-1].sum()) / steps,
        "creep_mm": 1e3 * period * float(creep.sum()) / steps,
        "net_mm": 1e3 * float(run["slip_net"][-1].sum()) / steps,
        "sliding": float(sliding.sum()) / max(int(touching.sum()), 1),
    }


def landing_scenario(contact: str, friction: float, walker: str, duration: float) -> Scenario:
    """A walk of Go2."""
    return Scenario(
        robot="go2",
        controller=walker,
        plant=LANDINGS[contact],
        gait=Walking(velocity=(0.3, 0.0, 0.0)),
        ground=Ground(mu_s=friction, stiffness=_soft_stiffness() if contact == SOFT else STIFFNESS),
        duration=duration,
    )


@cache
def _soft_stiffness() -> float:
    """Of Menagerie's contact under Go2's weight, N/m."""
    plant = LANDINGS[MENAGERIE]
    return build(Scenario(robot="go2", plant=plant, gait=Walking(), duration=0.1)).simulator.ground.stiffness


def landing_row(run: Run, creep: Vector) -> dict[str, Any]:
    """Where the slip of a walk is made; ``creep`` is the speed of creep, (ticks - 1, feet), m/s."""
    period, steps = float(run.metadata["control_period"]), max(int(run["steps"].max()), 1)
    stance, way = run["stance"][1:] > 0, np.diff(run["slip_path"], axis=0)
    touching = run["foot_force"][1:, :, 2] > HELD
    ticks = np.arange(1.0, len(stance) + 1.0)[:, None]
    age = ticks - np.maximum.accumulate(np.where(stance, 0.0, ticks))
    landing = stance & (age * period <= LANDING)
    parts = {"air_mm": ~stance, "landing_mm": landing, "stance_mm": stance & ~landing}
    return {
        "ending": run.ending,
        "sinks_mm": -1e3 * float(np.median(run["foot_position"][1:, :, 2][touching & stance])),
        "path_mm": 1e3 * float(way.sum()) / steps,
        **{name: 1e3 * float(way[part].sum()) / steps for name, part in parts.items()},
        "creep_mm": 1e3 * period * float((creep * touching).sum()) / steps,
    }


def _creep_speed(run: Run, plant: Plant) -> Vector:
    """(ticks - 1, feet) speed at which feet creep under their forces, m/s."""
    force, depth = run["foot_force"][1:], -run["foot_position"][1:, :, 2]
    if not isinstance(plant, MujocoPlant) or plant.contact is None:
        return np.zeros(depth.shape)
    creep = plant.contact.creep(force, depth, inverse_mass=plant.inverse_mass, friction=plant.ground.mu_s)
    speed: Vector = np.linalg.norm(creep, axis=-1)
    return speed


def _name(walker: str) -> str:
    return "gentle" if walker == GENTLE else label(walker)


def _spread(name: str, scale: float = 1.0) -> Value:
    """Median, least and largest of the walks, in which a fall counts as more than any."""

    def value(rows: Rows) -> Cell:
        values = sorted(scale * row[name] if row["ending"] == "completed" else np.inf for row in rows)
        middle = float(np.median(values))
        if not np.isfinite(middle):
            return Cell("", "", "fell")
        return Cell("", "", middle, "", values[0], max(value for value in values if np.isfinite(value)))

    return value


def _pair(rows: Rows) -> str:
    medians = (_spread(name)(rows).value for name in ("path_mm", "net_mm"))
    return " / ".join(cell_text(Cell("", "", value)) for value in medians)


def _on(robot: str) -> Callable[[dict[str, Any]], bool]:
    return lambda row: bool(row["robot"] == robot)


VIEWS = (
    View(
        "contacts_{friction:g}",
        "Contact models, friction {friction:g}",
        row=lambda row: f"{row['contact']}: {_name(row['walker'])}",
        columns={
            "fell": lambda rows: f"{sum(row['ending'] != 'completed' for row in rows)} of {len(rows)}",
            "path": (_spread("path_mm"), "mm"),
            "creep": (_spread("creep_mm"), "mm"),
            "net": (_spread("net_mm"), "mm"),
            "sliding": (_spread("sliding", 1e2), "%"),
        },
        note="Median over the walks, with the least and the largest; a fall counts as more than any. Per step of the "
        "walk, both feet: path; what of it is creep by the contact's own law, from the forces; net displacement. "
        "Sliding: share of the feet's time on the ground in which they move faster than they creep by 5 mm/s. Gentle: "
        "the condensed WBC, which assumes 0.4 of the friction.",
        only=_on("harpy"),
    ),
    View(
        "contacts_{friction:g}_brief",
        "Median path / net displacement, mm, friction {friction:g}",
        row="{contact}",
        across=lambda row: _name(row["walker"]),
        columns=_pair,
        only=_on("harpy"),
    ),
    View(
        "contacts_landing",
        "Go2: in which part of a stance its feet slip",
        row=lambda row: f"{row['contact']}, friction {row['friction']:g}: {ON_FOUR[row['walker']]}",
        columns={
            "sinks": (shown("sinks_mm"), "mm"),
            "path": (lambda rows: rows[0]["path_mm"] if rows[0]["ending"] == "completed" else "fell", "mm"),
            "in the air": (shown("air_mm"), "mm"),
            "landing": (shown("landing_mm"), "mm"),
            "later": (shown("stance_mm"), "mm"),
            "creep": (shown("creep_mm"), "mm"),
        },
        note="One walk of each controller at 0.3 m/s. Sinks: median of the feet in stance. Path per step of the walk, "
        "all feet: while the gait has the foot in the air, in the first 50 ms of its stance, later; creep is the "
        "contact's own, by its closed form. As soft: our ground with the stiffness that the weight finds in "
        "Menagerie's contact.",
        only=_on("go2"),
    ),
)

STUDY = Study(
    name="contacts",
    help="""Walk on contact models that are not ours.

    MuJoCo's own contact and what is advised against its slip, and spheres as feet, beside ours. The tables
    take the creep that a contact has by itself from the rest of the slip, and show in which part of a stance Go2 slips.
    It is left out where MuJoCo is not installed. With it this takes many minutes.
    """,
    example="--out contacts.jsonl",
    defaults=STARTS
    | {
        "robots": ("harpy", "go2"),  # Harpy walks on all contacts, Go2 on LANDINGS
        "contacts": tuple(CONTACTS),
        "walkers": WALKERS,
        "frictions": (0.25, 0.15),
        "starts": 3,
        "duration": 4.0,
        "seed": 700,
    },
    quick={
        **{"robots": ("harpy",), "contacts": ("ours", "MuJoCo default"), "frictions": (0.25,)},
        **{"starts": 1, "duration": 1.5},
    },
    jobs=_jobs,
    measure=_measured,
    views=VIEWS,
    only="robots",
)
