"""Compliant ground with Stribeck friction (equations.md E1, E2), and its implicit time step.

The ground maps the motion of a foot to the force on it. Friction at rest is set-valued (any force inside the cone), so
an explicit evaluation has to regularise it and creeps. :func:`contact_step` instead finds the forces at the *end* of a
step together with the velocities they cause: a foot whose force fits in the cone does not move at all.

Friction may change along x, on strips such as ice. A foot feels that of its place at the beginning of a step.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.deprecated import renamed_arguments
from harpy_pin.errors import InputError, shown
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.state import Vector

__all__ = ["Ground", "contact_step", "friction_force", "normal_force"]

CONES = ("circular", "per_axis")
MAX_STIFFNESS = 1e9
"""N/m: a robot of 4 kg sinks by 40 nm."""
MAX_FRICTION_STRIPS = 16
"""Of one ground: its record has room for so many, so that kernels are compiled once for all grounds."""
TINY = 1e-30
"""Keeps quotients of two zeros finite."""
_RATIO = 0.9
"""The paper's μ_c / μ_s."""
_STIFFNESS, _DAMPING = 8000.0, 268.3
"""Of the paper's ground, N/m and N·s/m: a damping ratio of 0.71 under 4.5 kg."""


class GroundRecord(RecordOf):
    """Parameters of :class:`Ground`, and:

    Attributes:
        per_axis: 1 for that cone.
        strips: how many strips there are.
        strip: (16, 4) from and to, m, static and sliding coefficient of each.
    """

    stiffness: float
    damping: float
    mu_s: float
    mu_c: float
    mu_v: float
    stribeck_velocity: float
    per_axis: int
    strips: int
    strip: Vector


@checks.explained_arguments(
    mu="the static friction coefficient is mu_s, as in Ground(mu_s=0.6)",
    friction="the static friction coefficient is mu_s, as in Ground(mu_s=0.6)",
    mu_d="the sliding friction coefficient is mu_c, 0.9 mu_s where it is not given",
    k="the stiffness is stiffness, N/m",
    d="the damping is damping, N·s/m",
)
@renamed_arguments(patches="friction_strips")
@dataclass(frozen=True, kw_only=True)
class Ground:
    """Parameters of the ground z = 0; defaults are equations.md §3.

    Attributes:
        stiffness: normal stiffness k, N/m, at most 1e9.
        damping: normal damping d while the foot goes down, N·s/m (undamped rebound). When not given, that of the
            paper's damping ratio: 268.3 √(k / 8000 N/m).
        mu_s: static friction coefficient, at most 10; the paper's 0.25 by default, where ``harpy walk`` has 0.8.
        mu_c: Coulomb (sliding) friction coefficient; 0.9 mu_s, the paper's ratio, when not given.
        mu_v: viscous friction, N·s/m.
        stribeck_velocity: σ of the transition from mu_s to mu_c, m/s.
        cone: ``circular`` (Coulomb's disc) or ``per_axis`` (x and y apart: a box, the paper's form).
        friction_strips: (from x, to x, static coefficient) of strips with another friction, m, in the order of x and
            apart from each other, at most 16. A strip holds its first x and not its last. Its sliding coefficient has
            the ground's ratio mu_c / mu_s (0.9 where mu_s is zero).
    """

    stiffness: float = _STIFFNESS
    damping: float | None = None
    mu_s: float = 0.25
    mu_c: float | None = None
    mu_v: float = 0.85
    stribeck_velocity: float = 0.01
    cone: Literal["circular", "per_axis"] = "circular"
    friction_strips: tuple[tuple[float, float, float], ...] = ()

    def __post_init__(self) -> None:
        stiffness = checks.number("ground stiffness", self.stiffness, low=0.0, high=MAX_STIFFNESS, strict=True)
        damping = _DAMPING * math.sqrt(stiffness / _STIFFNESS) if self.damping is None else self.damping
        mu_s = checks.number("friction mu_s", self.mu_s, low=0.0, high=checks.MAX_FRICTION)
        mu_c = _RATIO * mu_s if self.mu_c is None else self.mu_c
        checks.keep(
            self,
            stiffness=stiffness,
            damping=checks.number("ground damping", damping, low=0.0),
            mu_s=mu_s,
            mu_c=checks.number("friction mu_c", mu_c, low=0.0, high=mu_s),
            mu_v=checks.number("viscous friction mu_v", self.mu_v, low=0.0),
            stribeck_velocity=checks.number("stribeck_velocity", self.stribeck_velocity, low=0.0, strict=True),
        )
        checks.one_of("friction cone", self.cone, CONES)
        checks.keep(self, friction_strips=_checked_strips(self.friction_strips))

    @property
    def record(self) -> Records[GroundRecord]:
        """The parameters, for kernels."""
        numbers = {name: value for name, value in asdict(self).items() if name not in ("cone", "friction_strips")}
        assert self.mu_c is not None
        ratio = self.mu_c / self.mu_s if self.mu_s > 0.0 else _RATIO
        strip = np.zeros((MAX_FRICTION_STRIPS, 4))
        for row, (begin, end, mu) in zip(strip, self.friction_strips, strict=False):
            row[:] = begin, end, mu, ratio * mu
        count = np.int64(len(self.friction_strips))
        return make_record(GroundRecord, **numbers, per_axis=self.cone == "per_axis", strips=count, strip=strip)

    @checked
    def friction(self, x: ArrayLike) -> Vector:
        """Static friction coefficient of places on the ground.

        Args:
            x: of the places, m, of any shape.

        Returns:
            The coefficients, in that shape.
        """
        places = np.asarray(x, dtype=np.float64)
        mu = np.full(places.shape, self.mu_s)
        for begin, end, value in self.friction_strips:
            mu[(begin <= places) & (places < end)] = value
        return mu


def _checked_strips(strips: Any) -> tuple[tuple[float, float, float], ...]:
    """Strips as plain numbers; see :class:`Ground` for what they must be."""

    def refuse(message: str, value: Any) -> InputError:
        return InputError(message, name="friction_strips", value=value)

    if not isinstance(strips, list | tuple):
        raise refuse(f"friction_strips must be a tuple of strips, got {shown(strips)}", strips)
    if len(strips) > MAX_FRICTION_STRIPS:
        raise refuse(f"a ground has at most {MAX_FRICTION_STRIPS} friction_strips, got {len(strips)}", strips)
    checked: list[tuple[float, float, float]] = []
    for strip in strips:
        if not isinstance(strip, list | tuple) or len(strip) != 3:
            raise refuse(f"a strip must be (from x, to x, friction), got {shown(strip)}", strip)
        begin, end = checks.number("from of a strip", strip[0]), checks.number("to of a strip", strip[1])
        mu = checks.number("friction of a strip", strip[2], low=0.0, high=checks.MAX_FRICTION)
        if end <= begin:
            raise refuse(f"a strip must end behind its beginning, got {begin:g} to {end:g} m", strip)
        if checked and begin < checked[-1][1]:
            order = f"{begin:g} m lies before {checked[-1][1]:g} m"
            raise refuse(f"friction_strips must be in the order of x and apart: {order}", strip)
        checked.append((begin, end, mu))
    return tuple(checked)


@kernel
def normal_force(height: float, velocity: float, ground: GroundRecord) -> float:
    """Normal force u_gz(p_z, ṗ_z) of the ground, N (paper, ground model; equations.md E1).

    −k p_z − d ṗ_z where p_z ≤ 0, with d = 0 for ṗ_z > 0, clipped at zero: the ground never pulls.

    Args:
        height: p_z, m.
        velocity: ṗ_z, m/s.
        ground: the element of :attr:`Ground.record`.
    """
    if height > 0.0:
        return 0.0
    force = -ground.stiffness * height
    if velocity < 0.0:
        force -= ground.damping * velocity
    return float(max(force, 0.0))


@kernel
def local_friction(x: float, ground: GroundRecord) -> tuple[float, float]:
    """Static and sliding coefficient at a place x, m, for the element of :attr:`Ground.record`."""
    mu_s, mu_c = ground.mu_s, ground.mu_c
    for i in range(ground.strips):
        if ground.strip[i, 0] <= x < ground.strip[i, 1]:
            mu_s, mu_c = ground.strip[i, 2], ground.strip[i, 3]
    return mu_s, mu_c


@kernel
def _stribeck(speed: float, normal: float, mu_s: float, mu_c: float, ground: GroundRecord) -> float:
    """Magnitude of the friction on a foot sliding at ``speed``, N (equations.md E2)."""
    ratio = speed / ground.stribeck_velocity
    mu = mu_c + (mu_s - mu_c) * np.exp(-ratio * ratio)
    return float(mu * normal + ground.mu_v * speed)


def friction_force(velocity: Vector, normal: float, ground: Any, creep: float) -> Vector:
    """Regularised Stribeck friction on a foot (paper, friction model, sign and magnitude as in equations.md E2).

    f = −[(μ_c + (μ_s − μ_c) e^{−(s/σ)²}) u_gz + μ_v s] tanh(s/creep) v_t/s; per axis, s is the speed along each axis.
    It is for analysis and as a reference, outside the friction strips; the simulator uses :func:`contact_step`.

    Args:
        velocity: (2,) tangential velocity v_t, m/s.
        normal: u_gz, N; no friction where it is zero.
        ground: the element of :attr:`Ground.record`.
        creep: speed below which friction fades to zero, m/s.

    Returns:
        (2,) friction force on the foot, N.
    """
    force = np.zeros(2)
    _creeping_friction(velocity, normal, ground, creep, force)
    return force


@kernel(velocity=(2,), force=(2,))
def _creeping_friction(velocity: Vector, normal: float, ground: GroundRecord, creep: float, force: Vector) -> None:
    if normal <= 0.0:
        return
    mu_s, mu_c = ground.mu_s, ground.mu_c
    if ground.per_axis:
        for i in range(2):
            speed = abs(velocity[i])
            if speed > 0.0:
                force[i] = -_stribeck(speed, normal, mu_s, mu_c, ground) * np.tanh(speed / creep) * velocity[i] / speed
    else:
        speed = np.hypot(velocity[0], velocity[1])
        if speed > 0.0:
            magnitude = _stribeck(speed, normal, mu_s, mu_c, ground) * np.tanh(speed / creep)
            force[0] = -magnitude * velocity[0] / speed
            force[1] = -magnitude * velocity[1] / speed


@kernel
def _solve_normal(height: float, free: float, mobility: float, dt: float, ground: GroundRecord) -> float:
    """Normal force at the end of a step, N: the law of E1 at height + dt u, with u = free + mobility·force.

    The law, with the vertical jump where the damper engages filled in, is a monotone graph in u: one solution.
    """
    k, d = ground.stiffness, ground.damping
    threshold = -height / dt
    if free >= threshold:
        return 0.0
    # Going down: force = -k (height + dt u) - d u.
    force = (-k * height - (k * dt + d) * free) / (1.0 + (k * dt + d) * mobility)
    u = free + mobility * force
    if u >= 0.0:
        # Rebound: no damping.
        force = (-k * height - k * dt * free) / (1.0 + k * dt * mobility)
        u = free + mobility * force
    if u > threshold:
        force = (threshold - free) / mobility
    return max(force, 0.0)


@kernel
def _solve_slide_1d(
    free: float, mobility: float, normal: float, mu_s: float, mu_c: float, ground: GroundRecord
) -> float:
    """Friction along one axis, N: zero velocity if the box allows it, else sliding at the Stribeck force."""
    stick = -free / mobility
    if abs(stick) <= mu_s * normal:
        return stick
    # Speed s > 0 with s = |free| - mobility F(s): the right side falls below s at s = |free|.
    start = abs(free)
    low, high = 0.0, start
    speed = max(start - mobility * mu_s * normal, 0.0)
    drop = 2.0 * (mu_s - mu_c) * normal
    for _ in range(60):
        gap = speed + mobility * _stribeck(speed, normal, mu_s, mu_c, ground) - start
        if gap > 0.0:
            high = speed
        else:
            low = speed
        if abs(gap) <= 1e-13 * start or high - low <= 1e-15:
            break
        ratio = speed / ground.stribeck_velocity
        slope = 1.0 + mobility * (ground.mu_v - drop * ratio / ground.stribeck_velocity * np.exp(-ratio * ratio))
        speed = speed - gap / slope if slope > 0.0 else -1.0
        if speed <= low or speed >= high:
            speed = 0.5 * (low + high)
    return -(free / start) * _stribeck(speed, normal, mu_s, mu_c, ground)


@kernel
def _slide_velocity(gain: float, a11: float, a12: float, a22: float, u1: float, u2: float) -> tuple[float, float]:
    """(I + gain A)⁻¹ u: the velocity of a foot under the friction force −gain·velocity."""
    b11, b12, b22 = 1.0 + gain * a11, gain * a12, 1.0 + gain * a22
    det = b11 * b22 - b12 * b12
    return (b22 * u1 - b12 * u2) / det, (b11 * u2 - b12 * u1) / det


@kernel
def _first_gain(u1: float, u2: float, a11: float, a12: float, a22: float, most: float, f1: float, f2: float) -> float:
    """Where to begin: the gain of the force guessed, or as if the mobility were the same in all directions."""
    w1, w2 = u1 + a11 * f1 + a12 * f2, u2 + a12 * f1 + a22 * f2
    against = -(f1 * w1 + f2 * w2)
    if against > 0.0:
        return against / (w1 * w1 + w2 * w2 + TINY)
    start = np.sqrt(u1 * u1 + u2 * u2)
    return float(max(most / max(start - 0.5 * (a11 + a22) * most, 0.01 * start + TINY), 1e-12))


@kernel
def _solve_slide_2d(
    u1: float,
    u2: float,
    a11: float,
    a12: float,
    a22: float,
    normal: float,
    mu_s: float,
    mu_c: float,
    ground: GroundRecord,
    f1: float,
    f2: float,
) -> tuple[float, float]:
    """Friction in the plane, N: zero velocity if Coulomb's disc allows it, else sliding against the motion.

    The force is −g w with w the velocity that it leaves, (I + g A)⁻¹ u, and g |w| = F(|w|). In g − F/|w|, nearly a
    straight line, Newton's steps find the gain g, with a bracket around it; (f1, f2) is a guess of the force.
    """
    det = a11 * a22 - a12 * a12
    stick1, stick2 = -(a22 * u1 - a12 * u2) / det, -(a11 * u2 - a12 * u1) / det
    if stick1 * stick1 + stick2 * stick2 <= (mu_s * normal) ** 2:
        return stick1, stick2
    gain = _first_gain(u1, u2, a11, a12, a22, mu_c * normal, f1, f2)
    low, high, last = 0.0, np.inf, np.inf
    w1, w2 = u1, u2
    for _ in range(100):
        w1, w2 = _slide_velocity(gain, a11, a12, a22, u1, u2)
        speed = np.sqrt(w1 * w1 + w2 * w2) + TINY
        ratio = speed / ground.stribeck_velocity
        more = (mu_s - mu_c) * normal * np.exp(-ratio * ratio)
        friction = mu_c * normal + more + ground.mu_v * speed
        rest = gain - friction / speed
        if rest > 0.0:
            high = gain
        else:
            low = gain
        if abs(rest) * speed <= 1e-13 * (1.0 + friction) or high - low <= 1e-15 * gain:
            break
        # How the speed and rest change with the gain.
        z1, z2 = _slide_velocity(gain, a11, a12, a22, a11 * w1 + a12 * w2, a12 * w1 + a22 * w2)
        slowing = -(w1 * z1 + w2 * z2) / speed
        steeper = ground.mu_v - 2.0 * more * ratio / ground.stribeck_velocity
        slope = 1.0 - (steeper - friction / speed) * slowing / speed
        gain = gain - rest / slope if slope > 0.0 and abs(rest) < 0.5 * last else -1.0
        last = abs(rest)
        if not low < gain < high:  # Newton leaves the bracket or is slow
            gain = 0.5 * (low + high) if high < np.inf else 4.0 * low
            last = np.inf
    return -gain * w1, -gain * w2


@kernel(mobility=("3n", "3n"), free_velocity=("3n",), height=("n",), friction=("n", 2), force=("3n",))
def contact_step(
    mobility: Vector,
    free_velocity: Vector,
    height: Vector,
    friction: Vector,
    dt: float,
    ground: GroundRecord,
    force: Vector,
    tolerance: float = 1e-10,
    max_sweeps: int = 500,
) -> int:
    """Contact forces of one implicit time step, by Gauss–Seidel over the feet.

    Finds forces f such that, with foot velocities u = free_velocity + mobility f, each normal force obeys E1 at the
    end of the step and each friction force obeys E2 at the velocity u, exactly at rest where the cone allows it.

    Args:
        mobility: (3n, 3n) change of foot velocity over the step per newton, dt J M⁻¹ Jᵀ, m/s/N.
        free_velocity: (3n,) foot velocities without contact forces, world axes, m/s.
        height: (n,) foot heights at the start of the step, m.
        friction: (n, 2) static and sliding coefficient under each foot, see :func:`local_friction`.
        dt: step, s.
        ground: the element of :attr:`Ground.record`.
        force: (3n,) starting guess in, forces out, world axes, N.
        tolerance: largest change of a force in the last sweep, relative to 1 N + the largest force.
        max_sweeps: limit of the iteration.

    Returns:
        Number of sweeps done; ``max_sweeps + 1`` if they did not converge.
    """
    n = height.shape[0]
    touching = False
    for k in range(n):
        touching = touching or height[k] + dt * free_velocity[3 * k + 2] < 0.0
    if not touching:
        force[:] = 0.0
        return 0
    for sweep in range(1, max_sweeps + 1):
        change, largest = 0.0, 0.0
        relax = 1.0 if sweep <= 60 else 0.5  # breaks the rare cycle between sticking and sliding
        for k in range(n):
            x, y, z = 3 * k, 3 * k + 1, 3 * k + 2
            mu_s, mu_c = friction[k, 0], friction[k, 1]
            # Normal and friction of one foot are coupled most: iterate them a few times.
            for _ in range(2):
                free = free_velocity[z]
                for j in range(3 * n):
                    if j != z:
                        free += mobility[z, j] * force[j]
                normal = _solve_normal(height[k], free, mobility[z, z], dt, ground)
                change = max(change, abs(normal - force[z]))
                normal = force[z] + relax * (normal - force[z])
                force[z] = normal
                if normal <= 0.0:
                    change = max(change, abs(force[x]), abs(force[y]))
                    force[x] = 0.0
                    force[y] = 0.0
                    break
                if ground.per_axis:
                    for i in (x, y):
                        free = free_velocity[i]
                        for j in range(3 * n):
                            if j != i:
                                free += mobility[i, j] * force[j]
                        along = _solve_slide_1d(free, mobility[i, i], normal, mu_s, mu_c, ground)
                        change = max(change, abs(along - force[i]))
                        force[i] += relax * (along - force[i])
                else:
                    free_x, free_y = free_velocity[x], free_velocity[y]
                    for j in range(3 * n):
                        if j != x and j != y:
                            free_x += mobility[x, j] * force[j]
                            free_y += mobility[y, j] * force[j]
                    a11, a12, a22 = mobility[x, x], mobility[x, y], mobility[y, y]
                    fx, fy = _solve_slide_2d(
                        free_x, free_y, a11, a12, a22, normal, mu_s, mu_c, ground, force[x], force[y]
                    )
                    change = max(change, abs(fx - force[x]), abs(fy - force[y]))
                    force[x] += relax * (fx - force[x])
                    force[y] += relax * (fy - force[y])
            largest = max(largest, force[z], abs(force[x]), abs(force[y]))
        if change <= tolerance * (1.0 + largest):
            return sweep
    return max_sweeps + 1
