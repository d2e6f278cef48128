"""Limitations of the results, printed with them."""

from __future__ import annotations

LIMITATIONS = (
    "One machine, not reserved for this: other processes disturb the tails (p99, max) more than the medians. "
    "No core is reserved, no frequency fixed, no real-time priority set.",
    "All controllers are called from Python. Its calls, eigenpy's and ProxQP's binding are part of the times. They "
    "are a larger share of the governed controller's short tick; the QP controller has more of them. What the ratio "
    "between complete C++ controllers would be is not measured here.",
    "Replays run tick after tick with nothing between them: caches are warmer than on a robot that does other work.",
    "The solvers get dense programs; sparsity and code generation are not tried. The QP controller's "
    "own tick tries the last active set first, which solves nearly every tick; its tail is the ticks where that fails.",
    "A solver that reports success need not have found the optimum; the checks say how often it had not. The time of a "
    "solution that is not optimal is not the time of solving the program.",
    "The controllers do not solve the same task. The program and the condensed controller hold friction, torque and "
    "thrust limits on the full rigid-body model, at every foot. The rows of the paper's governor, for friction and "
    "normal force, act on one force that a reduced-order model expects at the centre of pressure, not on the forces "
    "at the feet. A cheaper tick does not mean that the same was achieved: see the walks.",
    "As in the paper, the governed controller's torques and thrusts are not limited; those of the program and of the "
    "condensed controller are. The largest torque and thrust of each walk are in the table of walks.",
    "The friction pyramid of the program and of the condensed controller has eight faces inside the cone of three "
    "quarters of μ; the "
    "reduced-order governors' pyramid lies around Coulomb's disc; the contact-force filter uses 0.95 of the disc less "
    "0.2 N. Outside the campaign all are given the true static coefficient. None knows the ground's compliance, nor "
    "that sliding friction is a tenth lower.",
    "The QP controller and the condensed controller know the exact mass, inertia and joint damping (in the campaign: "
    "with an error of the body's mass); the governed controller needs the mass and the legs' geometry only.",
    "Every controller gets the true state, without noise and at once. A scenario can have measurement noise and delay, "
    "but no walk of this comparison has either.",
    "The contact-force filter's weights (some 400 settings tried) and the program's weights, gains and share of "
    "friction (some 650, used by the condensed controller as well) were searched for little slip on walks of this same "
    "gait at friction "
    "0.2, 0.15 and 0.1. The program's were then chosen among rounded candidates by twelve more walks, whose pushes and "
    "mass errors overlap with the campaign's. The default gait was itself searched for little slip. The scripts of "
    "these searches are lost. 'python -m comparison tune' is the search that can be repeated, with one budget for all; "
    "of its settings only the paper's best variant is in this table, 'campaign variants' walks the others.",
    "Where no row is violated the paper's governor takes its cheap branch and only lags behind its target; the share "
    "of ticks with a violated row is in the table of activity. Where that share is zero, the constraints had no effect "
    "on the walk, whatever the measures say. Updates with violated rows are therefore timed apart, with a governor "
    "that assumes no friction.",
    "Replays are open-loop: the states come from the walks of two controllers, so that integrals, applied reference "
    "and warm start of the others follow states that their own commands did not cause.",
    "The paper's governor is walked as printed (measured state, PID, published gains), and in the best variant that "
    "the search found. It slides in both; whether it falls depends on choices that the paper leaves open.",
    "One robot, one gait on flat ground, one speed, one set of gains for each controller. Walks are "
    "deterministic; the campaign shows how much the measures depend on the scenario.",
)
"""Printed with every result."""

OF_THE_CAMPAIGN = (
    "The campaign's walks have errors of the body's mass and of the assumed friction, and pushes, but neither noise "
    "nor delay of the measurements. Its scenarios are drawn from a few levels of each; shares and medians over them "
    "describe this set of scenarios, not walking in general. Slip of a walk that fell counts up to its fall, so that "
    "an early fall hides slip that would have come.",
    "Walks of the governors repeat exactly, and walks of the QP controller as long as its exchange of active "
    "constraints ends by itself; where ProxQP is called, the last digits depend on where its memory lies, which a walk "
    "on the verge of falling enlarges.",
)
"""Printed with every result that has a campaign."""
