/* DAQP on the program of a controller's state: VARIABLES, ROWS, TOLERANCE and the struct STATE are defined before. */

#include <stdlib.h>

#include "api.h"

static DAQPWorkspace workspace;
static DAQPProblem problem;
static int sense[ROWS];
static c_float primal[VARIABLES], multipliers[ROWS];
static DAQPResult result;

static void set_up(struct STATE *state)
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
    workspace.settings->primal_tol = TOLERANCE;
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
