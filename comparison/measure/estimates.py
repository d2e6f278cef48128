"""How far estimates of the contacts are off."""

from __future__ import annotations

from harpy_pin.model.state import Vector

LIKELY, TOUCHES = 0.5, 1.0
"""Probability from which on the estimate has a foot in contact, and force from which on it is,
N.
"""


def contacts(force: Vector, probability: Vector) -> dict[str, float]:
    """Precision and recall of the contacts, from normal forces (ticks, feet) and probabilities."""
    touching, held = force > TOUCHES, probability > LIKELY
    both = float((touching & held).sum())
    return {
        "precision": both / max(int(held.sum()), 1),
        "recall": both / max(int(touching.sum()), 1),
    }
