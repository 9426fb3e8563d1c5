/* A host: the controller in a loop with a simulated device, $entry, for 2 s. Prints a table.
 *
 * On a real device the lines that move it are gone: `in` comes from the sensors, and `out` goes to the motors.
 */
#include <stdio.h>

#include "controller.h"

int main(void)
{
    static ws_state s;
$host
    double next[$size];
    const double given = 1.0;
    long tick;
@if steps
    static const long FRAMES[] = {
        $pattern
    }; /* ticks that the engine takes for its answers */
    long due = 0, answers = 0;
@end
    ws_init(&s);
    printf("time_s,$header\n");
    for (tick = 0; tick < (long)(2 * WS_FAST_HZ); tick++) {
        ws_inputs in;
        ws_outputs out;
$sensed
@if steps
        if (tick == due) {
            s.answered = 1;
            due += FRAMES[answers++ % $pattern_count];
        }
@end
        out = ws_fast_tick(&s, in);
        printf("%.17g$formats\n", (double)tick * WS_T, $printed);
        /* the device, exact for inputs held over the tick */
$pushed
$moved
    }
    return 0;
}
