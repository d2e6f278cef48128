"""URDFs of robots whose legs stand out to the sides, as an insect's do."""

from math import atan2

PLACES = {"front": (0.12, 0.06), "middle": (0.0, 0.1), "hind": (-0.12, 0.06)}
"""Where the legs of the left side begin, in the frame of the body, m; those of the right side
mirrored.
"""
LINKS = (("coxa", 0.052, 0.06), ("femur", 0.066, 0.1), ("tibia", 0.138, 0.06))
"""Name, length in m and mass in kg of the links of a leg: the first one turns about the vertical,
the others bend.
"""
LIMITS = ((-1.0, 1.0), (-1.6, 1.6), (-0.5, 2.6))
"""Ranges of the three joints, rad."""


def sprawling_urdf(
    rows: tuple[str, ...] = tuple(PLACES), *, limits: tuple[tuple[float, float], ...] = LIMITS
) -> str:
    """A robot of 2.6 kg with six legs, or of those rows, with frames ``left_front_foot`` and so on
    at their ends.
    """
    text = _link("body", 1.3, 0.24)
    for side, sign in (("left", 1), ("right", -1)):
        for row in rows:
            leg, (x, y) = f"{side}_{row}", PLACES[row]
            parent, place, yaw = "body", f"{x} {sign * y} 0", sign * atan2(y, x)
            for (name, length, mass), (low, high) in zip(LINKS, limits, strict=True):
                axis = "0 0 1" if name == "coxa" else "0 1 0"
                ends = f'<parent link="{parent}"/><child link="{leg}_{name}"/><axis xyz="{axis}"/>'
                limit = f'<limit lower="{low}" upper="{high}" effort="1.8" velocity="10"/>'
                ends += f'<origin xyz="{place}" rpy="0 0 {yaw}"/>{limit}'
                text += _link(f"{leg}_{name}", mass, length)
                text += f'<joint name="{leg}_{name}_joint" type="revolute">{ends}</joint>'
                parent, place, yaw = f"{leg}_{name}", f"{length} 0 0", 0.0
            ends = f'<parent link="{parent}"/><child link="{leg}_foot"/><origin xyz="{place}"/>'
            text += f'<link name="{leg}_foot"/><joint name="{leg}_end" type="fixed">{ends}</joint>'
    return f'<robot name="sprawling">{text}</robot>'


def _link(name: str, mass: float, length: float) -> str:
    """A link with the inertia of a ball as large as half of its length, in its frame."""
    moment = 0.1 * mass * length**2
    inertia = f'ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"'
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia '
        f"{inertia}/></inertial></link>"
    )
