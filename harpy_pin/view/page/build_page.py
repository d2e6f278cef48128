"""The page: scenes, charts, measures and controls in one HTML file that needs nothing else."""

import base64
import html
import json
import zlib
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from harpy_pin.model.state import Vector
from harpy_pin.view.page.charts import Chart, Clock, Line, charts_of
from harpy_pin.view.page.shown import Shown, headline, scoreboard, telling_moment
from harpy_pin.view.palette import (
    APPLIED,
    BODY,
    CONTACT,
    ESTIMATE,
    FLOOR,
    FRICTION,
    PRESSURE,
    SLIDING,
    SLIP,
    TARGET,
    THRUST,
    ground_colour,
)
from harpy_pin.view.scene.forces import Scales
from harpy_pin.view.scene.frames import Frames, normal_floor
from harpy_pin.view.scene.meshcat_backend import encoded, keyframes, node_commands, stage_commands
from harpy_pin.view.scene.scene import scene_of

DIGITS = 4
"""Digits of a number on a chart."""
CAPTION = (
    "A foot holds as long as the ground's force on it (blue arrow) stays inside its friction cone "
    "(light blue). "
    "While a foot slides its cone is red, and it leaves a dark mark."
)


def build_page(shown: Sequence[Shown]) -> str:
    """HTML text of a replay of one run, or of several side by side."""
    content = _page_content(shown)
    assets = files("harpy_pin.view.page").joinpath("assets")

    def asset(name: str) -> str:
        return assets.joinpath(name).read_text(encoding="utf-8")

    fills = {
        "title": html.escape(content["title"]),
        "style": asset("uPlot.min.css") + asset("page.css"),
        "meshcat": files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8"),
        "uplot": asset("uPlot.iife.min.js"),
        "content": pack(content),
        "scripts": "".join(
            asset(f"{name}.js") for name in ("unpack", "scene", "charts", "labels", "player")
        ),
    }
    # One pass, so that nothing that was put in is read as a placeholder.
    head, *parts = asset("page.html").split("{{")
    pieces = [head]
    for part in parts:
        name, _, rest = part.partition("}}")
        pieces += [fills[name], rest]
    return "".join(pieces)


def _page_content(shown: Sequence[Shown]) -> dict[str, Any]:
    """All that a page of runs shows, as plain data."""
    alone, first = len(shown) == 1, shown[0].frames
    named = "scenario" in first.run.metadata  # the heading says what walks
    title, facts = headline(shown[0])
    moments = [telling_moment(one.frames) for one in shown]
    worst = max(range(len(shown)), key=lambda k: moments[k].power)
    reason = moments[worst].reason
    scores = (
        []
        if alone or any(len(one.frames.run) < 2 for one in shown)
        else scoreboard([o.frames.run for o in shown])
    )
    return {
        "title": title if alone else " · ".join(one.name for one in shown),
        "heading": f"{first.robot.name} – {shown[0].name if alone else 'side by side'}",
        "caption": CAPTION,
        "facts": [
            fact
            for fact in facts
            if alone and not (named and fact[0] in ("controller", "governor"))
        ],
        "key": _key([one.frames for one in shown]),
        "moment": {
            "time": moments[worst].time,
            "reason": reason if alone else f"{shown[worst].name}: {reason}",
        },
        "duration": max(float(one.frames.time[-1]) for one in shown),
        "fps": max(one.frames.fps for one in shown),
        "runs": [_run_content(one) for one in shown],
        "charts": _encode(charts_of(shown), shown),
        "scores": [vars(score) for score in scores],
    }


def _run_content(one: Shown) -> dict[str, Any]:
    """Scene, keyframes and values of one run."""
    frames, scene = one.frames, scene_of(one.frames)
    return {
        "name": one.name,
        "colour": one.colour,
        "start": float(frames.run["t"][0]),
        "ending": frames.run.ending,
        "commands": encoded(stage_commands(scene.size) + node_commands(scene.nodes, scene.motions)),
        "time": np.round(frames.time, 6).tolist(),
        "tracks": keyframes(scene.motions) if len(frames) > 1 else [],
        "values": _values(frames),
    }


def _encode(charts: Sequence[Chart], shown: Sequence[Shown]) -> dict[str, Any]:
    """Charts as the page reads them: one row of times for all lines, extremes over equal spans,
    null for no value.

    Each line has its values at the frames, too: the numbers beside it are those of the scene's
    instant.
    """
    times = [one.frames.run["t"] - one.frames.run["t"][0] for one in shown]
    clock, frames = Clock.of(times), max((one.frames.time for one in shown), key=len)
    return {
        "time": np.round(clock.points, 6).tolist(),
        "frames": np.round(frames, 6).tolist(),
        "charts": [
            vars(chart)
            | {
                "level": None
                if chart.level is None
                else {"value": chart.level[0], "label": chart.level[1]}
            }
            | {"lines": [_encode_line(line, clock, frames) for line in chart.lines]}
            for chart in charts
        ],
    }


def _encode_line(line: Line, clock: Clock, frames: Vector) -> dict[str, Any]:
    """A line with few digits and few points."""
    style = {name: getattr(line, name) for name in ("label", "colour", "dashed", "filled")}
    row = np.minimum(np.searchsorted(line.time, frames - 0.5 * clock.period), len(line.time) - 1)
    at_frames = np.where(frames <= line.time[-1] + clock.period, line.values[row], np.nan)
    return style | {
        "values": _short(clock.thin(line.time, line.values)),
        "shown": _short(at_frames),
    }


def _short(values: Vector) -> list[float | None]:
    """Numbers of few digits; None where there is none."""
    return [
        float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()
    ]


def _key(shown: Sequence[Frames]) -> list[dict[str, str]]:
    """What the colours of the scene mean; the name is that of the value of the moment, where there
    is one.
    """
    frames, references = shown[0], {label for one in shown for label in one.references}
    scales = Scales.of(frames.robot, float(frames["q"][0, 2]))
    ground, floor = frames.ground, normal_floor(frames.run)
    rows = [("contact", CONTACT, "contact force", f"{scales.force:g} N per metre")]
    if ground is not None:
        rows.append(
            ("friction", FRICTION, "friction cone", "share of the friction that each foot uses")
        )
        rows.append(("", SLIDING, "foot slides", ""))
        rows.append(("", SLIP, "slip mark", ""))
        if floor is not None:
            rows.append(
                (
                    "",
                    FLOOR,
                    f"ring: floor of f_z, {floor:.3g} N",
                    "the smallest normal force that is asked",
                )
            )
    rows.append(("", PRESSURE, "centre of pressure", ""))
    if any(one.robot.thrusters for one in shown):
        rows.append(("thrust", THRUST, "thrust", f"{scales.force:g} N per metre"))
    if "target" in references:
        rows.append(
            (
                "target",
                TARGET,
                "target x_r",
                "distance from the body; its path is drawn on the ground",
            )
        )
    if "applied" in references:
        rows.append(("applied", APPLIED, "applied x_w", "distance from the body"))
    if "estimate" in references:
        rows.append(("estimate", ESTIMATE, "estimated place", "distance from the body"))
    if references:
        rows.append(("", BODY, "body", ""))
    if ground is not None:
        rows.append(("", ground_colour(ground.mu_s), f"ground, μ = {ground.mu_s:g}", ""))
        for begin, end, mu in ground.friction_strips:
            rows.append(("", ground_colour(mu), f"{begin:g} to {end:g} m, μ = {mu:g}", ""))
    return [dict(zip(("name", "colour", "label", "hint"), row, strict=True)) for row in rows]


def _values(frames: Frames) -> dict[str, list[str]]:
    """Text of the key's values at each frame."""
    contacts, thrust = frames.contacts[frames.rows], frames["thrust"]
    values = {"contact": [_list(row, "{:.0f}", "N") for row in contacts.normal]}
    if contacts.mu is not None:
        used = 100.0 * np.minimum(contacts.used, 1.0)
        values["friction"] = [
            " · ".join(
                "–" if n <= 0.0 else "slides" if s else f"{u:.0f} %"
                for n, s, u in zip(*row, strict=True)
            )
            for row in zip(contacts.normal, contacts.slides, used, strict=True)
        ]
    if thrust.shape[1]:
        values["thrust"] = [_list(row, "{:.1f}", "N") for row in np.linalg.norm(thrust, axis=2)]
    for label, points in frames.references.items():
        error = 1e3 * np.linalg.norm(points[frames.rows] - frames["q"][:, :3], axis=1)
        values[label] = [f"{e:.0f} mm" if np.isfinite(e) else "–" for e in error]
    return values


def _list(row: Vector, form: str, unit: str) -> str:
    """``12 · 30 N``: one value per foot or thruster."""
    return " · ".join(form.format(value) for value in row) + f" {unit}"


def pack(content: Any) -> str:
    """Plain data as one word of base64 (zlib over JSON)."""
    return base64.b64encode(
        zlib.compress(json.dumps(content, allow_nan=False).encode("ascii"), 6)
    ).decode("ascii")
