/* Run vectors.csv, which the blocks of `wavesweep simulate` computed, through the controller and compare every bit. */
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
        strtol(at, &at, 10); /* the number of the tick */
$read
        out = ws_fast_tick(&s, in);
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
