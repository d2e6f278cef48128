"""A gait of flat ground, laid over ground that its feet feel."""

from __future__ import annotations

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.gaits.gait import Gait
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.ground.terrain import Plane
from harpy_pin.model.entry import as_state
from harpy_pin.model.state import GRAVITY, State, Vector

KEPT = 2
"""Places where it touched the ground that are kept of each foot."""
LOADED = 0.05
"""Normal force from which on a foot touches the ground, as a share of the weight."""
FAR_BEHIND = -1e9
"""Where the profile that lifts the plane begins, m."""


class OnFeltGround(OnTerrain):
    """A gait of flat ground, laid over the plane nearest to the places where its feet have touched
    the ground.

    The places are the last two of each foot, from the measured state. What they say nothing of
    stays as it was, and the estimate follows with a lag.

    Args:
        gait: of flat ground.
        lag: time constant of the estimate, s.
        spread: distance of the places that counts as much as the last estimate of the slope, m.

    Attributes:
        slope: (2,) estimated rise per metre along x and y.
    """

    @checked
    def __init__(self, gait: Gait, *, lag: float = 0.1, spread: float = 0.05) -> None:
        super().__init__(gait, Plane(slope=0.0))
        self._lag = checks.number("lag", lag, low=0.0)
        self._spread = checks.number("spread", spread, low=1e-3, high=10.0)
        self._record["terrain"]["level"] = 0
        self._record["terrain"]["pieces"] = 1
        self._record["terrain"]["profile"][0, 0] = (FAR_BEHIND, 0.0, 0.0)
        self.slope: Vector = np.zeros(2)
        self._forget()

    def _forget(self) -> None:
        feet = len(self.robot.feet)
        self._places: Vector = np.full((feet, KEPT, 3), np.nan)
        self._touched = np.zeros(feet, dtype=bool)
        self._time = -1.0
        self._height = 0.0
        self.slope[:] = 0.0
        self._write()

    def observe(self, state: State) -> None:
        """See :meth:`~harpy_pin.gaits.gait.Gait.observe`; takes up where feet touch the ground.

        Raises:
            InputError: it is no state of the robot.
        """
        state = as_state(state, self.robot)
        place, force = state.foot_position, state.foot_force
        if np.isfinite(place).all() and np.isfinite(force).all() and np.isfinite(state.t):
            if state.t < self._time:
                self._forget()
            self._feel(place, force, float(state.t))
        super().observe(state)

    def _feel(self, place: Vector, force: Vector, t: float) -> None:
        """Keep the places of feet that touch, and let the plane follow them."""
        touching = force[:, 2] > LOADED * self.robot.mass * GRAVITY
        landed = touching & ~self._touched
        self._places[landed, 1:] = self._places[landed, :-1]
        self._places[touching, 0] = place[touching]
        self._touched = touching
        known = self._places[np.isfinite(self._places).all(axis=2)]
        span, self._time = max(t - self._time, 0.0) if self._time >= 0.0 else 0.0, t
        if len(known) == 0:
            return
        middle = known.mean(axis=0)
        around = known - middle
        normal = around[:, :2].T @ around[:, :2] + self._spread**2 * np.eye(2)
        slope = np.linalg.solve(
            normal, around[:, :2].T @ around[:, 2] + self._spread**2 * self.slope
        )
        share = 1.0 - np.exp(-span / self._lag) if self._lag > 0.0 else 1.0
        self.slope += share * (slope - self.slope)
        self._height += share * (middle[2] - slope @ middle[:2] - self._height)
        self._write()

    def _write(self) -> None:
        """The plane for the kernels."""
        terrain = self._record["terrain"]
        terrain["slope"][0] = self.slope
        terrain["profile"][0, 0, 1] = self._height
        if isinstance(self.gait, WalkingGait):
            own = self.gait._record_["terrain"]
            for name in ("level", "pieces", "slope", "profile"):
                own[name] = terrain[name]
