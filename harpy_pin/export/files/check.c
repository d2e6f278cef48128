/* Every recorded tick once more: what is computed here must be what was recorded. */

#include <math.h>
#include <stdio.h>

#include "vectors.h"

int main(void)
{
    static struct ${name}_state state;
    int different = 0, first = -1;
    double largest = 0.0;
    ${name}_init(&state);
    for (int n = 0; n < ${NAME}_TICKS; n++) {
        $real command[${NAME}_OUTPUTS];
        int same = ${name}_replay(&state, n, command) == ${name}_statuses[n];
        for (int i = 0; i < ${NAME}_OUTPUTS; i++) {
            const $real expected = ${name}_commands[n][i];
            const double gap = fabs((double)command[i] - (double)expected);
            if (!(command[i] == expected)) {
                same = 0;
            }
            if (!(gap <= largest)) {
                largest = gap;
            }
        }
        if (!same) {
            different++;
            first = first < 0 ? n : first;
        }
    }
    if (different == 0) {
        printf("all equal: %d ticks of $name, $real\n", ${NAME}_TICKS);
        return 0;
    }
    printf("$name, $real: %d of %d ticks differ, the first is %d; ", different, ${NAME}_TICKS, first);
    printf("largest difference of a command %g N or N m\n", largest);
    return 1;
}
