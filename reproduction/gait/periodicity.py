"""Periodicity and stability of a planar walk: the Poincaré map of one step at a fixed phase of its
clock.

The walk is driven by a clock, so the section is a moment of the step, not an event. The state at
the section is (z, pitch, four joint angles, seven velocities, four integrals of the joint PID): all
that the next step depends on, x left out. After one step the legs change names, so that a walk of
equal steps is a fixed point of the map.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from reproduction.gait.planar_gait import PlanarGait
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.planar_walk import PlanarJoints, PlanarWalk

SWAP = np.array([0, 1, 4, 5, 2, 3, 6, 7, 8, 11, 12, 9, 10, 15, 16, 13, 14])
"""Order of the section's entries with left and right exchanged."""
SCALE = np.array([1.0] * 6 + [10.0] * 7 + [50.0] * 4)
"""Sizes of the entries, m, rad, m/s, rad/s, N·m, in units of the difference step."""
PHASE = 0.5
"""Of the section, as a share of the step: mid-step is far from both touchdown and lift-off."""
DIFFERENCES = (1e-6, 3e-6, 1e-5, 3e-5)
"""Steps of the central differences: the spread of the spectral radius over them is its error
estimate.
"""


class StepMap:
    """State at a phase of one step → state at the same phase of the next, legs exchanged.

    Args:
        robot: Harpy on its free flyer, or its planar model.
        gait: the walk.
        ground: contact parameters.
        joints: PID gains; with ``k_i`` zero the controller has no memory and the integrals stay as
            they are.

    Raises:
        InputError: the step is no whole number of ticks.
    """

    def __init__(
        self,
        robot: Robot | PlanarModel,
        gait: PlanarGait,
        *,
        ground: Ground | None = None,
        joints: PlanarJoints | None = None,
    ) -> None:
        self.walk = PlanarWalk(robot, gait, ground=ground, joints=joints)
        ticks = gait.step_duration / self.walk.period
        if abs(ticks - round(ticks)) > 1e-6:
            raise InputError(
                "the step must last a whole number of ticks", name="gait", value=gait.step_duration
            )
        self.start = round(PHASE * ticks) * self.walk.period
        self.memory = any(self.walk.joints.k_i)
        self.size = 17 if self.memory else 13

    def settle(self, steps: int) -> Vector:
        """State at the section after a number of steps from the gait's own start.

        Raises:
            InputError: the walk falls before.
        """
        walk = self.walk
        walk.reset(*walk.initial_state())
        summary = walk.run(self.start + steps * walk.gait.step_duration)
        if summary.fell:
            raise InputError(f"the walk falls after {summary.steps:.1f} steps", name="gait")
        section = self._read()
        return section if steps % 2 == 0 else self._swapped(section)

    def __call__(self, section: Vector) -> Vector:
        """State one step later.

        Args:
            section: (17,) or, without memory, (13,) state.

        Returns:
            The state, NaN where the walk falls.
        """
        walk, n = self.walk, self.size
        s = checks.vector("section", section, n)
        q = np.concatenate(([0.0], s[:6]))
        walk.reset(q, s[6:13], integral=s[13:] if self.memory else None, t=self.start)
        summary = walk.run(walk.gait.step_duration)
        return np.full(n, np.nan) if summary.fell else self._swapped(self._read())

    def jacobian(self, section: Vector, step: float = 1e-5) -> Vector:
        """(n, n) derivative of the map by central differences of ``step`` times :data:`SCALE`, in
        units of it.

        Its eigenvalues have no units.

        Raises:
            InputError: a shifted state falls within the step.
        """
        n = self.size
        matrix = np.zeros((n, n))
        for i in range(n):
            shift = np.zeros(n)
            shift[i] = step * SCALE[i]
            matrix[:, i] = (self(section + shift) - self(section - shift)) / (
                2.0 * step * SCALE[:n]
            )
        if not np.all(np.isfinite(matrix)):
            raise InputError(f"a state shifted by {step:g} falls within one step", name="section")
        return matrix

    def _read(self) -> Vector:
        walk = self.walk
        return np.concatenate((walk.q[1:], walk.v, walk.integral))[: self.size]

    def _swapped(self, section: Vector) -> Vector:
        return np.asarray(section[SWAP[: self.size]])


@dataclass(frozen=True)
class Periodicity:
    """How periodic and how stable a walk is."""

    section: Vector  # (n,) fixed point of the step map (see :class:`StepMap`)
    residual: float  # largest entry of map(section) − section, in units of :data:`SCALE`
    spectral_radius: float  # median over the difference steps; below 1 the walk is locally stable
    spread: tuple[float, float]  # (2,) least and largest over the difference steps
    # (n,) at the difference step whose radius is the median, by magnitude
    eigenvalues: NDArray[np.complex128]
    # change of the section over the last step of the walk that led to it, in units of :data:`SCALE`
    settled: float
    memory: bool  # whether the state holds the integrals of the PID

    @property
    def stable(self) -> bool:
        """Whether the radius is below 1 at every difference step."""
        return self.spread[1] < 1.0


def analyse_periodicity(
    robot: Robot | PlanarModel,
    gait: PlanarGait,
    *,
    ground: Ground | None = None,
    memory: bool = True,
    settle: int = 600,
    newton: int = 20,
) -> Periodicity:
    """Fixed point of the step map, by letting the walk settle and Newton's method, and its spectral
    radius.

    Args:
        robot: Harpy on its free flyer, or its planar model.
        gait: the walk.
        ground: contact parameters.
        memory: keep the integral parts; without them the controller is a function of time and state
            alone.
        settle: steps to walk first; the integrals of the PID need hundreds, the motion some ten.
        newton: most iterations.

    Raises:
        InputError: the walk falls before it settles, or a shifted state falls.
    """
    joints = PlanarJoints() if memory else PlanarJoints(k_i=(0.0, 0.0))
    step_map = StepMap(robot, gait, ground=ground, joints=joints)
    section = step_map.settle(settle)
    n = step_map.size
    scale = SCALE[:n]
    error = (step_map(section) - section) / scale
    settled = float(np.abs(error).max())
    for _ in range(newton):
        size = float(np.abs(error).max())
        if size < 1e-10:
            break
        matrix = step_map.jacobian(section, DIFFERENCES[len(DIFFERENCES) // 2])
        change = scale * np.linalg.lstsq(np.eye(n) - matrix, error, rcond=None)[0]
        for shrink in (1.0, 0.5, 0.25, 0.1, 0.03):
            candidate = section + shrink * change
            trial = (step_map(candidate) - candidate) / scale
            if np.all(np.isfinite(trial)) and np.abs(trial).max() < size:
                section, error = candidate, trial
                break
        else:
            break
    spectra = [np.linalg.eigvals(step_map.jacobian(section, h)) for h in DIFFERENCES]
    radii = np.array([np.abs(values).max() for values in spectra])
    middle = int(np.argsort(radii)[len(radii) // 2])
    values = spectra[middle]
    return Periodicity(
        section=section,
        residual=float(np.abs(error).max()),
        spectral_radius=float(np.median(radii)),
        spread=(float(radii.min()), float(radii.max())),
        eigenvalues=values[np.argsort(-np.abs(values))].astype(np.complex128),
        settled=settled,
        memory=step_map.memory,
    )
