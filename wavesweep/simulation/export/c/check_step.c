/* The whole loop as it was analysed, linear and under the input of vectors.csv, with the controller of $own_header in it: every
 * bit of what this reads and gives is compared with the same loop as `wavesweep` runs it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "$own_header"

/* The numbers of the loop. */
enum {
$loop_places
    PLACES
};

typedef struct {
    double z[PLACES];
} ws_state;

static ws_${stem}_state controller;
static long differences, steps;

static void make_step(double *z)
{
    ws_${stem}_step(&controller, $call);
    steps++;
}

static void compare(double found, double expected, const char *name, long tick)
{
    if (memcmp(&found, &expected, sizeof found) != 0 && differences++ < 10)
        printf("tick %ld: %s is %a, expected %a\n", tick, name, found, expected);
}

$loop_programs
@if sent
/* What messages bring, and where it comes. */
enum { SENT = $count_sent, TICKS = $ticks };
static const int COMPUTED[] = {$computed};
static const int ARRIVED[] = {$arrived};
static double sent[TICKS][SENT];

@end
int main(int argc, char **argv)
{
    static ws_state loop;
    static char line[65536];
    ws_state *const s = &loop;
    double *const z = s->z;
    long tick = 0;
    FILE *file = fopen(argc > 1 ? argv[1] : "vectors.csv", "r");
    if (!file || !fgets(line, sizeof line, file)) {
        fprintf(stderr, "vectors.csv cannot be read\n");
        return 2;
    }
    ws_${stem}_init(&controller);
    for (; fgets(line, sizeof line, file); tick++) {
        char *at = line;
        long program, before;
@if sent
        int g;
@end
        strtol(at, &at, 10); /* the number of the tick */
        program = strtol(at + 1, &at, 10);
        z[$entry] = strtod(at + 1, &at);
@if sent
        for (g = 0; g < SENT; g++) { /* the tick whose message comes: -1 for none, -2 for none that is then zero */
            const long from = strtol(at + 1, &at, 10);
            if (from >= tick || tick >= TICKS) {
                fprintf(stderr, "row %ld of vectors.csv is not one of this loop\n", tick);
                return 2;
            }
            if (from != -1)
                z[ARRIVED[g]] = from < 0 ? 0.0 : sent[from][g];
        }
@end
        before = steps;
        switch (program) {
$loop_cases
        }
@if sent
        for (g = 0; g < SENT; g++)
            sent[tick][g] = z[COMPUTED[g]];
@end
        if (strtol(at + 1, &at, 10) != steps - before)
            differences++;
$compared
    }
    fclose(file);
    printf("%ld ticks of the whole loop, %ld steps, %d signals each: ", tick, steps, $signals);
    if (differences)
        printf("%ld numbers differ\n", differences);
    else
        printf("no bit differs\n");
    return differences || tick == 0;
}
