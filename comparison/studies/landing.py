"""Go2 on contacts of other stiffness: in which part of a stance its feet slip."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from comparison.measure.walking import Rows
from comparison.study import shown, tabulated
from comparison.tables import Table
from harpy_pin import Ground, Mujoco, Scenario, Walking, build
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector
from harpy_pin.scenario import Compliant, PlantPart

RADIUS = 0.022
"""Of Go2's feet, m."""
SOFT, MENAGERIE = "ours, as soft", "menagerie, 22 mm"
LANDINGS: dict[str, PlantPart] = {
    "ours": Compliant(),
    SOFT: Compliant(),
    "elliptic, 22 mm": Mujoco("elliptic", foot_radius=RADIUS),
    MENAGERIE: Mujoco("menagerie", foot_radius=RADIUS),
    "menagerie, points": Mujoco("menagerie"),
}
"""Contact models by name. MuJoCo's have the same cone, ``impratio`` and time constant, and another impedance."""
WALKERS = {"condensed": "condensed WBC", "wbc": "WBC QP"}
"""Controllers, with their names for readers."""
FRICTIONS = (0.6, 0.25)
LANDING = 0.05
"""First part of a stance, s."""
STIFFNESS = 79e3
"""Of our ground: two feet sink in by 1 mm under Go2, N/m."""
HELD = 1e-9
"""Forces below are none, N."""
_NOTE = (
    "One walk of each controller at 0.3 m/s. Sinks: median of the feet in stance. Path per step of the walk, all feet: "
    "while the gait has the foot in the air, in the first 50 ms of its stance, later; creep is the contact's own, by "
    "its closed form. As soft: our ground with the stiffness that the weight finds in Menagerie's contact."
)


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
    """Where the slip of a walk is made.

    Args:
        run: its log.
        creep: (ticks - 1, feet) speed of creep, m/s.
    """
    period, steps = float(run.metadata["control_period"]), max(int(run["steps"].max()), 1)
    stance, way = run["stance"][1:] > 0, np.diff(run["slip_path"], axis=0)
    touching = run["foot_force"][1:, :, 2] > HELD
    age = np.zeros(stance.shape)
    for i in range(len(stance)):
        age[i] = (age[i - 1] + 1.0) * stance[i] if i else stance[i]
    landing = stance & (age * period <= LANDING)
    parts = {"air_mm": ~stance, "landing_mm": landing, "stance_mm": stance & ~landing}
    return {
        "ending": run.ending,
        "sinks_mm": -1e3 * float(np.median(run["foot_position"][1:, :, 2][touching & stance])),
        "path_mm": 1e3 * float(way.sum()) / steps,
        **{name: 1e3 * float(way[part].sum()) / steps for name, part in parts.items()},
        "creep_mm": 1e3 * period * float((creep * touching).sum()) / steps,
    }


COLUMNS: dict[str, Any] = {
    "sinks": (shown("sinks_mm"), "mm"),
    "path": (lambda rows: rows[0]["path_mm"] if rows[0]["ending"] == "completed" else "fell", "mm"),
    "in the air": (shown("air_mm"), "mm"),
    "landing": (shown("landing_mm"), "mm"),
    "later": (shown("stance_mm"), "mm"),
    "creep": (shown("creep_mm"), "mm"),
}


def landing_table(rows: Rows) -> Table:
    """Path, and in which part of a stance it is made."""
    return tabulated(
        "contacts_landing", "Go2: in which part of a stance its feet slip", rows,
        lambda row: f"{row['contact']}, friction {row['friction']:g}: {WALKERS[row['walker']]}", COLUMNS, _NOTE,
    )  # fmt: skip
