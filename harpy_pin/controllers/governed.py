"""The paper's controller: gait → governor → thruster feedback, inverse kinematics, joint PID → contact-force filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.feedforward import actuate_forward, forward_record
from harpy_pin.controllers.friction_estimator import FrictionEstimator
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.paper_law import TILTED, actuate, control_record, limit_bent, measure_state
from harpy_pin.controllers.parameters import GovernedParameters
from harpy_pin.deprecated import renamed_arguments
from harpy_pin.errors import InputError
from harpy_pin.gaits.commanded import CommandedGait
from harpy_pin.gaits.flight.flying_gait import FlyingGait
from harpy_pin.gaits.foothold_governor import GovernedGait
from harpy_pin.gaits.gait import LONGEST, Gait
from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.governor import Governor
from harpy_pin.model.contact_frame import in_contact_frames
from harpy_pin.model.entry import BAD, GOOD, as_state
from harpy_pin.model.kinematics import LegGeometry
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import field
from harpy_pin.model.state import Command, State, Vector

__all__ = ["GovernedController"]


@fixed_arrays("applied", "bent", "out_of_reach", "reference")
@renamed_arguments(force_governor="force_filter")
class GovernedController(GaitController):
    """Walks the paper's way.

    ``step`` is a chain of :meth:`plan`, :meth:`govern`, :meth:`actuate` and :meth:`hold`, which may be called (and
    timed) apart. A state whose time, q, v, foot positions or forces are not all finite numbers is a bad sample, which
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
        walks = gait.gait if isinstance(gait, GovernedGait) else gait
        if isinstance(walks, CommandedGait | FlyingGait):
            kind, what = "commanded", "faces x and cannot turn"
            if isinstance(walks, FlyingGait):
                kind, what = "flying", "neither jumps nor flies"
            message = f"the paper's controller {what}: walk a {kind} gait with 'condensed' or 'wbc'"
            raise InputError(message, name="gait", value=gait)
        super().__init__(gait, p.period)
        if len(self.robot.joints) != 6:
            raise InputError(f"this controller moves 6 joints, '{self.robot.name}' has {len(self.robot.joints)}")
        self.governor = governor
        self.force_filter = force_filter
        legs = [LegGeometry.from_robot(self.robot, foot).record for foot in self.robot.feet]
        self._legs = np.zeros(len(legs), legs[0].dtype)
        for k, leg in enumerate(legs):
            self._legs[k] = leg[0]
        self._record = control_record(p, self.robot)
        self._forward = forward_record(self.gait, p.feedforward) if p.legs == "feedforward" else None
        self.reference: Vector = field(self._record, "reference")
        self.applied: Vector = self.reference if governor is None else governor.applied
        self.bent: Vector = field(self._record, "bent")
        self.out_of_reach: Vector = field(self._record, "out_of_reach")
        self._measured = field(self._record, "measured")
        self._joint_target = field(self._record, "joint_target")
        self._centre_of_pressure = self._measured[6:]
        self._command = Command(field(self._record, "torque"), field(self._record, "thrust"))
        self._assumed = _assumed_friction(governor, force_filter) if p.estimate_friction else []
        self.friction: FrictionEstimator | None = None
        if p.estimate_friction:
            assumed = max(float(value.max()) / share for value, share in self._assumed)
            self.friction = FrictionEstimator(p.friction, assumed=assumed, feet=len(self.robot.feet), period=p.period)
        self._prepare()
        self.reset()

    def _prepare(self) -> None:
        """Begin to compile the kernels of a tick."""
        q, v = self.gait.initial_state()
        feet = np.zeros((len(self.robot.feet), 3))
        measure_state.prepare(self._record, self.target.record, q, v, feet, feet)
        given = (self._record, self._legs, self.target.record, self.applied, q, v)
        if self._forward is None:
            actuate.prepare(*given)
        else:
            actuate_forward.prepare(*given, feet, self._forward)
        if self.force_filter is not None:
            limit_bent.prepare(self._record, self.applied, self.force_filter.bend)

    def reset(self) -> None:
        """Forget the integrals and the last command; the applied reference restarts at the target."""
        super().reset()
        self._blind = False
        self._tilted = True  # what a filter knew before is unknown
        self._command.torque[:] = 0.0
        self._command.thrust[:] = 0.0
        field(self._record, "integral")[:] = 0.0
        self._measured[6:] = np.nan
        self._fresh = True
        if self.force_filter is not None:
            self.force_filter.reset()
        if self.friction is not None:
            self.friction.reset()

    def _phases(self, state: State) -> Command:
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
        verdict = BAD
        try:
            if -LONGEST < state.t < LONGEST:
                target = self._plan(state)
                given = (state.q, state.v, state.foot_position, state.foot_force)
                verdict = measure_state(self._record, target._record_, *given)
        except (AttributeError, TypeError):
            as_state(state, self.robot)
            raise
        if verdict > GOOD:
            self._answer_bad(verdict, state)
            self._blind = True
            return self._reference_
        if self._blind:
            self._blind = False
            self._bad_in_a_row = 0
        if verdict or self._tilted:
            self._follow_ground(tilted=verdict == TILTED)
        if self.friction is not None:
            self._estimate(self.friction, state)
        return self._reference_

    def _follow_ground(self, *, tilted: bool) -> None:
        """Tell the filter the normals of the ground, where they are or were not vertical."""
        self._tilted = tilted
        if self.force_filter is not None:
            self.force_filter.normal[:] = self.target.normal

    def _estimate(self, friction: FrictionEstimator, state: State) -> None:
        """Estimate the friction, and tell the governors: each foot's where they know feet, else the lowest."""
        force, velocity = state.foot_force, state.foot_velocity
        if self._tilted:
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
        if self.governor is not None:
            if self._fresh:
                self.governor.reset(self._reference_)
            self._applied_ = self.governor.update(self._measured, self._reference_, self.period)
        self._fresh = False
        return self._applied_

    def actuate(self, state: State) -> Command:
        """Thrusts from the applied reference, torques from the gait's feet by the parameters' control law.

        Args:
            state: as given to :meth:`plan`.
        """
        if self._blind:
            return self._command
        try:
            given = (self._record, self._legs, self.target._record_, self._applied_, state.q, state.v)
            if self._forward is None:
                actuate(*given)
            else:
                actuate_forward(*given, state.foot_force, self._forward)
        except (AttributeError, TypeError):
            as_state(state, self.robot)
            raise
        return self._command

    def hold(self, state: State) -> Command:
        """The command, changed by the contact-force filter if there is one.

        Args:
            state: as given to :meth:`plan`.
        """
        command, governor = self._command, self.force_filter
        if governor is not None and not self._blind:
            governor.update(state, command)
            limit_bent(self._record, self._applied_, governor._bend_)
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
            "bad_samples": self.bad_samples,
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
