"""States, targets and supports for the condensed controller, from ordinary to hopeless."""

import pinocchio as pin

import harpy_pin as hp
from harpy_pin.wbc import WholeBodyTargets, WholeBodyWeights

ROBOT = hp.load_harpy()
NV = 12
STANDING = hp.make_gait(ROBOT).initial_state()[0]
SUPPORTS = ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
WEIGHTS = WholeBodyWeights(posture=1e-10)
"""The condensed controller has no posture task: limbs leave no posture free. The whole-body program must have one."""


def random_case(rng, *, spread):
    """A state around standing, targets however far from what is possible, and which feet are held."""
    q = pin.integrate(ROBOT.model, STANDING, spread * rng.standard_normal(NV))
    v = 3.0 * spread * rng.standard_normal(NV)
    targets = WholeBodyTargets(ROBOT)
    size = 10.0 ** rng.uniform(-1.0, 2.0)
    targets.body[:] = size * rng.standard_normal(3)
    targets.orientation[:] = 3.0 * size * rng.standard_normal(3)
    targets.feet[:] = size * rng.standard_normal((2, 3))
    targets.held[:] = SUPPORTS[rng.integers(4)]
    targets.force_range[:] = (rng.uniform(0.0, 20.0), 200.0)
    return q, v, targets
