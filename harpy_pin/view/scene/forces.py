"""Forces: arrows, and the friction cones that the ground's forces on feet must stay in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector
from harpy_pin.view.palette import CONTACT, FLOOR, FRICTION, SLIDING, THRUST
from harpy_pin.view.scene.frames import Contacts
from harpy_pin.view.scene.nodes import (
    Lines,
    Look,
    Mesh,
    Motion,
    Motions,
    Node,
    node_name,
    revolved,
    turn_z_to,
)

HEAD_LENGTH, HEAD_WIDTH = 3.2, 2.4
"""Length and diameter of an arrow's head in shaft diameters."""
SIDES = 64
ROUNDING = 1.0 + 1e-6
CONE_SLANT, CONTACT_RADIUS, THRUST_RADIUS = 0.45, 0.009, 0.013
"""Side of a friction cone, and radii of arrows, as shares of the robot's height: thin, so that the
cone is seen.
"""


class Arrow:
    """Arrow of a force: it starts at a point, points along the force, and is as long as the force
    is strong.

    One shorter than its head consists of a head alone, smaller in proportion; one shorter than a
    hundredth of it is not drawn.

    Args:
        path: of its node.
        colour: ``#rrggbb``.
        radius: of the shaft, m.
        metres_per_newton: scale.

    Attributes:
        nodes: a shaft from z = 0 to z = 1, which is stretched, and a head from z = 0 on.
        head: length of the head, m.
    """

    def __init__(self, path: str, colour: str, *, radius: float, metres_per_newton: float) -> None:
        self._path, self._scale = path, metres_per_newton
        self.head = 2.0 * radius * HEAD_LENGTH
        look = Look(colour, light="bright", in_front=5)
        self.nodes = [
            Node(f"{path}/shaft", revolved([(0.0, 0.0), (radius, 0.0), (radius, 1.0)]), look),
            Node(
                f"{path}/head",
                revolved([(0.0, 0.0), (radius * HEAD_WIDTH, 0.0), (0.0, self.head)]),
                look,
            ),
        ]

    def motions(self, origin: Vector, force: Vector) -> Motions:
        """Motion of the arrow from (n, 3) points, m, and forces, N."""
        strength = np.linalg.norm(force, axis=1)
        length = strength * self._scale
        shown = length > 0.01 * self.head
        direction = np.where(
            shown[:, None], force / np.where(shown, strength, 1.0)[:, None], (0.0, 0.0, 1.0)
        )
        small = np.clip(length / self.head, 0.01, 1.0)
        shaft = np.maximum(length - self.head, 0.0)
        stretched, zero = np.maximum(shaft, 1e-4), np.zeros_like(length)
        return {
            self._path: Motion(position=origin, quaternion=turn_z_to(direction), visible=shown),
            f"{self._path}/shaft": Motion(
                scale=np.column_stack((small, small, stretched)), visible=shaft > 0.0
            ),
            f"{self._path}/head": Motion(
                position=np.column_stack((zero, zero, shaft)),
                scale=np.column_stack((small, small, small)),
            ),
        }


class Cone:
    """Friction cone of a foot: blue while the foot sticks, red while it slides or its force lies
    outside.

    Args:
        path: of its node.
        slant: length of the side of the circular cone, m.
        per_axis: the pyramid |f_x| ≤ μ f_z, |f_y| ≤ μ f_z instead of a circular cone.
        ring: height at which a ring marks the smallest normal force that is desired, m; there is
            none where the cone ends below.
        full: share of its friction from which on a force counts as outside.

    Attributes:
        nodes: of half-angle 45° and height 1, stretched as the friction is.
    """

    def __init__(
        self,
        path: str,
        *,
        slant: float,
        per_axis: bool = False,
        ring: float | None = None,
        full: float = ROUNDING,
    ) -> None:
        self._path, self._slant, self._ring, self._full = path, slant, ring, full
        if per_axis:
            corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
        else:
            angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
            corners = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        rim = np.column_stack((corners, np.ones(len(corners))))
        edge, spokes = (
            np.stack((rim, np.roll(rim, -1, axis=0)), axis=1),
            np.stack((np.zeros_like(rim), rim), axis=1),
        )
        triangles = np.concatenate(
            (np.zeros((len(rim), 1, 3)), edge), axis=1
        )  # unshared corners: sharp edges
        side = Mesh(triangles.reshape(-1, 3), np.arange(3 * len(rim)).reshape(-1, 3))
        edges = Lines(np.concatenate((edge, spokes)) if per_axis else edge)
        self.nodes = [
            Node(f"{path}/{kind}/{name}", shape, Look(colour, opacity))
            for kind, colour in (("sticking", FRICTION), ("sliding", SLIDING))
            for name, shape, opacity in (("side", side, 0.3), ("edges", edges, 1.0))
        ]
        if ring is not None:
            self.nodes.append(Node(f"{path}/floor", Lines(edge), Look(FLOOR)))

    def motions(self, contact: Contacts, normal: Vector | None) -> Motions:
        """Motion of the cone: its apex is the foot of the (n,) contacts, its axis the (n, 3) normal
        or the vertical.
        """
        assert contact.mu is not None
        mu, slides = contact.mu, contact.slides | (contact.used > self._full)
        height = self._slant / np.hypot(1.0, mu)
        scale = np.stack((mu * height, mu * height, height), axis=1)
        turn, visible = None if normal is None else turn_z_to(normal), contact.touching & (mu > 0.0)
        motions = {self._path: Motion(position=contact.position, quaternion=turn, visible=visible)}
        for kind, shown in (("sticking", ~slides), ("sliding", slides)):
            motions[f"{self._path}/{kind}"] = Motion(visible=shown)
            for name in ("side", "edges"):
                motions[f"{self._path}/{kind}/{name}"] = Motion(scale=np.maximum(scale, 1e-6))
        if self._ring is not None:
            ring = self._ring * np.stack((mu, mu, np.ones_like(mu)), axis=1)
            motions[f"{self._path}/floor"] = Motion(
                scale=np.maximum(ring, 1e-6), visible=self._ring < height
            )
        return motions


class Forces:
    """Arrow and friction cone of each foot, and arrow of each thruster.

    Args:
        robot: whose forces they are.
        scales: of the arrows.
        cones: draw friction cones.
        floor: smallest normal force that is desired, N; None where there is none.
        cone: further arguments of :class:`Cone`.

    Attributes:
        nodes: of all arrows and cones.
    """

    def __init__(
        self,
        robot: Robot,
        scales: Scales,
        *,
        cones: bool = True,
        floor: float | None = None,
        **cone: Any,
    ) -> None:
        def arrow(path: str, colour: str, radius: float, newtons_per_metre: float) -> Arrow:
            return Arrow(
                path,
                colour,
                radius=radius * scales.height,
                metres_per_newton=1.0 / newtons_per_metre,
            )

        feet, thrusters = (
            [node_name(name) for name in names] for names in (robot.feet, robot.thrusters)
        )
        cone |= {
            "slant": CONE_SLANT * scales.height,
            "ring": None if floor is None else floor / scales.force,
        }
        self._contacts = [
            arrow(f"contact_force/{name}", CONTACT, CONTACT_RADIUS, scales.force) for name in feet
        ]
        self._thrusts = [
            arrow(f"thrust/{name}", THRUST, THRUST_RADIUS, scales.force) for name in thrusters
        ]
        self._cones = [Cone(f"friction_cone/{name}", **cone) for name in feet if cones]
        parts: list[Arrow | Cone] = [*self._contacts, *self._cones, *self._thrusts]
        self.nodes = [node for part in parts for node in part.nodes]

    def motions(
        self,
        contacts: Contacts,
        foot_force: Vector,
        normal: Vector | None,
        mount: Vector,
        thrust: Vector,
    ) -> Motions:
        """Motion of all arrows and cones.

        Args:
            contacts: (n, feet).
            foot_force: (n, feet, 3) of the ground on the feet, world axes, N.
            normal: (n, feet, 3) of the ground; None is the vertical.
            mount: (n, thrusters, 3) where thrusters are, m.
            thrust: (n, thrusters, 3) their forces on the robot, N.
        """
        motions: Motions = {}
        for k, arrow in enumerate(self._contacts):
            motions |= arrow.motions(contacts.position[:, k], foot_force[:, k])
        for k, cone in enumerate(self._cones):
            motions |= cone.motions(contacts[:, k], None if normal is None else normal[:, k])
        for k, arrow in enumerate(self._thrusts):
            motions |= arrow.motions(mount[:, k], thrust[:, k])
        return motions


@dataclass(frozen=True)
class Scales:
    """Sizes of what is drawn, from the robot's height and weight."""

    height: float  # of the body above the ground, m
    force: float  # contact force or thrust that is drawn one metre long, N/m

    @classmethod
    def of(cls, robot: Robot, height: float) -> Scales:
        """Half the robot's weight is about a third of its height."""
        height = float(np.clip(height, 0.1, 10.0))
        share = robot.mass * GRAVITY * min(2.0 / max(len(robot.feet), 1), 1.0)
        return cls(height, nice_scale(1.25 * share / (0.65 * height)))


def nice_scale(newtons_per_metre: float) -> float:
    """The nearest of 1, 2, 5, 10, 20, … N/m below or at a scale, so that a legend can name it."""
    if not np.isfinite(newtons_per_metre) or newtons_per_metre <= 0.0:
        return 100.0
    decade = 10.0 ** np.floor(np.log10(newtons_per_metre))
    steps = [s for s in (1.0, 2.0, 5.0) if s * decade <= newtons_per_metre * (1.0 + 1e-12)]
    return float(steps[-1] * decade)
