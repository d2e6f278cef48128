/* Ticks of a controller on recorded states, behind ticks.c: with the calls and the clock of the closed loop.

   The state is copied to where the kernels read it before the clock starts, the command after it has stopped. */

/* Differences of two readings with nothing between them, ns. */
void time_nothing(int64_t count, int64_t *laps)
{
    for (int64_t n = 0; n < count; n++) {
        const int64_t begin = clock_ns();
        laps[n] = clock_ns() - begin;
    }
}

/* Tick through states, each with its time in front; returns how many were answered: all, or those before the first one
   that compiled code hands over to Python. Calls read the state at `sample`, and write the two parts of the command. */
int64_t replay(link *calls, int64_t call_count, double *sample, int64_t sample_size, const double *torque,
               int64_t torque_size, const double *thrust, int64_t thrust_size, const double *states, int64_t count,
               double *commands, int64_t *laps)
{
    for (int64_t n = 0; n < count; n++) {
        const double t = states[0];
        memcpy(sample, states + 1, (size_t)sample_size * sizeof *states);
        states += 1 + sample_size;
        int64_t answer;
        const int64_t begin = clock_ns();
        if (!run_links(calls, calls + call_count, t, &answer)) return n;
        laps[n] = clock_ns() - begin;
        memcpy(commands, torque, (size_t)torque_size * sizeof *commands);
        memcpy(commands + torque_size, thrust, (size_t)thrust_size * sizeof *commands);
        commands += torque_size + thrust_size;
    }
    return count;
}
