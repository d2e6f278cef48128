"""Contact models that are not ours: who falls, how far feet slip on each, and how much of it the model itself makes.

MuJoCo's and Drake's friction creeps: a foot inside the cone moves with a velocity that its force sets. This part of
the slip is known in closed form, and taken apart from the rest. Friction, and the stiffness that the weight finds, are
known to controllers and gait.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from comparison import landing
from comparison.campaign.store import kept_rows
from comparison.contenders import BEST, controller_part, label
from comparison.measure.starts import StartsSettings, start_velocity
from comparison.measure.walking import Progress, Rows, as_far_as_it_goes, grouped
from comparison.tables import Cell, Table, cell_text
from harpy_pin import Disturbances, Drake, GaitParameters, Ground, Mujoco, Scenario, Straight, build, checks
from harpy_pin.log.run import Run
from harpy_pin.model.catalogue import installed_data
from harpy_pin.model.state import Vector
from harpy_pin.scenario import Compliant, PlantPart
from harpy_pin.simulation.drake import DrakePlant
from harpy_pin.simulation.mujoco import MujocoPlant, installed_version
from harpy_pin.simulation.plant import Plant

__all__ = ["CONTACTS", "WALKERS", "ContactsSettings", "contact_tables", "walk_contacts"]

CONTACTS: dict[str, PlantPart] = {
    "ours": Compliant(),
    "MuJoCo stiff": Mujoco("stiff"),
    "MuJoCo default": Mujoco("default"),
    "default, 5 mm": Mujoco("default", foot_radius=0.005),
    "default, 10 mm": Mujoco("default", foot_radius=0.01),
    "default, 20 mm": Mujoco("default", foot_radius=0.02),
    "MuJoCo elliptic": Mujoco("elliptic"),
    "menagerie, 20 mm": Mujoco("menagerie", foot_radius=0.02),
    "Drake": Drake(),
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


@dataclass(frozen=True, kw_only=True)
class ContactsSettings(StartsSettings):
    """What is walked.

    Attributes:
        robots: Harpy walks on all contacts, Go2 on those of :mod:`comparison.landing`.
        contacts: names of :data:`CONTACTS`.
        frictions: of the ground.
    """

    robots: tuple[str, ...] = ("harpy", "go2")
    contacts: tuple[str, ...] = tuple(CONTACTS)
    frictions: tuple[float, ...] = (0.25, 0.15)
    starts: int = 3
    duration: float = 4.0
    seed: int = 700

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.robots:
            checks.one_of("robot", name, ("harpy", "go2"))
        for name in self.contacts:
            checks.one_of("contact", name, CONTACTS)
        for friction in self.frictions:
            checks.number("frictions", friction, low=0.0, strict=True)

    @classmethod
    def quick(cls) -> ContactsSettings:
        """Few short walks: to see whether it works."""
        return cls(robots=("harpy",), contacts=("ours", "MuJoCo default"), frictions=(0.25,), starts=1, duration=1.5)


def walk_contacts(settings: ContactsSettings, progress: Progress | None = None, path: Path | None = None) -> Rows:
    """Walk every controller on every contact that is installed.

    Returns:
        A row for each walk: ``robot``, ``contact``, ``friction``, ``walker``, ``start``, ``ending``, and per step of
        the walk ``path_mm``, ``creep_mm``; of Harpy's ``end_time_s``, ``net_mm`` and ``sliding``, the share of the time
        on the ground; of Go2's see :func:`comparison.landing.landing_row`.
    """
    same = f"{settings.duration} {settings.jitter} {settings.seed}"
    return kept_rows({f"{what} {same}": (what, settings) for what in _cases(settings)}, _walked, progress, path)


def _cases(settings: ContactsSettings) -> Iterator[dict[str, Any]]:
    """What each walk is, but for the settings that all share."""
    names = ("robot", "contact", "friction", "walker", "start")
    contacts, starts = _installed(CONTACTS, settings.contacts), range(settings.starts)
    landings = _installed(landing.LANDINGS, tuple(landing.LANDINGS)) if installed_data() is not None else []
    cases = {
        "harpy": product(["harpy"], contacts, settings.frictions, WALKERS, starts),
        "go2": product(["go2"], landings, landing.FRICTIONS, landing.WALKERS, [0]),
    }
    for robot in settings.robots:
        yield from (dict(zip(names, case, strict=True)) for case in cases[robot])


def _installed(plants: Mapping[str, PlantPart], contacts: tuple[str, ...]) -> list[str]:
    has = {"mujoco": installed_version() is not None, "drake": find_spec("pydrake") is not None}
    return [name for name in contacts if has.get(plants[name].name, True)]


def _walked(job: tuple[dict[str, Any], ContactsSettings]) -> dict[str, Any]:
    """What a walk was, and its measures."""
    what, settings = job
    if what["robot"] == "go2":
        built = build(landing.landing_scenario(what["contact"], what["friction"], what["walker"], settings.duration))
        run = built.run()
        return what | landing.landing_row(run, _creep_speed(run, built.simulator))
    velocity = start_velocity(settings.jitter, settings.seed, what["start"])
    friction, gentle = what["friction"], what["walker"] == GENTLE
    scenario = Scenario(
        gait=Straight(stiffness=_stiffness(what["contact"], friction)),
        controller=controller_part(*(("condensed", CAREFUL * friction) if gentle else (what["walker"],))),
        plant=CONTACTS[what["contact"]],
        ground=Ground(mu_s=friction),
        disturbances=Disturbances(start_velocity=velocity),
        duration=settings.duration,
    )
    built = build(scenario)
    run = as_far_as_it_goes(built.run)
    return what | _measure(run, built.simulator)


@cache
def _stiffness(contact: str, friction: float) -> float:
    """Of the ground as the weight finds it, N/m."""
    return build(Scenario(plant=CONTACTS[contact], ground=Ground(mu_s=friction))).simulator.ground.stiffness


def _measure(run: Run, plant: Plant) -> dict[str, Any]:
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
    if isinstance(plant, DrakePlant) and plant.approximation == "lagged":
        return lambda force, depth: plant.creep(force)
    return lambda force, depth: np.zeros((*depth.shape, 2))


def contact_tables(rows: Rows) -> list[Table]:
    """For each friction a table of falls, path, creep, net displacement and sliding; and one of Go2's landings."""
    tables, brief, landings = [], [], [row for row in rows if row["robot"] == "go2"]
    for (friction,), here in grouped([row for row in rows if row["robot"] == "harpy"], "friction").items():
        cells, pairs = [], []
        for (contact, walker), walks in grouped(here, "contact", "walker").items():
            row, fell = f"{contact}: {_name(walker)}", sum(walk["ending"] != "completed" for walk in walks)
            cells.append(Cell(row, "fell", f"{fell} of {len(walks)}"))
            for key, column in (("path_mm", "path"), ("creep_mm", "creep"), ("net_mm", "net")):
                cells.append(_spread(row, column, walks, key, "mm"))
            cells.append(_spread(row, "sliding", [{**w, "sliding": 1e2 * w["sliding"]} for w in walks], "sliding", "%"))
            medians = (_spread(row, "", walks, key, "mm").value for key in ("path_mm", "net_mm"))
            pairs.append(Cell(contact, _name(walker), " / ".join(cell_text(Cell("", "", value)) for value in medians)))
        tables.append(Table(f"contacts_{friction:g}", f"Contact models, friction {friction:g}", tuple(cells)))
        title = f"Median path / net displacement, mm, friction {friction:g}"
        brief.append(Table(f"contacts_{friction:g}_brief", title, tuple(pairs)))
    tables = [*tables[:-1], *(replace(table, note=NOTE) for table in tables[-1:])]
    return [*tables, *brief, *([landing.landing_table(landings)] if landings else [])]


def _name(walker: str) -> str:
    return "gentle" if walker == GENTLE else label(walker)


def _spread(row: str, column: str, walks: Rows, key: str, unit: str) -> Cell:
    """Median, least and largest of the walks, in which a fall counts as more than any."""
    values = sorted(walk[key] if walk["ending"] == "completed" else np.inf for walk in walks)
    middle = float(np.median(values))
    if not np.isfinite(middle):
        return Cell(row, column, "fell", unit)
    finite = [value for value in values if np.isfinite(value)]
    return Cell(row, column, middle, unit, finite[0], finite[-1])
