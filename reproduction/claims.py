"""Claims of the paper, the verdicts on them (equations.md §4), and what the reproduction does
otherwise.
"""

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """What the reproduction says of a claim."""

    HOLDS = "holds"
    IN_PART = "holds in part"
    NOT = "does not hold"


def judge(holds: bool, in_part: bool = False) -> Verdict:
    """The verdict on a claim that holds, or at least holds in part."""
    if holds:
        return Verdict.HOLDS
    return Verdict.IN_PART if in_part else Verdict.NOT


@dataclass(frozen=True)
class Claim:
    """A claim."""

    key: str  # Q1 to Q8
    text: str  # what the paper says
    where: str  # in the paper
    # what counts as holding, and as holding in part. Those of Q1 to Q3 were written with numbers of
    # the VLIP runs
    # already known, so they are conventions, not predictions.
    criterion: str


@dataclass(frozen=True)
class Finding:
    """The verdict on a claim."""

    claim: Claim  # which
    verdict: Verdict  # what was found
    number: str  # the number behind it, in words and units
    command: str  # prints it
    values: dict[str, float]  # the numbers themselves
    setting: str = ""  # which gait walked, for the claims on the full robot


CLAIMS: dict[str, Claim] = {
    claim.key: claim
    for claim in (
        Claim(
            "Q1",
            "VLIP: when the target reference is used, almost all constraints are violated.",
            "constraint figure of the VLIP run",
            "Holds if every kind of constraint (friction x, friction y, normal force, angle) is "
            "violated at some time "
            "and some constraint at more than half of the ticks; in part if at least half of the "
            "kinds are.",
        ),
        Claim(
            "Q2",
            "VLIP: with the applied reference the constraints stay above zero, but for a slight "
            "dip near t = 1.4 s "
            "that is pushed back.",
            "constraint figure of the VLIP run",
            "Holds if at most 5 % of the ticks violate a force constraint, by at most 1 N, with "
            "the worst between 1.2 "
            "and 1.6 s; in part if the share of violating ticks is at most half of the ungoverned "
            "one.",
        ),
        Claim(
            "Q3",
            "VLIP: applied and target reference differ most around t = 0.5 s, in angle and length.",
            "state figure of the VLIP run",
            "Holds if the first period's largest difference of angle and of length both lie within "
            "0.15 s of 0.5 s; in "
            "part if one does.",
        ),
        Claim(
            "Q4",
            "3D: the 2D gait is not stable in 3D without thrusters; with them it walks.",
            "text of the 3D simulation",
            "Holds if the walk falls without thrust and does not fall with it.",
        ),
        Claim(
            "Q5",
            "3D: the robot avoids slipping at μ_s = 0.25, with friction inside the bounds.",
            "force figure of the 3D run",
            "Holds if the feet slip at most 8 mm per step in all and 1 mm after the first 50 ms; "
            "in part if less than "
            "without a governor. (Simulated friction inside the cone is no evidence: Coulomb's law "
            "has it so.)",
        ),
        Claim(
            "Q6",
            "3D: the target reference violates the normal-force constraint frequently; the applied "
            "one is pushed back.",
            "constraint figure of the 3D run",
            "Holds if the target violates the model's normal-force row at more than 1 % of the "
            "ticks and the applied "
            "reference at less than half as many; in part if it violates it at all.",
        ),
        Claim(
            "Q7",
            "3D: the constraint at the applied reference chatters.",
            "constraint figure of the 3D run",
            "Holds if the reversals per second of the applied reference grow by at least a half "
            "when the control "
            "period is divided by four; in part if they grow by a tenth.",
        ),
        Claim(
            "Q8",
            "The governor costs much less than optimisation-based whole-body control.",
            "abstract; no number is given anywhere",
            "Holds if a governor update takes at most a tenth of the whole-body program's solve on "
            "the same states; in "
            "part if at most a half.",
        ),
    )
}


@dataclass(frozen=True)
class Departure:
    """A departure."""

    printed: str  # what the paper prints
    here: str  # what is computed here
    row: str  # of equations.md; a dash where the choice is this project's own


DEPARTURES: tuple[Departure, ...] = (
    Departure(
        "Stribeck friction even in the velocity, viscous term with the wrong sign",
        "opposes the velocity, viscous term added; per axis or circular (circular by default)",
        "E2",
    ),
    Departure("projector Y with J_sᵀJ_s and J_s in the wrong order", "Y = r rᵀ / L²", "E5"),
    Departure(
        "u_r = J_sᵀ(…), a vector",
        "u_r = J_s(…), a scalar; it is r·c̈, not the length's acceleration",
        "E6",
    ),
    Departure("u_roll and u_pitch", "roll and yaw, with the signs a right-handed body needs", "E7"),
    Departure(
        "update law with different conditions in the equations and in the listing; α_r given twice",
        "the listing by default, the equations as an option; the second α_r is α_n",
        "E8",
    ),
    Departure(
        "constraints linearised by a Taylor series",
        "exactly affine rows (R1), or the tracked reading (R2)",
        "§2",
    ),
    Departure("masses, lengths, ground and joint gains not printed", "values marked L and C", "§3"),
    Departure("mass of the VLIP run not printed", "4 kg", "§3"),
    Departure(
        "c is the body's centre of mass", "the body's origin, with the total mass of 4.02 kg", "§3"
    ),
    Departure(
        "joint derivative gain of the hips 40 in continuous time",
        "10 at the hips and 3 at the knees: held over 1 ms, 40 is unstable on the inertia a hip "
        "motor feels",
        "§3",
    ),
    Departure(
        "joint damping of 5 N·m·s/rad", "0.1: with motors of 8.5 N·m, 5 would stop the knee", "§3"
    ),
    Departure(
        "Runge–Kutta steps of an explicit friction law",
        "a step that is implicit in the contact, exact stick",
        "§3",
    ),
    Departure(
        "feet at ±0.15 m", "±0.125 m in the default and the optimised gait, which slips less", "§3"
    ),
    Departure(
        "massless lower legs", "10 g each, and a rotor inertia of 0.005 kg·m² at every joint", "§3"
    ),
)
