"""Walk with late and noisy measurements.

The paper's joint PID, legs with feedforward, the condensed controller and the whole-body QP by own
search, beside the delays that a linear argument allows. The gains of the legs with feedforward were
chosen on walks at friction 0.5 and 0.3; what is walked here is at other friction, and with noise.
"""

from collections.abc import Iterator
from typing import Any

import harpy_pin as hp
from comparison.contenders import published_parameters
from comparison.studies.margins import joint_loop, joint_mobility, pd_delay_margin
from comparison.study import Cell, Job, Rows, Study, Table, View, grid, kept, walk_as_far_as_it_goes

JOINTS = ("hip, frontal", "hip, sagittal", "knee")
WALKERS: dict[str, hp.scenario.ControllerPart] = {
    **{
        f"{legs}, {name}": hp.Governed(governor=name, parameters={"legs": legs.lower()})
        for legs in ("PID", "feedforward")
        for name in ("none", "paper", "filter")
    },
    "condensed WBC": hp.Condensed(),
    "QP": hp.WholeBody(parameters={"solver": "active_set"}),
}


def _jobs(s: Any) -> Iterator[Job]:
    """Every walker with every delay, then with every noise."""
    cases = [*grid(delay_ms=s.delays, noise=0.0), *grid(delay_ms=0, noise=s.noises)]
    for one in grid(friction=s.frictions, walker=WALKERS, case=cases, duration=s.duration):
        yield one.pop("case") | one


def _measured(job: Job) -> dict[str, Any]:
    scenario = hp.Scenario(
        ground=hp.Ground(mu_s=job["friction"]),
        disturbances=hp.Disturbances(
            delay=job["delay_ms"] * 1e-3, noise=hp.Noise.typical(job["noise"])
        ),
        controller=WALKERS[job["walker"]],
        duration=job["duration"],
    )
    run = walk_as_far_as_it_goes(scenario)
    found = kept(run, "slip_mm_per_step")
    return found | {"fell_s": float(run.metadata["end_time"]) if found.pop("fell") else None}


def _slip_or_fall(rows: Rows) -> Cell:
    (row,) = rows
    if row["fell_s"] is None:
        return Cell("", "", row["slip_mm_per_step"], "mm")
    return Cell("", "", f"fell, {row['fell_s']:.2f} s")


def _of_joints(rows: Rows) -> Iterator[Table]:
    """Delay margins of the joints under the two leg laws."""
    robot = hp.load_harpy()
    q = hp.make_gait(robot, stiffness=hp.Ground().stiffness).initial_state()[0]
    p = hp.controllers.GovernedParameters()
    pid = (p.joints.k_p * 2, p.joints.k_d * 2)
    swing = (p.feedforward.swing_p * 2, p.feedforward.swing_d * 2)
    stance = (
        p.feedforward.stance_p + p.feedforward.swing_p,
        p.feedforward.stance_d + p.feedforward.swing_d,
    )

    def margins(place: str, held: tuple[str, ...], **joints: Any) -> Iterator[Cell]:
        for name, (k_p, k_d) in (("PID", pid), ("feedforward", stance if held else swing)):
            loop = joint_loop(robot, q, k_p=k_p, k_d=k_d, held=held, **joints)
            yield Cell(place, f"margin, {name}", 1e3 * loop.delay_margin(), "ms")

    cells = []
    for phase, held in (("in the air", ()), ("on the ground", ("left_foot",))):
        mobility = joint_mobility(robot, q, held=held)
        for j, joint in enumerate(JOINTS):
            place = f"{joint}, {phase}"
            cells.append(Cell(place, "apparent inertia", 1.0 / float(mobility[j, j]), "kg m²"))
            cells += margins(place, held, joints=(j,))
    cells += [
        *margins("all joints, in the air", ()),
        *margins("all joints, one foot on the ground", ("left_foot",)),
    ]
    note = (
        "Gains held over 1 ms. The walk can bear no more delay than the smallest margin of its "
        "joints."
    )
    yield Table(
        "delay_joints", "Delay margins of the joint loops at the gait's posture", tuple(cells), note
    )


def _of_tasks(rows: Rows) -> Iterator[Table]:
    """Delay margins of the accelerations that condensed WBC and QP command."""
    p = published_parameters()
    gains = {
        "body": p.body,
        "orientation": p.orientation,
        "swing foot": p.swing,
        "velocity of a held foot": (0.0, p.contact_damping),
    }
    cells = []
    for name, (k_p, k_d) in gains.items():
        margin = 1e3 * pd_delay_margin(k_p, k_d, period=p.period)
        cells += [
            Cell(name, "k_p", k_p, "1/s²"),
            Cell(name, "k_d", k_d, "1/s"),
            Cell(name, "margin", margin, "ms"),
        ]
    note = "In closed form. A held foot is at rest whatever is commanded; "
    note += "its row is for a foot that the ground lets move."
    yield Table(
        "delay_tasks", "Delay margins of the tasks of condensed WBC and QP", tuple(cells), note
    )


STUDY = Study(
    name="delay",
    help=__doc__,
    defaults={
        "frictions": (0.8, 0.25),
        "delays": (0, 1, 2, 3, 4, 5, 8, 30, 40),  # of the measurements, ms
        "noises": (0.5, 1.0),  # as multiples of the typical ones, walked without delay
        "duration": 6.0,  # s
    },
    quick={"frictions": (0.8,), "delays": (0, 2), "noises": (1.0,), "duration": 1.0},
    jobs=_jobs,
    measure=_measured,
    views=[
        _of_joints,
        _of_tasks,
        View(
            "delay_walks_{friction:g}",
            "Walks at friction {friction:g}: slip per step, mm, or when the robot fell",
            row="{walker}",
            across=lambda row: (
                f"{row['noise']:g} × noise" if row["noise"] else f"{row['delay_ms']} ms"
            ),
            columns=_slip_or_fall,
        ),
    ],
)
