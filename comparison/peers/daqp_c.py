"""DAQP's own C on a microcontroller: its source comes from its package, and is built in a temporary folder."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from string import Template

from harpy_pin.export.exported_controllers import Exportable

FETCH = 120.0
"""Time for the download, s."""
TOLERANCE = 1e-7
"""Violation that it may leave, as our own search (:mod:`harpy_pin.wbc.active_set_warm_start`)."""
_SOLVER = Template("""
#include <stdlib.h>

#include "api.h"

#define VARIABLES $variables
#define ROWS $rows

static DAQPWorkspace workspace;
static DAQPProblem problem;
static int sense[ROWS];
static c_float primal[VARIABLES], multipliers[ROWS];
static DAQPResult result;

static void set_up(struct ${name}_state *state)
{
    problem.n = VARIABLES;
    problem.m = ROWS;
    problem.ms = (int)state->program.bounded;
    problem.H = state->program.hessian;
    problem.f = state->program.gradient;
    problem.A = state->program.inequality + state->program.bounded * VARIABLES;
    problem.bupper = state->program.upper;
    problem.blower = state->program.lower;
    problem.sense = sense;
    result.x = primal;
    result.lam = multipliers;
    setup_daqp(&problem, &workspace, NULL);
    workspace.settings->primal_tol = $tolerance;
}

/* From nothing: no constraint is active. */
static int solve(void)
{
    daqp_deactivate_constraints(&workspace);
    reset_daqp_workspace(&workspace);
    daqp_update_ldp(DAQP_UPDATE_Rinv | DAQP_UPDATE_M | DAQP_UPDATE_v | DAQP_UPDATE_d | DAQP_UPDATE_sense, &workspace,
                    &problem);
    daqp_solve(&result, &workspace);
    return result.exitflag;
}
""")


def daqp_source(place: Path) -> Path | None:
    """The folder with DAQP's C, of the version that is installed; None where it cannot be had."""
    try:
        desired = f"daqp=={version('daqp')}"
    except PackageNotFoundError:
        return None
    download = ["-m", "pip", "download", "--no-binary", "daqp", "--no-deps", "-q", "-d"]
    command = [sys.executable, *download, str(place), desired]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=FETCH)
        (archive,) = place.glob("daqp-*.tar.gz")
        with tarfile.open(archive) as packed:
            packed.extractall(place, filter="data")
    except (subprocess.SubprocessError, OSError, ValueError):
        return None
    folder = archive.with_name(archive.name.removesuffix(".tar.gz")) / "csrc"
    return folder if (folder / "src" / "api.c").exists() else None


def daqp_count(folder: Path, name: str, what: Exportable) -> None:
    """Make the program ``count`` of an exported folder, whose tick only builds the program, solve it by DAQP.

    In double precision: in single precision DAQP does not end on some of these programs, with none of the tolerances
    that were tried.
    """
    program = what.record.dtype["program"]
    solver = _SOLVER.substitute(
        name=name, variables=program["gradient"].shape[0], rows=program["lower"].shape[0], tolerance=TOLERANCE
    )
    file = folder / "count.c"
    text = file.read_text(encoding="utf-8")
    text = text.replace("#define PAINT", f"{solver}\n#define PAINT")
    replay = f"    (void){name}_replay(state, n, command);\n"
    assert replay in text
    text = text.replace(replay, replay + "    failures += solve() < 0;\n")
    text = text.replace("static uint32_t since(", "static int failures;\n\nstatic uint32_t since(", 1)
    text = text.replace(
        f"    {name}_init(&state);\n",
        f"    {name}_init(&state);\n    (void){name}_replay(&state, 0, command);\n    set_up(&state);\n",
    )
    text = text.replace("    return 0;\n}", "    return failures > 0 ? 5 : 0;\n}")
    file.write_text(text, encoding="utf-8")
