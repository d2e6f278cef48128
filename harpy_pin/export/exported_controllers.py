"""What is exported of a controller, alone or with its gait, or of an estimator.

That is its record before the first tick, and the kernel of its tick.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.controllers.condensed import CondensedController
from harpy_pin.controllers.condensed_tick import CondensedTickRecord
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.governed import GovernedController
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.tick import BAD_SAMPLE, FALLBACK, VIOLATED
from harpy_pin.controllers.whole_body import WholeBodyController
from harpy_pin.errors import InputError
from harpy_pin.estimation.estimator import ESTIMATED, Estimator
from harpy_pin.estimation.record import EstimatorRecord
from harpy_pin.estimation.statuses import STATUS
from harpy_pin.estimation.tick import estimate
from harpy_pin.export.one_record import contact_step, paper_step, program_step
from harpy_pin.gaits.gait import GaitTarget, GaitTargetRecord
from harpy_pin.gaits.walking.measuring import measure
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.tick import begin_walk, walk_on
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.governors.erg import ExplicitReferenceGovernor
from harpy_pin.governors.rows import ForceRows
from harpy_pin.ground.surface import flat_terrain
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.record import Record, RecordOf, fields, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.model.terms import read_thrusts
from harpy_pin.wbc.active_set_warm_start import WarmStartedActiveSet
from harpy_pin.wbc.condensed.condensed_solver import CondensedStatus

MEASURED: tuple[str, ...] = ("q", "v", "foot_position", "foot_force")
"""What a controller may take of a state."""
LAW = ("joint_position", "joint_velocity", "joint_stiffness", "joint_damping")
"""Rows of the motors' law, see :class:`harpy_pin.model.state.Command`."""


PROGRAM_STATUSES = {"OPTIMAL": 0, "FALLBACK": FALLBACK}
"""Of a tick of the whole-body QP; without a solution it gives the last command for a while, then
the posture.
"""
GOVERNOR_STATUSES = {"SATISFIED": 0, "VIOLATED": VIOLATED}
"""Of a tick of a governor: whether its constraints hold with the command given."""


@dataclass(frozen=True)
class Exportable:
    """A controller or an estimator that can become C."""

    kind: str  # its short name, a part of the names in C
    title: str  # what it is, in words
    robot: Robot  # whose it is
    period: float  # time between ticks, s
    target: Record  # the gait's targets, or the velocity that the gait follows
    record: Record  # before the first tick
    step: Callable[..., int]  # the kernel of its tick
    inputs: Mapping[
        str, tuple[int, ...]
    ]  # names and shapes of what is measured, in the kernel's order
    outputs: Mapping[
        str, tuple[int, ...]
    ]  # names and shapes of the command's parts, or of the estimate's
    statuses: Mapping[str, int]  # what a tick's status says, by name
    # part of the record that has the command; empty where it is the record itself
    control: str = ""

    def command_of(self, record: Record) -> Record:
        """The part of a record that has the command."""
        return record[self.control] if self.control else record

    def outcome(self, record: Record) -> NDArray[np.float64]:
        """The numbers of the last command, in the order of :attr:`outputs`."""
        command = self.command_of(record)[0]
        parts = (
            command["motors"]["law"][LAW.index(name)] if name in LAW else command[name]
            for name in self.outputs
        )
        return np.concatenate([np.ravel(part) for part in parts])


def exportable(controller: object) -> Exportable:
    """What is exported of a controller or an estimator, with its gait and settings; it is not
    changed.

    One that is not this library's, or that has a setting which is not exported, is an
    :class:`InputError`.
    """
    for kind, export in _EXPORTS.items():
        if isinstance(controller, kind):
            return export(controller)
    raise InputError(
        f"a {type(controller).__name__} cannot be exported", name="controller", value=controller
    )


def _condensed(controller: CondensedController) -> Exportable:
    _refuse_lags(controller.parameters)
    controller.reset()
    title, record = "condensed whole-body controller", controller._record_.copy()
    return _exportable(
        "condensed", title, controller, record, controller._step, CondensedStatus.__members__
    )


class VelocityCommandRecord(RecordOf):
    """What an exported walk is asked for."""

    velocity: Vector = sized(
        "entries"
    )  # (4,) forward, to the left, m/s, turning, rad/s, change of the height, m


class WalkTickRecord(RecordOf):
    """A walking gait, and the condensed whole-body controller behind it."""

    gait: WalkingRecord
    goal: GaitTargetRecord
    control: CondensedTickRecord


@cache
def walk_step(step: Kernel[int]) -> Kernel[int]:
    """The tick of a walk with a tick of the controller, the time since the last one (1,), s,
    instead of a clock.
    """

    @kernel
    def walk_and_control(
        r: WalkTickRecord,
        command: VelocityCommandRecord,
        elapsed: Vector,
        q: Vector,
        v: Vector,
        foot_force: Vector,
    ) -> int:
        gait = r.gait
        measure(gait, q, v, foot_force)
        gait.planned.command[:] = command.velocity
        if gait.measured.seen:
            span = elapsed[0] if elapsed[0] > 0.0 else 0.0
            if gait.time < 0.0:
                begin_walk(gait, 0.0)
                span = 0.0
            walk_on(gait, r.goal, span)
        return step(r.control, r.goal, q, v, foot_force)

    return walk_and_control


def exportable_walk(controller: object) -> Exportable:
    """What is exported of a condensed whole-body controller together with its walking gait.

    It is asked for a velocity. Another controller is an :class:`InputError`, and so is a gait of
    another class, on ground that is not level, or whose velocity is a script or a function.
    """
    if not isinstance(controller, CondensedController):
        raise InputError(
            f"a walk is exported with a CondensedController, not with a "
            f"{type(controller).__name__}",
            name="controller",
            value=controller,
        )
    gait, alone = controller.gait, exportable(controller)
    if not isinstance(gait, WalkingGait):
        raise InputError(
            f"a walk is exported with a WalkingGait, not with a {type(gait).__name__}",
            name="controller",
        )
    _refuse(
        bool(gait.script) or gait.calls(State(0.0, *controller._sample)) is None,
        "a script or function of velocities",
    )
    last = gait._record_
    _refuse(not last["terrain"]["level"][0], "a walk on ground that is not level")
    parts: Any = fields(last)
    parts |= {
        "terrain": flat_terrain(pieces=1, cells=1),
        "time": -1.0,
    }  # without room for other ground
    before = make_record(WalkingRecord, **parts)
    before["measured"]["seen"] = 0
    return replace(
        alone,
        kind="walk",
        title="walking gait and condensed whole-body controller",
        target=make_record(VelocityCommandRecord, {"entries": len(gait.command)}),
        record=make_record(
            WalkTickRecord,
            gait=before,
            goal=GaitTarget(len(gait.robot.feet))._record_,
            control=alone.record,
        ),
        step=walk_step(controller._step),
        inputs={"elapsed": (1,), **alone.inputs},
        control="control",
    )


def _refuse_lags(p: WholeBodyParameters) -> None:
    for name in ("thrust_lag", "thrust_turning_lag"):
        _refuse(getattr(p, name) > 0.0, f"a {name}")


def _program(controller: WholeBodyController) -> Exportable:
    p, problem = controller.parameters, controller.problem
    _refuse_lags(p)
    _refuse(controller.added is not None, "a program with added tasks")
    _refuse(controller._in_python, "a whole-body QP by another solver than 'active_set'")
    fresh = type(problem)(problem.robot, problem.weights, problem.limits)
    program = fresh.program
    search = WarmStartedActiveSet(program)
    controller.reset()
    record = make_record(
        None,
        control=controller._record_,
        problem=fresh._record_,
        terms=fresh.terms,
        program=program._record_,
        search=search._record_,
        dual=search.dual._record_,
    )
    title = f"whole-body QP, own search, formulation '{p.formulation}'"
    step = program_step(controller._step)
    return _exportable("wbc", title, controller, record, step, PROGRAM_STATUSES)


def _governed(controller: GovernedController) -> Exportable:
    governor, behind = controller.governor, controller.force_filter
    paper = isinstance(governor, ExplicitReferenceGovernor) and isinstance(governor.rows, ForceRows)
    _refuse(
        controller.parameters.legs != "pid", f"the leg control law '{controller.parameters.legs}'"
    )
    _refuse(
        controller.friction is not None, "the paper's controller with an estimate of the friction"
    )
    _refuse(
        (not paper or behind is not None) and (governor is not None or behind is None),
        "this pair of governors",
    )
    controller.reset()
    parts: dict[str, Any] = {"control": controller._record_}
    if behind is None:
        assert isinstance(governor, ExplicitReferenceGovernor)
        assert isinstance(governor.rows, ForceRows)
        parts |= {"governor": governor._record, "rows": governor.rows._record_}
        record: Record = make_record(None, **parts)
        kind, title, step = "paper", "the paper's reference governor", paper_step
    else:
        behind.reset()
        parts |= {
            "dynamics": behind.dynamics._record_,
            "terms": behind.terms,
            "governor": behind._record_,
        }
        record = make_record(None, **parts)
        kind, title, step = (
            "filter",
            "the paper's controller behind the contact-force filter",
            contact_step,
        )
    return _exportable(kind, title, controller, record, step, GOVERNOR_STATUSES)


@kernel
def estimate_after(
    r: EstimatorRecord,
    goal: GaitTargetRecord,
    elapsed: Vector,
    gyroscope: Vector,
    accelerometer: Vector,
    joint_position: Vector,
    joint_velocity: Vector,
    torque: Vector,
    normal_force: Vector,
    thrust: Vector,
    acceleration: Vector,
) -> int:
    """One step, the time since the last one (1,), s, instead of a clock, which single precision
    would round.

    ``goal`` are the gait's targets of the last tick, ``thrust`` (thrusters, 3) is in world axes, N,
    ``acceleration`` (nv,) the intended one, NaN where there is none.
    """
    read_thrusts(r.dynamics, thrust, r.thrust)
    r.intended[:] = acceleration
    status = estimate(
        r,
        elapsed[0],
        gyroscope,
        accelerometer,
        joint_position,
        joint_velocity,
        torque,
        normal_force,
        goal.stance,
        goal.phase,
        goal.ground_height,
    )
    r.t = 0.0
    return status


def _estimator(estimator: Estimator) -> Exportable:
    robot = estimator.robot
    estimator.reset()
    feet, joints, record = len(robot.feet), (len(robot.joints),), estimator._record_.copy()
    record["t"] = 0.0
    inputs: dict[str, tuple[int, ...]] = {"elapsed": (1,), "gyroscope": (3,), "accelerometer": (3,)}
    inputs |= dict.fromkeys(("joint_position", "joint_velocity", "joint_torque"), joints)
    inputs |= {"normal_force": (feet,), "thrust": (len(robot.thrusters), 3)}
    inputs["acceleration"] = (robot.nv,)
    outputs = {name: record[name].shape[1:] for name in ESTIMATED}
    statuses = {text.upper().replace(" ", "_"): code for code, text in STATUS.items()}
    target = GaitTarget(feet)._record_
    about = "estimator", "state estimator", robot, estimator.period, target
    return Exportable(*about, record, estimate_after, inputs, outputs, statuses)


def _exportable(
    kind: str,
    title: str,
    controller: GaitController,
    record: Record,
    step: Callable[..., int],
    statuses: Mapping[str, int],
) -> Exportable:
    robot = controller.robot
    feet = len(robot.feet)
    shapes = {
        "q": (robot.nq,),
        "v": (robot.nv,),
        "foot_position": (feet, 3),
        "foot_force": (feet, 3),
    }
    names = MEASURED if kind in ("paper", "filter") else ("q", "v", "foot_force")
    statuses = {name: int(status) for name, status in statuses.items()} | {"BAD_SAMPLE": BAD_SAMPLE}
    inputs = {name: shapes[name] for name in names}
    control = "" if kind == "condensed" else "control"
    joints = (len(robot.joints),)
    outputs: dict[str, tuple[int, ...]] = {"torque": joints, "thrust": (len(robot.thrusters), 3)}
    if "motors" in ((record[control] if control else record).dtype.names or ()):
        outputs |= dict.fromkeys(LAW, joints)
    target = GaitTarget(feet)._record_
    about = kind, title, robot, controller.period, target
    return Exportable(*about, record, step, inputs, outputs, statuses, control)


def _refuse(found: bool, what: str) -> None:
    if found:
        raise InputError(f"{what} cannot be exported", name="controller")


_EXPORTS: dict[type, Callable[[Any], Exportable]] = {
    CondensedController: _condensed,
    WholeBodyController: _program,
    GovernedController: _governed,
    Estimator: _estimator,
}
