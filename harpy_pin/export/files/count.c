/* Instructions of every recorded tick, by SysTick, and the stack. In QEMU with -icount every instruction takes the same
   time; a loop of known length says how much that is. A line for each tick: the count of SysTick. */

#include <stdint.h>
#include <stdio.h>

#include "vectors.h"

#define PAINT 0xA5A5A5A5u
#define LOOPS 50000u
#define STACK 262144u

static volatile uint32_t *const control = (volatile uint32_t *)0xE000E010u;
static volatile uint32_t *const reload = (volatile uint32_t *)0xE000E014u;
static volatile uint32_t *const now = (volatile uint32_t *)0xE000E018u;

/* Two instructions for each round. */
__attribute__((noinline)) static void spin(uint32_t rounds)
{
    __asm volatile("1: subs %0, %0, #1\n\tbne 1b" : "+r"(rounds) : : "cc");
}

static uint32_t since(uint32_t before)
{
    return (before - *now) & 0xFFFFFFu;
}

__attribute__((noinline)) static uint32_t tick(struct ${name}_state *state, int n, $real *command)
{
    const uint32_t before = *now;
    (void)${name}_replay(state, n, command);
    return since(before);
}

int main(void)
{
    static struct ${name}_state state;
    static uint32_t counts[${NAME}_TICKS];
    static $real command[${NAME}_OUTPUTS];
    uint32_t here = 0;
    int different = 0;
    uint32_t *const bottom = (uint32_t *)((uintptr_t)&here - STACK), *const top = (uint32_t *)((uintptr_t)&here - 256u);
    *reload = 0xFFFFFFu;
    *now = 0;
    *control = 5;
    uint32_t before = *now;
    spin(LOOPS);
    const uint32_t once = since(before);
    before = *now;
    spin(2 * LOOPS);
    const uint32_t twice = since(before);
    ${name}_init(&state);
    for (volatile uint32_t *word = bottom; word < top; word++) {
        *word = PAINT;
    }
    for (int n = 0; n < ${NAME}_TICKS; n++) {
        counts[n] = tick(&state, n, command);
        for (int i = 0; i < ${NAME}_OUTPUTS; i++) {
            if (!(command[i] == ${name}_commands[n][i])) {
                different++;
                break;
            }
        }
    }
    uint32_t *deepest = bottom;
    while (deepest < top && *deepest == PAINT) {
        deepest++;
    }
    printf("stack %lu different %d\n", (unsigned long)((uintptr_t)&here - (uintptr_t)deepest), different);
    printf("loop %lu %lu\n", (unsigned long)(2 * LOOPS), (unsigned long)(twice - once));
    for (int n = 0; n < ${NAME}_TICKS; n++) {
        printf("%lu\n", (unsigned long)counts[n]);
    }
    return 0;
}
