/* Run vectors.csv through the controller in doubles, as `wavesweep simulate` computed it, and each of its ticks, from the same
 * state, in floats. Each of the WS_ROUNDED operations and constants of a tick is rounded once, so a float may be off by
 * WS_ROUNDED/2^24 of what it would be if all terms were positive, which controller_A.c computes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "controller_A.h"
#include "controller_D.h"

#define WS_ROUNDED $operations
static const char *const NAME[] = {
$names
};
static long differences, changes[WS_PLACES], lost[WS_PLACES];
static double farthest, widest[WS_PLACES], off[WS_PLACES];

static void compare(double found, double expected, const char *name, long tick)
{
    if (memcmp(&found, &expected, sizeof found) != 0 && differences++ < 10)
        printf("tick %ld: %s is %a in doubles, expected %a\n", tick, name, found, expected);
}

int main(int argc, char **argv)
{
    static ws_state s;
    static wsD_state d;
    static wsA_state a;
    static char line[65536];
    const double share = 1.01 * WS_ROUNDED / 16777216; /* 1.01: of what the doubles round */
    long ticks = 0;
    int i;
    FILE *file = fopen(argc > 1 ? argv[1] : "vectors.csv", "r");
    if (!file || !fgets(line, sizeof line, file)) {
        fprintf(stderr, "vectors.csv cannot be read\n");
        return 2;
    }
    ws_init(&s);
    wsD_init(&d);
    wsA_init(&a);
    for (; fgets(line, sizeof line, file); ticks++) {
        char *at = line;
        double before[WS_PLACES];
        wsD_inputs in;
        wsD_outputs out;
        wsA_inputs size;
        ws_inputs rounded;
        strtol(at, &at, 10); /* the number of the tick */
$read
        for (i = 0; i < (int)(sizeof in / sizeof(double)); i++) { /* the members of each are numbers alone */
            ((float *)&rounded)[i] = (float)((double *)&in)[i];
            ((double *)&size)[i] = fmax(fabs(((double *)&in)[i]), 0x1p-126); /* below which a rounding is no share */
        }
        for (i = 0; i < WS_PLACES; i++) {
            before[i] = d.z[i];
            a.z[i] = fmax(fabs(d.z[i]), 0x1p-126);
            s.z[i] = (float)d.z[i];
        }
        ws_fast_tick(&s, rounded);
        wsA_fast_tick(&a, size);
        out = wsD_fast_tick(&d, in);
$compared
        for (i = 0; i < WS_PLACES; i++) {
            const double apart = fabs((double)s.z[i] - d.z[i]);
            const double bound = share * a.z[i] + WS_ROUNDED * 0x1p-149;
            if (!(apart <= bound) && differences++ < 10)
                printf("tick %ld: %s is %.9g, expected %.9g within %.3g\n", ticks, NAME[i], (double)s.z[i], d.z[i], bound);
            farthest = apart > farthest * bound ? apart / bound : farthest;
            widest[i] = bound > widest[i] ? bound : widest[i];
            off[i] = apart > off[i] ? apart : off[i];
            changes[i] += d.z[i] < before[i] || d.z[i] > before[i];
            lost[i] += (d.z[i] < before[i] || d.z[i] > before[i]) && !(s.z[i] < (float)before[i] || s.z[i] > (float)before[i]);
        }
    }
    fclose(file);
    printf("%ld ticks, %d signals each: ", ticks, $count);
    if (differences)
        printf("%ld numbers differ\n", differences);
    else
        printf("no bit of the doubles differs; floats within their bounds, at most %.2g of one\n", farthest);
    for (i = 0; i < WS_PLACES; i++) {
        if (lost[i] > changes[i] / 100)
            printf("%s: %ld of %ld changes are below half a unit in its last place, and left out\n", NAME[i], lost[i], changes[i]);
    }
$told
    return differences || ticks == 0;
}
