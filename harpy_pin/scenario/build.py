"""A scenario becomes a walk.

A run remembers its scenario, so that it can be walked again from its file::

    run = walk(Scenario(controller="wbc", ground=Ground(mu_s=0.25), duration=3.0), save="walk.npz")
    again = walk(Scenario.of(Run.load("walk.npz")))

With the same versions on the same machine the two are equal bit for bit. Only with ProxQP (the
whole-body controller's default solver) the last digits may differ, as they depend on where its
memory lies; those of ``active_set`` do not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait
from harpy_pin.log.run import Run
from harpy_pin.model.loading import load_harpy
from harpy_pin.model.robot import heavier
from harpy_pin.model.source import loaded_robot
from harpy_pin.model.state import State
from harpy_pin.scenario.gait_parts import GaitPart, Stand
from harpy_pin.scenario.scenario import Scenario
from harpy_pin.simulation.loop import Controller
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.sensors import ESTIMATED, Sensors

if TYPE_CHECKING:
    from harpy_pin.simulation.sensing import EstimatedState


@dataclass(frozen=True, eq=False)
class Walk:
    """A scenario built and ready to be walked once.

    Attributes:
        scenario: what it was built from.
        gait: targets of body and feet; ``gait.robot`` is the robot whose mass and inertia the
            controller assumes.
        controller: that walks it.
        simulator: holds the true robot, in its start state.
        sensors: between them; none where the scenario has neither sensors nor noise nor delay.
        own: which of gait and controller are not the scenario's.
    """

    scenario: Scenario
    gait: Gait
    controller: Controller
    simulator: Plant
    sensors: Sensors | EstimatedState | None
    own: tuple[str, ...] = ()

    def run(
        self,
        *,
        on_tick: Callable[[State], None] | None = None,
        on_piece: Callable[[float], None] | None = None,
        metadata: Mapping[str, object] | None = None,
        save: str | Path | None = None,
    ) -> Run:
        """Walk; for arguments and errors see :func:`walk` and
        :meth:`harpy_pin.simulation.plant.Plant.run`.
        """
        own = {"own": list(self.own)} if self.own else {}
        more = {} if metadata is None else checks.mapping("metadata", metadata)
        return self.simulator.run(
            self.controller,
            self.scenario.duration,
            control_period=self.scenario.period,
            metadata={"scenario": self.scenario.to_dict(), **own, **more},
            on_tick=on_tick,
            on_piece=on_piece,
            pushes=self.scenario.disturbances.pushes,
            sensors=self.sensors,
            save=save,
        )


def build(
    scenario: Scenario,
    *,
    gait: Gait | None = None,
    controller: Callable[[Gait], Controller] | None = None,
) -> Walk:
    """Everything that a walk needs, ready to run: a profiler or a viewer may stand in between.

    Args:
        scenario: what to walk.
        gait: one's own, with its robot, instead of the scenario's gait, speed and URDF. It is laid
            over ground that is not flat, unless it has a ``terrain`` of its own: ``OnTerrain(gait,
            Plane(slope=0.0))`` walks blind.
        controller: makes one's own controller from the gait, instead of the scenario's.

    Raises:
        InputError: a value that this gait or robot does not have, another control period than the
            scenario's, or MuJoCo is asked for and not installed.
        RobotError: the URDF is missing, malformed, or lacks a foot or a thruster.
    """
    checks.instance("scenario", scenario, Scenario)
    if controller is not None and not callable(controller):
        maker = "a function or a class that makes the controller from the gait"
        example = "the class itself, or lambda gait: controller"
        raise InputError(
            f"controller must be {maker}, such as {example}; got {shown(controller)}",
            name="controller",
            value=controller,
        )
    checks.function("controller", controller, 1)
    own = tuple(
        name for name, given in (("gait", gait), ("controller", controller)) if given is not None
    )
    disturbances = scenario.disturbances
    if gait is None:
        robot = (
            load_harpy(scenario.urdf) if scenario.robot == "harpy" else loaded_robot(scenario.robot)
        )
        gait = scenario.gait.make(robot, scenario.felt_ground.stiffness)
        gait = _on_ground(gait, scenario.gait, scenario)
    else:
        robot = checks.instance("gait", gait, Gait).robot
        scenario = replace(scenario, ground=scenario.ground.fitted(robot, walks=gait.walks))
        gait = _on_ground(gait, Stand(), scenario) if gait.terrain is None else gait
    if scenario.robot != "harpy" and scenario.robot_name != gait.robot.name:
        raise InputError(
            f"the gait is of '{gait.robot.name}', the scenario of '{scenario.robot_name}'; a "
            f"gait of one's own "
            "brings its robot along: leave robot out of the scenario",
            name="gait",
            value=gait,
        )
    # The plant first: its kernels are compiled while the controller is made.
    heavy = heavier(gait.robot, disturbances.mass_error) if disturbances.mass_error else gait.robot
    simulator = scenario.plant.make(
        heavy, scenario.ground, dt=scenario.dt, actuators=disturbances.actuators
    )
    chosen: Controller
    if controller is not None:
        chosen = controller(gait)
    else:
        chosen = scenario.controller.make(gait, mu=scenario.mu, period=scenario.period)
    period = getattr(chosen, "period", scenario.period)
    if period != scenario.period:
        raise InputError(
            f"the controller's period {period:g} s is not the scenario's {scenario.period:g} s"
        )
    q, v = gait.initial_state(penetration=simulator.static_penetration)
    v[:6] += np.array(disturbances.start_velocity)
    simulator.reset(q, v)
    delay = checks.multiple("delay", disturbances.delay, "period", scenario.period, low=0)
    sensors: Sensors | EstimatedState | None = None
    if scenario.sensors is not None:
        from harpy_pin.simulation.sensing import estimated_state

        how: dict[str, Any] = {"feedback": scenario.state == ESTIMATED, "seed": disturbances.seed}
        how |= {"controller": chosen, "period": period}
        sensors = estimated_state(simulator, gait.robot, scenario.sensors, **how)
    elif disturbances.noise or delay > 0:
        sensors = Sensors(simulator.robot, disturbances.noise, delay=delay, seed=disturbances.seed)
    return Walk(scenario, gait, chosen, simulator, sensors, own)


def _on_ground(gait: Gait, part: GaitPart, scenario: Scenario) -> Gait:
    """The gait laid over the scenario's ground, where that is not flat."""
    surface, error = scenario.ground.surface, scenario.disturbances.normal_error
    if surface is None or surface.record["level"][0] or not gait.robot.feet:
        return gait
    return part.over(gait, surface, normal_error=error, friction=scenario.mu)


def walk(
    scenario: Scenario,
    *,
    gait: Gait | None = None,
    controller: Callable[[Gait], Controller] | None = None,
    on_tick: Callable[[State], None] | None = None,
    metadata: Mapping[str, object] | None = None,
    save: str | Path | None = None,
) -> Run:
    """Walk a scenario.

    Args:
        scenario: what to walk; saved as ``run.metadata["scenario"]``.
        gait: see :func:`build`.
        controller: see :func:`build`.
        on_tick: called with the true state at each tick, before the controller.
        metadata: more entries for the log's metadata.
        save: file of the log, on disk while the walk goes on; see
            :meth:`harpy_pin.simulation.plant.Plant.run`.

    Returns:
        The log; it ends early if the robot falls.

    Raises:
        InputError: see :func:`build`.
        RobotError: see :func:`build`.
        ControlError: the controller failed; ``error.run`` holds the log so far.
        RunFileError: the log cannot be written; ``error.run`` holds it if there is one.
        Interrupted: Ctrl-C; ``error.run`` holds the log so far.
    """
    return build(scenario, gait=gait, controller=controller).run(
        on_tick=on_tick, metadata=metadata, save=save
    )
