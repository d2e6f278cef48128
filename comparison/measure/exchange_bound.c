/* Counts of the pieces of a search, by the timer that every Cortex-M has: behind the code of the pieces, SYSTEM, FRAME and
   EXCHANGE, and RESET, which gives `*state` its first values. A loop of 200,000 instructions says what a tick of it is. */

static struct bench_state state;

static void reset_state(struct bench_state *state)
{
    RESET
}

static volatile uint32_t *const now = (volatile uint32_t *)0xE000E018u;
static uint32_t before;

static void begin(void)
{
    before = *now;
}

static unsigned long end(void)
{
    return (unsigned long)((before - *now) & 0xFFFFFFu);
}

int main(void)
{
    *(volatile uint32_t *)0xE000E014u = 0xFFFFFFu;
    *now = 0;
    *(volatile uint32_t *)0xE000E010u = 5;
    reset_state(&state);
    begin();
    uint32_t rounds = 100000u;
    __asm volatile("1: subs %0, %0, #1\n\tbne 1b" : "+r"(rounds) : : "cc");
    printf("loop %lu\n", end());
    begin();
    SYSTEM(&state);
    printf("system %lu\n", end());
    begin();
    FRAME(&state);
    printf("frame %lu\n", end());
    for (int size = 0; size < VARIABLES; size++) {
        for (int drops = 0; drops < 2; drops++) {
            for (int sign = -1; sign < 2; sign += 2) {
                reset_state(&state);
                begin();
                (void)EXCHANGE(&state, size, drops, (real)sign);
                printf("exchange %lu\n", end());
            }
        }
    }
    return 0;
}
