"""The page: scene, animation, legend and controls in one HTML file that needs nothing else."""

from __future__ import annotations

import html
import json
from importlib.resources import files

import numpy as np

from harpy_pin.model.robot import Robot
from harpy_pin.plant.run import Run
from harpy_pin.view.page.headline import headline
from harpy_pin.view.palette import APPLIED, BODY, CONTACT, FRICTION, TARGET, THRUST
from harpy_pin.view.scene.cones import sliding
from harpy_pin.view.scene.frames import Frames, local_friction
from harpy_pin.view.scene.recorder import CommandRecorder
from harpy_pin.view.scene.scene import Scales, draw_scene

__all__ = ["build_page"]


def build_page(run: Run, robot: Robot, frames: Frames) -> str:
    """HTML text of a replay.

    Args:
        run: the log.
        robot: the robot that was logged.
        frames: the rows that are drawn.
    """
    recorder = CommandRecorder()
    visualizer = recorder.visualizer
    animation = draw_scene(visualizer, run, robot, frames)
    if animation.clips:
        visualizer.set_animation(animation, play=True, repetitions=float("inf"))
    facts = headline(run)
    values = _values(run, frames)
    scales = Scales.of(robot, frames)
    notes = [f"Contact forces: {scales.contact:g} N per metre"] if robot.feet else []
    if robot.thrusters:
        notes.append(f"{'thrusts' if notes else 'Thrusts'}: {scales.thrust:g} N per metre")
    note = "; ".join(notes)
    content = {
        "title": html.escape(facts.title),
        "heading": html.escape(f"{robot.name} – replay"),
        "facts": "".join(
            f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in facts.facts
        ),
        "key": _key(run, robot, frames, values),
        "note": html.escape(note + ". Grid: 0.1 m."),
        "duration": repr(float(frames.time[-1])),
        "meshcat": files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8"),
        "commands": json.dumps(recorder.encoded()),
        "frames": _script_json(
            {
                "fps": frames.fps,
                "start": float(run["t"][0]),
                "time": np.round(frames.time, 6).tolist(),
                "values": values,
            }
        ),
    }
    page = files("harpy_pin.view.page").joinpath("page.html").read_text(encoding="utf-8")
    # One pass, so that nothing that was put in is read as a placeholder.
    head, *parts = page.split("{{")
    pieces = [head]
    for part in parts:
        name, _, rest = part.partition("}}")
        pieces += [content[name], rest]
    return "".join(pieces)


def _script_json(data: object) -> str:
    """JSON that may stand inside a script element."""
    return json.dumps(data, ensure_ascii=True).replace("<", "\\u003c")


def _key(run: Run, robot: Robot, frames: Frames, values: dict[str, list[str]]) -> str:
    """Rows of the legend, with a place for the value of the moment where there is one."""
    rows = [("contact", CONTACT, "contact force")] if robot.feet else []
    if "friction" in values:
        rows.append(("friction", FRICTION, "friction cone <small>(red: slides)</small>"))
    if robot.thrusters:
        rows.append(("thrust", THRUST, "thrust"))
    if "target" in frames.references:
        rows.append(("target", TARGET, "target x<sub>r</sub> <small>(from body)</small>"))
    if "applied" in frames.references:
        rows.append(("applied", APPLIED, "applied x<sub>w</sub> <small>(from body)</small>"))
    if frames.references:
        rows.append(("body", BODY, "body"))
    return "".join(
        f'<tr><td><i style="background:{colour}"></i>{label}</td><td id="value-{name}"></td></tr>'
        for name, colour, label in rows
    )


def _values(run: Run, frames: Frames) -> dict[str, list[str]]:
    """Text of the legend's values at each frame."""
    normal = np.maximum(frames.foot_force[..., 2], 0.0)
    if normal.shape[1] == 0:
        values, mu = {}, None
    else:
        values = {"contact": [_list(row, "{:.0f}", "N") for row in normal]}
        mu = local_friction(run, frames.foot_position)
    if mu is not None and np.any(mu > 0.0):
        tangential = np.hypot(frames.foot_force[..., 0], frames.foot_force[..., 1])
        if run.metadata["ground"].get("cone") == "per_axis":
            tangential = np.abs(frames.foot_force[..., :2]).max(axis=-1)
        used = 100.0 * tangential / np.maximum(mu * normal, 1e-9)
        slides = sliding(frames.foot_force, frames.foot_velocity)
        values["friction"] = [
            " · ".join(
                "–" if n <= 0.0 else "slides" if s else f"{min(u, 100.0):.0f} %" for n, s, u in zip(*row, strict=True)
            )
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
