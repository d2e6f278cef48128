"""Draw Harpy with its frames, joint axes and dimensions, from the model: ``python
docs/frames_figure.py``.

Writes ``docs/images/frames.svg``. Every point is computed by Pinocchio from ``urdf/harpy.urdf``.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import harpy_pin as hp

OUT = Path(__file__).resolve().parent / "images" / "frames.svg"
KNEE = 1.7
"""Angle of both knees in the picture, rad; the hips put the feet below them."""
MOTOR = 0.6
"""Where the knee motor sits on the link of 0.5 m, as a share of its length."""
COLOURS = {"x": "#d62a1e", "y": "#009e73", "z": "#0072b2"}
LINK, PANTOGRAPH, FORCE, THRUST, INK = "#37474f", "#b0bec5", "#0072b2", "#e69f00", "#2b3440"
SIDE, FRONT = (0, 2), (1, 2)
"""Columns of a point that a panel shows."""

Point = NDArray[np.float64]


def points() -> dict[str, Point]:
    """Origins of the frames in the world, m, by name; both feet are on the ground."""
    robot = hp.load_harpy()
    sagittal = -np.arctan2(0.2 * np.sin(KNEE), 0.5 + 0.2 * np.cos(KNEE))
    q = pin.neutral(robot.model)
    q[7:] = 2 * (0.0, sagittal, KNEE)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    found = {
        frame.name: place.translation.copy()
        for frame, place in zip(robot.model.frames, data.oMf, strict=True)
    }
    lift = found["left_foot"][2]
    for place in found.values():
        place[2] -= lift
    return found


def arrow(panel: Axes, start: Point, change: Point, colour: str, width: float = 1.6) -> None:
    """An arrow in the plane of a panel, m."""
    style = {
        "arrowstyle": "-|>",
        "color": colour,
        "linewidth": width,
        "shrinkA": 0.0,
        "shrinkB": 0.0,
    }
    panel.annotate("", start + change, start, arrowprops=style, zorder=6)


def axes_at(panel: Axes, origin: Point, names: str, length: float = 0.1) -> None:
    """Two axes of a frame: the first points to the right, the second up."""
    for name, direction in zip(names, np.eye(2), strict=True):
        arrow(panel, origin, length * direction, COLOURS[name])
        panel.text(
            *(origin + (length + 0.018) * direction),
            name,
            color=COLOURS[name],
            ha="center",
            va="center",
        )


def note(
    panel: Axes, text: str, at: Point, offset: tuple[float, float], align: str = "left"
) -> None:
    """A label, with a thin line to what it names."""
    line = {"arrowstyle": "-", "color": "#90a4ae", "linewidth": 0.7, "shrinkA": 1.0, "shrinkB": 2.0}
    panel.annotate(
        text, at, at + np.array(offset), ha=align, va="center", color=INK, arrowprops=line, zorder=7
    )


def draw_leg(panel: Axes, at: dict[str, Point], side: str, columns: tuple[int, int]) -> None:
    """The serial chain that is simulated, the pantograph behind it, and the joints."""
    chain = [
        at[f"{side}_{name}"][list(columns)]
        for name in ("hip_frontal", "hip_sagittal", "knee", "foot")
    ]
    hip, knee, foot = chain[1:]
    motor = hip + MOTOR * (knee - hip)
    shin = motor + foot - knee
    if columns == SIDE:
        panel.plot(
            *np.transpose([motor, shin, foot]),
            color=PANTOGRAPH,
            linewidth=3.0,
            linestyle=(0, (2, 1)),
            zorder=1,
        )
    panel.plot(*np.transpose(chain), color=LINK, linewidth=4.0, solid_capstyle="round", zorder=2)
    panel.plot(
        *np.transpose([*chain[:2], knee]),
        "o",
        color="#ef6c00",
        markersize=7.0,
        linestyle="",
        zorder=4,
    )
    panel.plot(*motor, "s", color=LINK, markersize=8.0, zorder=3)
    panel.plot(*foot, "o", color=INK, markersize=5.0, zorder=4)


def draw_body(panel: Axes, base: Point, title: str) -> None:
    """The body's cube of 0.2 m, its origin, and the ground."""
    panel.fill(
        *np.transpose(base + 0.1 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])),
        color="#eceff1",
        zorder=0,
    )
    panel.plot(*base, "o", color=INK, markersize=5.0, zorder=5)
    panel.axhline(0.0, color="#8d6e63", linewidth=1.2, zorder=0)
    panel.set_title(title, loc="left", fontsize=10.0)
    panel.set_aspect("equal")
    panel.set_axis_off()


def draw_side(panel: Axes, at: dict[str, Point]) -> None:
    """From the robot's right: x to the right, z up."""
    place = {name: point[list(SIDE)] for name, point in at.items()}
    draw_body(panel, place["base"], "Side (seen from the right)")
    draw_leg(panel, at, "left", SIDE)
    axes_at(panel, place["base"], "xz", 0.08)
    axes_at(panel, np.array((-0.32, 0.0)), "xz")
    hip, knee, foot = (place[f"left_{name}"] for name in ("hip_sagittal", "knee", "foot"))
    note(panel, "world", np.array((-0.32, 0.0)), (0.0, -0.05), "center")
    note(panel, "base: origin\nof the body", place["base"], (-0.14, 0.05), "right")
    note(panel, "hip sagittal:\nturns about y", hip, (-0.14, 0.0), "right")
    note(panel, "knee motor,\n0.3 m from the hip", hip + MOTOR * (knee - hip), (0.1, 0.06))
    note(panel, "knee: turns about y,\n0.5 m from the hip", knee, (0.09, 0.05))
    note(panel, "foot, 0.2 m\nfrom the knee", foot, (0.1, -0.06))
    note(
        panel,
        "pantograph\n(not simulated)",
        hip + MOTOR * (knee - hip) + 0.7 * (foot - knee),
        (-0.12, 0.02),
        "right",
    )
    arrow(panel, foot, np.array((0.0, 0.17)), FORCE, 2.2)
    panel.text(foot[0] - 0.02, foot[1] + 0.13, "f", color=FORCE, ha="right", fontweight="bold")


def draw_front(panel: Axes, at: dict[str, Point]) -> None:
    """From ahead: y to the right, z up."""
    place = {name: point[list(FRONT)] for name, point in at.items()}
    draw_body(panel, place["base"], "Front (seen from ahead)")
    for side in ("left", "right"):
        draw_leg(panel, at, side, FRONT)
        mount = place[f"{side}_thruster_mount"]
        panel.plot(*mount, "D", color=THRUST, markersize=7.0, zorder=5)
        arrow(panel, mount, np.array((0.0, 0.13)), THRUST, 2.2)
    axes_at(panel, place["base"], "yz", 0.05)
    axes_at(panel, np.array((-0.36, 0.0)), "yz")
    note(panel, "world", np.array((-0.36, 0.0)), (0.0, -0.05), "center")
    note(
        panel,
        "left thruster\n(0, 0.1, 0) m\nfrom the base",
        place["left_thruster_mount"],
        (0.1, 0.09),
    )
    mount = place["left_thruster_mount"]
    panel.text(mount[0] + 0.02, mount[1] + 0.12, "u", color=THRUST, fontweight="bold")
    note(
        panel,
        "hip frontal: turns about x\n(0, 0.1, −0.1) m",
        place["left_hip_frontal"],
        (0.1, 0.045),
    )
    note(
        panel, "hip sagittal, 0.05 m\nbeside the frontal", place["left_hip_sagittal"], (0.06, -0.09)
    )
    note(panel, "left_foot", place["left_foot"], (0.06, -0.05))
    note(panel, "right_foot", place["right_foot"], (0.04, -0.05))


def main() -> None:
    """Write the figure."""
    style = {"font.size": 9.0, "svg.hashsalt": "frames", "svg.fonttype": "path"}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(8.4, 4.1), layout="constrained")
        side, front = figure.subplots(1, 2)
        at = points()
        draw_side(side, at)
        draw_front(front, at)
        for panel, limits in ((side, (-0.42, 0.5)), (front, (-0.42, 0.5))):
            panel.set_xlim(*limits)
            panel.set_ylim(-0.09, 0.75)
        figure.savefig(OUT, metadata={"Date": None})


if __name__ == "__main__":
    main()
