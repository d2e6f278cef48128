"""Robots with closed loops, written as URDF: a four-bar knee, a parallel ankle, coupled joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import harpy_pin as hp

Point = tuple[float, float, float]
SIDES = (("left", 1.0), ("right", -1.0))


def link(name: str, mass: float, centre: Point = (0.0, 0.0, 0.0), size: float = 0.1) -> str:
    moment = mass * size**2 / 6.0
    x, y, z = centre
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} {y} {z}"/><mass value="{mass}"/>'
        f'<inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>'
        "</inertial></link>"
    )


def joint(
    name: str,
    parent: str,
    child: str,
    at: Point,
    axis: str = "0 1 0",
    effort: float = 60.0,
    mimic: str = "",
    reach: float = 2.5,
) -> str:
    """A joint that turns; one without effort has no motor."""
    x, y, z = at
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>{mimic}'
        f'<limit lower="{-reach}" upper="{reach}" effort="{effort}" velocity="30"/>'
        f'<dynamics damping="0" armature="{0.01 if effort else 0.0}"/></joint>'
    )


def frame(name: str, parent: str, at: Point) -> str:
    x, y, z = at
    return (
        f'<link name="{name}"/><joint name="{name}_fixed" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{x} {y} {z}"/></joint>'
    )


def written(folder: Path, name: str, parts: Sequence[str]) -> Path:
    path = folder / f"{name}.urdf"
    path.write_text(f'<robot name="{name}">{"".join(parts)}</robot>')
    return path


def _four_bar_leg(name: str, hip: Point, reach: float) -> tuple[list[str], tuple[str, str, str]]:
    """Parts and loop of a leg on a point, whose knee is a four-bar linkage."""
    parts = [
        link(f"{name}_hip", 0.4, (0.0, 0.0, 0.0)),
        joint(f"{name}_hip_roll", "base", f"{name}_hip", hip, "1 0 0"),
        link(f"{name}_thigh", 1.0, (0.01, 0.0, -0.14), 0.2),
        joint(f"{name}_hip_pitch", f"{name}_hip", f"{name}_thigh", (0.0, 0.0, 0.0)),
        link(f"{name}_crank", 0.1, (-0.03, 0.0, 0.0), 0.05),
        joint(f"{name}_knee", f"{name}_thigh", f"{name}_crank", (0.0, 0.0, -0.05), reach=reach),
        link(f"{name}_rod", 0.08, (0.0, 0.0, -0.11), 0.1),
        joint(
            f"{name}_rod_joint", f"{name}_crank", f"{name}_rod", (-0.035, 0.0, -0.035), effort=0.0
        ),
        link(f"{name}_shank", 0.4, (0.0, 0.0, -0.1), 0.2),
        joint(f"{name}_hinge", f"{name}_thigh", f"{name}_shank", (0.0, 0.0, -0.28), effort=0.0),
        frame(f"{name}_rod_end", f"{name}_rod", (0.002, 0.0, -0.225)),
        frame(f"{name}_lever", f"{name}_shank", (-0.033, 0.0, -0.03)),
        frame(f"{name}_foot", f"{name}_shank", (0.0, 0.0, -0.28)),
    ]
    return parts, (f"{name}_rod_end", f"{name}_lever", "point")


def four_bar(folder: Path, *, reach: float = 0.9) -> hp.Robot:
    """A biped with point feet whose knees are four-bar linkages; their motors reach so far, rad."""
    parts, loops = [link("base", 8.0, size=0.3)], []
    for side, s in SIDES:
        leg, loop = _four_bar_leg(side, (0.0, 0.08 * s, -0.1), reach)
        parts, loops = parts + leg, [*loops, loop]
    return hp.load_robot(
        written(folder, "four_bar", parts),
        feet=("left_foot", "right_foot"),
        loops=loops,
        posture=(0.0, -0.4, 0.74) * 2,
    )


def quadruped(folder: Path) -> hp.Robot:
    """A quadruped with such legs."""
    parts, loops = [link("base", 12.0, size=0.4)], []
    names = [f"{end}_{side}" for end in ("front", "hind") for side, _ in SIDES]
    for name, (x, y) in zip(
        names, ((0.25, 0.12), (0.25, -0.12), (-0.25, 0.12), (-0.25, -0.12)), strict=True
    ):
        leg, loop = _four_bar_leg(name, (x, y, 0.0), 1.3)
        parts, loops = parts + leg, [*loops, loop]
    return hp.load_robot(
        written(folder, "quadruped", parts),
        feet=tuple(f"{name}_foot" for name in names),
        loops=loops,
        posture=(0.0, -0.4, 0.74) * 4,
    )


def parallel_ankle(folder: Path) -> hp.Robot:
    """A biped with soles; two motors on each shank move its ankle by rods."""
    parts, loops = [link("base", 14.0, (0.0, 0.0, 0.15), 0.4)], []
    for side, s in SIDES:
        parts += [
            link(f"{side}_yaw_link", 0.5),
            joint(f"{side}_yaw", "base", f"{side}_yaw_link", (0.0, 0.09 * s, -0.05), "0 0 1"),
            link(f"{side}_roll_link", 0.5),
            joint(
                f"{side}_roll", f"{side}_yaw_link", f"{side}_roll_link", (0.0, 0.0, -0.03), "1 0 0"
            ),
            link(f"{side}_thigh", 1.8, (0.0, 0.0, -0.15), 0.3),
            joint(f"{side}_pitch", f"{side}_roll_link", f"{side}_thigh", (0.0, 0.0, 0.0)),
            link(f"{side}_shank", 1.2, (0.0, 0.0, -0.1), 0.3),
            joint(f"{side}_knee", f"{side}_thigh", f"{side}_shank", (0.0, 0.0, -0.3)),
            link(f"{side}_cross", 0.05),
            joint(
                f"{side}_ankle_pitch",
                f"{side}_shank",
                f"{side}_cross",
                (0.0, 0.0, -0.3),
                effort=0.0,
            ),
            link(f"{side}_foot", 0.5, (0.03, 0.0, -0.03), 0.15),
            joint(
                f"{side}_ankle_roll",
                f"{side}_cross",
                f"{side}_foot",
                (0.0, 0.0, 0.0),
                "1 0 0",
                effort=0.0,
            ),
            frame(f"{side}_sole", f"{side}_foot", (0.03, 0.0, -0.05)),
        ]
        for which, t in (("inner", -1.0), ("outer", 1.0)):
            y = 0.045 * t * s
            parts += [
                link(f"{side}_{which}_crank", 0.05, (-0.02, 0.0, 0.0), 0.05),
                joint(
                    f"{side}_{which}",
                    f"{side}_shank",
                    f"{side}_{which}_crank",
                    (0.0, y, -0.12 + 0.03 * t),
                    reach=0.9,
                ),
                frame(f"{side}_{which}_tip", f"{side}_{which}_crank", (-0.05, 0.0, 0.0)),
                frame(f"{side}_{which}_heel", f"{side}_foot", (-0.055, y, 0.0)),
            ]
            loops.append((f"{side}_{which}_tip", f"{side}_{which}_heel", "length"))
    sole = hp.FlatFoot(length=0.18, width=0.08)
    return hp.load_robot(
        written(folder, "parallel_ankle", parts),
        feet=("left_sole", "right_sole"),
        flat_feet={"left_sole": sole, "right_sole": sole},
        loops=loops,
    )


def coupled(folder: Path) -> hp.Robot:
    """A biped whose tarsi mimic its knees."""
    parts = [link("base", 5.0, size=0.3)]
    for side, s in SIDES:
        mimic = f'<mimic joint="{side}_knee" multiplier="-0.8" offset="0.1"/>'
        parts += [
            link(f"{side}_hip", 0.3),
            joint(f"{side}_hip_roll", "base", f"{side}_hip", (0.0, 0.1 * s, 0.0), "1 0 0"),
            link(f"{side}_femur", 0.4, (0.0, 0.0, -0.1)),
            joint(f"{side}_hip_pitch", f"{side}_hip", f"{side}_femur", (0.05, 0.03 * s, 0.0)),
            link(f"{side}_tibia", 0.3, (-0.05, 0.0, -0.12)),
            joint(f"{side}_knee", f"{side}_femur", f"{side}_tibia", (0.07, 0.0, -0.13)),
            link(f"{side}_tarsus", 0.1, (0.03, 0.0, -0.06), 0.05),
            joint(
                f"{side}_tarsus_joint",
                f"{side}_tibia",
                f"{side}_tarsus",
                (-0.2, 0.0, -0.24),
                effort=0.0,
                mimic=mimic,
            ),
            frame(f"{side}_foot", f"{side}_tarsus", (0.06, 0.0, -0.13)),
        ]
    return hp.load_robot(written(folder, "coupled", parts), feet=("left_foot", "right_foot"))


def across(folder: Path) -> hp.Robot:
    """A tree whose two limbs a rod ties, with a joint beyond the loop."""
    parts = [
        link("base", 3.0),
        link("one", 0.5, (0.0, 0.0, -0.1)),
        joint("a", "base", "one", (0.1, 0.0, 0.0)),
        link("two", 0.4, (0.0, 0.02, -0.1)),
        joint("b", "one", "two", (0.0, 0.01, -0.2), "1 0 0"),
        link("three", 0.6, (0.0, 0.0, -0.1)),
        joint("c", "base", "three", (-0.1, 0.05, 0.0), effort=0.0),
        link("four", 0.2, (0.0, 0.0, -0.05)),
        joint("d", "three", "four", (0.0, 0.0, -0.2), "0.6 0.8 0"),
        frame("tip_two", "two", (0.0, 0.0, -0.15)),
        frame("tip_three", "three", (-0.2, 0.0, 0.05)),
        frame("tip_four", "four", (0.0, 0.0, -0.15)),
    ]
    return hp.load_robot(
        written(folder, "across", parts),
        feet=("tip_two", "tip_four"),
        loops=[("tip_two", "tip_three", "length")],
    )


def rubbing(folder: Path, *, damping: float = 0.3, friction: float = 0.0) -> hp.Robot:
    """The four-bar biped, whose joints without a motor have losses, N·m·s/rad and N·m, and
    armature.
    """
    robot = four_bar(folder)
    text = robot.urdf.read_text()
    told = 'damping="0" armature="0.0"'
    assert text.count(told) == 4
    path = folder / "rubbing.urdf"
    losses = f'damping="{damping}" friction="{friction}" armature="0.01"'
    path.write_text(text.replace(told, losses))
    given = {name: robot.source[name] for name in ("feet", "loops", "posture")}
    return hp.load_robot(path, **given)


ROBOTS = {
    "four_bar": four_bar,
    "parallel_ankle": parallel_ankle,
    "coupled": coupled,
    "across": across,
    "rubbing": rubbing,
}
