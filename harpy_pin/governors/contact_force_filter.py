"""A filter behind any controller that keeps the contact forces in their friction cones.

The reduced-order model has one force along one leg, and a reference can scale it but not turn it
(equations.md §2). The full model has the force on every foot, affine in thrusts and torques
(:mod:`harpy_pin.model.contact_map`). Here each foot's force is put back into Coulomb's cone in
closed form, and the command gets the change that brings it there,

    minimise    ‖W_a δa‖² + ‖W_y δy‖²      δa = M⁻¹ (X + J_fᵀ A) δy: the change of motion of body
    and swing feet subject to  A δy = f* − f

with f* the force of each foot with its tangential part shortened into the cone, and its normal part
as the weight demands. The torque part of δy is a change K_p⁻¹ δτ of the joint targets, the thrust
part one of the body's reference. There is no active set and no iteration: three Cholesky factors. A
command that satisfies the cones is not changed.

For feet that stick, with the whole change applied, the force on each foot is f*, to rounding:
inside the cone tightened by the margins. So no foot slides while the error of the predicted force
(measured in ``docs/governors.md``) and the share of the change that still lags stay below the
margins. The change is bounded: where it exceeds the authority it is shortened as a whole, and the
violation left is in the status.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.governors.contact_force_kernels import (
    BAD_STATE,
    MISFIT_SIZES,
    ContactForceFilterRecord,
    filter_forces,
)
from harpy_pin.governors.contact_force_parameters import ContactForceFilterParameters
from harpy_pin.governors.governor import GovernorStatus
from harpy_pin.model.contact_map import contact_terms
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import FLOAT64, as_command, as_state, refuse_law
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector


@fixed_arrays("bend", "force", "friction", "normal", "record", "terms")
class ContactForceFilter(KeepsViews):
    """Holds the contact force of every foot in its friction cone by changing the command of any
    controller.

    Where q, v, the foot forces or the command are not all finite numbers, the last change is held
    for :data:`~harpy_pin.model.entry.HOLD_TICKS` ticks and then fades out; the status is
    ``infeasible`` and counts them. Bad samples change nothing else.

    Args:
        robot: with feet and thrusters, a free flyer.
        parameters: settings; by default those that fit the robot
            (:meth:`ContactForceFilterParameters.for_robot`).
        period: time between updates, s.

    Attributes:
        dynamics: terms of the last update.
        status: of the last update; its rows are, per foot, the friction margin μ f_z − |f_t| and
            f_z, both in N, at the command as given (``h_r``) and as bent (``h_w``), +inf for a foot
            in the air; ``rate`` is δy.
        bend: (3 thrusters + joints,) δy = [δu; δτ] of the last update, N and N·m.
        force: (feet, 3) force that sticking demands under the bent command, world axes, N; zero in
            the air.
        friction: (feet,) friction coefficient of each foot: that of the parameters, to be
            overwritten between updates where more is known.
        normal: (feet, 3) normals of the ground at the feet, upwards, of length one: vertical, to be
            overwritten between updates where the ground is not level.
        terms: what the contact-force map works in.
        record: what the kernel of an update reads and works in.
    """

    _bend_: Vector
    _record_: Records[Any]
    _terms_: Records[Any]

    @checked
    def __init__(
        self,
        robot: Robot,
        parameters: ContactForceFilterParameters | None = None,
        *,
        period: float = 1e-3,
    ) -> None:
        self.robot = robot
        self.parameters = (
            parameters if parameters is not None else ContactForceFilterParameters.for_robot(robot)
        )
        self.period = checks.number("period", period, low=0.0, strict=True)
        self.dynamics = Dynamics(robot)
        if robot.rotors:
            raise InputError(
                "the contact-force filter changes free thrusters, not rotors", name="robot"
            )
        feet, p = len(robot.feet), self.parameters
        self.terms = contact_terms(robot)
        self.record = make_record(
            ContactForceFilterRecord,
            robot.sizes,
            **asdict(p),
            bend_share=1.0 - np.exp(-self.period / p.lag) if p.lag > 0.0 else 1.0,
            friction=np.full(feet, p.mu),
            normal=np.tile((0.0, 0.0, 1.0), (feet, 1)),
        )
        self.bend: Vector = field(self._record_, "bend")
        self.force: Vector = field(self._record_, "force")
        self.friction: Vector = field(self._record_, "friction")
        self.normal: Vector = field(self._record_, "normal")
        names = tuple(
            f"{row} {foot}" for foot in robot.feet for row in ("friction", "normal force")
        )
        h_r, h_w = field(self._record_, "h_r"), field(self._record_, "h_w")
        self.status = GovernorStatus(names, h_r, h_w, self.bend, self._record_)
        q, v, torque = (np.zeros(robot.nq), np.zeros(robot.nv), np.zeros(len(robot.joints)))
        thrust = np.zeros((len(robot.thrusters), 3))
        filter_forces.prepare(
            self.dynamics._record_, self.terms, self._record_, q, v, self.force, torque, thrust
        )

    def reset(self) -> None:
        """Forget the bend, and the bad samples."""
        self.bend[:] = 0.0
        self._record_["bad_samples"] = self._record_["bad_in_a_row"] = 0

    def update(self, state: State, command: Command) -> Command:
        """Bend a command, in place.

        Args:
            state: measured; a foot whose measured normal force exceeds the threshold is taken to
                touch.
            command: of any controller.

        Returns:
            The command itself; where its arrays are not float64, and so cannot hold the bend, a
            copy.

        Raises:
            InputError: an array of the state or of the command has the wrong shape, or no numbers;
                or the command has a motors' law.
        """
        dynamics = self.dynamics
        refuse_law(command)
        try:
            torque, thrust = command._torque_, command._thrust_
            if torque.dtype != FLOAT64 or thrust.dtype != FLOAT64:
                return self.update(state, as_command(command, self.robot))
            records = (dynamics._record_, self._terms_, self._record_)
            excess = filter_forces(*records, state.q, state.v, state.foot_force, torque, thrust)
            dynamics.finite = excess > BAD_STATE
        except Exception:
            given, fit = as_state(state, self.robot), as_command(command, self.robot)
            if given is state and fit is command:
                raise
            return self.update(given, fit)
        if excess == MISFIT_SIZES:
            return self.update(as_state(state, self.robot), as_command(command, self.robot))
        return command
