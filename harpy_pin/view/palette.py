"""Colours of the scene and the figures: the Okabe–Ito palette, distinct for colour-blind readers
and in print.
"""

from collections.abc import Iterable

CONTACT = "#0072b2"
FRICTION = "#56b4e9"
SLIDING = "#d62a1e"
THRUST = "#e69f00"
TARGET = "#009e73"
APPLIED = "#b0408a"
ESTIMATE = "#d55e00"
BODY = "#ffffff"
LEFT = "#0072b2"
RIGHT = "#d55e00"
SLIP = "#3a2a26"
FLOOR = "#1b2430"
PRESSURE = "#f0e442"
FEET = (LEFT, RIGHT, "#009e73", "#b0408a")
"""One after the other for feet (or thrusters) in one chart."""
RUNS = ("#0072b2", "#d55e00", "#009e73", "#b0408a")
"""One after the other for runs side by side."""
_ICE, _GRIP = (0xC6, 0xE0, 0xF2), (0xF3, 0xF1, 0xEC)
_GRIPPING = 0.8


def as_int(colour: str) -> int:
    """0xRRGGBB of ``#rrggbb``, the form Meshcat takes."""
    return int(colour.lstrip("#"), 16)


def as_rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of ``#rrggbb``: the form viser takes."""
    number = as_int(colour)
    return number >> 16, number >> 8 & 255, number & 255


def as_hex(shares: Iterable[float]) -> str:
    """``#rrggbb`` of red, green and blue between 0 and 1."""
    return "#" + "".join(f"{round(255 * min(max(share, 0.0), 1.0)):02x}" for share in shares)


def ground_colour(mu: float) -> str:
    """Colour of ground with a friction coefficient: the more slippery, the bluer; pale sand from
    0.8 on.
    """
    share = min(max(mu / _GRIPPING, 0.0), 1.0)
    return as_hex((a + share * (b - a)) / 255 for a, b in zip(_ICE, _GRIP, strict=True))
