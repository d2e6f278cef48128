/* Ticks of a closed loop: kernels are called by their addresses, so that one library serves every robot and controller. It stands behind calls.h. */

#include <time.h>

/* --- rows of a log --- */
enum { FLOAT, WHOLE, TRUTH };

typedef struct {
    const void *source;
    int64_t count;  /* elements */
    int64_t kind;   /* of its elements */
} signal;

/* Write signals into a row, one after the other. */
void copy_row(const signal *signals, int64_t count, double *row)
{
    for (const signal *s = signals; s < signals + count; row += s++->count) {
        const int64_t *wholes = s->source;
        const bool *truths = s->source;
        if (s->kind == FLOAT) memcpy(row, s->source, (size_t)s->count * sizeof *row);
        else if (s->kind == WHOLE) for (int64_t i = 0; i < s->count; i++) row[i] = (double)wholes[i];
        else for (int64_t i = 0; i < s->count; i++) row[i] = truths[i];
    }
}

/* --- ticks --- */
typedef struct {
    link *calls;            /* gait and controller, whose time is taken; then what prepares the row */
    int64_t timed, count;   /* of them */
    bound *physics, *stands;
    const signal *signals;
    int64_t signal_count, width;
    double *t, *push;
    int64_t *tick_ns;
    int64_t push_count;     /* numbers in push: the forces of a tick */
    int64_t misfit;         /* what the physics return for a command that they refuse */
    double start, period;   /* time of tick 0, s, and from one to the next */
    int64_t sweeps, ending; /* out: of the last contact, and how the robot stands */
} loop;

enum { HANDED_OVER = -1 };

static int64_t clock_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + (int64_t)now.tv_nsec;
}

/* At most so many ticks from the given one on, a row for each; returns how many were done.

   pushes has the forces of each tick, or is NULL where nobody pushes. */
int64_t run_ticks(loop *l, int64_t tick, int64_t count, const double *pushes, double *rows)
{
    l->ending = HANDED_OVER;
    for (int64_t n = 0; n < count; n++) {
        const double t = l->start + (double)(tick + n) * l->period;
        int64_t answer;
        const int64_t begin = clock_ns();
        if (!run_links(l->calls, l->calls + l->timed, t, &answer)) return n;
        *l->tick_ns = clock_ns() - begin;
        *l->t = t;
        if (!run_links(l->calls + l->timed, l->calls + l->count, t, &answer)) return n;
        copy_row(l->signals, l->signal_count, rows + n * l->width);
        if (pushes) memcpy(l->push, pushes + n * l->push_count, (size_t)l->push_count * sizeof *pushes);
        l->sweeps = run(l->physics);
        if (l->sweeps == l->misfit) return n;
        const int64_t ending = run(l->stands);
        if (ending != 0) { l->ending = ending; return n + 1; }
    }
    l->ending = 0;
    return count;
}
