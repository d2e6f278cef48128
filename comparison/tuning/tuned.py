"""The settings that the search found, from the file that ``python -m comparison tune --json`` wrote."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from comparison.tuning.variants import VARIANTS
from harpy_pin.scenario import CONTROLLER_PARTS, ControllerPart
from harpy_pin.scenario.parts import read_part

TUNED_FILE = Path(__file__).with_name("tuned.json")
"""What the command wrote; the file says with how large a budget, and on how many walks."""

WHOLE_BODY = ("condensed", "wbc")


@cache
def tuned() -> dict[str, Any]:
    """The document of :func:`comparison.tuning.tune.tune`."""
    document: dict[str, Any] = json.loads(TUNED_FILE.read_text(encoding="utf-8"))
    return document


def best_paper() -> str:
    """The variant of the paper's governor with the least cost on the training walks, by its name."""
    return str(tuned()["best_paper"])


def searched(variant: str) -> str:
    """The variant whose search gave the settings of a variant.

    The two whole-body controllers have one optimum, and so one best setting: both have what was found for the one with
    the least cost on the training walks.
    """
    if variant not in WHOLE_BODY:
        return variant
    return min(WHOLE_BODY, key=lambda name: tuned()["variants"][name]["training"]["cost"])


def variant_part(name: str, mu: float | None = None) -> ControllerPart:
    """A variant as the controller of a scenario, with ``/tuned`` after its name with the settings that were found."""
    variant = name.removesuffix("/tuned")
    part = VARIANTS[variant].part
    found = tuned()["variants"][searched(variant)]["controller"] if name.endswith("/tuned") else {}
    return read_part(CONTROLLER_PARTS, "controller", {**part, **found, "name": part["name"], "mu": mu})
