/* Ticks of a controller on recorded states, each timed inside C as the closed loop times its own (ticks.c).

   The state is copied to where the kernels read it before the clock starts, the command after it has stopped. */

#define _POSIX_C_SOURCE 199309L
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

/* --- as in bridge.c and calls.py --- */
enum { MOST_SLOTS = 128, MOST_RESULTS = 16 };
typedef union { void *pointer; double number; int64_t whole; } slot;
typedef struct { void (*entry)(const slot *, slot *); slot slots[MOST_SLOTS]; } bound;
typedef struct { bound *bound; int64_t takes_time, answers, expected; } call;

static int64_t clock_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + (int64_t)now.tv_nsec;
}

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
int64_t replay(const call *calls, int64_t call_count, double *sample, int64_t sample_size, const double *torque,
               int64_t torque_size, const double *thrust, int64_t thrust_size, const double *states, int64_t count,
               double *commands, int64_t *laps)
{
    for (int64_t n = 0; n < count; n++) {
        const double t = states[0];
        memcpy(sample, states + 1, (size_t)sample_size * sizeof *states);
        states += 1 + sample_size;
        const int64_t begin = clock_ns();
        for (const call *c = calls; c < calls + call_count; c++) {
            slot results[MOST_RESULTS];
            results[0].whole = 0;
            if (c->takes_time) c->bound->slots[0].number = t;
            c->bound->entry(c->bound->slots, results);
            if (c->answers && results[0].whole != c->expected) return n;
        }
        laps[n] = clock_ns() - begin;
        memcpy(commands, torque, (size_t)torque_size * sizeof *commands);
        memcpy(commands + torque_size, thrust, (size_t)thrust_size * sizeof *commands);
        commands += torque_size + thrust_size;
    }
    return count;
}
