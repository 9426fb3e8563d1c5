
/* z:
$columns
 */

enum { SUMMED = $summed, KEPT = $kept, WIDTH = $width, ROWS = $rows };

$ticks
@if several
/* The kind of each tick of the frame. */
static const unsigned char KIND[WS_FRAME] = {
$kinds
};

@end
void ws_init(ws_state *s)
{
    static const ws_state rest = {0};
    *s = rest;
}

ws_outputs ws_fast_tick(ws_state *s, ws_inputs in)
{
    double z[WIDTH], y[ROWS];
    ws_outputs out;
@if memory
    int i;
    for (i = 0; i < KEPT; i++)
        z[i] = s->z[i];
@end
$given
@if several
    switch (KIND[s->phase]) {
$cases
    }
@else
    tick_0(z, y);
@end
@if memory
    /* the first states are summed from their changes */
    for (i = 0; i < KEPT; i++)
        s->z[i] = i < SUMMED ? z[i] + y[i] : y[i];
@end
$taken
    s->phase = s->phase + 1 == WS_FRAME ? 0 : s->phase + 1;
    return out;
}
