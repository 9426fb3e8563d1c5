/* A host: the controller in a loop with a simulated device, pushed with 1 N from rest for 2 s. Prints a table.
 *
 * On a real device the two lines that move it are gone: x and v come from the sensor, and the force goes to the motors.
 * A real slow environment runs elsewhere: take s.sent to it, and bring its result back, before the delay has passed.
 */
#include <stdio.h>

#include "controller.h"

int main(void)
{
    ws_state s;
    double x = 0.0, v = 0.0; /* the device's position (m) and velocity (m/s) */
    const double hand = 1.0; /* N */
    long tick;
    ws_init(&s, x);
    printf("time_s,x,v,f_m,touching\n");
    for (tick = 0; tick < 2 * (long)WS_FAST_HZ; tick++) {
        const double f_m = ws_fast_tick(&s, x, v);
        if (s.waiting)
            ws_receive(&s, ws_slow_frame(&s, s.sent));
        printf("%.17g,%.17g,%.17g,%.17g,%d\n", (double)tick * WS_T, x, v, f_m, s.touching);
        {
            /* $device; exact for a force held over the tick */
            const double f = hand - f_m;
            const double dx = $px * x + $pv * v + $pf * f;
            const double dv = $vx * x + $vv * v + $vf * f;
            x = x + dx;
            v = v + dv;
        }
    }
    return 0;
}
