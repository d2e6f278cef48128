"""Who is compared, by name; who is tuned: every variant that the paper's text allows; and what the
search found.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import harpy_pin as hp
from harpy_pin.scenario import CONTROLLER_PARTS, ControllerPart, Governed
from harpy_pin.scenario.parts import read_part

Point = Mapping[str, Any]
"""A value for each setting of a space: the factor of a :class:`Range`, the value of a
:class:`Choice`.
"""


@dataclass(frozen=True)
class Range:
    """A setting that is searched as a multiple of its published value, uniformly in the
    logarithm.
    """

    low: float
    high: float


@dataclass(frozen=True)
class Choice:
    """A setting with few values; the published one comes first."""

    values: tuple[Any, ...]


Space = Mapping[str, Range | Choice]
"""What is searched, by the setting's path in the controller's part: ``parameters.centre.k_pt``."""

_GAIN = Range(0.25, 4.0)
_WEIGHT = Range(0.05, 20.0)

_THRUSTERS: Space = {
    f"parameters.{name}": _GAIN
    for name in ("centre.k_pt", "centre.k_dt", "attitude.k_p", "attitude.k_d")
}
_LEGS: Mapping[str, Space] = {
    "pid": {
        "parameters.joints.k_p": Range(0.1, 2.0),
        "parameters.joints.k_i": Range(0.1, 4.0),
        "parameters.joints.k_d": Range(0.2, 1.5),
    },
    "feedforward": {
        "parameters.feedforward.stance_p": _GAIN,
        "parameters.feedforward.stance_d": Range(0.25, 2.0),
        "parameters.feedforward.swing_p": _GAIN,
        "parameters.feedforward.swing_d": Range(0.25, 2.0),
    },
}
_PAPER: Space = {
    **{f"governor_parameters.alpha_{name}": Range(0.1, 10.0) for name in "rtn"},
    "governor_parameters.conditions": Choice(("algorithm", "equation")),
    "governor_parameters.friction_share": Range(0.4, 1.0),
    "governor_parameters.min_normal_force": Range(0.05, 1.5),
    "parameters.reference_velocity": Choice((True, False)),
}
_FILTER: Space = {
    "governor_parameters.friction_share": Range(0.5, 1.05),
    "governor_parameters.margin": Range(0.1, 10.0),
    "governor_parameters.contact_damping": _GAIN,
    **{
        f"governor_parameters.{name}": _WEIGHT
        for name in ("linear", "angular", "swing", "thrust", "torque")
    },
    "governor_parameters.lag": Range(0.25, 8.0),
    "governor_parameters.sliding_speed": _GAIN,
}
_WHOLE_BODY: Space = {
    **{f"parameters.{name}": _GAIN for name in ("body", "orientation", "swing", "contact_damping")},
    "parameters.min_normal_force": Range(0.1, 3.0),
    "parameters.limits.friction_share": Range(0.9, 2.5),
    **{
        f"parameters.weights.{name}": _WEIGHT
        for name in ("orientation", "swing", "thrust", "force")
    },
}

OWN = "wbc/active_set"
"""The whole-body QP by this library's own search. ``wbc`` is the same program by ProxQP, with the
same optimum.
"""

OWN_PART: Mapping[str, Any] = {"name": "wbc", "parameters": {"solver": "active_set"}}
"""That controller of a scenario: the QP of studies of walks, not of its solvers."""


@cache
def published_parameters() -> hp.controllers.WholeBodyParameters:
    """Settings of the whole-body controllers for Harpy's straight walk."""
    return hp.controllers.WholeBodyParameters.for_gait(hp.make_gait(hp.load_harpy()))


_PUBLISHED: Mapping[tuple[str, str], Callable[[], Any]] = {
    ("governed", "parameters"): hp.controllers.GovernedParameters,
    ("wbc", "parameters"): published_parameters,
    ("condensed", "parameters"): published_parameters,
    ("paper", "governor_parameters"): hp.governors.PaperGovernorParameters,
    ("filter", "governor_parameters"): hp.ContactForceFilterParameters,
}


@dataclass(frozen=True)
class Variant:
    """A contender that is tuned."""

    label: str  # its name for readers
    part: Mapping[str, Any]  # the controller's part that stays, as a mapping
    space: Space  # what is searched

    @property
    def published(self) -> Point:
        """The point of the published settings."""
        return {
            path: 1.0 if isinstance(span, Range) else span.values[0]
            for path, span in self.space.items()
        }

    def settings(self, point: Point) -> dict[str, Any]:
        """The part as a mapping with the settings of a point; those at their published values are
        left out.
        """
        settings: dict[str, Any] = {
            key: dict(v) if isinstance(v, Mapping) else v for key, v in self.part.items()
        }
        for path, value in point.items():
            if value == self.published[path]:
                continue
            *groups, name = path.split(".")
            place, record = settings, self._record(groups[0])
            for group in groups:
                place = place.setdefault(group, {})
            for group in groups[1:]:
                record = getattr(record, group)
            published = getattr(record, name)
            if isinstance(self.space[path], Range):
                value = (
                    [value * x for x in published]
                    if isinstance(published, tuple)
                    else value * published
                )
            place[name] = value
        return settings

    def controller(self, point: Point, mu: float | None = None) -> ControllerPart:
        """The controller of a scenario with the settings of a point; it assumes the ground's
        friction by default.
        """
        return read_part(CONTROLLER_PARTS, "controller", {**self.settings(point), "mu": mu})

    def _record(self, group: str) -> Any:
        """The published settings of a group."""
        return _PUBLISHED[
            self.part["governor"] if group == "governor_parameters" else self.part["name"], group
        ]()


def _governed(governor: str, legs: str, own: Space, **more: Any) -> Variant:
    """The governed controller with one governor and one control law of the legs."""
    names = {"none": "no governor", "paper": "paper's governor", "filter": "contact-force filter"}
    words = [names[governor], *more.values(), "PID" if legs == "pid" else "feedforward"]
    other_legs = {} if legs == "pid" else {"parameters": {"legs": legs}}
    part = {"name": "governed", "governor": governor, **more, **other_legs}
    return Variant(", ".join(words), part, {**own, **_THRUSTERS, **_LEGS[legs]})


VARIANTS: Mapping[str, Variant] = {
    **{f"none/{legs}": _governed("none", legs, {}) for legs in _LEGS},
    **{
        f"paper/{at}/{legs}": _governed("paper", legs, _PAPER, evaluate_at=at)
        for at in ("measured", "tracked")
        for legs in _LEGS
    },
    **{f"filter/{legs}": _governed("filter", legs, _FILTER) for legs in _LEGS},
    "condensed": Variant("condensed WBC", {"name": "condensed"}, _WHOLE_BODY),
    OWN: Variant("whole-body QP, own search", OWN_PART, _WHOLE_BODY),
}
"""Contenders that are tuned, by name, in the order in which they are searched.

What is searched are settings of the optimum, whoever finds it: thousands of walks of the QP are by
the faster search.

Gains that are found without a governor are tried by the governed ones, too.
"""

PAPER = tuple(name for name in VARIANTS if name.startswith("paper/"))
"""The variants of the paper's governor."""

TUNED_FILE = Path(__file__).parent / "tuning" / "tuned.json"
"""What the command wrote; the file says with how large a budget, and on how many walks."""

WHOLE_BODY = ("condensed", OWN)
"""Those of :data:`VARIANTS` with one optimum."""


@cache
def tuned() -> dict[str, Any]:
    """The document of :func:`comparison.tuning.tune.tune`."""
    document: dict[str, Any] = json.loads(TUNED_FILE.read_text(encoding="utf-8"))
    return document


def best_paper() -> str:
    """The variant of the paper's governor with the least cost on the training walks, by its
    name.
    """
    return str(tuned()["best_paper"])


def searched(variant: str) -> str:
    """The variant whose search gave the settings of a variant.

    The two whole-body controllers have one optimum, and so one best setting: both have what was
    found for the one with the least cost on the training walks.
    """
    if variant not in WHOLE_BODY:
        return variant
    return min(WHOLE_BODY, key=lambda name: tuned()["variants"][name]["training"]["cost"])


BEST = "paper/best"
"""The paper's governor in the variant, and with the settings, that ``python -m comparison tune``
found best.
"""

CONTENDERS = (
    *(f"governed/{name}" for name in hp.controllers.GOVERNORS),
    BEST,
    "condensed",
    OWN,
    "wbc",
)
"""Controllers and governors to compare, in the order in which they are shown."""

WALKERS = tuple(name for name in CONTENDERS if name != "wbc")
"""Those of them that differ in more than who solves their program: who walks in studies of walks,
not of times.
"""

TUNED = tuple(name + end for name in VARIANTS for end in ("", "/tuned"))
"""Every tuned variant with its published settings, and with those that were found."""

TRUSTING = ("condensed/trusting", f"{OWN}/trusting")
"""Condensed WBC and QP that trust the friction they are told, without an estimate; they walk the
wide campaign, too.
"""

HARSH = (*(name for name in TUNED if not name.startswith("filter/")), "governed/filter", *TRUSTING)
"""Every tuned variant but the filter's, the filter, and the WBCs without an estimate; they walk the
harsh campaign.
"""

LIMITED: dict[str, dict[str, Any]] = {
    name: {"name": "governed", "governor": name, "limits": True}
    for name in ("none", "paper", "filter")
}
"""Governed controllers of a scenario with the limits of torque and thrust that the others have, by
their governor.
"""

_LABELS = {
    "governed/none": "no governor",
    "governed/paper": "paper's governor",
    BEST: "paper's best variant",
    "governed/filter": "contact-force filter",
    "condensed": "condensed WBC",
    "wbc": "whole-body QP, ProxQP",
    OWN: "whole-body QP, own search",
    "wbc/daqp": "whole-body QP, DAQP",
    "condensed/trusting": "condensed WBC, no friction estimate",
    f"{OWN}/trusting": "whole-body QP, own search, no friction estimate",
    "joint_pd": "joint PD",
}
_SHORT = {BEST: "best", "condensed/trusting": "cond., no est.", "wbc": "QP, ProxQP", OWN: "QP"}


def label(contender: str) -> str:
    """A contender's name for readers."""
    if contender in TUNED and contender not in _LABELS:
        variant = contender.removesuffix("/tuned")
        return VARIANTS[variant].label + (", tuned" if variant != contender else "")
    governor = contender.rpartition("/")[2]
    return _LABELS.get(contender, f"{governor} governor")


def short_name(contender: str) -> str:
    """A contender's name where eight of them share 80 columns: a governor's own, or the
    controller's.
    """
    if contender in _SHORT:
        return _SHORT[contender]
    return (
        contender.removeprefix("governed/")
        .replace(OWN, "QP")
        .replace("wbc", "QP")
        .replace("/trusting", ", no est.")
    )


def controller_part(contender: str, mu: float | None = None) -> ControllerPart:
    """A contender as the controller of a scenario; it assumes the ground's friction coefficient by
    default.

    A contender is ``governed`` with a governor (``governed/filter``), or another controller, alone
    (``wbc``), or with the solver of its program (``wbc/active_set``), or ``trusting`` the friction
    it is told; or one of :data:`TUNED`, or :data:`BEST`.
    """
    if contender == BEST or contender in TUNED:
        name = best_paper() if contender == BEST else contender
        variant = name.removesuffix("/tuned")
        part = VARIANTS[variant].part
        found = tuned()["variants"][searched(variant)]["controller"] if variant != name else {}
        of_part = {**found.get("parameters", {}), **part.get("parameters", {})}
        settings = {**part, **found, "name": part["name"], "parameters": of_part, "mu": mu}
        return read_part(CONTROLLER_PARTS, "controller", settings)
    controller, _, variant = contender.partition("/")
    if controller == "governed":
        return Governed(governor=variant, mu=mu)
    chosen: dict[str, Any] = {}
    for word in variant.split("/") if variant else ():
        if word == "trusting":
            chosen["estimate_friction"] = False
        else:
            chosen["solver"] = word
    return CONTROLLER_PARTS[controller](mu=mu, parameters=chosen)
