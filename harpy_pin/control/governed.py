"""The paper's controller: gait → governor → thruster law + inverse kinematics + joint PID (→ force governor)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.control.bridge import Bridge
from harpy_pin.errors import InputError
from harpy_pin.gait.base import Gait, GaitTarget, own_target
from harpy_pin.governor.base import Governor
from harpy_pin.governor.contact import ContactForceGovernor
from harpy_pin.governor.reduced.model import Law
from harpy_pin.model.entry import BAD, GOOD, MISFIT, all_finite, all_finite_rows, as_state
from harpy_pin.model.kinematics import LegGeometry, body_rotation, leg_inverse, leg_jacobian
from harpy_pin.model.record import Record, fields, make_record
from harpy_pin.model.record import field as record_field
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.model.thrust import AttitudeGains, CentreGains, allocate, centre_feedback, limit_thrust, roll_yaw

__all__ = ["GovernedController", "GovernedParameters", "JointGains"]

FULL = int(Law.FULL)
MAX_JOINT_RATE = 20.0
"""Largest joint velocity target, rad/s: near a straight leg the inverse Jacobian has no bound."""


@dataclass(frozen=True, kw_only=True)
class JointGains:
    """PID of the joints, one value for (hip frontal, hip sagittal, knee).

    equations.md gives the hips 1000/20/40 in continuous time. Held over a control period of 1 ms, a derivative gain of
    40 is unstable: the inertia a hip motor feels is 0.017 kg·m² in the air, and 40 · 1 ms / 0.017 > 2. The hips
    therefore get 10, and the light knee what it can bear.

    Attributes:
        k_p: N·m/rad.
        k_i: N·m/(rad·s).
        k_d: N·m·s/rad.
        integral_limit: largest torque of the integral part, N·m.
    """

    k_p: tuple[float, float, float] = (1000.0, 1000.0, 1000.0)
    k_i: tuple[float, float, float] = (20.0, 20.0, 20.0)
    k_d: tuple[float, float, float] = (10.0, 10.0, 3.0)
    integral_limit: float = 4.0

    def __post_init__(self) -> None:
        checks.gains("joint k_p", self.k_p)
        checks.gains("joint k_i", self.k_i)
        checks.gains("joint k_d", self.k_d)
        checks.number("integral_limit", self.integral_limit, low=0.0)


@dataclass(frozen=True, kw_only=True)
class GovernedParameters:
    """Settings of :class:`GovernedController`; defaults are the paper's 3D run (equations.md §3).

    Attributes:
        period: time between ticks, s.
        centre: gains of the thruster law.
        attitude: gains of the roll and yaw feedback.
        joints: gains of the joint PID.
        reference_velocity: whether x_r carries ċ_t (as printed) or zero velocity (equations.md §3, "c in the 3D run").
        limit_torque: apply the motors' peak torque (off in the paper).
        limit_thrust: apply the thrusters' limit (off in the paper).
        thrust: whether there are thrusters at all; without them only the legs act.
    """

    period: float = 1e-3
    centre: CentreGains = field(default_factory=CentreGains)
    attitude: AttitudeGains = field(default_factory=AttitudeGains)
    joints: JointGains = field(default_factory=JointGains)
    reference_velocity: bool = True
    limit_torque: bool = False
    limit_thrust: bool = False
    thrust: bool = True

    def __post_init__(self) -> None:
        checks.number("period", self.period, low=0.0, strict=True)


class GovernedController:
    """Walks the paper's way.

    ``step`` is a chain of :meth:`plan`, :meth:`govern`, :meth:`actuate` and :meth:`hold`, which may be called (and
    timed) apart. A state whose time, q, v, foot positions or forces are not all finite numbers is a bad sample: it
    moves neither integrals nor references, and :class:`~harpy_pin.control.bridge.Bridge` says what is commanded.

    Args:
        gait: where body and feet should be; the controller takes its own copy of a library's gait, with targets of its
            own, so that one gait may serve several controllers.
        governor: bends the body's reference for the thrusters; none applies it as it is.
        parameters: gains and switches.
        force_governor: bends the thrusts and the joint targets that follow, for the true contact force.

    Attributes:
        target: the gait's targets of the last tick.
        reference: (6,) x_r of the last tick.
        applied: (6,) x_w of the last tick, before the force governor.
        bent: (6,) x_w of the last tick after it: the reference of least change to which the thruster law gives the
            total thrust applied.
        out_of_reach: (2,) distance by which each foot target was out of reach in the last tick, m (then the leg goes
            to the nearest point).

    Raises:
        InputError: a robot with other joints than those of two legs of Harpy's kind.
    """

    def __init__(
        self,
        gait: Gait,
        governor: Governor | None = None,
        parameters: GovernedParameters | None = None,
        *,
        force_governor: ContactForceGovernor | None = None,
    ) -> None:
        self.gait = own_target(gait)
        self.robot = gait.robot
        if len(self.robot.joints) != 6:
            raise InputError(f"this controller moves 6 joints, '{self.robot.name}' has {len(self.robot.joints)}")
        self.governor = governor
        self.force_governor = force_governor
        self.parameters = p = parameters if parameters is not None else GovernedParameters()
        self.period = p.period
        self.target: GaitTarget = self.gait.target
        legs = [LegGeometry.from_robot(self.robot, foot).record for foot in self.robot.feet]
        self._legs = np.zeros(len(legs), legs[0].dtype)
        for k, leg in enumerate(legs):
            self._legs[k] = leg[0]
        self._record = control_record(p, self.robot)
        self.reference: Vector = record_field(self._record, "reference")
        self.applied: Vector = self.reference if governor is None else governor.applied
        self.bent: Vector = record_field(self._record, "bent")
        self.out_of_reach: Vector = record_field(self._record, "out_of_reach")
        self._measured = record_field(self._record, "measured")
        self._command = Command(record_field(self._record, "torque"), record_field(self._record, "thrust"))
        self._bridge = Bridge()
        self._convert = False  # whether states come in a form that kernels do not take
        self.reset()

    @property
    def bad_samples(self) -> int:
        """States that were not all numbers, since the last reset."""
        return self._bridge.bad_samples

    def reset(self) -> None:
        """Forget the integrals and the last command; the applied reference restarts at the target."""
        self._bridge.reset()
        self._blind = False
        self._command.torque[:] = 0.0
        self._command.thrust[:] = 0.0
        record_field(self._record, "integral")[:] = 0.0
        self._measured[6:] = np.nan
        self._fresh = True
        if self.force_governor is not None:
            self.force_governor.reset()

    def step(self, state: State) -> Command:
        """One tick: joint torques and thrusts.

        Raises:
            InputError: an array of the state has the wrong shape, or no numbers.
        """
        if self._convert:
            state = as_state(state, self.robot)
        try:
            self.plan(state)
            self.govern(state)
            self.actuate(state)
            return self.hold(state)
        except Exception:
            fit = as_state(state, self.robot)
            if fit is state:
                raise
            self._convert = True
        return self.step(fit)

    def plan(self, state: State) -> Vector:
        """Targets of the gait, and the body's target x_r = [c_t; ċ_t].

        Returns:
            (6,) x_r.
        """
        verdict = BAD
        if isfinite(state.t):
            self.target = target = self.gait.update(state.t)
            verdict = _measure(self._record, target.record, state.q, state.v, state.foot_position, state.foot_force)
        if verdict:
            self._bad(verdict, state)
        elif self._blind:
            self._blind = False
            self._bridge.in_a_row = 0
        return self.reference

    def _bad(self, verdict: int, state: State) -> None:
        """Bridge a bad sample, or say what does not fit."""
        if verdict == MISFIT:
            as_state(state, self.robot)
            raise InputError("the gait's targets are no numbers", name="gait", value=self.gait)
        self._blind = True
        self._bridge.hold(self._command)

    def govern(self, state: State) -> Vector:
        """Applied reference.

        Returns:
            (6,) x_w.
        """
        if self._blind:
            return self.applied
        if self.governor is not None:
            if self._fresh:
                self.governor.reset(self.reference)
            self.applied = self.governor.update(self._measured, self.reference, self.period)
        self._fresh = False
        return self.applied

    def actuate(self, state: State) -> Command:
        """Thrusts from the applied reference, torques from the gait's feet."""
        if not self._blind:
            _actuate(self._record, self._legs, self.target.record, self.applied, state.q, state.v)
        return self._command

    def hold(self, state: State) -> Command:
        """The command, bent by the force governor if there is one."""
        command, governor = self._command, self.force_governor
        if governor is not None and not self._blind:
            governor.update(state, command)
            _after_bend(self._record, self.applied, governor.bend)
        return command

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, x_w, planned stance, joint targets, and the governors' rows."""
        force_governor = self.force_governor
        signals: dict[str, ArrayLike] = {
            "x_r": self.reference,
            "x_w": self.applied if force_governor is None else self.bent,
            "stance": self.target.stance,
            "joint_target": record_field(self._record, "joint_target"),
            "out_of_reach": self.out_of_reach,
            "centre_of_pressure": self._measured[6:],
            "bad_samples": self.bad_samples,
        }
        if self.governor is not None:
            status = self.governor.status
            signals |= {"h_r": status.h_r, "h_w": status.h_w, "infeasible": status.infeasible}
        if force_governor is not None:
            status = force_governor.status
            signals |= {
                "demanded_force": force_governor.force,
                "bend": force_governor.bend,
                "contact_h_r": status.h_r,
                "contact_h_w": status.h_w,
                "contact_infeasible": status.infeasible,
            }
        return signals

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains and governor."""
        governor, force_governor = self.governor, self.force_governor
        return {
            "gait": dict(self.gait.describe()),
            "control": asdict(self.parameters),
            "governor": " + ".join(type(g).__name__ for g in (governor, force_governor) if g is not None) or "none",
            "force_governor": asdict(force_governor.parameters) if force_governor is not None else "none",
            "rows": list(governor.status.names) if governor is not None else [],
        }


def control_record(parameters: GovernedParameters, robot: Robot) -> Record:
    """What the kernels of :class:`GovernedController` know and write.

    Fields, beside the gains of :class:`~harpy_pin.model.thrust.CentreGains`:
        period: between ticks, s.
        reference_velocity: whether x_r carries ċ_t.
        attitude_p, attitude_d: of each thruster, N/rad and N·s/rad.
        joint_p, joint_i, joint_d: (6,) N·m/rad, N·m/(rad·s), N·m·s/rad.
        integral_limit: N·m.
        torque_limit: (6,) N·m, infinite where there is none.
        thrust_limit: of each thruster, N, likewise.
        measured: (9,) [c; ċ; u].
        rotation: (3, 3) body to world.
        reference: (6,) x_r.
        bent: (6,) x_w after the force governor.
        joint_target: (6,) rad.
        integral: (6,) N·m.
        out_of_reach: (2,) m.
        torque: (6,) of the command, N·m.
        thrust: (2, 3) of the command, world axes, N.
    """
    p, joints = parameters, parameters.joints
    limit = robot.thrust_limit if p.limit_thrust else np.inf
    return make_record(
        period=p.period,
        reference_velocity=p.reference_velocity,
        attitude_p=p.attitude.k_p,
        attitude_d=p.attitude.k_d,
        joint_p=joints.k_p * 2,
        joint_i=joints.k_i * 2,
        joint_d=joints.k_d * 2,
        integral_limit=joints.integral_limit,
        torque_limit=robot.torque_limit if p.limit_torque else np.full(6, np.inf),
        thrust_limit=limit if p.thrust else 0.0,
        measured=np.zeros(9),
        rotation=np.zeros((3, 3)),
        reference=np.zeros(6),
        bent=np.zeros(6),
        joint_target=np.zeros(6),
        integral=np.zeros(6),
        out_of_reach=np.zeros(2),
        torque=np.zeros(6),
        thrust=np.zeros((2, 3)),
        **fields(p.centre.record),
    )


@njit(cache=True)
def _measure(control, target, q, v, foot_position, foot_force):  # type: ignore[no-untyped-def]
    """x_r, [c; ċ; u] and the body's rotation; u is held while no foot carries. Returns whether the state is good."""
    p, goal = control[0], target[0]
    measured, rotation = p.measured, p.rotation
    if q.shape != (13,) or v.shape != (12,) or foot_position.shape != (2, 3) or foot_force.shape != (2, 3):
        return MISFIT
    if not (all_finite(q) and all_finite(v) and all_finite_rows(foot_position) and all_finite_rows(foot_force)):
        return BAD
    if not all_finite(goal.body):
        return MISFIT
    body_rotation(q, rotation)
    for i in range(3):
        p.reference[i] = goal.body[i]
        p.reference[3 + i] = goal.body[3 + i] if p.reference_velocity else 0.0
        measured[i] = q[i]
        measured[3 + i] = rotation[i, 0] * v[0] + rotation[i, 1] * v[1] + rotation[i, 2] * v[2]
    normal = 0.0
    for k in range(foot_force.shape[0]):
        normal += foot_force[k, 2]
    if normal > 0.0:
        for i in range(3):
            s = 0.0
            for k in range(foot_force.shape[0]):
                s += foot_force[k, 2] * foot_position[k, i]
            measured[6 + i] = s / normal
    elif np.isnan(measured[6]):
        # Nothing has carried yet: between the feet.
        for i in range(3):
            measured[6 + i] = 0.5 * (foot_position[0, i] + foot_position[1, i])
    return GOOD


@njit(cache=True)
def _actuate(control, legs, target, applied, q, v):  # type: ignore[no-untyped-def]
    """The command: thrusts from the applied reference, torques from the gait's feet."""
    p, goal = control[0], target[0]
    _thrusts(p, applied, v)
    for k in range(2):
        _leg(k, p, legs[k], goal, q, v)


@njit(cache=True)
def _thrusts(p, applied, v):  # type: ignore[no-untyped-def]
    """Thruster law, allocation and limit."""
    r, centre, angles = np.empty(3), np.empty(3), np.empty(4)
    c, c_dot, foot = p.measured[0:3], p.measured[3:6], p.measured[6:9]
    for i in range(3):
        r[i] = c[i] - foot[i]
    centre_feedback(r, c, c_dot, applied, FULL, p, centre)
    roll_yaw(p.rotation, v[3:6], angles)
    allocate(centre, p.rotation, angles, p.attitude_p, p.attitude_d, p.thrust)
    limit_thrust(p.thrust, p.thrust_limit)


@njit(cache=True)
def _leg(k, p, leg, goal, q, v):  # type: ignore[no-untyped-def]
    """Inverse kinematics and joint PID of leg k."""
    point, motion, jacobian, rate = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty(3)
    target = p.joint_target[3 * k : 3 * k + 3]
    _to_body(k, p, goal, v[3:6], point, motion)
    p.out_of_reach[k] = leg_inverse(leg, point, target)
    leg_jacobian(leg, target, jacobian)
    _solve3(jacobian, motion, rate)
    if p.out_of_reach[k] > 0.0:
        rate[:] = 0.0
    for i in range(3):
        j = 3 * k + i
        error = target[i] - q[7 + j]
        rate[i] = min(max(rate[i], -MAX_JOINT_RATE), MAX_JOINT_RATE)
        p.integral[j] += p.joint_i[j] * error * p.period
        p.integral[j] = min(max(p.integral[j], -p.integral_limit), p.integral_limit)
        u = p.joint_p[j] * error + p.integral[j] + p.joint_d[j] * (rate[i] - v[6 + j])
        p.torque[j] = min(max(u, -p.torque_limit[j]), p.torque_limit[j])


@njit(cache=True)
def _to_body(k, p, goal, spin, point, motion):  # type: ignore[no-untyped-def]
    """The target of foot k in body axes, and its rate at constant level.

    A foot that carries (level 0) holds its place in the body: p. A foot in the air (level 1) holds its place in the
    world, so that it meets the ground where and when it should: Rᵀ (c_t + p − c).
    """
    body, position, velocity, level = goal.body, goal.foot_position[k], goal.foot_velocity[k], goal.level[k]
    for i in range(3):
        point[i] = 0.0
        motion[i] = 0.0
        for j in range(3):
            point[i] += p.rotation[j, i] * (body[j] + position[j] - p.measured[j])
            motion[i] += p.rotation[j, i] * (body[3 + j] + velocity[j] - p.measured[3 + j])
    cross = (
        spin[1] * point[2] - spin[2] * point[1],
        spin[2] * point[0] - spin[0] * point[2],
        spin[0] * point[1] - spin[1] * point[0],
    )
    for i in range(3):
        motion[i] = (1.0 - level) * velocity[i] + level * (motion[i] - cross[i])
        point[i] = (1.0 - level) * position[i] + level * point[i]


@njit(cache=True)
def _solve3(a, b, x):  # type: ignore[no-untyped-def]
    """x = a⁻¹ b for 3×3 a by Cramer's rule; zero where a is singular (a straight or folded leg)."""
    c0 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    c1 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c2 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    det = a[0, 0] * c0 + a[0, 1] * c1 + a[0, 2] * c2
    if abs(det) < 1e-9:
        x[:] = 0.0
        return
    x[0] = (b[0] * c0 + a[0, 1] * (b[2] * a[1, 2] - b[1] * a[2, 2]) + a[0, 2] * (b[1] * a[2, 1] - b[2] * a[1, 1])) / det
    x[1] = (a[0, 0] * (b[1] * a[2, 2] - b[2] * a[1, 2]) + b[0] * c1 + a[0, 2] * (a[1, 0] * b[2] - b[1] * a[2, 0])) / det
    x[2] = (a[0, 0] * (a[1, 1] * b[2] - b[1] * a[2, 1]) + a[0, 1] * (b[1] * a[2, 0] - a[1, 0] * b[2]) + b[0] * c2) / det


@njit(cache=True)
def _after_bend(control, applied, bend):  # type: ignore[no-untyped-def]
    """Limits of the bent command, and x_w moved, by the least norm, to where K_p e + K_d ė has grown by the change of
    the total thrust."""
    p = control[0]
    for i in range(3):
        k_p, k_d = p.k_pt[i], p.k_dt[i]
        squared = k_p * k_p + k_d * k_d
        change = (bend[i] + bend[3 + i]) / squared if squared > 0.0 else 0.0
        p.bent[i] = applied[i] + k_p * change
        p.bent[3 + i] = applied[3 + i] + k_d * change
    for j in range(p.torque.shape[0]):
        p.torque[j] = min(max(p.torque[j], -p.torque_limit[j]), p.torque_limit[j])
    limit_thrust(p.thrust, p.thrust_limit)
