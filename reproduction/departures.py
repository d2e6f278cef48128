"""Where this reproduction departs from the printed paper, and the row of equations.md that says why."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DEPARTURES", "Departure"]


@dataclass(frozen=True)
class Departure:
    """A departure.

    Attributes:
        printed: what the paper prints.
        here: what is computed here.
        row: of equations.md; a dash where the choice is this project's own.
    """

    printed: str
    here: str
    row: str


DEPARTURES: tuple[Departure, ...] = (
    Departure(
        "Stribeck friction even in the velocity, viscous term with the wrong sign",
        "opposes the velocity, viscous term added; per axis or circular (circular by default)",
        "E2",
    ),
    Departure("projector Y with J_sᵀJ_s and J_s in the wrong order", "Y = r rᵀ / L²", "E5"),
    Departure("u_r = J_sᵀ(…), a vector", "u_r = J_s(…), a scalar; it is r·c̈, not the length's acceleration", "E6"),
    Departure("u_roll and u_pitch", "roll and yaw, with the signs a right-handed body needs", "E7"),
    Departure(
        "update law with different conditions in the equations and in the listing; α_r given twice",
        "the listing by default, the equations as an option; the second α_r is α_n",
        "E8",
    ),
    Departure(
        "constraints linearised by a Taylor series", "exactly affine rows (R1), or the tracked reading (R2)", "§2"
    ),
    Departure("masses, lengths, ground and joint gains not printed", "values marked L and C", "§3"),
    Departure("mass of the VLIP run not printed", "4 kg", "§3"),
    Departure("c is the body's centre of mass", "the body's origin, with the total mass of 4.02 kg", "§3"),
    Departure(
        "joint derivative gain of the hips 40 in continuous time",
        "10 at the hips and 3 at the knees: held over 1 ms, 40 is unstable on the inertia a hip motor feels",
        "§3",
    ),
    Departure("joint damping of 5 N·m·s/rad", "0.1: with motors of 8.5 N·m, 5 would stop the knee", "§3"),
    Departure(
        "Runge–Kutta steps of an explicit friction law", "a step that is implicit in the contact, exact stick", "§3"
    ),
    Departure("feet at ±0.15 m", "±0.125 m in the default and the optimised gait, which slips less", "§3"),
    Departure("massless lower legs", "10 g each, and a rotor inertia of 0.005 kg·m² at every joint", "§3"),
)
