"""Recorded ticks: what a controller was given along a simulated motion, and what its exported form
answers.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.estimation.imu import Imu
from harpy_pin.export.code import Code
from harpy_pin.export.exported_controllers import MEASURED, Exportable
from harpy_pin.gaits.gait import Gait
from harpy_pin.gaits.standing import Hovering, Standing
from harpy_pin.gaits.walking import WalkingGait
from harpy_pin.ground.ground import Ground
from harpy_pin.kernels.compiler import EXACT, SHARED, compiler, run_compiler, work_folder
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Command, State
from harpy_pin.scenario import Disturbances, Governed, Scenario, Walk, build
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.sensing import EstimatedState, Sensing

CONTROLLERS = ("condensed", "wbc", "paper", "filter")
"""Names for export: the condensed controller, the whole-body QP by this library's own search, the
paper's governor, and the contact-force filter.
"""
ESTIMATOR = "estimator"  # the state estimator's name
WALK = "walk"  # a walking gait and the condensed controller
WALK_SPEED = 0.5
"""At which it walks, as a share of the largest."""
SINK = 1e-3  # how deep feet sink in where a robot stands, m: it makes the ground's stiffness
SHIFT = (0.02, 0.01, 0.0)
"""How far a robot that stays in one place moves its body back and forth, m."""
SINGLE_FORCE = 100.0
"""Factor on the weight on contact forces in single precision. Forces that feet exert against each
other move nothing, so that this weight alone decides them; beside the others it would be below the
rounding.
"""


@dataclass(frozen=True)
class Recording:
    """Inputs of ticks, a row for each."""

    target: NDArray[np.float64]  # (ticks, ·) the gait's targets, in the order of their record
    # of each thing that is measured (ticks, ·), by its name
    inputs: dict[str, NDArray[np.float64]]

    def __len__(self) -> int:
        return len(self.target)


def ready(
    robot: Robot,
    controller: str,
    *,
    duration: float,
    friction: float = 0.5,
    pushes: Sequence[Push] = (),
    single: bool = False,
) -> Walk:
    """A motion that fits a robot, with a controller: Harpy walks, others stand, step in place or
    hover.

    The controller, one of :data:`CONTROLLERS`, :data:`WALK`, or :data:`ESTIMATOR`, for which the
    condensed controller walks, knows the friction. In ``single`` precision its weight on contact
    forces of a robot that stands is larger (:data:`SINGLE_FORCE`). One that is unknown, or does not
    take the robot, is an :class:`InputError`. The duration is in s.
    """
    if controller not in (*CONTROLLERS, ESTIMATOR, WALK):
        raise InputError.unknown("controller", controller, (*CONTROLLERS, ESTIMATOR, WALK))
    if controller == WALK:
        walk = WalkingGait(robot)
        walk.command[0] = WALK_SPEED * walk.max_speed
        given: dict[str, Any] = {
            "disturbances": Disturbances(pushes=tuple(pushes)),
            "duration": duration,
        }
        given |= (
            {"controller": {"name": "condensed", "parameters": _single_weights(walk)}}
            if single
            else {}
        )
        return build(Scenario(ground=Ground(mu_s=friction), **given), gait=walk)
    sensors = Imu() if controller == ESTIMATOR else None
    controller = "condensed" if controller == ESTIMATOR else controller
    whole_body = controller in ("condensed", "wbc")
    if not whole_body and robot.name != "harpy":
        raise InputError(
            f"'{controller}' is for Harpy's legs and thrusters, not for '{robot.name}'",
            name="controller",
        )
    parameters: dict[str, Any] = {"solver": "active_set"} if controller == "wbc" else {}
    part: Governed | dict[str, Any]
    part = (
        {"name": controller, "parameters": parameters}
        if whole_body
        else Governed(governor=controller)
    )
    how: dict[str, Any] = {
        "disturbances": Disturbances(pushes=tuple(pushes)),
        "duration": duration,
        "sensors": sensors,
    }
    if robot.name == "harpy":
        return build(Scenario(controller=part, ground=Ground(mu_s=friction), **how))
    gait: Gait
    if not robot.feet:
        gait = Hovering(robot, shift=[10.0 * x for x in SHIFT])
        return build(Scenario(controller=part, **how), gait=gait)
    on_points = robot.corners == (1, 1)
    stays = (
        WalkingGait(robot, "step", (0.0, 0.0, 0.0)) if on_points else Standing(robot, shift=SHIFT)
    )
    gait = stays
    ground = Ground(mu_s=friction, stiffness=robot.mass * GRAVITY / (len(robot.feet) * SINK))
    if whole_body and single:
        parameters |= _single_weights(stays)
    return build(Scenario(controller=part, ground=ground, **how), gait=gait)


def _single_weights(gait: Standing | WalkingGait) -> dict[str, Any]:
    """Parameters of a controller in single precision that differ."""
    return {"weights": {"force": SINGLE_FORCE * gait.controller_parameters["weights"]["force"]}}


@dataclass
class _Watch:
    """A controller whose inputs are kept, or beside one on the true state what a robot's sensors
    say.
    """

    inner: GaitController
    what: Exportable
    sensing: Sensing | None = None
    target: list[NDArray[np.float64]] = field(default_factory=list)
    inputs: list[list[NDArray[np.float64]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.period, self._last = self.inner.period, 0.0
        if self.sensing is not None:
            self._given = Command(
                *(np.zeros(self.what.inputs[name]) for name in ("joint_torque", "thrust"))
            )

    def step(self, state: State) -> Command:
        """A tick; sensors belong to the target and the command of the last one."""
        if self.sensing is None:
            command = self.inner.step(state)
            self._keep(
                [*(getattr(state, name) for name in MEASURED), np.full(1, state.t - self._last)]
            )
            self._last = state.t
            return command
        s, given = self.sensing.read(state, self._given.torque, self._given.thrust), self._given
        elapsed, force = np.full(1, self.period), np.full(len(state.foot_force), np.nan)
        unit, joints = (
            (s.gyroscope, s.accelerometer),
            (s.joint_position, s.joint_velocity, s.joint_torque),
        )
        motion = np.nan if self.inner.acceleration is None else self.inner.acceleration
        intended = np.full(self.what.inputs["acceleration"], motion)
        self._keep([elapsed, *unit, *joints, force, given.thrust, intended])
        command = self.inner.step(state)
        self._given = Command(command.torque.copy(), command.thrust.copy())
        return command

    def _keep(self, inputs: list[NDArray[np.float64]]) -> None:
        target: Any = self.inner.target._record_
        if isinstance(self.inner.gait, WalkingGait) and self.what.kind == WALK:
            parts = [self.inner.gait.command]
        else:
            parts = [target[name][0] for name in _names(self.what)]
        self.target.append(np.concatenate([np.ravel(part) for part in parts]))
        self.inputs.append([np.ravel(part).copy() for part in inputs])


def record(motion: Walk, what: Exportable) -> Recording:
    """The inputs of every tick of a motion with one of the library's controllers, up to its end."""
    assert isinstance(motion.controller, GaitController)
    sensing = motion.sensors.sensing if isinstance(motion.sensors, EstimatedState) else None
    names = (*MEASURED, "elapsed") if sensing is None else tuple(what.inputs)
    watch = _Watch(motion.controller, what, sensing)
    motion.simulator.run(
        watch, motion.scenario.duration, pushes=motion.scenario.disturbances.pushes
    )
    columns = {name: np.array([row[n] for row in watch.inputs]) for n, name in enumerate(names)}
    return Recording(np.array(watch.target), columns)


def answers(
    what: Exportable, code: Code, given: Recording
) -> tuple[NDArray[Any], NDArray[np.int32]]:
    """(ticks, ·) torques and thrusts, and (ticks,) the status, from the first state on.

    In double precision those of the library's kernels; in single precision those of the exported C
    on this machine, for which a :class:`HarpyError` asks for a compiler.
    """
    return _from_kernels(what, given) if code.real == "double" else _from_c(what, code, given)


def _from_kernels(what: Exportable, given: Recording) -> tuple[NDArray[Any], NDArray[np.int32]]:
    state, target = what.record.copy(), what.target
    commands, statuses = [], []
    for n in range(len(given)):
        begin = 0
        for name in _names(what):
            size = target[name][0].size
            target[name][0].ravel()[:] = given.target[n, begin : begin + size]
            begin += size
        inputs = [given.inputs[name][n].reshape(shape) for name, shape in what.inputs.items()]
        statuses.append(what.step(state, target, *inputs))
        commands.append(what.outcome(state))
    return np.array(commands), np.array(statuses, dtype=np.int32)


def _from_c(
    what: Exportable, code: Code, given: Recording
) -> tuple[NDArray[Any], NDArray[np.int32]]:
    kind = np.float32 if code.real == "float" else np.float64
    with work_folder() as folder:
        lib = ctypes.CDLL(str(_library(code, Path(folder))))
    state = ctypes.create_string_buffer(code.ram)
    getattr(lib, f"{code.name}_init")(state)
    sizes = [int(np.prod(shape)) for shape in what.outputs.values()]
    outputs = [np.zeros(size, dtype=kind) for size in sizes]
    function, commands, statuses = getattr(lib, f"{code.name}_step"), [], []
    for n in range(len(given)):
        arrays = [given.target[n], *(given.inputs[name][n] for name in what.inputs)]
        inputs = [np.ascontiguousarray(array, dtype=kind) for array in arrays]
        pointers = [
            ctypes.c_void_p(array.ctypes.data) for array in (*inputs, *outputs) if array.size
        ]
        statuses.append(function(state, *pointers))
        commands.append(np.concatenate(outputs))
    return np.array(commands), np.array(statuses, dtype=np.int32)


def _library(code: Code, folder: Path) -> Path:
    """The exported C as a shared library."""
    if compiler() is None:
        raise HarpyError(
            "the recorded answers in single precision are those of the C itself: install a C "
            "compiler"
        )
    for name, text in ((f"{code.name}.h", code.header), (f"{code.name}.c", code.source)):
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / "controller.so"
    source = str(folder / f"{code.name}.c")
    run_compiler([*EXACT, "-O2", *SHARED, source, "-o", str(library), "-lm"], temporary=str(folder))
    return library


def _names(what: Exportable) -> tuple[str, ...]:
    return what.target.dtype.names or ()
