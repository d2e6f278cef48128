"""States of any robot that no robot can have, and states at the edge of what is taken for
possible.
"""

import numpy as np

import harpy_pin as hp
from harpy_pin.model.entry import MAX_SAMPLE


def draw_hostile(robot, rng):
    """A state: of everyday size or of any size within the bound, and then, half of them, spoiled in
    one place.
    """
    model, feet = robot.model, len(robot.feet)
    q, v = np.empty(model.nq), rng.standard_normal(model.nv)
    q[:7] = rng.standard_normal(7)
    q[3:7] /= np.linalg.norm(q[3:7])
    q[7:] = rng.uniform(-np.pi, np.pi, model.nq - 7)
    if rng.random() < 0.5:
        q[3:7] = (*(0.1 * rng.standard_normal(3)), 1.0)
        q[3:7] /= np.linalg.norm(q[3:7])
    force = rng.uniform((-50.0, -50.0, 0.0), (50.0, 50.0, 200.0), (feet, 3))
    force[rng.random(feet) < 0.3] = 0.0
    kind = rng.integers(4)
    if kind == 1:
        v *= 10.0 ** rng.uniform(-6.0, 6.0)
    elif kind == 2:
        v *= 10.0 ** rng.uniform(-6.0, 6.0, v.shape)
    elif kind == 3:
        q[:3] *= 10.0 ** rng.uniform(-6.0, 6.0, 3)
        q[7:] *= 10.0 ** rng.uniform(-6.0, 6.0)
        force *= 10.0 ** rng.uniform(-6.0, 6.0, (feet, 3))
    for array in (q[:3], q[7:], v, force):
        np.clip(array, -MAX_SAMPLE, MAX_SAMPLE, out=array)
    points = rng.standard_normal((2, feet, 3))
    state = hp.State(rng.uniform(0.0, 10.0), q, v, *points, force)
    if rng.random() < 0.5:
        spoil(state, rng)
    return state


def spoil(state, rng):
    """One number, one array or the time of a state, in place: any number that there is."""
    kind = rng.integers(5)
    if kind == 0:
        state.q[3:7] *= (0.0, 5e-324, 1e-160, 1e-3, 10.0, 1e160)[rng.integers(6)]
    elif kind == 1:
        state.t = any_number(rng)
    else:
        array = (state.q, state.v, state.foot_force)[rng.integers(3)].reshape(-1)
        which = rng.integers(array.size) if kind == 2 else slice(None)
        array[which] = any_number(rng) if kind < 4 else 1e200 * rng.standard_normal(array.size)


def any_number(rng):
    """Of any size, or none."""
    if rng.random() < 0.2:
        return (np.nan, np.inf, -np.inf, 0.0, 5e-324, 1.7e308, -1.7e308)[rng.integers(7)]
    return float(rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-320.0, 308.0))
