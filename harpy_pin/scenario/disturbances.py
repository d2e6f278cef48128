"""What disturbs a walk: pushes, noise, delay, a wrong mass, other motors, a start that is not the
gait's.
"""

from dataclasses import asdict, dataclass, field
from typing import Any

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.scenario.parts import plain
from harpy_pin.simulation.actuators import Actuators
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.sensors import Noise

MAX_MASS_ERROR = 100.0  # as a share: far beyond any robot, and far from numbers that overflow


@dataclass(frozen=True, kw_only=True)
class Disturbances(checks.Checked):
    """What disturbs a walk; nothing by default.

    Attributes:
        pushes: forces on the body.
        noise: of the controller's measurements; in a mapping a number is a multiple of typical
            noise.
        delay: age of the controller's measurements, s, a multiple of the control period (see
            :class:`harpy_pin.simulation.sensors.Sensors`).
        mass_error: share by which the robot's body is heavier than the controller believes, above
            −1.
        actuators: slow or weak motors and joint friction, of which the controller knows nothing.
        start_velocity: (6,) what the body has too much at the start: linear, m/s, and angular
            velocity, rad/s, body axes (upright and facing x, so that they agree with the world's).
        seed: of the noise.
        normal_error: angle by which the normals of the ground that the controller knows are wrong,
            about y, rad. It takes effect on ground that is not flat.

    Raises:
        InputError: a value out of its domain.
    """

    pushes: tuple[Push, ...] = ()
    noise: Noise = field(default_factory=Noise)
    delay: float = checks.setting(0.0, low=0.0)
    mass_error: float = checks.setting(0.0, low=-1.0, high=MAX_MASS_ERROR, strict=True)
    actuators: Actuators = checks.setting(Actuators(), checks.record, kind=Actuators)
    start_velocity: tuple[float, ...] = checks.setting(
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), checks.fixed_vector, size=6
    )
    seed: int = checks.setting(0, checks.whole)
    normal_error: float = checks.setting(0.0, low=-1.0, high=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.pushes, list | tuple):
            raise InputError(
                f"pushes must be a list, got {shown(self.pushes)}", name="pushes", value=self.pushes
            )
        noise: Any = self.noise
        multiple = isinstance(noise, int | float) and not isinstance(noise, bool)
        checks.keep(
            self,
            pushes=tuple(checks.record("push", push, Push) for push in self.pushes),
            noise=Noise.typical(noise) if multiple else checks.record("noise", noise, Noise),
        )

    def to_dict(self) -> dict[str, Any]:
        """Names and values, ready for JSON and exact."""
        values: dict[str, Any] = plain(asdict(self))
        return values
