"""A whole walk as one C program: gait and plant in double precision, the law in single or double.

    python examples/embedded/closed_loop.py

It writes the exported law and ``loop.c`` to a temporary folder, compiles them with this machine's
compiler, and walks Harpy for 20 s at a friction of 0.15. Slip is the path of both feet along the
ground in a step.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import harpy_pin as hp
from harpy_pin.export.code import controller_code, initial_values
from harpy_pin.export.exported_controllers import exportable
from harpy_pin.export.recording import ready
from harpy_pin.gaits.straight import _walk
from harpy_pin.kernels.compiler import compiler
from harpy_pin.kernels.functions import translate
from harpy_pin.kernels.types import REAL, Array, Struct
from harpy_pin.kernels.unit import Unit
from harpy_pin.model.record import make_record
from harpy_pin.simulation.simulator import physics_steps

FRICTION = 0.15
MAIN = """
static struct world world;

static void convert(number *to, const real *from, int count)
{
    for (int n = 0; n < count; n++) {
        to[n] = (number)from[n];
    }
}

int main(void)
{
    static struct harpy_condensed_state law;
    struct world *const state = &world;
    struct harpy_condensed_target target;
    const int numbers = (int)(sizeof target / sizeof(number));
    number q[13], v[12], foot_force[6], command[12];
    real torque[6], thrust[6], push[6] = {0};
    double before = 0.0;
    STATEMENTS
    harpy_condensed_init(&law);
    for (int n = 0; n <= TICKS; n++) {
        if (n > 0 && n % 750 == 0) {
            const double path = state->step.slip.path[0] + state->step.slip.path[1];
            printf("%.6f ", 1e3 * (path - before));
            before = path;
        }
        WALK(n * 1e-3, &state->gait, &state->target);
        convert((number *)&target, (const real *)&state->target, numbers);
        convert(q, state->q, 13);
        convert(v, state->v, 12);
        convert(foot_force, state->step.force, 6);
        (void)harpy_condensed_step(&law, &target, q, v, foot_force, command, command + 6);
        for (int i = 0; i < 6; i++) {
            torque[i] = (real)command[i];
            thrust[i] = (real)command[6 + i];
        }
        (void)PHYSICS(&state->dynamics, &state->ground, &state->step, state->q, state->v, torque,
                      thrust, push);
    }
    printf("\\n%.6f %.6f\\n", state->q[0], state->q[2]);
    return 0;
}
"""


def program(duration: float, *, single: bool) -> dict[str, str]:
    """The files of the walk in C: the exported law, and the loop with gait and plant."""
    motion = ready(hp.load_harpy(), "condensed", duration=duration, friction=FRICTION)
    plant, what = motion.simulator, exportable(motion.controller)
    code = controller_code(what, "harpy_condensed", single=single)
    world = make_record(
        target=what.target,
        gait=motion.gait._record,
        dynamics=plant.dynamics.record,
        ground=plant._ground,
        step=plant.record,
        q=plant.q,
        v=plant.v,
    )
    unit = Unit()
    names = ("target", "gait", "dynamics", "ground", "step")
    one = {name: Array.packed(Struct(world.dtype[name], name), (1,)) for name in names}
    q, v, feet, joints = (Array.packed(REAL, shape) for shape in ((13,), (12,), (2, 3), (6,)))
    walk = translate(unit, _walk, (REAL, one["gait"].element, one["target"].element))
    records = tuple(one[name].element for name in ("dynamics", "ground", "step"))
    physics = translate(unit, physics_steps, (*records, q, v, joints, feet, feet))
    unit.struct(Struct(world.dtype, "world"))
    table, statements = initial_values(unit, world)
    main = MAIN.replace("STATEMENTS", "\n    ".join(statements))
    main = main.replace("TICKS", str(round(1e3 * duration)))
    main = main.replace("WALK", walk.name).replace("PHYSICS", physics.name)
    begin = f'#include <stdio.h>\n\n#include "harpy_condensed.h"\n\ntypedef {code.real} number;'
    loop = "\n\n".join([unit.header(), begin, unit.types(), unit.code(), table, main])
    return {"harpy_condensed.h": code.header, "harpy_condensed.c": code.source, "loop.c": loop}


def run(duration: float, *, single: bool) -> tuple[np.ndarray, np.ndarray]:
    """Slip of each step, mm, and where the body ends: x and height, m."""
    with tempfile.TemporaryDirectory() as folder:
        walk = Path(folder) / "loop"
        for name, text in program(duration, single=single).items():
            (Path(folder) / name).write_text(text)
        command = compiler()
        assert command is not None, "needs a C compiler"
        sources = [str(path) for path in Path(folder).glob("*.c")]
        flags = [
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-Wall",
            "-Wextra",
            "-Wconversion",
            "-Wdouble-promotion",
            "-Werror",
        ]
        subprocess.run([*command, *flags, *sources, "-o", str(walk), "-lm"], check=True)
        text = subprocess.run([str(walk)], check=True, capture_output=True, text=True).stdout
    slip, end = (np.array(line.split(), dtype=float) for line in text.strip().split("\n"))
    return slip, end


if __name__ == "__main__":
    length = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    for name, is_single in (("float", True), ("double", False)):
        slip, end = run(length, single=is_single)
        print(
            f"{name:6}: {len(slip)} steps, slip {slip.mean():.2f} mm in a step, "
            f"largest {slip.max():.2f} mm; ends at x = {end[0]:.3f} m, height {end[1]:.3f} m"
        )
