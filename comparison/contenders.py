"""Who walks a campaign, by name."""

from __future__ import annotations

from typing import Any

from comparison.tuning.variants import VARIANTS, best_paper, variant_part
from harpy_pin.controllers.named_controllers import GOVERNORS
from harpy_pin.scenario import CONTROLLER_PARTS, ControllerPart, Governed

BEST = "paper/best"
"""The paper's governor in the variant, and with the settings, that ``python -m comparison tune`` found best."""

CONTENDERS = (*(f"governed/{name}" for name in GOVERNORS), BEST, "condensed", "wbc")
"""Controllers and governors to compare, in the order in which they are shown."""

TUNED = tuple(name + end for name in VARIANTS for end in ("", "/tuned"))
"""Every tuned variant with its published settings, and with those that were found."""

FORCES = "wbc/contact_force"
"""The whole-body QP, stated in the contact forces alone; the section on ticks has it, too."""

ESTIMATES = ("condensed/estimate", "wbc/estimate")
"""Law and QP with the friction estimated as they go (docs/friction.md); they walk the wide campaign, too."""

HARSH = (*(name for name in TUNED if not name.startswith("filter/")), "governed/filter", *ESTIMATES)
"""Every tuned variant but the filter's, the filter, and law and QP with the friction estimated; they walk the harsh
campaign."""

LIMITED: dict[str, dict[str, Any]] = {
    name: {"name": "governed", "governor": name, "limits": True} for name in ("none", "paper", "filter")
}
"""Governed controllers of a scenario with the limits of torque and thrust that the others have, by their governor."""

_LABELS = {
    "governed/none": "no governor",
    "governed/paper": "paper's governor",
    BEST: "paper's best variant",
    "governed/filter": "contact-force filter",
    "condensed": "condensed WBC",
    "wbc": "whole-body QP",
    FORCES: "condensed program by a general solver",
    "condensed/estimate": "condensed WBC, friction estimated",
    "wbc/estimate": "whole-body QP, friction estimated",
    "wbc/proxqp": "whole-body QP, ProxQP only",
    "wbc/daqp": "whole-body QP, DAQP only",
    "joint_pd": "joint PD",
}
_SHORT = {BEST: "best", "condensed/estimate": "cond. est."}


def label(contender: str) -> str:
    """A contender's name for readers."""
    if contender in TUNED and contender not in _LABELS:
        variant = contender.removesuffix("/tuned")
        return VARIANTS[variant].label + (", tuned" if variant != contender else "")
    governor = contender.rpartition("/")[2]
    return _LABELS.get(contender, f"{governor} governor")


def short_name(contender: str) -> str:
    """A contender's name where eight of them share 80 columns: a governor's own, or the controller's."""
    if contender in _SHORT:
        return _SHORT[contender]
    return contender.removeprefix("governed/").replace("wbc", "QP").replace("/estimate", " est.")


def controller_part(contender: str, mu: float | None = None) -> ControllerPart:
    """A contender as the controller of a scenario; it assumes the ground's friction coefficient by default.

    A contender is ``governed`` with a governor (``governed/filter``), or another controller, alone (``wbc``) or with
    the formulation of its program (``wbc/contact_force``), or with ``estimate``, of the friction; or one of
    :data:`TUNED`, or :data:`BEST`.
    """
    if contender == BEST or contender in TUNED:
        return variant_part(best_paper() if contender == BEST else contender, mu)
    controller, _, variant = contender.partition("/")
    if controller == "governed":
        return Governed(governor=variant, mu=mu)
    parameters: dict[str, Any] = {"estimate_friction": True} if variant == "estimate" else {"formulation": variant}
    return CONTROLLER_PARTS[controller](mu=mu, parameters=parameters if variant else {})
