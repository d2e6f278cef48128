"""The contact-force filter's settings; see :mod:`harpy_pin.governors.contact_force_filter`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.gaits.fitting import leg_length
from harpy_pin.gaits.straight import TUNED_MASS
from harpy_pin.model.robot import Robot

TUNED_LEG = 0.7000000000000001
"""Length of Harpy's legs, m, by :func:`~harpy_pin.gaits.fitting.leg_length`."""


@dataclass(frozen=True, kw_only=True)
class ContactForceFilterParameters(checks.Checked):
    """Settings of :class:`~harpy_pin.governors.ContactForceFilter`; the defaults are Harpy's.

    For another robot :meth:`for_robot` scales them. The weights were found by a random search over
    slip on walks at friction 0.2, 0.15 and 0.1, without pushes (``docs/limitations.md``); its
    script was not kept.

    Attributes:
        mu: friction coefficient μ_s of the ground.
        friction_share: share of μ that is used; 1 − share is the known relative error of μ.
        margin: N kept between the tangential force and the cone, for the error of the predicted
            force.
        min_normal_force: least normal force of a foot that touches, N.
        contact_threshold: measured normal force that counts as touching, N.
        contact_damping: κ, rate at which a touching foot is taken to come to rest, 1/s.
        linear: weights on the change of the body's linear acceleration, body axes, s⁴/m².
        angular: weights on that of its angular acceleration, body axes, s⁴/rad².
        swing: weight on that of a foot in the air.
        thrust: weight on the change of each thrust, 1/N².
        torque: weight on the change of each torque, 1/(N·m)².
        thrust_authority: largest change of any component of a thrust, N.
        torque_authority: largest change of a torque, N·m; of a joint target with stiffness K_p,
            this over K_p.
        lag: time constant with which the change follows its target, s; zero for none. It bounds the
            rate of the change by twice the authority over the lag, so that a contact switch does
            not make the command jump.
        sliding_speed: speed of a foot from which on its force is corrected less, m/s; not at all
            from twice this speed on. No force inside the cone makes a sliding foot stick, and
            attempts make the walk worse.
    """

    mu: float = checks.setting(0.25, low=0.0)
    friction_share: float = checks.setting(0.95, low=0.0, high=1.0, strict=True)
    margin: float = checks.setting(0.2, low=0.0)
    min_normal_force: float = checks.setting(1.0, low=0.0)
    contact_threshold: float = checks.setting(1.0, low=0.0)
    contact_damping: float = checks.setting(100.0, low=0.0)
    linear: tuple[float, float, float] = checks.setting((0.04, 1.0, 0.1), checks.fixed_gains)
    angular: tuple[float, float, float] = checks.setting((0.015, 2e-6, 0.0075), checks.fixed_gains)
    swing: float = checks.setting(5.0, low=0.0)
    thrust: float = checks.setting(1e-5, low=0.0, strict=True)
    torque: float = checks.setting(1e-2, low=0.0, strict=True)
    thrust_authority: float = checks.setting(40.0, low=0.0, strict=True)
    torque_authority: float = checks.setting(7.5, low=0.0, strict=True)
    lag: float = checks.setting(0.002, low=0.0)
    sliding_speed: float = checks.setting(0.07, low=0.0, strict=True)

    @classmethod
    @checked
    def for_robot(cls, robot: Robot, *, mu: float = 0.25) -> ContactForceFilterParameters:
        """Settings for a robot: Harpy's, scaled with its mass m and the length l of its legs.

        Forces scale with m, torques with m l, the weights on their squares with one over the square
        of that, and those on squared angular accelerations with l².

        Args:
            robot: any; where it has no legs, only its mass counts.
            mu: friction coefficient μ_s of the ground.
        """
        plain, mass, leg = (
            cls(mu=mu),
            robot.mass / TUNED_MASS,
            (leg_length(robot) or TUNED_LEG) / TUNED_LEG,
        )
        x, y, z = plain.angular
        return replace(
            plain,
            margin=plain.margin * mass,
            min_normal_force=plain.min_normal_force * mass,
            contact_threshold=plain.contact_threshold * mass,
            angular=(x * leg**2, y * leg**2, z * leg**2),
            thrust=plain.thrust / mass**2,
            torque=plain.torque / (mass * leg) ** 2,
            thrust_authority=plain.thrust_authority * mass,
            torque_authority=plain.torque_authority * mass * leg,
        )

    @classmethod
    @checked
    def robust(
        cls,
        *,
        mu: float,
        friction_error: float = 0.05,
        force_error: float = 0.2,
        mass_error: float = 0.0,
        delay: float = 0.0,
        load: float = 40.0,
        force_rate: float = 200.0,
    ) -> ContactForceFilterParameters:
        """Settings tightened for known bounds on errors, in newtons.

        The force on a foot differs from the predicted one by at most δ = e_f + ε_m F + T Ḟ.
        Friction then holds if |f_t| + δ ≤ (1 − ε_μ) μ (f_z − δ), which is the cone with share 1 −
        ε_μ and margin (1 + (1 − ε_μ) μ) δ.

        Args:
            mu: nominal μ_s.
            friction_error: ε_μ, relative.
            force_error: e_f, error of the prediction itself, N.
            mass_error: ε_m, relative.
            delay: T, between measurement and action, s.
            load: F, largest force on a foot, N; by default Harpy's weight.
            force_rate: Ḟ, how fast the force on a foot changes away from impacts, N/s.

        Raises:
            InputError: a bound is negative, or the friction error is not below one.
        """
        share = 1.0 - checks.number("friction_error", friction_error, low=0.0, high=0.999)
        error = (
            checks.number("force_error", force_error, low=0.0)
            + checks.number("mass_error", mass_error, low=0.0)
            * checks.number("load", load, low=0.0)
            + checks.number("delay", delay, low=0.0)
            * checks.number("force_rate", force_rate, low=0.0)
        )
        return cls(mu=mu, friction_share=share, margin=(1.0 + share * mu) * error)
