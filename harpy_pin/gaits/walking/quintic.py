"""The way of a foot in the air: a quintic from where it is to where it should be, found anew at every tick."""

from __future__ import annotations

from harpy_pin.compiled import kernel

__all__: list[str] = []


@kernel
def toward(
    place: float, velocity: float, acceleration: float, goal: float, left: float, step: float
) -> tuple[float, float, float]:
    """Place, velocity and acceleration after a time on the quintic that ends at rest at the goal after the time left.

    Once it is over, they are the goal's.
    """
    if step >= left:
        return goal, 0.0, 0.0
    s, way, glide, bend = step / left, goal - place, velocity * left, 0.5 * acceleration * left * left
    third = 10.0 * way - 6.0 * glide - 3.0 * bend
    fourth = -15.0 * way + 8.0 * glide + 3.0 * bend
    fifth = 6.0 * way - 3.0 * glide - bend
    return (
        place + s * (glide + s * (bend + s * (third + s * (fourth + s * fifth)))),
        (glide + s * (2.0 * bend + s * (3.0 * third + s * (4.0 * fourth + s * 5.0 * fifth)))) / left,
        (2.0 * bend + s * (6.0 * third + s * (12.0 * fourth + s * 20.0 * fifth))) / (left * left),
    )
