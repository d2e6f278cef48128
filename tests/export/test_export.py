"""Exported C: it compiles without a warning, says what the library says, and leaves no undefined
behaviour.
"""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from long import long_but
from needs import needs_compiler, needs_robots

import harpy_pin as hp
from comparison.cli.studies import STUDIES
from harpy_pin.export import export, write_folder
from harpy_pin.export.board import CHIPS, build, measure, missing_tools, run
from harpy_pin.export.code import controller_code
from harpy_pin.export.exported_controllers import exportable, exportable_walk
from harpy_pin.export.mathematics import PORTABLE
from harpy_pin.export.recording import _from_kernels, _library, answers, ready, record
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.kernels.compiler import EXACT, compiler, work_folder

WARNINGS = (
    *(
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wdouble-promotion",
        "-Werror",
        "-ffp-contract=off",
    ),
    # clang's, of loops over the bodies of a robot that has one
    "-Wno-tautological-overlap-compare",
)
SANITIZERS = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g")
TWO = ("atan2", "hypot")
INPUTS = ("gyroscope", "accelerometer", "joint_position", "joint_velocity", "joint_torque")
needs_board = pytest.mark.needs("arm-none-eabi-gcc", "qemu-system-arm")


@pytest.fixture(scope="module", autouse=True)
def libraries(tmp_path_factory):
    """The same C is compiled once."""
    made = {}

    def library(code, folder):
        if code not in made:
            made[code] = _library(code, tmp_path_factory.mktemp("library"))
        return made[code]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("harpy_pin.export.recording._library", library)
        yield


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Exported folders, each made once, without looking for boards."""
    made = {}

    def folder(robot, controller, precision):
        key = (robot, controller, precision)
        if key not in made:
            place = tmp_path_factory.mktemp("_".join(key))
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("harpy_pin.export.folder.missing_tools", lambda: "none desired")
                made[key] = export(robot, place, controller=controller, precision=precision)
        return made[key]

    return folder


def compile_and_run(done, *flags):
    name, place = done.code.name, done.folder
    sources = [str(place / file) for file in (f"{name}.c", "vectors.c", "check.c")]
    command = [*compiler(), *WARNINGS, *flags, *sources, "-o", str(place / "check"), "-lm"]
    subprocess.run(command, check=True)
    return subprocess.run([str(place / "check")], capture_output=True, text=True)


ALL = [*product(("condensed", "wbc", "paper", "filter", "estimator"), ("float", "double"))]
ALWAYS = [("condensed", "float"), ("paper", "double"), ("estimator", "float")]


@needs_compiler
@pytest.mark.parametrize(("controller", "precision"), long_but(ALL, ALWAYS))
def test_the_c_says_what_the_library_says(folders, controller, precision):
    """Without a warning; in double precision the recorded answers are those of the library's
    kernels.
    """
    done = compile_and_run(folders("harpy", controller, precision), "-O2")
    assert done.stdout == f"all equal: 200 ticks of harpy_{controller}, {precision}\n"
    assert done.returncode == 0


@pytest.mark.needs("sanitizers")
@pytest.mark.parametrize(("controller", "precision"), long_but(ALL, [("paper", "float")]))
def test_no_undefined_behaviour(folders, controller, precision):
    done = compile_and_run(folders("harpy", controller, precision), "-O1", *SANITIZERS)
    assert done.stderr == ""
    assert "all equal" in done.stdout


@needs_robots
@needs_compiler
@pytest.mark.long
@pytest.mark.parametrize("robot", ["solo12", "iris"])
def test_other_robots(folders, robot):
    assert compile_and_run(folders(robot, "condensed", "float"), "-O2").returncode == 0


@needs_compiler
def test_a_difference_is_found(folders, tmp_path):
    """The check fails where one command is another."""
    done = folders("harpy", "paper", "float")
    place = tmp_path / "changed"
    shutil.copytree(done.folder, place)
    source = place / f"{done.code.name}.c"
    text = source.read_text()
    assert text.count("state->governor.alpha_r = 10.0f;") == 1
    source.write_text(
        text.replace("state->governor.alpha_r = 10.0f;", "state->governor.alpha_r = 10.5f;")
    )
    changed = compile_and_run(type(done)(done.code, done.what, done.ticks, place), "-O1")
    assert changed.returncode == 1
    assert "ticks differ" in changed.stdout


@pytest.mark.parametrize("controller", ["condensed", "wbc", "paper", "filter"])
def test_a_tick_is_the_controllers(controller):
    """The record that is exported begins as the controller does, and has the command where the C
    looks for it.
    """
    motion = ready(hp.load_harpy(), controller, duration=0.05, friction=0.2)
    what = exportable(motion.controller)
    given = record(motion, what)
    commands, _ = answers(what, controller_code(what, "x", single=False), given)
    run = ready(hp.load_harpy(), controller, duration=0.05, friction=0.2).run()
    joints = run["torque"].shape[1]
    np.testing.assert_array_equal(commands[: len(run), :joints], run["torque"][: len(commands)])
    np.testing.assert_array_equal(
        commands[: len(run), joints:], run["thrust"][: len(commands)].reshape(-1, 6)
    )


@needs_compiler
@pytest.mark.parametrize("intended", [True, False])
def test_the_estimate_is_the_estimators(folders, intended):
    """In double precision every number is that of the class; in single precision it is as good as
    its sensors.

    Also through 100 ms without readings, by the motion that the controller intends or without one.
    """
    motion = ready(hp.load_harpy(), "estimator", duration=0.5)
    estimator, target = motion.sensors.estimator, GaitTarget()
    what = exportable(estimator)
    given = record(motion, what)
    assert np.ptp(given.inputs["acceleration"][1:], axis=0).min() > 0.0
    for name in INPUTS:
        given.inputs[name][300:400] = np.nan
    if not intended:
        given.inputs["acceleration"][:] = np.nan
    ours, ended = _from_kernels(what, given)
    assert ended[300] == what.statuses["NO_SAMPLE"]
    floats, _ = answers(what, folders("harpy", "estimator", "float").code, given)
    assert 0.0 < np.abs(floats - ours)[:, :13].max() < 1e-4
    estimator.reset()
    for n, row in enumerate(ours):
        begin = 0
        for name in target.record.dtype.names:
            place = target.record[name][0].ravel()
            place[:] = given.target[n, begin : begin + place.size]
            begin += place.size
        readings = hp.Readings(1e-3 * n, *(given.inputs[name][n] for name in INPUTS))
        readings.thrust = given.inputs["thrust"][n].reshape(2, 3)
        state = estimator.step(
            readings, target, given.inputs["acceleration"][n] if intended else None
        )
        np.testing.assert_array_equal(row[:25], np.concatenate([state.q, state.v]))


@needs_compiler
def test_an_estimate_in_single_precision_lasts(folders):
    """Forty seconds at rest, on both feet: as good as in double precision."""
    robot, ticks, rng = hp.load_harpy(), 40_000, np.random.default_rng(0)
    motion = ready(robot, "estimator", duration=0.01)
    what, imu = exportable(motion.sensors.estimator), motion.sensors.estimator.imu
    given, share = record(motion, what), 1.0 / np.sqrt(1e-3)
    inputs = {name: np.zeros((ticks, *rows.shape[1:])) for name, rows in given.inputs.items()}
    inputs["elapsed"][1:] = 1e-3
    inputs["gyroscope"] += imu.gyroscope_density * share * rng.standard_normal((ticks, 3))
    inputs["accelerometer"] += imu.accelerometer_density * share * rng.standard_normal(
        (ticks, 3)
    ) + (0.0, 0.0, 9.81)
    inputs["joint_position"] += given.inputs["joint_position"][
        0
    ] + imu.encoder_noise * rng.standard_normal((ticks, 6))
    inputs["normal_force"] += 0.5 * 9.81 * robot.mass
    still = replace(given, inputs=inputs, target=np.repeat(given.target[:1], ticks, axis=0))
    for precision in ("float", "double"):
        found, statuses = answers(what, folders("harpy", "estimator", precision).code, still)
        assert np.linalg.norm(found[ticks // 2 :, 13:16], axis=1).max() < 0.02
        assert not statuses[ticks // 2 :].any()


@needs_compiler
@pytest.mark.parametrize(
    ("controller", "single"),
    long_but([("condensed", False), ("wbc", False), ("condensed", True)], [("condensed", False)]),
)
def test_joint_targets_are_exported(controller, single, tmp_path):
    """Four more arrays; in double precision with the digits of the walk."""
    motors = {"joint_stiffness": 1.0, "joint_damping": 0.3}
    scenario = hp.Scenario(
        controller={"name": controller, **motors}, duration=0.1, ground=hp.Ground(mu_s=0.2)
    )
    motion, run = hp.build(scenario), hp.build(scenario).run()
    what = exportable(motion.controller)
    given = record(motion, what)
    done = write_folder(what, given, tmp_path, name="condensed", single=single, readme=False)
    assert (
        compile_and_run(done, "-O1").stdout
        == f"all equal: 100 ticks of condensed, {done.code.real}\n"
    )
    assert f"{done.code.real} thrust[6], {done.code.real} joint_position[6]" in done.code.header
    rows = [run[name].reshape(100, -1) for name in ("torque", "thrust", "motor_law")]
    if not single:
        np.testing.assert_array_equal(answers(what, done.code, given)[0], np.hstack(rows))


def condensed_on(robot, mu, **how):
    """A condensed controller with a walking gait that goes ahead."""
    gait = hp.WalkingGait(hp.load_robot(robot))
    gait.command[:3] = 0.5 * gait.max_speed, 0.0, 0.1
    return hp.make_controller("condensed", gait, mu=mu, **how)


@needs_robots
@needs_compiler
@pytest.mark.parametrize("joint_targets", [False, True])
def test_a_walk_is_the_gaits_and_the_controllers(joint_targets, tmp_path):
    """In double precision gait and controller together have the digits of the library's."""
    law = {"joint_stiffness": 20.0, "joint_damping": 0.5} if joint_targets else {}
    made = condensed_on("go2", 0.5, **law)
    scenario = hp.Scenario(ground=hp.Ground(mu_s=0.5), duration=0.5)
    motion = hp.build(scenario, gait=made.gait, controller=lambda gait: made)
    what = exportable_walk(made)
    given = record(motion, what)
    fresh = condensed_on("go2", 0.5, **law)
    run = hp.walk(scenario, gait=fresh.gait, controller=lambda gait: fresh)
    done = write_folder(what, given, tmp_path, name="go2_walk", single=False, readme=False)
    assert compile_and_run(done, "-O1").stdout == "all equal: 500 ticks of go2_walk, double\n"
    names = ("torque", "motor_law") if joint_targets else ("torque",)
    ours = np.hstack([run[name].reshape(len(run), -1) for name in names])
    np.testing.assert_array_equal(answers(what, done.code, given)[0], ours)
    assert run["stance"].min() == 0.0


class InC:
    """A walk in C, as a controller."""

    def __init__(self, controller, *, single):
        self.code, self.period, self.inner = (
            controller_code(exportable_walk(controller), "walk", single=single),
            1e-3,
            controller,
        )
        with work_folder() as folder:
            self.lib = ctypes.CDLL(str(_library(self.code, Path(folder))))
        self.state = ctypes.create_string_buffer(self.code.ram)
        self.lib.walk_init(self.state)
        self.torque = np.zeros(len(controller.robot.joints), np.float32 if single else np.float64)

    def step(self, state):
        arrays = (
            self.inner.gait.command,
            np.full(1, self.period),
            state.q,
            state.v,
            state.foot_force,
        )
        arrays = [np.ascontiguousarray(array, dtype=self.torque.dtype) for array in arrays]
        self.lib.walk_step(
            self.state, *(ctypes.c_void_p(array.ctypes.data) for array in (*arrays, self.torque))
        )
        return hp.Command(self.torque.astype(float), np.zeros((0, 3)))


@needs_robots
@needs_compiler
@pytest.mark.parametrize("robot", long_but(["go2", "bolt", "g1"], ["go2"]))
def test_a_walk_in_single_precision_walks(robot):
    made = condensed_on(robot, 0.6)
    inner = InC(made, single=True)
    duration = 4.0
    scenario = hp.Scenario(ground=hp.Ground(mu_s=0.6), duration=duration)
    run = hp.walk(scenario, gait=made.gait, controller=lambda gait: inner)
    assert run.ending == "completed"
    moved = np.linalg.norm(run["q"][-1, :2] - run["q"][0, :2])
    assert moved > 0.6 * duration * made.gait.command[0]


@needs_robots
def test_walks_that_are_not_exported_are_refused():
    harpy = hp.make_controller("condensed", hp.make_gait(hp.load_harpy()), mu=0.5)
    with pytest.raises(hp.InputError, match="with a WalkingGait, not with a"):
        exportable_walk(harpy)
    program = hp.make_controller("wbc", hp.WalkingGait(hp.load_robot("go2")), mu=0.5)
    with pytest.raises(
        hp.InputError, match="with a CondensedController, not with a WholeBodyController"
    ):
        exportable_walk(program)
    scripted = hp.WalkingGait(hp.load_robot("go2"), velocity=((0.0, 0.1, 0, 0), (1.0, 0, 0, 0)))
    with pytest.raises(
        hp.InputError, match="a script or function of velocities cannot be exported"
    ):
        exportable_walk(hp.make_controller("condensed", scripted, mu=0.5))


@needs_compiler
def test_single_precision_is_close(folders):
    """Far from a change of the active set the two precisions differ by rounding; most ticks are."""
    motion = ready(hp.load_harpy(), "condensed", duration=1.0)
    what = exportable(motion.controller)
    given = record(motion, what)
    ours, _ = answers(what, folders("harpy", "condensed", "float").code, given)
    theirs, _ = _from_kernels(what, given)
    gap = np.abs(ours - theirs).max(axis=1)
    assert 0.0 < np.median(gap) < 1e-3
    assert gap.max() < 0.5


@needs_compiler
def test_portable_functions(tmp_path):
    """Against NumPy in double precision, at any angle that a robot has, and at the ends."""
    texts = dict.fromkeys(text for texts in PORTABLE.values() for text in texts)
    calls = "".join(
        f"real call_{name}(real x, real y) "
        f"{{ (void)y; return real_{name}({'x, y' if name in TWO else 'x'}); }}\n"
        for name in PORTABLE
    )
    source = tmp_path / "functions.c"
    head = "#include <math.h>\n#include <stdint.h>\ntypedef float real;\ntypedef int32_t integer;\n"
    source.write_text(head + "\n".join(texts) + "\n" + calls)
    library = tmp_path / "functions.so"
    subprocess.run(
        [*compiler(), *EXACT, "-O1", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"],
        check=True,
    )
    lib, rng = ctypes.CDLL(str(library)), np.random.default_rng(0)
    truth = {
        "sin": np.sin,
        "cos": np.cos,
        "atan2": np.arctan2,
        "acos": np.arccos,
        "hypot": np.hypot,
    }
    truth |= {"exp": np.exp, "tanh": np.tanh}
    for name in PORTABLE:
        function = getattr(lib, f"call_{name}")
        function.restype, function.argtypes = ctypes.c_float, [ctypes.c_float, ctypes.c_float]
        reach = {"acos": 1.0, "exp": 80.0}.get(name, 100.0)
        points = [(x, y) for x in (0.0, -0.0, 1.0, -1.0) for y in (0.0, -0.0, 1.0, -1.0)]
        points += np.float32(reach * rng.uniform(-1.0, 1.0, (2000, 2))).tolist()
        for x, y in points:
            expected = truth[name](x, y) if name in TWO else truth[name](x)
            assert function(x, y) == pytest.approx(expected, rel=5e-7, abs=5e-7), (name, x, y)
    for name in ("sin", "cos"):
        assert np.isnan(getattr(lib, f"call_{name}")(np.inf, 0.0))
    ends = {100.0: np.inf, -100.0: 0.0, np.inf: np.inf, -np.inf: 0.0}
    assert all(lib.call_exp(x, 0.0) == end for x, end in ends.items())
    assert np.isnan(lib.call_exp(np.nan, 0.0))
    assert lib.call_tanh(np.inf, 0.0) == 1.0


def test_missing_tools_are_named(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    packages = "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
    assert missing_tools() == f"apt-get install {packages}"
    with pytest.raises(hp.HarpyError, match=packages):
        STUDIES["embedded"].run(quick=True)


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        (
            "solo12",
            {"controller": "paper"},
            "'paper' is for Harpy's legs and thrusters, not for 'solo12'",
        ),
        ("nobody", {}, "unknown robot 'nobody'"),
        (
            "harpy",
            {"controller": "nothing"},
            "unknown controller 'nothing'; valid names: condensed, estimator, filter, paper, walk, "
            "wbc",
        ),
        ("harpy", {"precision": "half"}, "unknown precision 'half'"),
    ],
)
def test_refused_by_name(tmp_path, robot, options, message):
    if robot == "solo12" and hp.model.catalogue.installed_data() is None:
        pytest.skip("needs example-robot-data")
    with pytest.raises(hp.InputError, match=message):
        export(robot, tmp_path, **options)


def test_what_is_not_exported_is_refused():
    gait = hp.make_gait(hp.load_harpy())
    for name, given, message in (
        ("condensed", {"thrust_lag": 0.1}, "a thrust_lag"),
        ("wbc", {"thrust_turning_lag": 0.1}, "a thrust_turning_lag"),
        ("wbc", {}, "a whole-body QP by another solver than 'active_set'"),
        ("governed", {"legs": "feedforward"}, "leg control law 'feedforward'"),
        ("governed", {"governor": "none"}, "governors"),
    ):
        with pytest.raises(hp.InputError, match=f"{message}.* cannot be exported"):
            exportable(hp.make_controller(name, gait, mu=0.5, **given))
    with pytest.raises(hp.InputError, match="a str cannot be exported"):
        exportable("condensed")


@needs_compiler
@needs_board
@pytest.mark.parametrize("chip", long_but(CHIPS, list(CHIPS)[:1]))
def test_on_a_board(folders, chip):
    """Bare metal, in QEMU: the digits are those of this machine."""
    done = folders("harpy", "condensed", "float")
    sources = [f"{done.code.name}.c", "vectors.c", "check.c"]
    program = build(
        done.folder, sources, CHIPS[chip], done.folder / f"{chip}.elf", flags=("-O2", *WARNINGS[1:])
    )
    assert run(program, CHIPS[chip]) == ("all equal: 200 ticks of harpy_condensed, float\n", 0)


@needs_compiler
@needs_board
def test_the_page_of_an_export_says_what_a_tick_costs_on_boards(tmp_path):
    text = (export("harpy", tmp_path / "c", controller="paper").folder / "README.md").read_text()
    for chip in CHIPS.values():
        (row,) = (line for line in text.splitlines() if line.startswith(f"| {chip.title} |"))
        assert all(float(number) > 0 for number in row.split("|")[2:-1])


@pytest.mark.long
@needs_compiler
@needs_board
def test_a_board_counts_what_is_in_a_folder_named_from_here(folders, monkeypatch):
    done = folders("harpy", "paper", "float")
    monkeypatch.chdir(done.folder.parent)
    counted = measure(Path(done.folder.name), done.code.name, next(iter(CHIPS.values())))
    assert len(counted.instructions) == 200
    assert counted.flash > 0
