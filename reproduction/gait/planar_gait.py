"""Parameters, targets and file of the planar walk: a 4th-order Bezier curve per foot, in body axes,
by the clock.

The paper's parametrisation (equations.md §3, rows "gait" and "gait optimisation") has P1 = P0 and
P3 = P4 and only the middle point free: it is what :class:`PlanarGait` holds with every other number
at its default.
"""

from __future__ import annotations

import tomllib
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import HarpyError, InputError, RunFileError
from harpy_pin.files import replacing
from harpy_pin.gaits.straight import GaitParameters
from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.state import Vector

positive = partial(checks.setting, low=0.0, strict=True)


@dataclass(frozen=True, kw_only=True)
class PlanarGait(checks.Checked):
    """A planar walk. Positions are relative to the body's origin, body axes, m; heights count
    downwards.

    Both legs follow the same curves, half a cycle apart. The stance foot goes from the front end to
    the back end, the swing foot back. Nothing but the clock drives it.

    Raises:
        InputError: a number is not finite or out of its domain.
    """

    half_step: float = positive(
        0.1125
    )  # half the distance between the two ends, the paper's "end x"
    end_height: float = positive(0.6)  # of the ends below the body
    swing_mid_height: float = positive(
        0.5
    )  # of the middle control point P2 of the swing, below the body
    stance_mid_height: float = positive(
        0.6
    )  # of the middle control point P2 of the stance, below the body
    offset: float = checks.setting(
        0.0
    )  # how far the middle between the ends lies in front of the body
    swing_mid_x: float = checks.setting(0.0)  # of P2 of the swing, from that middle
    stance_mid_x: float = checks.setting(0.0)  # of P2 of the stance, from that middle
    # P1 − P0 of the swing, forward; the foot's speed at lift-off is 4/duration of it
    lift_x: float = checks.setting(0.0)
    lift_z: float = checks.setting(0.0)  # P1 − P0 of the swing, upward
    land_x: float = checks.setting(0.0)  # P4 − P3 of the swing, forward
    land_z: float = checks.setting(0.0)  # P4 − P3 of the swing, upward
    load_x: float = checks.setting(0.0)  # P1 − P0 of the stance, forward
    load_z: float = checks.setting(0.0)  # P1 − P0 of the stance, upward
    push_x: float = checks.setting(0.0)  # P4 − P3 of the stance, forward
    push_z: float = checks.setting(0.0)  # P4 − P3 of the stance, upward
    step_duration: float = positive(0.75)  # T, one step, s
    # δ, share of T in which both feet are planned on the ground (see
    # :mod:`harpy_pin.gaits.straight`)
    double_support: float = checks.setting(0.0, low=0.0, high=0.9)
    speed: float = checks.setting(0.3)  # desired, m/s
    height: float = positive(0.6)  # desired, m
    start_vx: float = checks.setting(0.2)  # forward velocity of the body at t = 0, m/s
    start_vz: float = checks.setting(0.1)  # upward velocity of the body at t = 0, m/s
    start_pitch: float = checks.setting(0.0)  # rad
    start_pitch_rate: float = checks.setting(0.0)  # rad/s

    @classmethod
    @checked
    def from_dict(cls, numbers: dict[str, Any]) -> PlanarGait:
        """A gait from numbers by name; those not given keep their defaults.

        Args:
            numbers: values by the names of the attributes.

        Raises:
            InputError: an unknown name, or a bad number.
        """
        known = tuple(entry.name for entry in fields(cls))
        for name in numbers:
            if name not in known:
                raise InputError.unknown("number of the planar gait", name, known)
        return cls(**numbers)

    @classmethod
    @checked
    def from_walk(cls, walk: GaitParameters) -> PlanarGait:
        """The hand-made walk in the plane: feet that stand still on the ground and land with the
        ground's speed.

        Args:
            walk: its sideways numbers are left out, and the bend of the swing.
        """
        front = 0.5 * walk.speed * walk.step_duration * (1.0 + walk.double_support)
        glide = 0.25 * walk.speed * walk.step_duration * (1.0 - walk.double_support)
        return cls(
            half_step=front,
            end_height=walk.height,
            swing_mid_height=walk.height - walk.clearance * 8.0 / 3.0,
            stance_mid_height=walk.height + walk.penetration_offset,
            lift_x=-glide,
            land_x=-glide,
            load_x=-0.5 * front,
            push_x=-0.5 * front,
            load_z=-walk.penetration_offset,
            push_z=walk.penetration_offset,
            step_duration=walk.step_duration,
            double_support=walk.double_support,
            speed=walk.speed,
            height=walk.height,
            start_vx=walk.speed,
            start_vz=0.0,
        )

    def as_dict(self) -> dict[str, float]:
        """Numbers by name."""
        return asdict(self)

    @property
    def curves(self) -> Vector:
        """(2, 5, 2) control points (x, z) of stance and swing, body axes, m."""
        front, back = self.offset + self.half_step, self.offset - self.half_step
        points = np.zeros((2, 5, 2))
        points[0, :, 0] = (
            front,
            front + self.load_x,
            self.offset + self.stance_mid_x,
            back - self.push_x,
            back,
        )
        points[1, :, 0] = (
            back,
            back + self.lift_x,
            self.offset + self.swing_mid_x,
            front - self.land_x,
            front,
        )
        points[:, :, 1] = -self.end_height
        points[0, 1:4, 1] = (
            self.load_z - self.end_height,
            -self.stance_mid_height,
            -self.end_height - self.push_z,
        )
        points[1, 1:4, 1] = (
            self.lift_z - self.end_height,
            -self.swing_mid_height,
            -self.end_height - self.land_z,
        )
        return points

    @property
    def record(self) -> Records[PlanarGaitRecord]:
        """The numbers and curves, for kernels."""
        return make_record(PlanarGaitRecord, **self.as_dict(), curves=self.curves)


class PlanarGaitRecord(RecordOf, PlanarGait):
    """The numbers of :class:`PlanarGait`, and its curves, (2, 5, 2) as :attr:`PlanarGait.curves`
    gives them.
    """

    curves: Vector


@kernel(position=(2, 2), velocity=(2, 2), stance=(2, 2))
def planar_targets(
    t: float, gait: PlanarGaitRecord, position: Vector, velocity: Vector, stance: Vector
) -> None:
    """Foot targets at time t ≥ 0. In even steps the left foot is in stance.

    Args:
        t: time, s.
        gait: element of a record with the fields of :attr:`PlanarGait.record`.
        position: (2, 2) out: left and right foot (x, z) in body axes, m.
        velocity: (2, 2) out, m/s.
        stance: (2, 2) out: 1 where the foot is planned on the ground, else 0; share of its stance
            or swing done.
    """
    duration, double = gait.step_duration, gait.double_support
    index = int(np.floor(t / duration + 1e-9))
    s = max(t / duration - index, 0.0)
    for k in range(2):
        if k == index % 2:
            on_ground, fraction = True, s / (1.0 + double)
        elif s < double:
            on_ground, fraction = True, (1.0 + s) / (1.0 + double)
        else:
            on_ground, fraction = False, (s - double) / (1.0 - double)
        span = duration * (1.0 + double) if on_ground else duration * (1.0 - double)
        points = gait.curves[0] if on_ground else gait.curves[1]
        r, f = 1.0 - fraction, fraction
        weights = np.array([r * r * r, 3.0 * r * r * f, 3.0 * r * f * f, f * f * f])
        left, right = weights @ points[:4], weights @ points[1:]
        position[k] = r * left + f * right
        velocity[k] = 4.0 * (right - left) / span
        stance[k, 0] = 1.0 if on_ground else 0.0
        stance[k, 1] = fraction


DATA = Path(__file__).parent
PACKAGED_GAIT = DATA / "planar_gait.toml"
"""The gait that walks best in the plane, with a planned double support; friction 0.25."""
SPACE_GAIT = DATA / "space_gait.toml"
"""The same, refined for the walk in space under the paper's governor, friction 0.25."""
PAPER_CURVES_GAIT = DATA / "paper_curves_gait.toml"
"""A gait with the paper's curves, P1 = P0 and P3 = P4 and no double support; friction 0.8."""
FORMAT = 1


@dataclass(frozen=True)
class OptimisedGait:
    """A found gait and where it came from."""

    gait: PlanarGait  # the walk
    # how it was found, plain values: command, search, seed, evaluations, cost, ending, versions, ..
    record: dict[str, Any] = field(default_factory=dict)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the text file; one of that name is replaced only once the new one is whole.

        Args:
            path: of the TOML file.

        Raises:
            RunFileError: the file cannot be written.
        """
        lines = [f"format = {FORMAT}", "", "[gait]"]
        lines += [f"{name} = {value!r}" for name, value in self.gait.as_dict().items()]
        lines += [
            "",
            "[record]",
            *(f"{name} = {_toml(value)}" for name, value in self.record.items()),
        ]
        with replacing(path) as file:
            file.write(("\n".join(lines) + "\n").encode())


@checked
def load_gait(path: str | Path | None = None) -> OptimisedGait:
    """Read a found gait; the packaged one by default.

    Args:
        path: of a file that :meth:`OptimisedGait.save` has written; the packaged gait by default.

    Raises:
        RunFileError: the file is missing, not TOML, or holds no planar gait; the message says which
            number is bad.
    """
    source = PACKAGED_GAIT if path is None else Path(path)
    try:
        content = tomllib.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFileError(
            f"cannot read the gait '{source}': {error.strerror or error}", path=source
        ) from error
    except (
        ValueError,
        RecursionError,
    ) as error:  # of TOML, of its encoding, of numbers and lists beyond measure
        raise RunFileError(f"'{source}' is not a TOML file: {error}", path=source) from error
    numbers, record = content.get("gait"), content.get("record", {})
    if (
        content.get("format") != FORMAT
        or not isinstance(numbers, dict)
        or not isinstance(record, dict)
    ):
        raise RunFileError(
            f"'{source}' is no gait of format {FORMAT}: it needs 'format' and [gait]", path=source
        )
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RunFileError(
                f"'{source}': {name} must be a number, got {ascii(value)[:60]}", path=source
            )
    try:
        gait = PlanarGait.from_dict(numbers)
    except HarpyError as error:
        raise RunFileError(f"'{source}': {error}", path=source) from error
    return OptimisedGait(gait, record)


def _toml(value: object) -> str:
    """One value as TOML: a boolean, a number, text, or a list of them."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    text = str(value).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text) + '"'
