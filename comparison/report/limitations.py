"""What the numbers do not say."""

from __future__ import annotations

__all__ = ["LIMITATIONS", "OF_THE_CAMPAIGN"]

LIMITATIONS = (
    "One machine, not reserved for this: other processes disturb the tails (p99, max) more than the medians. "
    "No core is reserved, no frequency fixed, no real-time priority set.",
    "Both controllers are called from Python. Its calls, eigenpy's and ProxQP's binding are part of the times. They "
    "are a larger share of the governed controller's short tick; the QP controller has more of them. Which way the "
    "ratio would go between two complete C++ controllers is not measured here.",
    "Replays run tick after tick with nothing between them: caches are warmer than on a robot that does other work.",
    "The solvers get dense programs, filled by Numba; sparsity and code generation are not tried. The QP controller's "
    "own tick tries the last active set first, which solves nearly every tick; the tails are the ticks where ProxQP is "
    "asked.",
    "A solver that reports success need not have found the optimum; the checks say how often it had not. A time for a "
    "solution that is not optimal is no time for solving the program.",
    "The two controllers do not solve the same task. The program holds friction, torque and thrust limits on the full "
    "rigid-body model, at every foot; the governor's friction and normal-force rows act on one force that a "
    "reduced-order model expects at the centre of pressure, not on the forces at the feet. A cheaper tick is no "
    "statement that the same was achieved: see the walks.",
    "As in the paper, the governed controller's torques and thrusts are not limited; the program's are. The largest "
    "torque and thrust of each walk are in the table of walks.",
    "The program's friction pyramid has eight faces inside the cone of three quarters of μ; the reduced-order "
    "governors' pyramid lies around Coulomb's disc; the true-force governor uses 0.95 of the disc less 0.2 N. All know "
    "the true static coefficient; none knows the ground's compliance, nor that sliding friction is a tenth lower.",
    "The QP controller knows the exact mass, inertia and joint damping; the governed controller needs the mass and "
    "the legs' geometry only. No model error, sensor noise or delay is simulated.",
    "The true-force governor's weights (some 400 settings) and the program's weights, gains and share of friction "
    "(some 650) were searched over slip on walks at friction 0.2, 0.15 and 0.1 of this very gait; the program's were "
    "then chosen among rounded candidates by twelve more walks, whose pushes and mass errors overlap with the "
    "campaign's.",
    "Where no row is violated the governor takes its cheap branch and only lags behind its target; the share of ticks "
    "with a violated row is in the table of checks. Where that share is zero, nothing in the walk is owed to the "
    "constraints, whatever the measures say. Updates with violated rows are therefore timed apart, with a governor "
    "that assumes no friction.",
    "Replays are open-loop: half of the states come from the other controller's walk, and integrals, applied "
    "reference and warm start follow states that their own commands did not cause.",
    "One robot, one gait on flat ground, one speed, one set of gains for each controller. Walks are "
    "deterministic; the pushed walks show how much the measures depend on the start.",
)
"""Said of every result."""

OF_THE_CAMPAIGN = (
    "The campaign, unlike all else here, does simulate errors of the body's mass and of the assumed friction, and "
    "pushes. Its scenarios are drawn from a few levels of each; shares and medians over them describe this set, not "
    "the world. Slip of a walk that fell counts up to its fall, so that an early fall hides slip that would have come.",
    "Walks of the governors repeat exactly, and walks of the QP controller as long as its exchange of active "
    "constraints ends by itself; where ProxQP is asked, the last digits depend on where its memory lies, which a walk "
    "on the verge of falling enlarges.",
)
"""Said of every result with a campaign."""
