"""Electrical power of thrusters: by momentum theory that of a disk at rest goes with the thrust to
the power 3/2.

So one point of a thruster, its thrust and its electrical power, gives the others.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.state import Vector


@dataclass(frozen=True, kw_only=True)
class Propulsion(checks.Checked):
    """Electrical power of one thruster, by one point of it: at other thrusts it goes with the
    thrust to the power 3/2.

    Attributes:
        thrust: at that point, N.
        power: electrical, there, W.
        efficiency: of motor and controller: shaft power over electrical power.

    Raises:
        InputError: a value out of its domain.
    """

    thrust: float = field(metadata=checks.rule(low=0.0, strict=True))
    power: float = field(metadata=checks.rule(low=0.0, strict=True))
    efficiency: float = checks.setting(0.8, low=0.0, high=1.0, strict=True)

    @checked
    def electrical(self, thrusts: Vector) -> Vector:
        """Electrical power, W.

        Args:
            thrusts: (...) magnitudes, N.
        """
        found: Vector = self.power * (np.abs(thrusts) / self.thrust) ** 1.5
        return found


PRESETS = {
    "fan": Propulsion(thrust=18.0, power=1000.0),
    "propeller": Propulsion(thrust=6.2, power=111.0),
}
"""``fan``: an electric ducted fan of some 18 N from 1 kW, an order of magnitude without a paper.
``propeller``: one of the four of LEO (Kim et al., *A bipedal walking robot that can fly, slackline,
and skateboard*, Science Robotics 6, 2021), which take 445 W to carry 2.58 kg.
"""
