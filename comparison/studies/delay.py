"""How much delay and noise each kind of leg law bears: what a linear argument predicts, beside walks.

The gains of the leg law with feedforward were chosen on walks at friction 0.5 and 0.3; what is walked here is at other
friction, and with noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from comparison.measure.walking import Rows, grouped, walk_as_far_as_it_goes
from comparison.studies.margins import joint_loop, joint_mobility, pd_delay_margin
from comparison.study import Job, Study, crossed
from comparison.tables import Cell, Table
from harpy_pin import Condensed, Disturbances, Governed, Ground, Scenario, WholeBody, build, load_harpy, measure
from harpy_pin.controllers import WholeBodyParameters
from harpy_pin.controllers.parameters import GovernedParameters
from harpy_pin.gaits.straight import make_gait
from harpy_pin.model.contact_map import ContactForceMap
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import State, Vector
from harpy_pin.scenario import ControllerPart
from harpy_pin.simulation.sensors import Noise

JOINTS = ("hip, frontal", "hip, sagittal", "knee")
_FEEDFORWARD = {"legs": "feedforward"}
WALKERS: dict[str, ControllerPart] = {
    "PID, none": Governed(governor="none"),
    "PID, paper": Governed(governor="paper"),
    "PID, filter": Governed(governor="filter"),
    "feedforward, none": Governed(governor="none", parameters=_FEEDFORWARD),
    "feedforward, paper": Governed(governor="paper", parameters=_FEEDFORWARD),
    "feedforward, filter": Governed(governor="filter", parameters=_FEEDFORWARD),
    "condensed WBC": Condensed(),
    "QP": WholeBody(),
}
MIDSTANCE = 0.5
"""When forces are looked at, s: the left foot carries alone."""
FORWARD = "feedforward"


def _jobs(s: Any) -> Iterator[Job]:
    """Every walker with every delay, then with every noise."""
    cases = [(delay, 0.0) for delay in s.delays] + [(0, noise) for noise in s.noises]
    for friction, who, (delay, noise) in product(s.frictions, WALKERS, cases):
        yield {"friction": friction, "walker": who, "delay_ms": delay, "noise": noise, "duration": s.duration}


def _measured(job: Job) -> dict[str, Any]:
    """When it fell, and its slip."""
    scenario = Scenario(
        ground=Ground(mu_s=job["friction"]),
        disturbances=Disturbances(delay=job["delay_ms"] * 1e-3, noise=Noise.typical(job["noise"])),
        controller=WALKERS[job["walker"]],
        duration=job["duration"],
    )
    run = walk_as_far_as_it_goes(scenario)
    fell = None if run.ending == "completed" else float(run.metadata["end_time"])
    return {"fell_s": fell, "slip_mm_per_step": measure(run).slip_mm_per_step}


def _place(row: dict[str, Any]) -> str:
    return f"{row['noise']:g} × noise" if row["noise"] else f"{row['delay_ms']} ms"


def _slip_or_fall(rows: Rows) -> Cell:
    (row,) = rows
    if row["fell_s"] is None:
        return Cell("", "", row["slip_mm_per_step"], "mm")
    return Cell("", "", f"fell, {row['fell_s']:.2f} s")


def _tables(rows: Rows) -> list[Table]:
    """Predicted margins of joints and tasks, forces by noise, and the walks."""
    return [_joint_table(), _task_table(), _force_table()] + [
        crossed(
            f"delay_walks_{friction:g}", f"Walks at friction {friction:g}: slip per step, mm, or when the robot fell",
            here, lambda row: row["walker"], _place, _slip_or_fall,
        )
        for (friction,), here in grouped(rows, "friction").items()
    ]  # fmt: skip


def _joint_table() -> Table:
    """Delay margins of the joints under the two leg laws."""
    robot = load_harpy()
    q = make_gait(robot, stiffness=Ground().stiffness).initial_state()[0]
    p = GovernedParameters()
    pid = (p.joints.k_p * 2, p.joints.k_d * 2)
    swing = (p.feedforward.swing_p * 2, p.feedforward.swing_d * 2)
    stance = (p.feedforward.stance_p + p.feedforward.swing_p, p.feedforward.stance_d + p.feedforward.swing_d)

    def margins(place: str, held: tuple[str, ...], **joints: Any) -> Iterator[Cell]:
        for name, (k_p, k_d) in (("PID", pid), (FORWARD, stance if held else swing)):
            loop = joint_loop(robot, q, k_p=k_p, k_d=k_d, held=held, **joints)
            yield Cell(place, f"margin, {name}", 1e3 * loop.delay_margin(), "ms")

    cells = []
    for phase, held in (("in the air", ()), ("on the ground", ("left_foot",))):
        mobility = joint_mobility(robot, q, held=held)
        for j, joint in enumerate(JOINTS):
            place = f"{joint}, {phase}"
            cells.append(Cell(place, "apparent inertia", 1.0 / float(mobility[j, j]), "kg m²"))
            cells += margins(place, held, joints=(j,))
    cells += [*margins("all joints, in the air", ()), *margins("all joints, one foot on the ground", ("left_foot",))]
    note = "Gains held over 1 ms. The walk can bear no more delay than the smallest margin of its joints."
    return Table("delay_joints", "Delay margins of the joint loops at the gait's posture", tuple(cells), note)


def _task_table() -> Table:
    """Delay margins of the accelerations that condensed WBC and QP command."""
    p = WholeBodyParameters()
    gains = {
        "body": p.body,
        "orientation": p.orientation,
        "swing foot": p.swing,
        "velocity of a held foot": (0.0, p.contact_damping),
    }
    cells = []
    for name, (k_p, k_d) in gains.items():
        cells.append(Cell(name, "k_p", k_p, "1/s²"))
        cells.append(Cell(name, "k_d", k_d, "1/s"))
        cells.append(Cell(name, "margin", 1e3 * pd_delay_margin(k_p, k_d, period=p.period), "ms"))
    note = (
        "In closed form. A held foot is at rest whatever is commanded; its row is for a foot that the ground lets move."
    )
    return Table("delay_tasks", "Delay margins of the tasks of condensed WBC and QP", tuple(cells), note)


def force_gain(step: Callable[[State], Any], state: State, *, touching: ArrayLike) -> Vector:
    """How the contact force follows errors of the measured configuration and velocity.

    The command is a function of the measured state, and the force on feet that stick is affine in the command. So for
    small errors δ the force changes by ∂f/∂y · ∂y/∂x̂ δ, the derivative of the command by central differences.

    The controller whose ``step`` is given must keep nothing from tick to tick.

    Returns:
        (3 feet, 2 nv) newtons per unit of error, q in the tangent space (body axes).
    """
    robot = load_harpy()
    model, dynamics, contact = robot.model, Dynamics(robot), ContactForceMap(robot)
    dynamics.update(state.q, state.v)
    zero_torque, zero_thrust = np.zeros(len(robot.joints)), np.zeros((len(robot.thrusters), 3))
    contact.update(dynamics, state.v, torque=zero_torque, thrust=zero_thrust, touching=touching)

    def command(error: Vector) -> Vector:
        given = step(_erring(state, error))
        return np.concatenate((given.thrust.ravel(), given.torque))

    small = 1e-6
    slopes = [(command(small * e) - command(-small * e)) / (2.0 * small) for e in np.eye(2 * model.nv)]
    gain: Vector = np.hstack((contact.thrust_gain, contact.torque_gain)) @ np.array(slopes).T
    return gain


def cone_margins(gain: Vector, error: Vector, mu: float, *, deviations: float | None = None) -> Vector:
    """By how much each face of a foot's pyramid has to be tightened, so that errors do not carry the force across.

    A face is aᵀf ≥ 0 with a = (∓1, 0, μ) or (0, ∓1, μ). With |δⱼ| ≤ eⱼ the force moves across it by at most
    Σⱼ |aᵀG|ⱼ eⱼ; with independent Gaussian errors of deviations eⱼ it moves by a Gaussian of deviation ‖aᵀG diag(e)‖.

    Args:
        gain: (3, n) G of one foot, see :func:`force_gain`.
        error: (n,) bounds or standard deviations.
        mu: friction coefficient.
        deviations: how many standard deviations are to be covered; none for bounds.

    Returns:
        (4,) margins of the faces +x, −x, +y, −y, N.
    """
    faces = np.array([[-1.0, 0.0, mu], [1.0, 0.0, mu], [0.0, -1.0, mu], [0.0, 1.0, mu]])
    share = np.abs(faces @ gain) * error
    margins: Vector = share.sum(axis=1) if deviations is None else deviations * np.sqrt((share**2).sum(axis=1))
    return margins


def _erring(state: State, error: Vector) -> State:
    """The state as measured with an error of configuration and velocity."""
    robot = load_harpy()
    nv = robot.model.nv
    q, v = pin.integrate(robot.model, state.q, error[:nv]), state.v + error[nv:]
    dynamics = Dynamics(robot)
    dynamics.update(q, v)
    position, velocity = dynamics.foot_position.copy(), dynamics.foot_velocity.copy()
    return State(state.t, q, v, position, velocity, state.foot_force.copy())


def memoryless(who: str, friction: float) -> tuple[Callable[[State], Any], State]:
    """A walker without integral part, and a true state of its walk in the middle of a stance."""
    controller = WALKERS[who]
    if isinstance(controller, Governed):
        controller = replace(controller, parameters={**controller.parameters, "joints": {"k_i": (0.0, 0.0, 0.0)}})
    built = build(Scenario(controller=controller, ground=Ground(mu_s=friction), duration=MIDSTANCE))
    built.run()
    return built.controller.step, built.simulator.state


def _force_table() -> Table:
    """Forces that typical noise makes, and the margins that cover them."""
    noise, cells = Noise.typical(), []
    levels = (noise.position, noise.orientation, noise.joint_position)
    rates = (noise.velocity, noise.angular_velocity, noise.joint_velocity)
    deviation = np.repeat((*levels, *rates), (3, 3, 6, 3, 3, 6))
    for who in ("PID, none", "feedforward, none", "condensed WBC"):
        step, state = memoryless(who, 0.25)
        gain = force_gain(step, state, touching=state.foot_force[:, 2] > 1.0)[:3]
        spread = np.sqrt(((gain * deviation) ** 2).sum(axis=1))
        for axis, value in zip("xyz", spread, strict=True):
            cells.append(Cell(who, f"deviation of f_{axis}", float(value), "N"))
        only = np.where(np.arange(24) < 3, deviation, 0.0)
        cells.append(Cell(who, "of f_x by position alone", float(np.sqrt(((gain[0] * only) ** 2).sum())), "N"))
        margins = cone_margins(gain, deviation, 0.25, deviations=3.0)
        cells.append(Cell(who, "margin, 3 deviations", float(margins.max()), "N"))
    title = "Contact force that typical noise makes through the command, one foot on the ground at 0.25"
    return Table(
        "delay_force", title, tuple(cells), "Linear, at one state: not over time, and not across changes of contact."
    )


STUDY = Study(
    name="delay",
    help="""Walk with late and noisy measurements.

    The paper's joint PID, legs with feedforward, the condensed controller and the whole-body QP, beside the delays that
    a linear argument allows.
    """,
    defaults={
        "frictions": (0.8, 0.25),
        "delays": (0, 1, 2, 3, 4, 5, 8, 30, 40),  # of the measurements, ms
        "noises": (0.5, 1.0),  # as multiples of the typical ones, walked without delay
        "duration": 6.0,  # s
    },
    quick={"frictions": (0.8,), "delays": (0, 2), "noises": (1.0,), "duration": 1.0},
    jobs=_jobs,
    measure=_measured,
    tables=_tables,
)
