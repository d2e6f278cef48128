"""URDFs of bipeds whose legs have the joints that a test asks for."""

from collections.abc import Sequence

AXES = {"yaw": "0 0 1", "roll": "1 0 0", "pitch": "0 1 0", "turn": "0 0 1", "knee": "0 1 0"}
AXES |= {"ankle": "0 1 0", "tilt": "1 0 0", "waist": "0 0 1", "lean": "1 0 0"}
LIMITS = {"knee": (0.0, 2.3)}
LONG = ("knee", "ankle")
"""Joints that are a link's length, 0.3 m, below the joint above them."""
MASS = {"pitch": 2.0, "knee": 1.5, "waist": 3.0, "lean": 3.0}
SIX = ("yaw", "roll", "pitch", "knee", "ankle", "tilt")


def biped_urdf(
    joints: Sequence[str] = SIX,
    *,
    waist: Sequence[str] = (),
    hips: float = 0.1,
    effort: float = 120.0,
    sole: str = "0 0 0",
    more: str = "",
) -> str:
    """A biped, of about 20 kg, with frames ``L_sole`` and ``R_sole`` at the ends of its legs.

    Args:
        joints: of a leg, from the hip on, by the names of :data:`AXES`; ``turn`` is a yaw within
            the thigh.
        waist: joints between the base and both legs.
        hips: half of the distance between the legs, m.
        effort: of each joint, N·m.
        sole: roll, pitch and yaw of the soles' frames in the feet, rad.
        more: further elements.
    """
    text, above = _link("base", 10.0), "base"
    for name in waist:
        text += _joint(name, above, name, "0 0 -0.1", effort)
        above = name
    for side, sign in (("L", 1), ("R", -1)):
        parent, place = above, f"0 {sign * hips} 0"
        for name in joints:
            if name in LONG:
                place = "0 0 -0.3"
            text += _joint(name, parent, f"{side}_{name}", place, effort)
            parent, place = f"{side}_{name}", "0 0 0"
        drop = "-0.3" if joints[-1] == "knee" else "-0.05"
        end = (
            f'<parent link="{parent}"/><child link="{side}_sole"/><origin xyz="0.02 0 {drop}" '
            f'rpy="{sole}"/>'
        )
        text += f'<link name="{side}_sole"/><joint name="{side}_end" type="fixed">{end}</joint>'
    return f'<robot name="biped">{text}{more}</robot>'


def _joint(kind: str, parent: str, child: str, place: str, effort: float) -> str:
    """A joint and the link below it."""
    low, high = LIMITS.get(kind, (-1.6, 1.6))
    ends = (
        f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/><axis '
        f'xyz="{AXES[kind]}"/>'
    )
    limit = f'<limit lower="{low}" upper="{high}" effort="{effort}" velocity="20"/>'
    return (
        _link(child, MASS.get(kind, 0.4))
        + f'<joint name="j_{child}" type="revolute">{ends}{limit}</joint>'
    )


def _link(name: str, mass: float) -> str:
    """A link with the inertia of a ball of 0.1 m."""
    moment = 0.004 * mass
    inertia = f'ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"'
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia '
        f"{inertia}/></inertial></link>"
    )
