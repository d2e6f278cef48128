"""A biped in MJCF with the kinds of joints that Cassie has: rods on ball joints and on hinges that
``<connect>`` closes, and a stiff spring in each shin.

A rod from thigh to heel keeps the tarsus parallel to the thigh; a motor at the foot, which a rod
ties to a crank. Points, lengths and masses are our own.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import harpy_pin as hp

FEET = ("left_foot", "right_foot")
SPRING = 1500.0
"""Of the shins, N·m/rad."""


def inertial(mass: float, at: str, size: float) -> str:
    moment = mass * size**2 / 6.0
    return f'<inertial pos="{at}" mass="{mass}" diaginertia="{moment} {moment} {moment}"/>'


def rod(mass: float, end: tuple[float, float, float]) -> str:
    """Inertia of a thin rod from the origin to a point."""
    x, y, z = end
    length = (x * x + y * y + z * z) ** 0.5
    across, along = mass * length**2 / 12.0, mass * 1e-5
    parts = [
        across * (i == j) - (across - along) * end[i] * end[j] / length**2
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    ]
    full = " ".join(f"{part:.9g}" for part in parts)
    return f'<inertial pos="{x / 2} {y / 2} {z / 2}" mass="{mass}" fullinertia="{full}"/>'


def leg(side: str, s: float, spring: float, ball: str) -> str:
    return f"""
<body name="{side}_roll_link" pos="0 {0.1 * s} -0.05">{inertial(1.5, "0 0 0", 0.1)}
 <joint name="{side}_roll" axis="1 0 0" range="-0.5 0.5" armature="0.03"/>
 <body name="{side}_yaw_link" pos="0 0 -0.05">{inertial(1.0, "0 0 0", 0.1)}
  <joint name="{side}_yaw" axis="0 0 1" range="-0.5 0.5" armature="0.03"/>
  <body name="{side}_thigh">{inertial(3.0, "0 0 -0.1", 0.2)}
   <joint name="{side}_pitch" axis="0 1 0" range="-1.2 1.2" armature="0.05"/>
   <body name="{side}_rod" pos="0 {0.03 * s} -0.1">{ball}
    <joint name="{side}_rod_ball" type="ball"/></body>
   <body name="{side}_lever" pos="0 0 -0.3">{inertial(0.5, "0 0 0", 0.06)}
    <joint name="{side}_knee" axis="0 1 0" range="-0.7 0.7" armature="0.05"/>
    <body name="{side}_shin">{rod(0.6, (-0.2, 0.0, -0.25))}
     <joint name="{side}_spring" axis="0 1 0" stiffness="{spring}" damping="0.1"/>
     <body name="{side}_tarsus" pos="-0.2 0 -0.25">{inertial(0.7, "0.08 0 -0.15", 0.2)}
      <joint name="{side}_tarsus_joint" axis="0 1 0"/>
      <body name="{side}_crank" pos="0.03 {-0.02 * s} -0.05">{inertial(0.1, "0.02 0 0", 0.04)}
       <joint name="{side}_crank_joint" axis="0 1 0"/>
       <body name="{side}_plantar" pos="0.05 0 0">{rod(0.1, (0.15, 0.0, -0.25))}
        <joint name="{side}_plantar_joint" axis="0 1 0"/></body></body>
      <body name="{side}_foot" pos="0.18 0 -0.3">{inertial(0.2, "0.02 0 -0.02", 0.1)}
       <joint name="{side}_foot_joint" axis="0 1 0" range="-0.8 0.8" armature="0.01"/>
       <geom name="{side}_bar" type="capsule" size="0.02" fromto="-0.05 0 -0.03 0.09 0 -0.03"
        contype="1"/>
       <site name="{side}_sole_0" pos="0.09 0 -0.05"/>
       <site name="{side}_sole_1" pos="-0.05 0 -0.05"/></body></body></body></body></body></body>
</body>"""


def motors(side: str) -> str:
    peaks = {"roll": 110, "yaw": 110, "pitch": 200, "knee": 200, "foot_joint": 45}
    return "".join(
        f'<motor joint="{side}_{name}" ctrlrange="-{peak} {peak}"/>' for name, peak in peaks.items()
    )


def sprung_text(
    *, spring: float = SPRING, ball: str | None = None, anchor: str = "-0.2 0 -0.25"
) -> str:
    """The file.

    Args:
        spring: of the shins, N·m/rad.
        ball: inertia of the bodies on ball joints; that of a thin rod by default.
        anchor: where a rod ends, in its body's frame, m.
    """
    ball = rod(0.15, (-0.2, 0.0, -0.25)) if ball is None else ball
    legs = "".join(leg(side, s, spring, ball) for side, s in (("left", 1), ("right", -1)))
    ties = "".join(
        f'<connect body1="{side}_rod" body2="{side}_tarsus" anchor="{anchor}"/>'
        f'<connect body1="{side}_plantar" body2="{side}_foot" anchor="0.15 0 -0.25"/>'
        for side in ("left", "right")
    )
    return f"""<mujoco model="sprung"><compiler angle="radian" autolimits="true"/>
<option timestep="0.001" cone="elliptic" impratio="100"/>
<default><geom contype="0" conaffinity="0" friction="0.8"/><equality solref="0.005 1"/></default>
<worldbody><geom name="ground" type="plane" size="0 0 1" conaffinity="1"/>
<body name="base" pos="0 0 1.05"><freejoint/>{inertial(12.0, "0 0 0.05", 0.3)}
<site name="imu"/>{legs}</body></worldbody>
<equality>{ties}</equality><actuator>{motors("left")}{motors("right")}</actuator></mujoco>"""


def sprung(folder: Path) -> hp.Robot:
    """The robot, with its springs held."""
    path = folder / "sprung.xml"
    path.write_text(sprung_text())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # springs are held
        return hp.load_robot(path, feet=FEET)
