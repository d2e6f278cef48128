"""The paper's controller: gait → governor → thruster feedback, inverse kinematics, joint PID →
contact-force filter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from importlib import import_module
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.friction import FrictionRecord, friction_record, update_friction
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.governed_tick import (
    actuate,
    control_record,
    limit_bent,
    measure,
    steps_of,
)
from harpy_pin.controllers.parameters import LEGS, GovernedParameters
from harpy_pin.controllers.tick import BAD_SAMPLE
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait
from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.erg import ExplicitReferenceGovernor
from harpy_pin.governors.governor import Governor
from harpy_pin.governors.rows import ForceRows
from harpy_pin.ground.contact_frame import in_contact_frames
from harpy_pin.model.entry import GOOD, as_array
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field, fields, make_record
from harpy_pin.model.state import State, Vector


@fixed_arrays("applied", "bent", "out_of_reach", "reference")
class GovernedController(GaitController):
    """Walks the paper's way.

    ``step`` is one compiled call for the paper's governor, for the contact-force filter, and
    without either. For both together, for a governor of your own and with an estimate of the
    friction, Python calls the same kernels one after the other. A state whose time, q, v, foot
    positions or forces are not all finite numbers is a bad sample, which
    :class:`~harpy_pin.controllers.gait_controller.GaitController` answers: it changes neither
    integrals nor references.

    Args:
        gait: where body and feet should be. Of one that never changes the controller takes a copy
            with targets of its own; every other gait serves one controller.
        governor: changes the body's reference for the thrusters; None applies it as it is.
        parameters: gains and switches.
        force_filter: changes the thrusts and joint torques that follow, for the contact forces of
            the full model.

    Attributes:
        target: the gait's targets of the last tick.
        reference: (6,) x_r of the last tick.
        applied: (6,) x_w of the last tick, before the contact-force filter.
        bent: (6,) x_w of the last tick after it: the reference of least change for which the
            thruster feedback gives the total thrust applied.
        out_of_reach: (2,) distance by which each foot target was out of reach in the last tick, m
            (then the leg goes to the nearest point).
        friction: the estimate of the friction coefficient, which the governors take; None without
            one.

    Raises:
        InputError: a robot with other joints than those of two legs of Harpy's kind, a commanded
            gait, or the friction is to be estimated and no governor takes it.
    """

    parameters: GovernedParameters
    _applied_: Vector
    _reference_: Vector

    @checked
    def __init__(
        self,
        gait: Gait,
        governor: Governor | None = None,
        parameters: GovernedParameters | None = None,
        *,
        force_filter: ContactForceFilter | None = None,
    ) -> None:
        given = GovernedParameters() if parameters is None else parameters
        p = checks.instance("parameters", given, GovernedParameters)
        if gait.not_governed:
            other = "walk this gait with 'condensed' or 'wbc'"
            message = f"the paper's controller {gait.not_governed}: {other}"
            raise InputError(message, name="gait", value=gait)
        super().__init__(gait, p)
        if len(self.robot.joints) != 6:
            raise InputError(
                f"this controller moves 6 joints, '{self.robot.name}' has {len(self.robot.joints)}"
            )
        self._governor, self._force_filter = governor, force_filter
        self._assumed = _assumed_friction(governor, force_filter) if p.estimate_friction else []
        self.friction: FrictionEstimator | None = None
        if p.estimate_friction:
            assumed = max(float(value.max()) / share for value, share in self._assumed)
            self.friction = FrictionEstimator(
                assumed=assumed, feet=len(self.robot.feet), period=p.period
            )
        record, self._actuate = control_record(p, self.robot), actuate
        if module := LEGS[p.legs]:
            self._actuate, parts = import_module(module).make_legs(self.gait, p)
            record = make_record(None, **fields(record), **parts)
        self._begin(record)
        self.reference: Vector = field(record, "reference")
        self.applied: Vector = self.reference if governor is None else governor.applied
        self.bent: Vector = field(record, "bent")
        self.out_of_reach: Vector = field(record, "out_of_reach")
        self._seen = field(record, "measured")
        self._signals |= {
            "joint_target": field(record, "joint_target"),
            "out_of_reach": self.out_of_reach,
        }
        self._signals["centre_of_pressure"] = self._seen[6:]
        if self.friction is not None:
            self._signals["friction_estimate"] = self.friction.estimate
        if force_filter is not None:
            self._signals |= {"demanded_force": force_filter.force, "bend": force_filter.bend}
        self._prepare()
        self.reset()

    def _rebuild(self) -> None:
        """See :meth:`GaitController._rebuild`: one kernel for this library's own governors, one
        at a time.
        """
        super()._rebuild()
        governor, force_filter = self._governor, self._force_filter
        steps = steps_of(self._actuate)
        self._step, self._parts, self._in_python = measure, (), True
        if self.friction is not None:
            return
        if governor is None and force_filter is None:
            self._step, self._in_python = steps["none"], False
        elif force_filter is None and type(governor) is ExplicitReferenceGovernor:
            if isinstance(governor.rows, ForceRows):
                self._step, self._in_python = steps["paper"], False
                self._parts = governor._record, governor.rows._record_
        elif governor is None and type(force_filter) is ContactForceFilter:
            self._step, self._in_python = steps["filter"], False
            self._parts = (
                force_filter.dynamics._record_,
                force_filter._terms_,
                force_filter._record_,
            )

    def _prepare(self) -> None:
        """Begin to compile the kernels of a tick."""
        record, target, example = self._record_, self.target._record_, State(0.0, *self._sample)
        self._step.prepare(record, target, *self._measured(example), *self._parts)
        if self._in_python:
            sample = example.q, example.v, example.foot_force
            self._actuate.prepare(record, target, self.applied, *sample)
            if self._force_filter is not None:
                limit_bent.prepare(record, self.applied, self._force_filter.bend)

    measured = ("q", "v", "foot_position", "foot_force")
    _measured = attrgetter(*measured)

    @property
    def governor(self) -> Governor | None:
        """Changes the body's reference for the thrusters."""
        return self._governor

    @governor.setter
    def governor(self, governor: Governor | None) -> None:
        self._governor = governor
        self._rebuild()

    @property
    def force_filter(self) -> ContactForceFilter | None:
        """Changes thrusts and torques for the contact forces of the full model."""
        return self._force_filter

    def reset(self) -> None:
        """Forget the integrals and the last command; the applied reference restarts at the
        target.
        """
        super().reset()
        for name in ("integral", "started"):
            self._record_[name] = 0
        self._seen[6:] = np.nan
        if self._governor is not None:
            self._governor.status.bad_samples = 0
        if self._force_filter is not None:
            self._force_filter.reset()
        if self.friction is not None:
            self.friction.reset()

    def _go_on(self, status: int, state: State) -> int:
        """Around governors of any kind, and an estimate of the friction, what follows the
        sample.
        """
        record, governor, force_filter = self._record_, self._governor, self._force_filter
        if self._verdict != GOOD:
            return BAD_SAMPLE
        if self.friction is not None:
            self._estimate(self.friction, state)
        if governor is not None:
            if not record["started"][0]:
                governor.reset(self._reference_)
                record["started"] = 1
            self._applied_ = governor.update(self._seen, self._reference_, self.period)
        sample = state.q, state.v, state.foot_force
        self._actuate(record, self.target._record_, self._applied_, *sample)
        if force_filter is not None:
            force_filter.normal[:] = self.target.normal
            force_filter.update(state, self._command)
            limit_bent(record, self._applied_, force_filter._bend_)
        return 0

    def _estimate(self, friction: FrictionEstimator, state: State) -> None:
        """Estimate the friction for the governors: each foot's where they know feet, else the
        lowest.
        """
        force, velocity = state.foot_force, state.foot_velocity
        if self._record_["tilted"][0]:
            force, velocity = (
                in_contact_frames(self.target.normal, vectors) for vectors in (force, velocity)
            )
        friction.update(force, velocity, self.target.stance)
        for assumed, share in self._assumed:
            assumed[:] = share * (friction.estimate if len(assumed) > 1 else friction.least)

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, x_w, planned stance, joint targets, and the governors' rows."""
        signals = {
            **super().telemetry(),
            "x_w": self.applied if self._force_filter is None else self.bent,
        }
        if self._governor is not None:
            signals |= self._governor.status.signals()
        if self._force_filter is not None:
            signals |= {
                f"contact_{name}": signal
                for name, signal in self._force_filter.status.signals().items()
            }
        return signals

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains and governor."""
        governor, force_filter = self.governor, self.force_filter
        return {
            **super().describe(),
            "governor": " + ".join(
                type(g).__name__ for g in (governor, force_filter) if g is not None
            )
            or "none",
            "force_filter": asdict(force_filter.parameters) if force_filter is not None else "none",
            "rows": list(governor.status.names) if governor is not None else [],
        }


@fixed_arrays("estimate", "least", "record")
class FrictionEstimator(KeepsViews):
    """The estimate of the friction coefficient for every foot of a robot
    (:mod:`harpy_pin.controllers.friction`).

    Args:
        assumed: coefficient that the estimate begins with and never exceeds.
        feet: how many.
        period: time between updates, s.

    Attributes:
        estimate: (feet,) μ̂ of the last update.
        least: (1,) lowest estimate of the feet that were loaded when one last did.

    Raises:
        InputError: a number out of its domain.
    """

    _record_: Records[FrictionRecord]

    def __init__(self, *, assumed: float, feet: int = 2, period: float = 1e-3) -> None:
        self.record = friction_record(assumed=assumed, feet=feet, period=period)
        self._initial = self.record.copy()
        self.estimate: Vector = field(self.record, "estimate")
        self.least: Vector = self.record["least"]
        self._feet = (len(self.estimate), 3)
        update_friction.prepare(
            self.record, np.zeros(self._feet), np.zeros(self._feet), np.zeros(self._feet[0])
        )

    def reset(self) -> None:
        """Begin with what is assumed."""
        self._record_[:] = self._initial

    def update(self, foot_force: Vector, foot_velocity: Vector, held: Vector) -> Vector:
        """Take one sample into account.

        Args:
            foot_force: (feet, 3) measured force of the ground on each foot, world axes, N.
            foot_velocity: (feet, 3) measured velocity of each foot, world axes, m/s.
            held: (feet,) other than zero where a foot is meant to stand on the ground; others are
                not looked at.

        Returns:
            (feet,) μ̂, the array :attr:`estimate` itself.

        Raises:
            InputError: an array of another shape, or not of numbers.
        """
        force = as_array("foot_force", foot_force, self._feet)
        velocity = as_array("foot_velocity", foot_velocity, self._feet)
        update_friction(self.record, force, velocity, as_array("held", held, self._feet[:1]))
        return self.estimate


def _assumed_friction(
    governor: Governor | None, force_filter: ContactForceFilter | None
) -> list[tuple[Vector, float]]:
    """The friction coefficients of governors, as arrays to write to, and the share of the assumed
    one that each is.
    """
    parts = (governor, getattr(governor, "rows", None), force_filter)
    found = [
        (getattr(part, "friction", None), getattr(part, "friction_share", 1.0)) for part in parts
    ]
    assumed = [(friction, share) for friction, share in found if friction is not None]
    if not assumed:
        raise InputError(
            "an estimate of the friction needs a governor that takes it", name="estimate_friction"
        )
    return assumed
