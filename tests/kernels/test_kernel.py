"""Kernels that Python may call: arrays of the wrong size are refused, and nothing around an array
is touched.
"""

import importlib
import os
import pkgutil
import re
import subprocess
import sys
from itertools import chain

import numpy as np
import pytest
from public_calls import public_names

import harpy_pin
import reproduction
from harpy_pin import Estimator, InputError
from harpy_pin.errors import KernelError
from harpy_pin.governors import ExplicitReferenceGovernor, ForceRows
from harpy_pin.governors.point_mass import Law, model_record
from harpy_pin.ground.ground import Ground
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.argument_types import argument_types
from harpy_pin.kernels.entry_points import entry_code
from harpy_pin.model.dynamics import dynamics_record
from harpy_pin.model.kinematics import LegGeometry
from harpy_pin.simulation.step import step_record
from reproduction.gait.planar_gait import PlanarGait
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.planar_walk import PlanarJoints, walk_record

GUARD, CANARY = 32, 1.2345e67


def checked_kernels():
    """Kernels that say the sizes of their arrays, but for those whose sizes are of a controller's
    record.
    """
    both = (
        pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        for package in (harpy_pin, reproduction)
    )
    for module in chain(*both):
        if not module.name.endswith("__main__"):
            for name, value in vars(importlib.import_module(module.name)).items():
                own = (
                    isinstance(value, Kernel)
                    and value.__module__ == module.name
                    and not name.startswith("_")
                )
                array = value.py_func.__annotations__.get("return") == "Vector" if own else False
                if (
                    own
                    and value._shapes
                    and not array
                    and not any(map(_of_part, value._shapes.values()))
                ):
                    yield f"{module.name}.{name}", value


def _of_part(shape):
    """Whether it is the shape of a field of what Python never calls a kernel with."""
    return str(shape).startswith(("r.", "f."))


KERNELS = dict(checked_kernels())


@pytest.fixture(scope="module")
def records(robot):
    """An example of every record that a kernel takes, by the name of its argument and, where that
    is not enough, the kernel's.
    """
    model = PlanarModel.from_robot(robot)
    walk = walk_record(PlanarGait(), PlanarJoints(), period=1e-3)
    leg = LegGeometry.from_robot(robot, robot.feet[0])
    reduced = model_record(mass=4.0, g=9.81, gains=None, law=Law.FULL)
    return {
        "leg": leg.record[0],
        "gains": reduced[0],
        "model": {
            "axial_force": reduced[0],
            "planar_step": model.record,
            "planar_control": model.record[0],
        },
        "p": {"explicit_update": ExplicitReferenceGovernor(ForceRows(mass=4.0, mu=0.3))._record[0]},
        "walk": walk[0],
        "gait": walk[0],
        "d": {"turn_feet": dynamics_record(robot)[0], "*": model.record[0]},
        "ground": {"planar_step": Ground().record, "*": Ground().record[0]},
        "e": Estimator(robot)._record_[0],
        "step": step_record({"nv": 7, "feet": 2}, dt=1e-3),
        "f": Estimator(robot)._record_["filter"][0],
    }


def record_of(records, name, argument):
    found = records[argument]
    return found.get(name, found.get("*")) if isinstance(found, dict) else found


def sizes_of(shape, record, numbers):
    if isinstance(shape, str):
        return np.shape(record[shape.split(".")[1]])
    sizes = []
    for entry in shape:
        name = str(entry).lstrip("0123456789")
        if isinstance(entry, int):
            sizes.append(entry)
        elif name == "+":
            sizes.append(int(entry[:-1]))
        else:
            sizes.append(int(entry[: -len(name)] or 1) * numbers[name])
    return tuple(sizes)


def guarded(shape):
    """An array in the middle of a larger buffer, and a function that says whether the rest of it is
    untouched.
    """
    size = int(np.prod(shape))
    buffer = np.full(size + 2 * GUARD, CANARY)
    inner = buffer[GUARD : GUARD + size].reshape(shape)
    inner[...] = 0.1
    return (
        inner,
        lambda: (buffer[:GUARD] == CANARY).all() and (buffer[GUARD + size :] == CANARY).all(),
    )


def arguments_of(name, function, records):
    """Arguments that fit, and for each array what says whether its surroundings are untouched."""
    given, intact = {}, []
    shapes = function._shapes
    for argument, parameter in function._signature.parameters.items():
        shape = shapes.get(argument)
        if shape is None:
            known = argument in records and record_of(records, name, argument) is not None
            given[argument] = record_of(records, name, argument) if known else 1
        elif isinstance(shape, str) and "." not in shape:
            given[argument] = 2
        else:
            record = (
                None
                if not isinstance(shape, str)
                else record_of(records, name, shape.split(".")[0])
            )
            given[argument], check = guarded(sizes_of(shape, record, {"n": 2, "m": 2}))
            intact.append(check)
        if argument == "law":
            given[argument] = 1
        if parameter.default is not parameter.empty and shape is None:
            del given[argument]
    return given, intact


def shortened(array, shape):
    """Too short along an axis whose length is given, else with an axis too many."""
    for axis, entry in enumerate(shape if not isinstance(shape, str) else array.shape):
        if isinstance(entry, int) or entry.endswith("+"):
            return np.delete(array, 0, axis)
    return array[:, None]


def test_public_kernels_are_checked():
    assert all(value._shapes for value in public_names().values() if isinstance(value, Kernel))
    assert len(KERNELS) > 25


@pytest.mark.parametrize("path", KERNELS)
def test_wrong_arrays_are_refused_and_right_ones_leave_their_surroundings(path, records, fuzz):
    function, name = KERNELS[path], path.rpartition(".")[2]
    given, intact = arguments_of(name, function, records)
    function(**given)
    assert all(check() for check in intact)
    rng = np.random.default_rng(0)
    for argument, shape in function._shapes.items():
        right = given[argument]
        if isinstance(shape, str) and "." not in shape:
            wrong = [-1, right + 1, 10**9, 1.5, None]
        else:
            wrong = [
                shortened(right, shape),
                np.zeros((*right.shape, 1)),
                right.astype(int),
                right.astype(np.float32),
                right.tolist(),
                None,
                "x",
            ]
            wrong += [
                array
                for array in (
                    np.zeros(rng.integers(0, 20, rng.integers(0, 4))) for _ in range(10 * fuzz)
                )
                if array.ndim != right.ndim
            ]
        for value in wrong:
            before = {
                key: value.copy() for key, value in given.items() if isinstance(value, np.ndarray)
            }
            with pytest.raises(InputError) as caught:
                function(**{**given, argument: value})
            # Where two arrays should agree in a size and do not, either may be named.
            assert caught.value.name == argument or caught.value.name in function._shapes
            assert f"{caught.value.name} of {name} must be" in str(caught.value)
            numbers = {key: array for key, array in before.items() if array.dtype.names is None}
            assert all(
                np.array_equal(given[key], array, equal_nan=True) for key, array in numbers.items()
            )
        assert all(check() for check in intact)


def test_sizes_agree():
    @kernel(matrix=("n", "n"), x=("n",), y=("3n",), longer=("2+",), columns="n")
    def take(matrix, x, y, longer, columns, scale=1.0):
        """Takes them."""
        return matrix.shape[0] + scale * columns

    def arrays(n=2, m=2, k=2, more=2, columns=1):
        return np.zeros((n, n)), np.zeros(m), np.zeros(3 * k), np.zeros(more), columns

    assert take(*arrays()) == 3
    assert take(*arrays(3, 3, 3, 9, 3)) == 6
    assert take(*arrays(), scale=2.0) == take(*arrays(), 2.0) == 4
    assert take.__doc__ == "Takes them."
    for wrong, name in (
        ({"m": 3}, "x"),
        ({"k": 3}, "y"),
        ({"more": 1}, "longer"),
        ({"columns": 3}, "columns"),
        ({"n": 3}, "x"),
    ):
        with pytest.raises(InputError, match=f"^{name} of take must be "):
            take(*arrays(**wrong))
    with pytest.raises(TypeError, match="missing"):
        take(np.zeros((2, 2)))


def test_kernels_reach_each_other_as_they_are():
    @kernel(x=(3,))
    def inner(x):
        return x[0]

    @kernel
    def outer(x):
        return inner(x) + 1.0

    assert outer(np.ones(3)) == 2.0
    assert outer(np.ones(1)) == 2.0  # not checked
    with pytest.raises(
        InputError,
        match=r"x of inner must be a float64 array of shape \(3,\), got float64 of shape",
    ):
        inner(np.ones(1))


def test_records_that_are_none():
    with pytest.raises(KernelError, match=r"leg_jacobian: 'leg\.upper'"):
        KERNELS["harpy_pin.model.kinematics.leg_jacobian"](1.0, np.zeros(3), np.zeros((3, 3)))
    with pytest.raises(InputError, match="p must be a record with 'rate'"):
        KERNELS["harpy_pin.governors.erg.explicit_update"](np.zeros(6), np.zeros(6), 0.0, None)


def test_debuggers_see_lines_of_python():
    line = three_times.py_func.__code__.co_firstlineno + 2
    text = entry_code(three_times, argument_types(three_times, {"x": 2.0}))
    assert f'#line {line} "{__name__.replace(".", "/")}.py"\n    return 3.0 * x;' in text
    assert "#line" not in three_times.c_source(2.0)


@pytest.mark.needs("gdb")
def test_a_backtrace_shows_files_and_lines_of_python(tmp_path):
    """gdb stops in a kernel, which a library of its own was compiled for."""
    (tmp_path / "twice.py").write_text(
        "from harpy_pin.kernels import kernel\n\n\n@kernel\ndef twice(x: float):\n"
        "    y = x + x\n    return y\n"
    )
    (tmp_path / "use.py").write_text("from twice import twice\n\nprint(twice(1.0))\n")
    asked = ("set breakpoint pending on", "break twice", "run", "backtrace 2")
    words = [word for line in asked for word in ("-ex", line)]
    path = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        ["gdb", "-batch", "-nx", *words, "--args", sys.executable, str(tmp_path / "use.py")],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": path, "HARPY_PIN_CACHE": str(tmp_path)},
    )
    assert re.search(r"#0  twice \(.*\) at .*twice\.py:[67]$", done.stdout, re.MULTILINE), done


@kernel
def three_times(x: float):
    return 3.0 * x
