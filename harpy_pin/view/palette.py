"""Colours of the scene and the figures: the Okabe–Ito palette, told apart by colour-blind readers and in print."""

from __future__ import annotations

__all__ = ["APPLIED", "BODY", "CONTACT", "FRICTION", "LEFT", "RIGHT", "SLIDING", "TARGET", "THRUST", "as_int"]

CONTACT = "#0072b2"
FRICTION = "#56b4e9"
SLIDING = "#d62a1e"
THRUST = "#e69f00"
TARGET = "#009e73"
APPLIED = "#b0408a"
BODY = "#ffffff"
LEFT = "#0072b2"
RIGHT = "#d55e00"


def as_int(colour: str) -> int:
    """0xRRGGBB of ``#rrggbb``, the form Meshcat takes."""
    return int(colour.lstrip("#"), 16)
