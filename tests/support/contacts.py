"""Random feet in contact, for the implicit step of the ground."""

import numpy as np


def draw_contact(seed, feet):
    """Feet above and in the ground, with a random symmetric positive definite mobility."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3 * feet, 3 * feet))
    mobility = root @ root.T + 0.1 * np.eye(3 * feet)
    dt = 10 ** rng.uniform(-4, -3)
    mobility *= dt * 10 ** rng.uniform(-0.5, 1.5) / np.trace(mobility)  # of the order dt / mass
    free = rng.normal(size=3 * feet) * 10 ** rng.uniform(-4, 0.5)
    height = rng.normal(size=feet) * 10 ** rng.uniform(-5, -2)
    return mobility, free, height, dt
