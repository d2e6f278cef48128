"""The page: scenes, charts, measures and controls in one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import html
import json
import zlib
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view.page.charts import charts_of, compare_charts, encode
from harpy_pin.view.page.moment import telling_moment
from harpy_pin.view.page.shown import Shown, headline, line_up, scoreboard
from harpy_pin.view.palette import (
    APPLIED,
    BODY,
    CONTACT,
    FLOOR,
    FRICTION,
    PRESSURE,
    SLIDING,
    SLIP,
    TARGET,
    THRUST,
    ground_colour,
)
from harpy_pin.view.scene.forces import friction_used, sliding
from harpy_pin.view.scene.frames import (
    Frames,
    friction_strips,
    is_per_axis,
    local_friction,
    normal_floor,
    static_friction,
)
from harpy_pin.view.scene.ground import about_normals, surface_of
from harpy_pin.view.scene.meshcat_backend import encoded, keyframes, node_commands, stage_commands
from harpy_pin.view.scene.scene import Scales, scene_of

__all__ = ["build_page", "pack", "page_content"]

UPLOT = "1.6.32"
"""Version of the charts' library (MIT), which lies in ``assets`` with its licence."""
_CAPTION = (
    "A foot holds as long as the ground's force on it (blue arrow) stays inside its friction cone (light blue). "
    "While a foot slides its cone is red, and it leaves a dark mark."
)


def build_page(runs: Sequence[tuple[Run, Robot]], *, fps: float, names: Sequence[str] | None = None) -> str:
    """HTML text of a replay of one run, or of several side by side.

    Args:
        runs: each with the robot that was logged.
        fps: frames per second of simulated time.
        names: of the runs; found in their logs by default.

    Raises:
        InputError: see :func:`harpy_pin.view.page.shown.line_up`.
    """
    shown = line_up(runs, fps=fps, names=names)
    content = page_content(shown)
    assets = files("harpy_pin.view.page").joinpath("assets")

    def asset(name: str) -> str:
        return assets.joinpath(name).read_text(encoding="utf-8")

    fills = {
        "title": html.escape(content["title"]),
        "style": asset("uPlot.min.css") + asset("page.css"),
        "meshcat": files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8"),
        "uplot": asset("uPlot.iife.min.js"),
        "content": pack(content),
        "scripts": "".join(asset(f"{name}.js") for name in ("unpack", "scene", "charts", "labels", "player")),
    }
    # One pass, so that nothing that was put in is read as a placeholder.
    head, *parts = asset("page.html").split("{{")
    pieces = [head]
    for part in parts:
        name, _, rest = part.partition("}}")
        pieces += [fills[name], rest]
    return "".join(pieces)


def page_content(shown: Sequence[Shown]) -> dict[str, Any]:
    """All that a page of runs shows, as plain data."""
    alone = len(shown) == 1
    named = "scenario" in shown[0].run.metadata  # the heading says what walks
    title, facts = headline(shown[0])
    title = title if alone else " · ".join(one.name for one in shown)
    moments = [telling_moment(_drawn_rows(one)) for one in shown]
    worst = max(range(len(shown)), key=lambda k: moments[k].power)
    start = float(shown[worst].run["t"][0])
    charts = charts_of(shown[0]) if alone else compare_charts(shown)
    names = {path for one in shown for path in one.frames.references}
    return {
        "title": title,
        "heading": f"{shown[0].robot.name} – {shown[0].name if alone else 'side by side'}",
        "caption": _CAPTION,
        "facts": [list(fact) for fact in facts if not (named and fact[0] in ("controller", "governor"))]
        if alone
        else [],
        "key": _key(shown, names),
        "moment": {
            "time": moments[worst].time - start,
            "reason": moments[worst].reason if alone else f"{shown[worst].name}: {moments[worst].reason}",
        },
        "duration": max(float(one.frames.time[-1]) for one in shown),
        "fps": max(one.frames.fps for one in shown),
        "runs": [_run_content(one) for one in shown],
        "charts": encode(charts, shown),
        "scores": []
        if alone or any(len(one.run) < 2 for one in shown)
        else [{"label": s.label, "values": s.values, "best": s.best} for s in scoreboard([one.run for one in shown])],
    }


def _drawn_rows(one: Shown) -> Run:
    """The rows of a run that its frames show."""
    frames = one.frames
    signals = {name: getattr(frames, name) for name in ("q", "foot_position", "foot_velocity", "foot_force")}
    time = one.run["t"] - one.run["t"][0]
    if "foot_friction" in one.run:
        rows = np.clip(np.searchsorted(time, frames.time - 1e-9), 0, len(time) - 1)
        signals["foot_friction"] = one.run["foot_friction"][rows]
    return Run({"t": one.run["t"][0] + frames.time, **signals}, one.run.metadata)


def _run_content(one: Shown) -> dict[str, Any]:
    """Scene, keyframes and values of one run."""
    scene = scene_of(one.run, one.robot, one.frames)
    return {
        "name": one.name,
        "colour": one.colour,
        "start": float(one.run["t"][0]),
        "ending": one.run.ending,
        "commands": encoded(stage_commands(scene.size) + node_commands(scene.nodes, scene.motions)),
        "time": np.round(one.frames.time, 6).tolist(),
        "tracks": keyframes(scene.motions) if len(one.frames) > 1 else [],
        "values": _values(one.run, one.frames),
    }


def _key(shown: Sequence[Shown], references: set[str]) -> list[dict[str, str]]:
    """What the colours of the scene mean; the name is that of the value of the moment, where there is one."""
    one = shown[0]
    scales = Scales.of(one.robot, one.frames)
    mu = static_friction(one.run)
    rows = [("contact", CONTACT, "contact force", f"{scales.contact:g} N per metre")]
    if mu is not None:
        rows.append(("friction", FRICTION, "friction cone", "share of the friction that each foot uses"))
        rows.append(("", SLIDING, "foot slides", ""))
        rows.append(("", SLIP, "slip mark", ""))
    floor = normal_floor(one.run)
    if mu is not None and floor is not None:
        rows.append(("", FLOOR, f"ring: floor of f_z, {floor:.3g} N", "the smallest normal force that is asked"))
    rows.append(("", PRESSURE, "centre of pressure", ""))
    if any(one.robot.thrusters for one in shown):
        rows.append(("thrust", THRUST, "thrust", f"{scales.thrust:g} N per metre"))
    if "target" in references:
        rows.append(("target", TARGET, "target x_r", "distance from the body; its path is drawn on the ground"))
    if "applied" in references:
        rows.append(("applied", APPLIED, "applied x_w", "distance from the body"))
    if references:
        rows.append(("", BODY, "body", ""))
    if mu is not None:
        grounds = [(mu, f"ground, μ = {mu:g}")]
        strips = friction_strips(one.run)
        grounds += [(value, f"{begin:g} to {end:g} m, μ = {value:g}") for begin, end, value in strips]
        rows += [("", ground_colour(value), label, "") for value, label in grounds]
    return [{"name": n, "colour": c, "label": label, "hint": hint} for n, c, label, hint in rows]


def _values(run: Run, frames: Frames) -> dict[str, list[str]]:
    """Text of the key's values at each frame."""
    surface, place = surface_of(run), frames.foot_position
    force, velocity = (about_normals(surface, place, given) for given in (frames.foot_force, frames.foot_velocity))
    normal = np.maximum(force[..., 2], 0.0)
    values = {"contact": [_list(row, "{:.0f}", "N") for row in normal]}
    mu = local_friction(run, frames.foot_position, time=frames.time)
    if mu is not None:
        used = 100.0 * np.minimum(friction_used(force, mu, per_axis=is_per_axis(run)), 1.0)
        slides = sliding(force, velocity)
        values["friction"] = [
            " · ".join("–" if n <= 0.0 else "slides" if s else f"{u:.0f} %" for n, s, u in zip(*row, strict=True))
            for row in zip(normal, slides, used, strict=True)
        ]
    if frames.thrust.shape[1]:
        values["thrust"] = [_list(row, "{:.1f}", "N") for row in np.linalg.norm(frames.thrust, axis=2)]
    for label, points in frames.references.items():
        error = 1e3 * np.linalg.norm(points - frames.q[:, :3], axis=1)
        values[label] = [f"{e:.0f} mm" if np.isfinite(e) else "–" for e in error]
    return values


def _list(row: np.ndarray[tuple[int, ...], np.dtype[np.float64]], form: str, unit: str) -> str:
    """``12 · 30 N``: one value per foot or thruster."""
    return " · ".join(form.format(value) for value in row) + f" {unit}"


def pack(content: Any) -> str:
    """Plain data as one word of base64 (zlib over JSON)."""
    return base64.b64encode(zlib.compress(json.dumps(content, allow_nan=False).encode("ascii"), 6)).decode("ascii")
