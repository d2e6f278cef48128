"""Contact models that are not ours: who falls, how far feet slip on each, and how much of it the model itself makes.

MuJoCo's friction creeps: a foot inside the cone moves with a velocity that its force sets. This part of
the slip is known in closed form, and taken apart from the rest. Friction, and the stiffness that the weight finds, are
known to controllers and gait.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from comparison.contenders import BEST, controller_part, label
from comparison.measure.walking import Rows, as_far_as_it_goes, grouped
from comparison.studies import landing
from comparison.study import STARTS, Job, Study, Value, crossed, start_velocity, tabulated
from comparison.tables import Cell, Table, cell_text
from harpy_pin import Disturbances, Ground, Mujoco, Scenario, Straight, build
from harpy_pin.gaits import GaitParameters
from harpy_pin.log.run import Run
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
CAREFUL = 0.4
"""Share of the ground's friction that :data:`GENTLE` assumes."""
GENTLE = "condensed/gentle"
WALKERS = ("governed/none", "governed/paper", BEST, "governed/filter", "condensed", "wbc", GENTLE)
SLIDING = 5e-3
"""Speed beyond the creep from which on a foot counts as sliding, m/s."""
HELD = 1e-9
"""Forces below are none, N."""
NOTE = (
    "Median over the walks, with the least and the largest; a fall counts as more than any. Per step of the walk, both "
    "feet: path; what of it is creep by the contact's own law, from the forces; net displacement. Sliding: share of "
    "the feet's time on the ground in which they move faster than they creep by 5 mm/s. Gentle: the condensed WBC, "
    "which assumes 0.4 of the friction."
)


def _jobs(s: Any) -> Iterator[Job]:
    """Every controller on every contact that is installed."""
    names = ("robot", "contact", "friction", "walker", "start")
    landings = _installed(landing.LANDINGS, tuple(landing.LANDINGS)) if installed_data() is not None else []
    cases = {
        "harpy": product(["harpy"], _installed(CONTACTS, s.contacts), s.frictions, s.walkers, range(s.starts)),
        "go2": product(["go2"], landings, landing.FRICTIONS, landing.WALKERS, [0]),
    }
    for case in (case for robot in s.robots for case in cases[robot]):
        yield dict(zip(names, case, strict=True)) | {"duration": s.duration, "jitter": s.jitter, "seed": s.seed}


def _installed(plants: Mapping[str, PlantPart], contacts: tuple[str, ...]) -> list[str]:
    return [name for name in contacts if not isinstance(plants[name], Mujoco) or installed_version() is not None]


def _measured(job: Job) -> dict[str, Any]:
    """How a walk ended, and per step of the walk ``path_mm``, ``creep_mm``.

    Of Harpy also ``end_time_s``, ``net_mm`` and ``sliding``, the share of the time on the ground; of Go2 see
    :func:`comparison.studies.landing.landing_row`.
    """
    friction, walker = job["friction"], job["walker"]
    if job["robot"] == "go2":
        built = build(landing.landing_scenario(job["contact"], friction, walker, job["duration"]))
        run = built.run()
        return landing.landing_row(run, _creep_speed(run, built.simulator))
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


def _creep_speed(run: Run, plant: Plant) -> Vector:
    """(ticks - 1, feet) speed at which feet creep under their forces, m/s."""
    speed: Vector = np.linalg.norm(_creep(plant)(run["foot_force"][1:], -run["foot_position"][1:, :, 2]), axis=-1)
    return speed


def _creep(plant: Plant) -> Callable[[Vector, Vector], Vector]:
    """Creep velocity of a plant's feet, from their forces and depths."""
    if isinstance(plant, MujocoPlant) and plant.contact is not None:
        contact, inverse = plant.contact, plant.inverse_mass
        return lambda force, depth: contact.creep(force, depth, inverse_mass=inverse, friction=plant.ground.mu_s)
    return lambda force, depth: np.zeros((*depth.shape, 2))


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


COLUMNS: dict[str, Any] = {
    "fell": lambda rows: f"{sum(row['ending'] != 'completed' for row in rows)} of {len(rows)}",
    "path": (_spread("path_mm"), "mm"),
    "creep": (_spread("creep_mm"), "mm"),
    "net": (_spread("net_mm"), "mm"),
    "sliding": (_spread("sliding", 1e2), "%"),
}


def _tables(rows: Rows) -> list[Table]:
    """For each friction a table of falls, path, creep, net displacement and sliding; and one of Go2's landings."""
    long: list[Table] = []
    brief: list[Table] = []
    landings = [row for row in rows if row["robot"] == "go2"]
    frictions = grouped([row for row in rows if row["robot"] == "harpy"], "friction")
    for (friction,), here in frictions.items():
        note = NOTE if len(long) == len(frictions) - 1 else ""
        long.append(
            tabulated(
                f"contacts_{friction:g}", f"Contact models, friction {friction:g}", here,
                lambda row: f"{row['contact']}: {_name(row['walker'])}", COLUMNS, note,
            )
        )  # fmt: skip
        brief.append(
            crossed(
                f"contacts_{friction:g}_brief", f"Median path / net displacement, mm, friction {friction:g}", here,
                lambda row: str(row["contact"]), lambda row: _name(row["walker"]), _pair,
            )
        )  # fmt: skip
    return [*long, *brief, *([landing.landing_table(landings)] if landings else [])]


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
        "robots": ("harpy", "go2"),  # Harpy walks on all contacts, Go2 on those of comparison.studies.landing
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
    tables=_tables,
    only="robots",
)
