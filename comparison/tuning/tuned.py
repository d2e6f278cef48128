"""The settings that the search found, from the file that ``python -m comparison tune --json`` wrote."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from comparison.tuning.variants import VARIANTS
from harpy_pin.scenario import CONTROLLER_PARTS, ControllerPart
from harpy_pin.scenario.parts import read_part

__all__ = ["TUNED_FILE", "best_paper", "tuned", "variant_part"]

TUNED_FILE = Path(__file__).with_name("tuned.json")
"""What the command wrote; the file says with how large a budget, and on how many walks."""

FOUND = "/tuned"
"""Ends the name of a variant with the settings that were found; without it they are the published ones."""


@cache
def tuned() -> dict[str, Any]:
    """The document of :func:`comparison.tuning.tune.tune`."""
    document: dict[str, Any] = json.loads(TUNED_FILE.read_text(encoding="utf-8"))
    return document


def best_paper() -> str:
    """The variant of the paper's governor with the least cost on the training walks, by its name."""
    return str(tuned()["best_paper"])


def variant_part(name: str, mu: float | None = None) -> ControllerPart:
    """A variant as the controller of a scenario.

    Args:
        name: of :data:`~comparison.tuning.variants.VARIANTS`, with ``/tuned`` for the settings that were found.
        mu: friction coefficient that it assumes; the ground's by default.
    """
    variant = name.removesuffix(FOUND)
    settings = tuned()["variants"][variant]["controller"] if name.endswith(FOUND) else VARIANTS[variant].part
    return read_part(CONTROLLER_PARTS, "controller", {**settings, "mu": mu})
