"""States near standing, and commands of any size, for the shield and its batch."""

import numpy as np
import pinocchio as pin

import harpy_pin as hp

ROBOT = hp.load_harpy()
STANDING = hp.make_gait(ROBOT).initial_state()[0]
AT_ONCE = hp.ContactForceFilterParameters(lag=0.0)


def draw(rng, *, size, supports=((1, 1), (1, 0), (0, 1))):
    """A state near standing, on one foot or two, and a command about as large as a walk's times
    ``size``.
    """
    q = pin.integrate(ROBOT.model, STANDING, 0.1 * rng.standard_normal(12))
    v = 0.02 * rng.standard_normal(12)
    force = np.zeros((2, 3))
    force[:, 2] = 30.0 * np.array(supports[rng.integers(len(supports))])
    thrust = rng.uniform((-3.0, -3.0, 0.0), (3.0, 3.0, 10.0), (2, 3))
    state = hp.State(0.0, q, v, np.zeros((2, 3)), np.zeros((2, 3)), force)
    return state, hp.Command(size * rng.uniform(-3.0, 3.0, 6), size * thrust)
