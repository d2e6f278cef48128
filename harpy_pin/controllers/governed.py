"""The paper's controller: gait → governor → thruster feedback, inverse kinematics, joint PID → contact-force filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.feedforward import FORWARD_STEPS, ForwardTickRecord, actuate_forward, forward_record
from harpy_pin.controllers.friction_estimator import FrictionEstimator
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.governed_tick import STEPS, actuate, control_record, limit_bent, measure
from harpy_pin.controllers.parameters import GovernedParameters
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import LONGEST, Gait
from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.erg import ExplicitReferenceGovernor
from harpy_pin.governors.governor import Governor
from harpy_pin.governors.rows import ForceRows
from harpy_pin.ground.contact_frame import in_contact_frames
from harpy_pin.model.entry import GOOD, as_state
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import field
from harpy_pin.model.state import Command, State, Vector

__all__ = ["GovernedController"]


@fixed_arrays("applied", "bent", "out_of_reach", "reference")
class GovernedController(GaitController):
    """Walks the paper's way.

    ``step`` is one compiled call for the paper's governor, for the contact-force filter, and without either. For both
    together, for a governor of your own and with an estimate of the friction it is a chain of :meth:`plan`,
    :meth:`govern`, :meth:`actuate` and :meth:`hold`, which may always be called (and timed) apart. A state whose time,
    q, v, foot positions or forces are not all finite numbers is a bad sample, which
    :class:`~harpy_pin.controllers.gait_controller.GaitController` answers: it changes neither integrals nor references.

    Args:
        gait: where body and feet should be; the controller takes its own copy of a library's gait, with targets of its
            own, so that one gait may serve several controllers.
        governor: changes the body's reference for the thrusters; None applies it as it is.
        parameters: gains and switches.
        force_filter: changes the thrusts and joint torques that follow, for the contact forces of the full model.

    Attributes:
        target: the gait's targets of the last tick.
        reference: (6,) x_r of the last tick.
        applied: (6,) x_w of the last tick, before the contact-force filter.
        bent: (6,) x_w of the last tick after it: the reference of least change for which the thruster feedback gives
            the total thrust applied.
        out_of_reach: (2,) distance by which each foot target was out of reach in the last tick, m (then the leg goes
            to the nearest point).
        friction: the estimate of the friction coefficient, which the governors take; None without one.

    Raises:
        InputError: a robot with other joints than those of two legs of Harpy's kind, a commanded gait, or the friction
            is to be estimated and no governor takes it.
    """

    _made_anew = (*GaitController._made_anew, "_actuate")
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
        parameters = GovernedParameters() if parameters is None else parameters
        self.parameters = p = checks.instance("parameters", parameters, GovernedParameters)
        why = getattr(gait, "not_governed", "")
        if why:
            message = f"the paper's controller {why}: walk this gait with 'condensed' or 'wbc'"
            raise InputError(message, name="gait", value=gait)
        super().__init__(gait, p.period)
        if len(self.robot.joints) != 6:
            raise InputError(f"this controller moves 6 joints, '{self.robot.name}' has {len(self.robot.joints)}")
        self._governor, self._force_filter = governor, force_filter
        if p.legs == "feedforward":
            record = control_record(p, self.robot, ForwardTickRecord, forward=forward_record(self.gait, p.feedforward))
        else:
            record = control_record(p, self.robot)
        self.reference: Vector = field(record, "reference")
        self.applied: Vector = self.reference if governor is None else governor.applied
        self.bent: Vector = field(record, "bent")
        self.out_of_reach: Vector = field(record, "out_of_reach")
        self._seen = field(record, "measured")
        self._joint_target = field(record, "joint_target")
        self._centre_of_pressure = self._seen[6:]
        self._assumed = _assumed_friction(governor, force_filter) if p.estimate_friction else []
        self.friction: FrictionEstimator | None = None
        if p.estimate_friction:
            assumed = max(float(value.max()) / share for value, share in self._assumed)
            self.friction = FrictionEstimator(p.friction, assumed=assumed, feet=len(self.robot.feet), period=p.period)
        self._begin(record)
        if not self._by_phases:
            self._step.prepare(record, self.target.record, *self._measured(State(0.0, *self._sample)), *self._parts)
        else:
            self._prepare_phases()
        self.reset()

    def _make_anew(self) -> None:
        """See :meth:`GaitController._make_anew`: one kernel for this library's own governors, one at a time."""
        super()._make_anew()
        governor, force_filter = self._governor, self._force_filter
        forward = "forward" in (self._record_.dtype.names or ())
        steps = FORWARD_STEPS if forward else STEPS
        self._actuate = actuate_forward if forward else actuate
        self._step, self._parts = steps["none"], ()
        self._by_phases = self.friction is not None
        if type(governor) is ExplicitReferenceGovernor and isinstance(governor.rows, ForceRows):
            self._step, self._parts = steps["paper"], (governor._record, governor.rows.record)
        elif governor is not None:
            self._by_phases = True
        if type(force_filter) is ContactForceFilter and governor is None:
            self._step = steps["filter"]
            self._parts = (force_filter.dynamics._record_, force_filter._terms_, force_filter._record_)
        elif force_filter is not None:
            self._by_phases = True

    def _prepare_phases(self) -> None:
        """Begin to compile the kernels that the phases call."""
        record, target, example = self._record_, self.target.record, State(0.0, *self._sample)
        measure.prepare(record, target, *self._measured(example))
        self._actuate.prepare(record, target, self.applied, example.q, example.v, example.foot_force)
        if self._force_filter is not None:
            limit_bent.prepare(record, self.applied, self._force_filter.bend)

    measured = ("q", "v", "foot_position", "foot_force")

    def _measured(self, state: State) -> tuple[Vector, ...]:
        """See :meth:`GaitController._measured`."""
        return state.q, state.v, state.foot_position, state.foot_force

    @property
    def governor(self) -> Governor | None:
        """Changes the body's reference for the thrusters."""
        return self._governor

    @governor.setter
    def governor(self, governor: Governor | None) -> None:
        self._governor = governor
        self._make_anew()

    @property
    def force_filter(self) -> ContactForceFilter | None:
        """Changes thrusts and torques for the contact forces of the full model."""
        return self._force_filter

    def reset(self) -> None:
        """Forget the integrals and the last command; the applied reference restarts at the target."""
        super().reset()
        self._blind = False
        for name in ("integral", "started"):
            self._record_[name] = 0
        self._seen[6:] = np.nan
        if self._governor is not None:
            self._governor.status.bad_samples = 0
        if self._force_filter is not None:
            self._force_filter.reset()
        if self.friction is not None:
            self.friction.reset()

    def _phases(self, state: State) -> Command:
        """One call where the governors are this library's; otherwise the phases one after the other."""
        if not self._by_phases:
            return super()._phases(state)
        self.plan(state)
        self.govern(state)
        self.actuate(state)
        return self.hold(state)

    def plan(self, state: State) -> Vector:
        """Targets of the gait, and the body's target x_r = [c_t; ċ_t].

        Args:
            state: measured, see :class:`~harpy_pin.model.state.State`.

        Returns:
            (6,) x_r.

        Raises:
            InputError: it is no state of the robot.
        """
        try:
            if -LONGEST < state.t < LONGEST:
                verdict = measure(self._record_, self._plan(state)._record_, *self._measured(state))
            else:
                verdict = measure(self._record_, self.target._record_, *self._measured(State(0.0, *self._nothing)))
        except (AttributeError, TypeError):
            as_state(state, self.robot)
            raise
        self._blind = verdict != GOOD
        if self._blind:
            self._refuse_misfit(state)
        elif self.friction is not None:
            self._estimate(self.friction, state)
        return self._reference_

    def _estimate(self, friction: FrictionEstimator, state: State) -> None:
        """Estimate the friction, and tell the governors: each foot's where they know feet, else the lowest."""
        force, velocity = state.foot_force, state.foot_velocity
        if self._record_["tilted"][0]:
            force, velocity = (in_contact_frames(self.target.normal, vectors) for vectors in (force, velocity))
        friction.update(force, velocity, self.target.stance)
        for assumed, share in self._assumed:
            assumed[:] = share * (friction.estimate if len(assumed) > 1 else friction.least)

    def govern(self, state: State) -> Vector:
        """Applied reference.

        Args:
            state: as given to :meth:`plan`.

        Returns:
            (6,) x_w.
        """
        if self._blind:
            return self._applied_
        if self._governor is not None:
            if not self._record_["started"][0]:
                self._governor.reset(self._reference_)
                self._record_["started"] = 1
            self._applied_ = self._governor.update(self._seen, self._reference_, self.period)
        return self._applied_

    def actuate(self, state: State) -> Command:
        """Thrusts from the applied reference, torques from the gait's feet by the parameters' control law.

        Args:
            state: as given to :meth:`plan`.
        """
        if self._blind:
            return self._command
        try:
            given = (self._record_, self.target._record_, self._applied_, state.q, state.v, state.foot_force)
            self._actuate(*given)
        except (AttributeError, TypeError):
            as_state(state, self.robot)
            raise
        return self._command

    def hold(self, state: State) -> Command:
        """The command, changed by the contact-force filter if there is one.

        Args:
            state: as given to :meth:`plan`.
        """
        command, governor = self._command, self._force_filter
        if governor is not None and not self._blind:
            governor.normal[:] = self.target.normal
            governor.update(state, command)
            limit_bent(self._record_, self._applied_, governor._bend_)
        return command

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, x_w, planned stance, joint targets, and the governors' rows."""
        force_filter = self.force_filter
        signals: dict[str, ArrayLike] = {
            "x_r": self.reference,
            "x_w": self.applied if force_filter is None else self.bent,
            "stance": self.target.stance,
            "joint_target": self._joint_target,
            "out_of_reach": self.out_of_reach,
            "centre_of_pressure": self._centre_of_pressure,
            "bad_samples": self._bad_samples,
        }
        if self.friction is not None:
            signals["friction_estimate"] = self.friction.estimate
        if self.governor is not None:
            status = self.governor.status
            signals |= {"h_r": status.h_r, "h_w": status.h_w, "infeasible": status.infeasible}
        if force_filter is not None:
            status = force_filter.status
            signals |= {
                "demanded_force": force_filter.force,
                "bend": force_filter.bend,
                "contact_h_r": status.h_r,
                "contact_h_w": status.h_w,
                "contact_infeasible": status.infeasible,
            }
        return signals

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains and governor."""
        governor, force_filter = self.governor, self.force_filter
        return {
            "gait": dict(self.gait.describe()),
            "control": asdict(self.parameters),
            "governor": " + ".join(type(g).__name__ for g in (governor, force_filter) if g is not None) or "none",
            "force_filter": asdict(force_filter.parameters) if force_filter is not None else "none",
            "rows": list(governor.status.names) if governor is not None else [],
        }


def _assumed_friction(governor: Governor | None, force_filter: ContactForceFilter | None) -> list[tuple[Vector, float]]:
    """The friction coefficients of governors, as arrays to write to, and the share of the assumed one that each is."""
    parts = (governor, getattr(governor, "rows", None), force_filter)
    found = [(getattr(part, "friction", None), getattr(part, "friction_share", 1.0)) for part in parts]
    assumed = [(friction, share) for friction, share in found if friction is not None]
    if not assumed:
        raise InputError("an estimate of the friction needs a governor that takes it", name="estimate_friction")
    return assumed
