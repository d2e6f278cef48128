"""The way of a swing foot from where it is to where it lands."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector


@kernel
def toward(
    place: float, velocity: float, acceleration: float, goal: float, left: float, step: float
) -> tuple[float, float, float]:
    """Place, velocity and acceleration after a time on the quintic that ends at rest at the goal
    after the time left.

    Once it is over, they are the goal's.
    """
    if step >= left:
        return goal, 0.0, 0.0
    s, way, glide, bend = (
        step / left,
        goal - place,
        velocity * left,
        0.5 * acceleration * left * left,
    )
    third = 10.0 * way - 6.0 * glide - 3.0 * bend
    fourth = -15.0 * way + 8.0 * glide + 3.0 * bend
    fifth = 6.0 * way - 3.0 * glide - bend
    return (
        place + s * (glide + s * (bend + s * (third + s * (fourth + s * fifth)))),
        (glide + s * (2.0 * bend + s * (3.0 * third + s * (4.0 * fourth + s * 5.0 * fifth))))
        / left,
        (2.0 * bend + s * (6.0 * third + s * (12.0 * fourth + s * 20.0 * fifth))) / (left * left),
    )


def swing(
    foot: ArrayLike,
    goal: ArrayLike,
    t: float,
    *,
    left: float,
    apex: float,
    rise: float | None = None,
    early: float = 0.0,
    descent: float = 0.0,
) -> Vector:
    """State of a swing foot after a time.

    Each coordinate is a polynomial of fifth order that ends at rest, without acceleration: x and y
    at the goal, z first at the highest point, then at the goal, where it may come down steadily.
    Such a polynomial that begins anew on its way is the same one. So this may be called once for a
    whole swing, or at every tick from the last state on, with a goal, or a time of landing, that
    changes.

    Args:
        foot: (3,) where the foot is lifted, at rest, m; or (3, 3) its position (m), velocity (m/s)
            and acceleration (m/s²) at present.
        goal: (3,) where it lands, m.
        t: time from the present on, s.
        left: time from the present to the landing, s; from then on it rests at the goal,
            or goes on down.
        apex: height z of the highest point, m.
        rise: time from the present to the highest point, s, by default half of ``left``; zero or
            less where it has been there.
        early: how long before the landing x and y are at the goal, s.
        descent: velocity downwards at which it lands and goes on, m/s.

    Returns:
        (3, 3) position (m), velocity (m/s), acceleration (m/s²), in the axes of ``foot``.

    Raises:
        InputError: an array has another shape or is not finite, or a time is not finite.
    """
    given = np.asarray(foot, dtype=object)
    state = np.zeros((3, 3))
    state[: 3 if given.shape == (3, 3) else 1] = checks.vector(
        "foot", foot, (3, 3) if given.shape == (3, 3) else 3
    )
    end = checks.vector("goal", goal, 3).tolist()
    landing = checks.number("left", left)
    top = 0.5 * landing if rise is None else checks.number("rise", rise)
    if top > max(landing, 0.0):
        raise InputError("a foot is at its highest before it lands: rise ≤ left", name="rise")
    now, height = checks.number("t", t, low=0.0), checks.number("apex", apex)
    before, down = checks.number("early", early, low=0.0), checks.number("descent", descent)
    return on_its_way(
        state, end, now, left=landing, rise=top, apex=height, early=before, descent=down
    )


def on_its_way(
    foot: Vector,
    goal: Sequence[float],
    t: float,
    *,
    left: float,
    rise: float,
    apex: float,
    early: float,
    descent: float,
) -> Vector:
    """:func:`swing` without its checks, from a state (3, 3)."""
    x, y, z = foot.T.tolist()
    ends = [toward(*x, goal[0], left - early, t), toward(*y, goal[1], left - early, t)]
    if t < rise:
        ends.append(toward(*z, apex, rise, t))
        return np.array(ends).T
    if rise > 0.0:
        z, left, t = [apex, 0.0, 0.0], left - rise, t - rise
    # In axes that come down with the foot it ends at rest
    height, velocity, acceleration = z
    ends.append(toward(height - descent * left, velocity + descent, acceleration, goal[2], left, t))
    way = np.array(ends).T
    way[:2, 2] += descent * (left - t), -descent
    return way
