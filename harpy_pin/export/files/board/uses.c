#include "$name.h"

static struct ${name}_state state;
static struct ${name}_target target;
static $real numbers[1024];
volatile int status;

int main(void)
{
#ifdef USED
    ${name}_init(&state);
    status = ${name}_step(&state, &target, $arguments);
#endif
    return 0;
}
