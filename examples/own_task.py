"""Tasks of one's own in the whole-body QP: a foot that carries less, a knee that swings wide, a range, and one in NumPy."""

import numpy as np

import harpy_pin as hp


class LessSpin:
    """Any object with a method ``rows``: damps the body's yaw, A a ≈ b in the generalised acceleration a."""

    def rows(self, dynamics, state):
        return np.eye(6, len(state.v))[5:], -5.0 * state.v[5:6]


def controller(gait: hp.Gait) -> hp.WholeBodyController:
    walker = hp.make_controller("wbc", gait, mu=0.25)

    # A foot's force: 25 N up, none sideways, while the left foot is on the ground.
    walker.foot = walker.add(hp.FootForceTask("left_foot", force=(0.0, 0.0, 25.0)), weight=0.01)

    # A frame: the angular velocity of the right shank is damped.
    shank = hp.FrameTask("right_knee", part="orientation", gains=(0.0, 5.0))
    walker.shank = walker.add(shank, weight=1e-3)

    walker.add(LessSpin(), weight=0.1)
    return walker


made = []
scenario = hp.Scenario(controller="wbc", ground=hp.Ground(mu_s=0.25), duration=2.0)
for name, make in (("without", None), ("with", lambda gait: made.append(controller(gait)) or made[0])):
    run = hp.walk(scenario, controller=make) if make else hp.walk(scenario)
    both = run["held"].all(axis=1)
    left = run["wanted_force"][both, 0, 2]
    print(f"{name:8s}tasks: {run.ending}, left foot in double support {left.mean():.1f} N on average")
print("rows of the last tick:", made[0].foot.matrix.shape, made[0].foot.target, "error", made[0].foot.error.round(2))
