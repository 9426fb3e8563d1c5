
/* Whether the first result is of a later frame than the one held. */
static int newer(const ws_state *s, const ws_result *result)
{
    return result->frame > s->held.frame;
}

/* A slow result arrives. Too late a one is held from the next tick on, unless a newer one is. */
void ws_receive(ws_state *s, ws_result result)
{
    if (!newer(s, &result))
        return;
@if delay0
    s->held = result;
@else
    if ((result.frame - 1) * WS_RATIO + WS_DELAY <= s->tick) {
        s->held = result;
    } else {
        s->next = result;
        s->has_next = 1;
    }
@end
}
@if !delay0

/* The result that was to wait until this tick. */
static void collect(ws_state *s)
{
    if (s->has_next && (s->next.frame - 1) * WS_RATIO + WS_DELAY <= s->tick) {
        if (newer(s, &s->next))
            s->held = s->next;
        s->has_next = 0;
    }
}
@end

/* Count the tick that ends. */
static void count(ws_state *s)
{
    s->tick++;
    s->phase = s->phase + 1 == WS_RATIO ? 0 : s->phase + 1;
}
