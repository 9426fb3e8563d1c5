/* Run vectors.csv, which `wavesweep simulate` computed, through the controller and compare every bit of every signal. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"

enum { SIGNALS = $count, PENDING = $pending };

static const char *const NAMES[SIGNALS] = {$names};

static long differences;

static void compare(double found, double expected, const char *name, long tick)
{
    if (memcmp(&found, &expected, sizeof found) != 0 && differences++ < 10)
        printf("tick %ld: %s is %a, expected %a\n", tick, name, found, expected);
}

int main(int argc, char **argv)
{
    static ws_state s;
    static char line[4096];
    ws_result pending[PENDING]; /* slow results that are late, and the ticks before which they arrive */
    uint64_t arrival[PENDING];
    int waiting = 0;
    long ticks = 0;
@if direct
    double computed = 0.0; /* the last slow force */
@end
    FILE *file = fopen(argc > 1 ? argv[1] : "vectors.csv", "r");
    if (!file || !fgets(line, sizeof line, file)) {
        fprintf(stderr, "vectors.csv cannot be read\n");
        return 2;
    }
    ws_init(&s, $x_first);
    for (; fgets(line, sizeof line, file); ticks++) {
        char *at = line;
        const long late = strtol(at, &at, 10); /* ticks by which this frame's slow result is late, -1 if it is lost */
        const double x = strtod(at + 1, &at), v = strtod(at + 1, &at);
        double found[SIGNALS];
@if direct
        const int event = s.phase == 0;
@end
        int i, kept = 0;
        for (i = 0; i < waiting; i++) {
            if (arrival[i] <= s.tick) {
                ws_receive(&s, pending[i]);
            } else {
                arrival[kept] = arrival[i];
                pending[kept++] = pending[i];
            }
        }
        waiting = kept;
@if delay0
        s.late = s.phase == 0 && late != 0;
@end
        ws_fast_tick(&s, x, v);
        if (s.waiting) {
            const ws_result result = ws_slow_frame(&s, s.sent);
            if (late == 0) {
                ws_receive(&s, result);
            } else if (late > 0 && waiting < PENDING) {
                arrival[waiting] = s.tick - 1 + WS_DELAY + (uint64_t)late;
                pending[waiting++] = result;
            } else if (late > 0) {
                return 3;
            }
@if direct
            computed = result.F;
        } else if (event) {
            computed = s.held.F;
@end
        }
$found
        for (i = 0; i < SIGNALS; i++)
            compare(found[i], strtod(at + 1, &at), NAMES[i], ticks);
        if (*at != '\n' && *at != '\r' && *at != '\0') {
            fprintf(stderr, "row %ld of vectors.csv is not one of this controller\n", ticks);
            return 2;
        }
    }
    fclose(file);
    printf("%ld ticks, %d signals each: ", ticks, SIGNALS);
    if (differences)
        printf("%ld numbers differ\n", differences);
    else
        printf("no bit differs\n");
    return differences || ticks == 0;
}
