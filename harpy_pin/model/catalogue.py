"""Well-known robots by name: their files in example-robot-data, their feet or rotors, and a
posture.

Postures are the reference configurations ``standing`` or ``half_sitting`` of each robot's SRDF,
where there is one. iCub's knees are bent further, its soles level, and its centre of mass above
their middle: in its SRDF's posture the knees are nearly straight, the soles tilt by 0.06 rad, and
the centre of mass is 42 mm from the rear edge of soles 150 mm long.

Dry friction in the joints is left out: the files of Go1, Talos and hextilt have one round number
for many joints.

Humanoids stand on flat feet, rectangles inside the soles of their collision geometry:

- Talos: the lowest 3 mm of the mesh of ``leg_left_6_link`` reach from x = −0.110 to 0.099 m and y =
  ±0.062 m of the sole's frame.
- G1: of the four spheres under each foot, the two at the front are 60 mm apart, those at the rear
  50 mm, and 170 mm lie between front and rear.
- iCub: the bottom of the foot's mesh reaches from x = −0.029 to 0.127 m and y = ±0.030 m of the
  sole's frame; its corners are cut off. (Its mesh files are drawn with y up, which has to be
  undone: ``view/scene/visuals.py``.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distribution
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, RobotError, install_line
from harpy_pin.model.flat_foot import FlatFoot
from harpy_pin.model.rotor import Rotor
from harpy_pin.model.state import Vector

DATA = "cmeel.prefix/share/example-robot-data/robots"
HARPY_FEET = ("left_foot", "right_foot")
HARPY_THRUSTERS = ("left_thruster", "right_thruster")
HARPY_THRUST_LIMIT = 53.0  # hardware limit of one thruster, N (equations.md §3)


@dataclass(frozen=True)
class CatalogueRobot:
    """Where a robot is, and what its file does not say.

    Attributes:
        file: within the folder of robots.
        feet: frame names of the feet.
        angles: standing angles of joints by name, rad; the other joints are at zero.
        mounts: feet and rotors that are no frames of the file: the link of each, and its place in
            the link's frame, m.
        flat_feet: the feet that are flat.
        rotors: thrusters with a fixed axis.
        facing: yaw of the direction in which it faces, about the axes of its base, rad.
        loops: closed loops, as of :func:`~harpy_pin.model.loading.load_robot`.
    """

    file: str
    feet: tuple[str, ...]
    angles: Mapping[str, float]
    mounts: Mapping[str, tuple[str, tuple[float, float, float]]] = field(default_factory=dict)
    flat_feet: Mapping[str, FlatFoot] = field(default_factory=dict)
    rotors: tuple[Rotor, ...] = ()
    facing: float = 0.0
    loops: tuple[tuple[str, str, str], ...] = ()

    @property
    def own(self) -> bool:
        """Whether the file is this library's."""
        return "/" not in self.file

    def path(self) -> Path:
        """The URDF.

        Raises:
            RobotError: example-robot-data is not installed.
        """
        if self.own:
            return own_urdf(self.file)
        if installed_data() is None:
            raise RobotError(f"'{self.file}' is in example-robot-data: {install_line('robots')}")
        return Path(str(distribution("example-robot-data").locate_file(DATA))) / self.file

    @checked
    def add_frames(self, model: pin.Model) -> None:
        """Add to a model of the file the frames of :attr:`mounts`.

        Args:
            model: changed in place; a frame is added for each.
        """
        for name, (link, place) in self.mounts.items():
            number = model.getFrameId(link)
            parent = model.frames[number]
            placement = parent.placement * pin.SE3(np.eye(3), np.array(place))
            model.addFrame(
                pin.Frame(name, parent.parentJoint, number, placement, pin.FrameType.OP_FRAME)
            )

    @checked
    def posture(self, model: pin.Model) -> Vector:
        """(joints,) standing angles, rad.

        Args:
            model: of the file; gives the order of the joints.
        """
        return np.array([self.angles.get(name, 0.0) for name in list(model.names)[2:]])


def own_urdf(name: str) -> Path:
    """Path of a URDF of this library: beside the package once installed, at the top of a checkout
    otherwise.
    """
    package = Path(__file__).parent.parent
    installed = package / "urdf" / name
    return installed if installed.is_file() else package.parent / "urdf" / name


def installed_data() -> str | None:
    """Version of example-robot-data; None where it is not installed."""
    try:
        return distribution("example-robot-data").version
    except PackageNotFoundError:
        return None


def known_name(name: Any) -> Any:
    """The name by which a robot is known here: ``Go2``, ``unitree_g1``, ``ANYmal-C`` and ``solo``
    are understood, too.

    Whatever is no such name stays as it is.
    """
    if not isinstance(name, str) or name in CATALOGUE:
        return name
    plain = name.strip().lower().replace("-", "_").replace(" ", "_").removeprefix("unitree_")
    plain = ALIASES.get(plain, plain)
    return plain if plain in CATALOGUE or plain == "harpy" else name


def catalogue_robot(name: str | Path) -> CatalogueRobot | None:
    """The robot of that name; None if it is a path: it has a folder or an extension, or is no
    string.

    An :class:`InputError` lists the names there are.
    """
    if (
        not isinstance(name, str)
        or name in (".", "..")
        or Path(name).name != name
        or Path(name).suffix
    ):
        return None
    name = known_name(name)
    if name not in CATALOGUE:
        raise InputError.unknown("robot", name, CATALOGUE)
    return CATALOGUE[name]


ALIASES = {"solo": "solo12", "anymal": "anymal_c", "anymalb": "anymal_b", "anymalc": "anymal_c"}
"""Short names, and the robots that they mean."""


def _legs(names: str, joints: str, *angles: float) -> dict[str, float]:
    """Angles of legs with the same joints, leg after leg; the joints of one leg if every leg is
    like it.
    """
    keys = [f"{leg}_{joint}" for leg, joint in product(names.split(), joints.split())]
    return dict(zip(keys, angles * (len(keys) // len(angles)), strict=True))


def _unitree(name: str, *angles: float) -> CatalogueRobot:
    """A quadruped whose frames are named like those of Unitree."""
    legs = "FL FR RL RR"
    feet = tuple(f"{leg}_foot" for leg in legs.split())
    angles_of = _legs(legs, "hip_joint thigh_joint calf_joint", *angles)
    return CatalogueRobot(f"{name}_description/urdf/{name}.urdf", feet, angles_of)


def _both(names: str, foot: FlatFoot) -> dict[str, FlatFoot]:
    """Two flat feet alike."""
    return dict.fromkeys(names.split(), foot)


def _rotors(
    link: str,
    places: Sequence[tuple[float, float, float]],
    turns: str,
    *,
    limit: tuple[float, float],
    drag: float,
    quaternions: Sequence[tuple[float, float, float, float]] | None = None,
) -> tuple[tuple[Rotor, ...], dict[str, tuple[str, tuple[float, float, float]]]]:
    """Rotors whose frames are not in the file, and the mounts of these frames, at places of a link,
    m.

    Each turns, seen from above, counterclockwise (``-``) or clockwise (``+``), with the drag, m,
    and the limit, N. The quaternions (x, y, z, w) are those of the rotors' frames, whose z axis is
    the rotor's; upright by default.
    """
    rotors, mounts = [], {}
    for k, (place, turn) in enumerate(zip(places, turns, strict=True)):
        x, y, z, w = (0.0, 0.0, 0.0, 1.0) if quaternions is None else quaternions[k]
        axis = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
        name = f"rotor_{k}"
        rotors.append(Rotor(name, axis=axis, limit=limit, drag=drag if turn == "+" else -drag))
        mounts[name] = (link, place)
    return tuple(rotors), mounts


_SOLO_FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
_ANYMAL_FEET = ("LF_FOOT", "LH_FOOT", "RF_FOOT", "RH_FOOT")
_ANYMAL = _legs(
    "LF LH RF RH",
    "HAA HFE KFE",
    *(-0.1, 0.7, -1.0),
    *(-0.1, -0.7, 1.0),
    *(0.1, 0.7, -1.0),
    *(0.1, -0.7, 1.0),
)

# Flying robots. Their URDFs have no thrusts; the numbers are published elsewhere, in the files
# named here. A rotor that
# turns counterclockwise has the drag −c_m/c_f: its moment on the robot is clockwise.
# iris: yaml/iris/platform/iris.yaml of eagle-mpc (github.com/PepMS/eagle-mpc), whose constants are
# those of the
# RotorS simulator: c_f = 8.54858e-6 N s², c_m = 0.016 m c_f, from 100 to 1100 rad/s. (RotorS itself
# ends at 838 rad/s.)
_RPM_LIMIT = (0.0854858, 10.3437818)
_IRIS = tuple(
    Rotor(f"iris__rotor_{k}", limit=_RPM_LIMIT, drag=drag)
    for k, drag in enumerate((-0.016, -0.016, 0.016, 0.016))
)
# hector: config/multicopter/hector.yaml of eagle-mpc: arms of 0.1525 m, 0.1 to 5 N, c_f = 6.6e-5,
# c_m = 1e-6. The file
# gives no heights: we take the rotors to be level with the origin of the base.
_HECTOR = _rotors(
    "base_link",
    ((0.1525, 0.0, 0.0), (0.0, 0.1525, 0.0), (-0.1525, 0.0, 0.0), (0.0, -0.1525, 0.0)),
    "-+-+",
    limit=(0.1, 5.0),
    drag=1.0 / 66.0,
)
# borinot: robots/borinot/xacro and robots/common/xacro of hidro_robots
# (github.com/PepMS/hidro_robots): places, turning
# directions, c_m/c_f, and the motor model 3.847e-6 N s² from 100 to 2236 rad/s. The rotor links of
# 5 g each that it has
# there are not in the file of example-robot-data.
_BORINOT = _rotors(
    "borinot__base_link",
    (
        *((0.0, -0.185, 0.05), (0.0, 0.185, 0.05), (0.1602146997, 0.0925, 0.05)),
        *(
            (-0.1602146997, -0.0925, 0.05),
            (0.1602146997, -0.0925, 0.05),
            (-0.1602146997, 0.0925, 0.05),
        ),
    ),
    "+-+--+",
    limit=(3.847e-6 * 100.0**2, 3.847e-6 * 2236.0**2),
    drag=0.016894178436859097,
)
# hextilt: yaml/hextilt/platform/hextilt.yaml of eagle-mpc: places, orientations and turning
# directions; its thrusts are
# those of iris there.
_HEXTILT = _rotors(
    "hextilt__base_link",
    (
        (0.3907966465836527, 0.0299377136375720, -0.0427554860579147),
        (0.2213251438331876, 0.3234709668364263, -0.0427554860579147),
        (-0.2213251438331875, 0.3234709668364264, -0.0427554860579147),
        (-0.3907966465836527, 0.0299377136375721, -0.0427554860579147),
        (-0.1694715027504653, -0.3534086804739983, -0.0427554860579147),
        (0.1694715027504649, -0.3534086804739985, -0.0427554860579147),
    ),
    "-+-+-+",
    limit=_RPM_LIMIT,
    drag=0.016,
    quaternions=(
        (0.2995615231515963, 0.0831219092134935, 0.0262082373043233, 0.9500877698156101),
        (-0.3009888436523893, -0.0777950765858490, 0.4523468856138499, 0.8359042631373822),
        (0.0777950765858490, 0.3009888436523893, 0.8359042631373822, 0.4523468856138501),
        (-0.0831219092134935, -0.2995615231515963, 0.9500877698156101, 0.0262082373043234),
        (-0.2217664465657472, 0.2178669344388960, 0.8096960258330590, -0.4977408842017598),
        (-0.2178669344388958, 0.2217664465657473, -0.4977408842017603, 0.8096960258330587),
    ),
)

CATALOGUE: dict[str, CatalogueRobot] = {
    "harpy_built": CatalogueRobot(
        "harpy_built.urdf",
        ("left_foot", "right_foot"),
        {},
        rotors=tuple(Rotor(f"{side}_thruster", limit=(0.0, 53.0)) for side in ("left", "right")),
        loops=tuple(
            (f"{side}_femur_rod", f"{side}_tarsus_rod", "length") for side in ("left", "right")
        ),
    ),
    "solo8": CatalogueRobot(
        "solo_description/robots/solo.urdf",
        _SOLO_FEET,
        _legs("FL FR", "HFE KFE", 0.8, -1.6) | _legs("HL HR", "HFE KFE", -0.8, 1.6),
    ),
    "solo12": CatalogueRobot(
        "solo_description/robots/solo12.urdf",
        _SOLO_FEET,
        _legs(
            "FL FR HL HR",
            "HAA HFE KFE",
            *(0.1, 0.8, -1.6),
            *(-0.1, 0.8, -1.6),
            *(0.1, -0.8, 1.6),
            *(-0.1, -0.8, 1.6),
        ),
    ),
    "bolt": CatalogueRobot(
        "bolt_description/robots/bolt.urdf",
        ("FL_FOOT", "FR_FOOT"),
        _legs(
            "FL FR",
            "HAA HFE KFE",
            *(-0.3, 0.78539816, -1.57079633),
            *(0.3, 0.78539816, -1.57079633),
        ),
    ),
    "a1": _unitree("a1", 0.0, 0.8, -1.81),
    "b1": _unitree("b1", 0.0, 0.8, -1.6),
    "go1": _unitree("go1", 0.0, 0.8, -1.853),
    "go2": _unitree("go2", *(0.068, 0.785, -1.44), *(-0.068, 0.785, -1.44)),
    "laikago": _unitree("laikago", 0.0, 0.8, -1.6),  # no SRDF
    "anymal_b": CatalogueRobot(
        "anymal_b_simple_description/robots/anymal.urdf", _ANYMAL_FEET, _ANYMAL
    ),
    "anymal_c": CatalogueRobot(
        "anymal_c_simple_description/urdf/anymal.urdf", _ANYMAL_FEET, _ANYMAL
    ),
    "hyq": CatalogueRobot(
        "hyq_description/robots/hyq_no_sensors.urdf",
        ("lf_foot", "lh_foot", "rf_foot", "rh_foot"),
        _legs(
            "lf lh rf rh", "haa_joint hfe_joint kfe_joint", *(-0.2, 0.75, -1.5), *(-0.2, -0.75, 1.5)
        ),
    ),
    "talos": CatalogueRobot(
        "talos_data/robots/talos_reduced.urdf",
        ("left_sole_link", "right_sole_link"),
        _legs(
            "leg_left leg_right",
            "3_joint 4_joint 5_joint 6_joint",
            *(-0.411354, 0.859395, -0.448041, -0.001708),
        )
        | _legs(
            "arm_left",
            "1_joint 2_joint 3_joint 4_joint 7_joint",
            0.25847,
            0.173046,
            -0.0002,
            -0.525366,
            0.1,
        )
        | _legs(
            "arm_right",
            "1_joint 2_joint 3_joint 4_joint 7_joint",
            -0.25847,
            -0.173046,
            0.0002,
            -0.525366,
            0.1,
        )
        | {"torso_2_joint": 0.006761},
        flat_feet=_both(
            "left_sole_link right_sole_link",
            FlatFoot(length=0.2, width=0.12, centre=(-0.005, 0.0, 0.0)),
        ),
    ),
    "icub": CatalogueRobot(
        "icub_description/robots/icub.urdf",
        ("l_sole", "r_sole"),
        _legs(
            "l r",
            "hip_pitch hip_roll knee ankle_pitch ankle_roll",
            0.122,
            0.08727,
            -0.35,
            -0.228,
            -0.08726,
        )
        | _legs("l r", "shoulder_roll shoulder_yaw elbow", 0.35, 0.5, 0.5)
        | {"torso_yaw": -0.05236},
        flat_feet=_both(
            "l_sole r_sole", FlatFoot(length=0.15, width=0.06, centre=(0.05, 0.0, 0.0))
        ),
        facing=np.pi,
    ),
    "g1": CatalogueRobot(  # no SRDF; the sole is among the four spheres under each foot
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        ("left_sole", "right_sole"),
        _legs("left right", "hip_pitch_joint knee_joint ankle_pitch_joint", -0.1, 0.3, -0.2),
        {
            f"{side}_sole": (f"{side}_ankle_roll_link", (0.035, 0.0, -0.035))
            for side in ("left", "right")
        },
        flat_feet=_both("left_sole right_sole", FlatFoot(length=0.17, width=0.05)),
    ),
    "iris": CatalogueRobot("iris_description/robots/iris_simple.urdf", (), {}, rotors=_IRIS),
    "hector": CatalogueRobot(
        "hector_description/robots/quadrotor_base.urdf",
        (),
        {},
        rotors=_HECTOR[0],
        mounts=_HECTOR[1],
    ),
    "borinot": CatalogueRobot(
        "borinot_description/urdf/borinot_flying_arm_2.urdf",
        (),
        {},
        rotors=_BORINOT[0],
        mounts=_BORINOT[1],
    ),
    "hextilt": CatalogueRobot(
        "hextilt_description/urdf/hextilt_flying_arm_5.urdf",
        (),
        {},
        rotors=_HEXTILT[0],
        mounts=_HEXTILT[1],
    ),
}
"""Robots by name."""
