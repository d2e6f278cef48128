"""Every kernel of the library is reached by what is built here, and all of their C is clean in both precisions."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.compiled import BACKEND, Kernel, compiler
from harpy_pin.compiled.entry import entry_code, entry_unit
from harpy_pin.compiled.kernels import wait_for_all
from harpy_pin.control import ExplicitController, WholeBodyController, make_parameters
from harpy_pin.gait import PlanarGait, PlanarWalk
from harpy_pin.gym.worlds import ACTIONS, Worlds
from harpy_pin.model.catalogue import installed_data
from harpy_pin.paper.vlip_simulation import simulate_vlip, vlip_governor, vlip_setting
from harpy_pin.scenario import Scenario, build

pytestmark = pytest.mark.skipif(BACKEND != "c", reason="looks at C")
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror", "-Wno-unused-function")
ELSEWHERE = {"harpy_pin.export.steps"}
"""Modules whose kernels tests/test_export.py compiles, with the same warnings."""
COMMAND = ((0.0, 0.3, 0.0, 0.0), (0.005, 0.1, 0.05, 0.4))


def all_kernels():
    found = {}
    for module in pkgutil.walk_packages(hp.__path__, "harpy_pin."):
        if not module.name.endswith("__main__") and module.name not in ELSEWHERE:
            known = importlib.import_module(module.name)
            found |= {id(v): v for v in vars(known).values() if isinstance(v, Kernel) and v.__module__ == module.name}
    return list(found.values())


def use_everything():
    """Walks and calls that need every kernel."""
    scenarios = [
        *(Scenario(controller=c, parameters=p) for c in ("explicit", "wbc") for p in ({}, {"govern_command": True})),
        *(Scenario(controller="wbc", parameters={"formulation": f}) for f in ("full", "force")),
        Scenario(controller="explicit", parameters={"limits": {"cone": "disc"}, "estimate_friction": True}),
        Scenario(controller="explicit", gait="commanded", command=COMMAND, parameters={"govern_command": True}),
        Scenario(controller="explicit", gait="commanded", command=COMMAND),
        Scenario(controller="explicit", speed=0.0),
        *(Scenario(governor=g) for g in ("none", "paper", "cone", "contact")),
        Scenario(governor="contact", parameters={"legs": "feedforward", "estimate_friction": True}),
        Scenario(controller="explicit", plant="mujoco"),
    ]
    for scenario in scenarios:
        build(
            Scenario.from_dict({**scenario.to_dict(), "duration": 0.55 if scenario.plant != "mujoco" else 0.01})
        ).run()
    robot = hp.load_harpy()
    q, v = hp.make_gait(robot).initial_state()
    force, torque, thrust = np.full((1, 2, 3), 10.0), np.zeros((1, 6)), np.zeros((1, 2, 3))
    hp.CondensedBatch(robot, 1).step(q[None], v[None], force)
    hp.ShieldBatch(robot, 1, mu=0.3)(q[None], v[None], force, torque, thrust)
    worlds = Worlds(1)
    worlds.step(np.zeros((1, ACTIONS)), np.zeros(1, dtype=bool))
    PlanarWalk(robot, PlanarGait()).run(0.01)
    for name in ("none", "paper", "cone", "margin"):
        setting = replace(vlip_setting(name), duration=0.01)
        simulate_vlip(vlip_governor(setting, name=name), setting)
    if installed_data() is not None:
        for name in ("g1", "bolt", "iris"):
            stand(hp.load_robot(name))
    wait_for_all()


def stand(robot):
    """A few ticks of a robot on flat feet, on two points, or in the air."""
    gait = hp.Hovering(robot) if not robot.feet else hp.Stepping(robot) if robot.name == "bolt" else hp.Standing(robot)
    simulator = hp.Simulator(robot)
    for name in ("explicit", "wbc"):
        parameters = make_parameters(name, mu=0.5, changes=getattr(gait, "parameters", None))
        controller = (ExplicitController if name == "explicit" else WholeBodyController)(gait, parameters)
        simulator.reset(*gait.initial_state(sink=simulator.static_sink))
        simulator.run(controller, 0.01)


def test_c_is_without_warnings(tmp_path):
    """As a stranger's compiler sees it; the bridge, too."""
    use_everything()
    seen = 0
    for kernel in all_kernels():
        for types in list(kernel._versions):
            name = f"{kernel.__module__}.{kernel.__name__}"
            (tmp_path / "double.c").write_text(entry_code(kernel, types))
            unit, _ = entry_unit(kernel, types, single=True)
            (tmp_path / "float.c").write_text("\n".join([unit.header(), unit.types(), unit.code()]))
            command = [*compiler.compiler(), "-std=c99", *WARNINGS, "-fsyntax-only", "-O1"]
            for file in ("double.c", "float.c"):
                if file == "float.c" and "float *" in (tmp_path / "double.c").read_text():
                    continue  # arrays of float32 are for doubles
                done = subprocess.run([*command, str(tmp_path / file)], capture_output=True, text=True)
                assert done.returncode == 0, f"{name}, {file}\n{done.stderr[:2000]}"
            seen += 1
    assert seen > 30
    bridge = compiler.Path(compiler.__file__).with_name("bridge.c")
    done = subprocess.run([*command, "-Wno-double-promotion", str(bridge)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_kernel_is_in_the_language():
    """Reached from a kernel that was called, or translated by itself for the arguments that its tests give it."""
    use_everything()
    reached = set()
    kernels = all_kernels()
    for kernel in kernels:
        for types in list(kernel._versions):
            unit, _ = entry_unit(kernel, types)
            reached |= {function for function, _ in unit.functions}
    missing = {f"{k.__module__}.{k.__name__}" for k in kernels if k.py_func not in reached}
    known = {f"harpy_pin.{name}" for name in OWN_TESTS}
    assert known <= {f"{k.__module__}.{k.__name__}" for k in kernels}
    assert missing <= known, sorted(missing - known)


OWN_TESTS = {
    *("explicit.law._law", "gait.staying._offset_at", "gait.staying._plan", "governor.reduced.cone._cone_batch"),
    *("governor.reduced.erg._force_batch", "governor.reduced.feedback.acceleration"),
    *("governor.reduced.margin._margin_batch", "governor.reduced.projection._project_all"),
    *("governor.reduced.rows._evaluate_angle_row", "governor.reduced.rows.angle_row", "model.contact_map._evaluate"),
    *("model.dynamics._read_thrusts", "model.kinematics.leg_forward", "plant.ground._creeping_friction"),
    *("plant.ground.normal_force", "wbc.force._build", "wbc.force._inputs", "wbc.force._recover"),
}
"""Kernels that no walk needs: tests of the objects that call them compile them."""
