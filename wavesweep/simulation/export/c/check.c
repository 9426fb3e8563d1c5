/* Run vectors.csv, which `wavesweep simulate` computed, through the controller and compare every bit of its outputs. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"

static long differences;

static void compare(double found, double expected, const char *name, long tick)
{
    if (memcmp(&found, &expected, sizeof found) != 0 && differences++ < 10)
        printf("tick %ld: %s is %a, expected %a\n", tick, name, found, expected);
}

int main(int argc, char **argv)
{
    static ws_state s;
    static char line[65536];
@if late
    enum { PENDING = $pending };
    static ws_result pending[PENDING]; /* results under way, and the ticks before which they arrive */
    static long arrival[PENDING];
    int waiting = 0;
@end
    long ticks = 0;
    FILE *file = fopen(argc > 1 ? argv[1] : "vectors.csv", "r");
    if (!file || !fgets(line, sizeof line, file)) {
        fprintf(stderr, "vectors.csv cannot be read\n");
        return 2;
    }
    ws_init(&s);
    for (; fgets(line, sizeof line, file); ticks++) {
        char *at = line;
        ws_inputs in;
        ws_outputs out;
@if late
        long late[WS_RESULTS]; /* ticks by which the results that are shown in this tick are late, -1 if they are lost */
        int i, kept = 0;
@end
        strtol(at, &at, 10); /* the number of the tick */
@if steps
        s.answered = (int)strtol(at + 1, &at, 10);
        s.delay = (int)strtol(at + 1, &at, 10);
@end
@if late
        for (i = 0; i < WS_RESULTS; i++) {
            late[i] = strtol(at + 1, &at, 10);
            s.late[i] = late[i] != 0;
        }
        for (i = 0; i < waiting; i++) {
            if (arrival[i] <= ticks) {
                ws_receive(&s, &pending[i]);
            } else {
                arrival[kept] = arrival[i];
                pending[kept++] = pending[i];
            }
        }
        waiting = kept;
@end
$read
        out = ws_fast_tick(&s, in);
@if late
        for (i = 0; i < WS_RESULTS; i++) {
            if (late[i] > 0 && waiting == PENDING)
                return 3;
            if (late[i] > 0) {
                arrival[waiting] = ticks + late[i];
                pending[waiting++] = s.sent[i];
            }
        }
@end
$compared
        if (*at != '\n' && *at != '\r' && *at != '\0') {
            fprintf(stderr, "row %ld of vectors.csv is not one of this controller\n", ticks);
            return 2;
        }
    }
    fclose(file);
    printf("%ld ticks, %d signals each: ", ticks, $count);
    if (differences)
        printf("%ld numbers differ\n", differences);
    else
        printf("no bit differs\n");
    return differences || ticks == 0;
}
