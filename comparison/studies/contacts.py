"""Walk on contact models that are not ours.

MuJoCo's own contact and what is advised against its slip, and spheres as feet, beside ours.
MuJoCo's friction creeps: a foot inside the cone moves with a velocity that its force sets. This
part of the slip is known in closed form, and the tables take it from the rest. Friction, and the
stiffness that the weight finds, are known to controllers and gait. This takes many
minutes.
"""

from functools import cache, partial
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import BEST, OWN, controller_part, label
from comparison.studies.grounds import ending_and_slip
from comparison.study import (
    STARTS,
    Cell,
    Job,
    Rows,
    Study,
    View,
    as_far_as_it_goes,
    cell_text,
    grid,
    start_velocity,
    starts,
)
from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco import MujocoPlant, SoftContact

CONTACTS: dict[str, hp.scenario.PlantPart] = {
    "ours": hp.scenario.Compliant(),
    "MuJoCo stiff": hp.Mujoco("stiff"),
    "MuJoCo default": hp.Mujoco("default"),
    "default, 5 mm": hp.Mujoco("default", foot_radius=0.005),
    "default, 10 mm": hp.Mujoco("default", foot_radius=0.01),
    "default, 20 mm": hp.Mujoco("default", foot_radius=0.02),
    "MuJoCo elliptic": hp.Mujoco("elliptic"),
    "menagerie, 20 mm": hp.Mujoco("menagerie", foot_radius=0.02),
}
"""Contact models by name; lengths are the radius of the feet, which are points otherwise."""
CAREFUL = 0.4
"""Share of the ground's friction that :data:`GENTLE` assumes."""
GENTLE = "condensed/gentle"
WALKERS = ("governed/none", "governed/paper", BEST, "governed/filter", "condensed", OWN, GENTLE)
SLIDING = 5e-3
"""Speed beyond the creep from which on a foot counts as sliding, m/s."""
HELD = 1e-9
"""Forces below do not count, N."""


def _measured(job: Job) -> dict[str, Any]:
    friction, walker = job["friction"], job["walker"]
    scenario = hp.Scenario(
        gait=hp.Straight(stiffness=_stiffness(job["contact"], friction)),
        controller=controller_part(
            *(("condensed", CAREFUL * friction) if walker == GENTLE else (walker,))
        ),
        plant=CONTACTS[job["contact"]],
        ground=hp.Ground(mu_s=friction),
        disturbances=hp.Disturbances(start_velocity=start_velocity(job)),
        duration=job["duration"],
    )
    built = hp.build(scenario)
    return _kept(as_far_as_it_goes(built.run), built.simulator)


@cache
def _stiffness(contact: str, friction: float) -> float:
    """Of the ground as the weight finds it, N/m."""
    return hp.build(
        hp.Scenario(plant=CONTACTS[contact], ground=hp.Ground(mu_s=friction))
    ).simulator.ground.stiffness


def _kept(run: hp.Run, plant: hp.simulation.Plant) -> dict[str, Any]:
    """Beside ending and slip, creep in the same unit and the share of the time on the ground in
    which feet slide.
    """
    end, period = float(run.metadata["end_time"]), float(run.metadata["control_period"])
    steps = max(end / hp.gaits.GaitParameters().step_duration, 1.0)
    touching = run["foot_force"][1:, :, 2] > HELD
    creeping = _creep_speed(run, plant) * touching
    way = np.diff(run["slip_path"], axis=0)
    sliding = (way / period - creeping > SLIDING) & touching
    return ending_and_slip(run) | {
        "creep_mm": 1e3 * period * float(creeping.sum()) / steps,
        "sliding": float(sliding.sum()) / max(int(touching.sum()), 1),
    }


def _creep_speed(run: hp.Run, plant: hp.simulation.Plant) -> Vector:
    """(ticks - 1, feet) speed at which feet creep under their forces, m/s."""
    force, depth = run["foot_force"][1:], -run["foot_position"][1:, :, 2]
    if not isinstance(plant, MujocoPlant) or plant.contact is None:
        return np.zeros(depth.shape)
    velocity = creep(
        plant.contact, force, depth, inverse_mass=plant.inverse_mass, friction=plant.ground.mu_s
    )
    speed: Vector = np.linalg.norm(velocity, axis=-1)
    return speed


def creep(
    contact: SoftContact, force: Vector, depth: Vector, *, inverse_mass: Vector, friction: float
) -> Vector:
    """Velocity of feet that creep steadily under forces inside the friction cone, m/s.

    The closed form is that of :mod:`harpy_pin.simulation.mujoco.soft_contact`.

    Args:
        contact: of MuJoCo.
        force: (..., 3) of the ground on the feet, along x, y and the normal, N; a pyramid's edges
            are those axes.
        depth: (...) of the feet, m.
        inverse_mass: (...) MuJoCo's own estimate for the feet's bodies, ``body_invweight0``, 1/kg.
        friction: coefficient.

    Returns:
        (..., 2) along x and y.
    """
    regularisation = np.asarray(contact.regularisation(depth, inverse_mass, friction))[..., None]
    rate, along = regularisation / (contact.impratio * contact.damping_rate), force[..., :2]
    if contact.cone == "elliptic" or friction == 0.0:
        return np.asarray(-rate * along)
    edges, load = np.abs(along) / friction, force[..., 2]
    share = np.maximum(np.minimum(0.25 * load, 0.5 * (load - edges.max(axis=-1))), 0.0)[..., None]
    moved = np.where(edges <= 2.0 * share, 0.5 * edges, edges - share)
    return np.asarray(-rate * np.sign(along) * 2.0 * friction * moved)


def _name(row: dict[str, Any]) -> str:
    return "gentle" if row["walker"] == GENTLE else label(row["walker"])


def _spread(name: str, rows: Rows, scale: float = 1.0) -> Cell:
    """Median, least and largest of the walks, in which a fall counts as more than any."""
    values = sorted(scale * row[name] if row["ending"] == "completed" else np.inf for row in rows)
    middle = float(np.median(values))
    if not np.isfinite(middle):
        return Cell("", "", "fell")
    return Cell("", "", middle, "", values[0], max(value for value in values if np.isfinite(value)))


def _pair(rows: Rows) -> str:
    medians = (_spread(name, rows).value for name in ("path_mm", "net_mm"))
    return " / ".join(cell_text(Cell("", "", value)) for value in medians)


STUDY = Study(
    name="contacts",
    help=__doc__,
    example="--out contacts.jsonl",
    defaults={
        **STARTS,
        **{"starts": 3, "duration": 4.0, "seed": 700},
        **{"contacts": tuple(CONTACTS), "walkers": WALKERS, "frictions": (0.25, 0.15)},
    },
    quick={
        "contacts": ("ours", "MuJoCo default"),
        "frictions": (0.25,),
        "starts": 1,
        "duration": 1.5,
    },
    jobs=lambda s: grid(contact=s.contacts, friction=s.frictions, walker=s.walkers, **starts(s)),
    measure=_measured,
    views=[
        View(
            "contacts_{friction:g}",
            "Contact models, friction {friction:g}",
            row=lambda row: f"{row['contact']}: {_name(row)}",
            columns={
                "fell": lambda rows: (
                    f"{sum(row['ending'] != 'completed' for row in rows)} of {len(rows)}"
                ),
                **{
                    name: (partial(_spread, f"{name}_mm"), "mm")
                    for name in ("path", "creep", "net")
                },
                "sliding": (partial(_spread, "sliding", scale=1e2), "%"),
            },
            note="Median over the walks, with the least and the largest; a fall counts as more "
            "than any. Per step of "
            "the walk, both feet: path; what of it is creep by the contact's own law, from the "
            "forces; net "
            "displacement. Sliding: share of the feet's time on the ground in which they move "
            "faster than they creep "
            "by 5 mm/s. Gentle: the condensed WBC, which assumes 0.4 of the friction.",
        ),
        View(
            "contacts_{friction:g}_brief",
            "Median path / net displacement, mm, friction {friction:g}",
            row="{contact}",
            across=_name,
            columns=_pair,
        ),
    ],
    only="contacts",
)
