"""Ways of the body through the air, and the feedback that keeps a robot on them.

A way is a function of the time: polynomials, and a jump that is braked by thrust.

Thrusters do not push the body every way: Harpy's two have no moment about the line between them,
and parallel rotors no force across their axes. What they lack, legs and leaning have to do. So the
gains are those of the linear-quadratic regulator of the whole robot as it hovers: body and joints
are its states, thrusts and torques its inputs.

Its feedback asks for generalised accelerations a at the measured state. What no thrust can give of
the wrench on the body that a needs,

    F = M a + n,    F_body ← F_body − Z Zᵀ F_body,    Z: the wrenches that no thrust has,

is taken out before it is asked for: the program of a whole-body controller finds exactly these
accelerations.
"""

from dataclasses import dataclass
from math import exp, perm, sqrt

import numpy as np
import pinocchio as pin
from scipy.linalg import solve_continuous_are

from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

SWIFT = 10.0 / sqrt(3.0)
"""Largest acceleration of a quintic from rest to rest over one metre in one second, m/s²."""


class Quintic:
    """A polynomial of fifth order through two states, each (3, n): position, velocity and
    acceleration.

    Before and after its ``duration``, s, the way stands still.
    """

    def __init__(self, start: Vector, end: Vector, duration: float) -> None:
        self.duration = duration
        rows = [
            [perm(n, d) * t ** (n - d) if n >= d else 0.0 for n in range(6)]
            for t in (0.0, duration)
            for d in range(3)
        ]
        self._way = np.linalg.solve(np.array(rows), np.vstack((start, end)))

    def at(self, t: float) -> Vector:
        """(3, n) position, velocity and acceleration at a time since its begin, s."""
        s = min(max(t, 0.0), self.duration)
        found = np.array(
            [sum(perm(n, d) * s ** (n - d) * self._way[n] for n in range(d, 6)) for d in range(3)]
        )
        if t > self.duration:
            found[0] += (t - self.duration) * found[1]
            found[2] = 0.0
        return found


def rest(place: Vector) -> Vector:
    """(3, n) position, velocity and acceleration of what stands still."""
    return np.vstack((place, np.zeros((2, len(place)))))


@dataclass(frozen=True)
class Fall:
    """Height of a body that is thrown up, falls freely, is braked, and then sinks at a constant
    speed.

    Thrust is switched on and off, and follows by its lag T. So the true velocity is v − T (a + g)
    and the true height z − T (v_true − v₀ + g t), with v and z those without lag and a the true
    acceleration.
    """

    height: float  # where it begins, m
    speed: float  # upwards, there, m/s
    ground: float  # height at which it has the touchdown's speed, m
    touchdown: float  # that speed, downwards, m/s
    brake: float  # acceleration upwards while it is braked, m/s²
    gravity: float = GRAVITY  # acceleration downwards until then, g, m/s²
    lag: float = 0.0  # of the thrust, T, s

    @property
    def free(self) -> float:
        """Duration of the free flight, s: its end has just the speed that the brake takes away
        until touchdown.
        """
        g, b, v, lag = self.gravity, self.brake, self.speed, self.lag
        end = self.touchdown - lag * g  # speed without lag
        rest = (
            v * v
            - end**2
            - 2.0 * b * (self.height - self.ground)
            - 2.0 * lag * (b * self.touchdown + g * end)
        )
        # g (g + b) (t + T)² − 2 v (g + b) (t + T) + rest = g (g + b) T², the later one
        return v / g - lag + sqrt(max((v / g) ** 2 + lag * lag - rest / (g * (g + b)), 0.0))

    @property
    def braked(self) -> float:
        """Duration of the braking, s."""
        return (
            max(self.gravity * (self.free + self.lag) - self.speed - self.touchdown, 0.0)
            / self.brake
        )

    def at(self, t: float) -> tuple[float, float, float]:
        """Height, velocity and acceleration at a time since its begin, s."""
        free = min(t, self.free)
        g = self.gravity
        z, v, a = self.height + (self.speed - 0.5 * g * free) * free, self.speed - g * free, -g
        if t > self.free:
            s = min(t - self.free, self.braked)
            z, v, a = (
                z + (v + 0.5 * self.brake * s) * s,
                v + self.brake * s,
                self._follow(a, self.brake, s),
            )
        late = t - self.free - self.braked
        if late > 0.0:
            z, a = z + late * v, self._follow(a, 0.0, late)
        true = v - self.lag * (a + g)
        return z - self.lag * (true - self.speed + g * t), true, a

    def _follow(self, start: float, goal: float, time: float) -> float:
        """An acceleration that follows another one."""
        return goal + (start - goal) * exp(-time / self.lag) if self.lag > 0.0 else goal


PLACE, TURN, JOINT = 0.05, 0.05, 0.3
"""Errors that weigh as much as each other: of the body, m and rad, and of a joint, rad."""
SPEED, SPIN, RATE = 0.3, 1.0, 2.0
"""Errors of the velocities that weigh as much as each other: m/s, rad/s, and rad/s of a joint."""
THRUST, TORQUE = 1.0, 0.25
"""Inputs that weigh as much: as a share of the weight on each thruster, and of a motor's limit."""
STEP = 1e-5  # size of the differences by which the equations of motion become linear, m and rad
NONE = 1e-6
"""Singular value, as a share of the largest, below which there is no thrust in a direction."""
LIGHTEST = 5e-4
"""Least inertia of a joint that the feedback reckons with, kg·m² per N·m of its motor: lighter ones
would be moved faster than a controller ticks.
"""
HELD = 0.02  # largest part of the weight that thrusts and torques may leave in hovering


class Balance:
    """Feedback of a robot with thrusters or rotors that hovers in a configuration q, (nq,); an
    error where it cannot.

    The thrusters carry ``weight`` times the robot's weight there. The ``gain``, (nv, 2 nv), is
    acceleration per error of configuration and velocity. The ``dynamics`` have the terms at the
    state of the last :meth:`reachable`.
    """

    def __init__(self, robot: Robot, q: Vector, *, weight: float = 1.0) -> None:
        self.robot, self.dynamics = robot, Dynamics(robot)
        model, nv = Dynamics(robot, gravity=np.array((0.0, 0.0, -weight * GRAVITY))), robot.nv
        rest, joints = np.zeros(nv), nv - 6
        model.update(q, rest)
        drive, mass = _inputs(model), model.mass_matrix.copy()
        light = np.zeros(nv)
        light[6:] = np.maximum(LIGHTEST * robot.torque_limit - np.diag(mass)[6:], 0.0)
        mass += np.diag(light)
        held, *_ = np.linalg.lstsq(drive, model.bias, rcond=NONE)
        if np.linalg.norm(drive @ held - model.bias) > HELD * robot.mass * GRAVITY:
            raise InputError(
                f"'{robot.name}' cannot hover in this posture", name="robot", value=robot
            )
        slope = np.zeros((nv, nv))
        for k in range(nv):
            for sign in (1.0, -1.0):
                change = np.zeros(nv)
                change[k] = sign * STEP
                model.update(robot.integrate(q, change), rest)
                given = np.linalg.solve(
                    model.mass_matrix + np.diag(light), _inputs(model) @ held - model.bias
                )
                slope[:, k] += sign * given / (2.0 * STEP)
        state = np.zeros((2 * nv, 2 * nv))
        state[:nv, nv:], state[nv:, :nv] = np.eye(nv), slope
        state[nv:, nv:] = -np.linalg.solve(mass, np.diag(model.damping))
        acts = np.vstack((np.zeros((nv, drive.shape[1])), np.linalg.solve(mass, drive)))
        errors = np.repeat((PLACE, TURN, JOINT, SPEED, SPIN, RATE), (3, 3, joints, 3, 3, joints))
        share = robot.mass * GRAVITY / len(robot.thrusters)
        inputs = np.concatenate(
            (np.full(robot.n_thrust, THRUST * share), TORQUE * robot.torque_limit)
        )
        cost = solve_continuous_are(state, acts, np.diag(errors**-2.0), np.diag(inputs**-2.0))
        self.gain: Vector = -acts[nv:] @ np.diag(inputs**2.0) @ acts.T @ cost

    def reachable(self, q: Vector, v: Vector, a: Vector) -> Vector:
        """(nv,) The acceleration without what no thrust can give; the terms stay at this state."""
        d = self.dynamics
        d.update(q, v)
        other = d.bias + d.damping * v
        force = d.mass_matrix @ a + other
        lacking = lacking_wrenches(d)
        force[:6] -= lacking @ (lacking.T @ force[:6])
        return np.asarray(np.linalg.solve(d.mass_matrix, force - other), dtype=np.float64)


def _inputs(d: Dynamics) -> Vector:
    """(nv, thrust variables + joints) generalised force of each input."""
    return np.hstack((d.thruster_jacobian.T, np.eye(len(d.bias))[:, 6:]))


def lacking_wrenches(d: Dynamics) -> Vector:
    """(6, n) orthonormal wrenches on the body, body axes, that no thrust has any part of."""
    left, values, _ = np.linalg.svd(d.thruster_jacobian[:, :6].T)
    rank = int((values > NONE * values[0]).sum())
    return np.asarray(left[:, rank:])


def lacking_moments(d: Dynamics) -> Vector:
    """(6, n) those of :func:`lacking_wrenches` that are mostly moments."""
    wrenches = lacking_wrenches(d)
    return wrenches[:, np.linalg.norm(wrenches[:3], axis=0) < 0.5]


FARTHEST = 0.1  # error of the place to which the feedback answers at most, m


@dataclass(frozen=True)
class Airway:
    """A flight as functions of the time since lift-off."""

    over: tuple[Quintic, ...]  # horizontal ways of the body, one after the other
    height: Fall | tuple[Quintic, ...]  # of the body
    legs: Quintic  # angles of the joints
    gains: tuple[tuple[float, Vector], ...]  # feedback and the time until which it is the one, s
    sinks: float  # time from which on a foot that is loaded has landed, s

    def body(self, t: float) -> Vector:
        """(3, 3) place, velocity and acceleration of the body's origin at a time since lift-off,
        s.
        """
        height = (
            np.array(self.height.at(t))
            if isinstance(self.height, Fall)
            else along(self.height, t)[:, 0]
        )
        return np.column_stack((along(self.over, t), height))

    def acceleration(self, t: float, q: Vector, v: Vector, balance: Balance) -> Vector:
        """(nv,) acceleration that leads from the measured q and v to the way, at a time since
        lift-off, s.
        """
        body, legs = self.body(t), self.legs.at(t)
        goal = np.concatenate((body[0], (0.0, 0.0, 0.0, 1.0), legs[0]))
        away = balance.robot.difference(goal, q)
        away[:3] = np.clip(away[:3], -FARTHEST, FARTHEST)
        still = np.zeros(3)
        error = np.concatenate((away, v - np.concatenate((body[1], still, legs[1]))))
        gain = next((gain for end, gain in self.gains if t < end), self.gains[-1][1])
        return balance.reachable(q, v, np.concatenate((body[2], still, legs[2])) + gain @ error)


def along(ways: tuple[Quintic, ...], t: float) -> Vector:
    """(3, n) on ways that follow each other."""
    for way in ways[:-1]:
        if t < way.duration:
            return way.at(t)
        t -= way.duration
    return ways[-1].at(t)


ORIENTATION = (400.0, 40.0)
"""Gains of the body's orientation of the controllers, 1/s² and 1/s: its target leans so that they
ask for what it should do.
"""
MOST_LEAN = 0.5  # largest angle between the body and its target, rad


def ask_for(o: GaitTarget, d: Dynamics, q: Vector, v: Vector, a: Vector) -> None:
    """Write the targets ``o``: places and velocities of the measured q and v, with their terms d;
    accelerations a.
    """
    turn = d.rotation
    o.body[:3], o.body[3:6] = q[:3], turn @ v[:3]
    o.body[6:9] = turn @ (a[:3] + np.cross(v[3:6], v[:3]))
    lean = (a[3:6] + ORIENTATION[1] * v[3:6]) / ORIENTATION[0]
    lean *= min(1.0, MOST_LEAN / max(float(np.linalg.norm(lean)), 1e-12))
    o.up[:], o.heading[0] = _up_and_heading(turn @ pin.exp3(lean))
    o.heading[1:] = 0.0
    o.foot_position[:] = d.foot_position - o.body[:3]
    o.foot_velocity[:] = d.foot_velocity - o.body[3:6]
    o.foot_acceleration[:] = (d.foot_jacobian @ a + d.foot_drift).reshape(-1, 3) - o.body[6:9]
    o.stance[:], o.phase[:] = 0.0, 0.4
    o.normal[:] = (0.0, 0.0, 1.0)


def _up_and_heading(rotation: Vector) -> tuple[Vector, float]:
    """Direction of the body's z axis, and the yaw after it is turned upright the shortest way."""
    up = rotation[:, 2]
    upright = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), up).matrix().T @ rotation
    return up, float(np.arctan2(upright[1, 0], upright[0, 0]))
