/* Kernels with arguments that stay where they are, and calls of several, one after the other.

   Nothing is checked here: whoever makes a call binds it to arrays that fit (bind_call of bridge.c) and keeps them
   alive. */

#define _POSIX_C_SOURCE 199309L  /* for files behind this one, which take the time */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { MOST_SLOTS = 128, MOST_RESULTS = 16 };

typedef union { void *pointer; double number; int64_t whole; } slot;

typedef struct { void (*entry)(const slot *, slot *); slot slots[MOST_SLOTS]; } bound;

typedef struct {
    bound *bound;
    int64_t takes_time;  /* whether its first argument is the time of the tick */
    int64_t answers;     /* whether it must return what is expected; otherwise the tick is Python's */
    int64_t expected;
} link;

/* Call one; returns the integer that it returns, if it does. */
static int64_t run(bound *b)
{
    slot results[MOST_RESULTS];
    results[0].whole = 0;
    b->entry(b->slots, results);
    return results[0].whole;
}

/* Call several, whose last answer is kept; false where one does not return what is expected. */
static bool run_links(link *first, const link *end, double t, int64_t *answer)
{
    for (link *l = first; l < end; l++) {
        if (l->takes_time) l->bound->slots[0].number = t;
        *answer = run(l->bound);
        if (l->answers && *answer != l->expected) return false;
    }
    return true;
}
