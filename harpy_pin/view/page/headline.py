"""What a run is, in a title and a few facts."""

from __future__ import annotations

from dataclasses import dataclass

from harpy_pin.log.file_format import MAX_NUMBER
from harpy_pin.log.measures import measure
from harpy_pin.log.run import Run
from harpy_pin.view.scene.frames import finite_part, friction_strips, is_per_axis, static_friction

__all__ = ["Headline", "headline"]


@dataclass(frozen=True)
class Headline:
    """Title and facts of a run.

    Attributes:
        title: one line.
        facts: names and values.
    """

    title: str
    facts: tuple[tuple[str, str], ...]


def headline(run: Run, *, complete: bool = True) -> Headline:
    """Describe a run from its metadata and measures; what the log does not say is left out.

    Args:
        run: the log.
        complete: whether these are all its rows; otherwise the ending says that it is drawn up to there.
    """
    finite = finite_part(run)
    parameters = run.metadata.get("parameters") or {}
    gait = parameters.get("gait") or {}
    controller = str(run.metadata.get("controller", "unknown controller"))
    governor = parameters.get("governor")
    duration = float(finite["t"][-1] - finite["t"][0])
    facts = [("controller", controller)]
    if governor is not None:
        facts.append(("governor", str(governor)))
    mu = static_friction(run)
    if mu is not None:
        cone = "box" if is_per_axis(run) else "disc"
        facts.append(("friction", f"μ = {mu:g} ({cone})"))
        for begin, end, strip_mu in friction_strips(run):
            facts.append((f"from {begin:g} to {end:g} m", f"μ = {strip_mu:g}"))
    speed = gait.get("speed")
    if isinstance(speed, int | float) and abs(speed) < MAX_NUMBER:
        facts.append(("speed desired", f"{speed:g} m/s"))
    distance = float(finite["q"][-1, 0] - finite["q"][0, 0])
    facts.append(("walked", f"{distance:.2f} m in {duration:.2f} s"))
    if len(finite) > 1 and finite["foot_force"].shape[1]:
        facts.append(("slip", f"{measure(finite).slip_mm_per_step:.1f} mm per step"))
    ending = run.ending if complete and len(run) == len(finite) else f"{run.ending} (drawn up to there)"
    facts.append(("ending", ending))
    subject = f"{run.metadata.get('robot', 'robot')} – {controller}"
    if governor is not None:
        subject += f" ({governor})" if governor != "none" else " (no governor)"
    title = f"{subject}, {run.ending}" if mu is None else f"{subject}, μ = {mu:g}, {run.ending}"
    return Headline(title, tuple(facts))
