@if local

static const double K_LM = $K_LM; /* $K_LM_text N/m */
static const double B_LM = $B_LM; /* $B_LM_text N s/m */
@end

void ws_init(ws_state *s, double x)
{
    static const ws_state rest = {0};
    *s = rest;
    s->wall.K_VE = $K_VE;      /* $K_VE_text N/m */
    s->wall.B_VE = $B_VE;      /* $B_VE_text N s/m */
    s->wall.position = $position;  /* $position_text m */
    s->wall.one_sided = $one_sided;
    s->held.touching = !s->wall.one_sided || s->wall.position < 0.0;
@if difference
    s->x_before = x;
@else
    (void)x;
@end
}

/* F_s = K_VE x + B_VE v at the samples of the frame's first tick. */
ws_result ws_slow_frame(ws_state *s, ws_sent sent)
{
    const ws_wall wall = s->wall;
    ws_result result = {sent.frame, 0.0, sent.x, sent.v, 1};
    if (!wall.one_sided) {
        result.F = wall.K_VE * sent.x + wall.B_VE * sent.v;
    } else {
        result.touching = sent.x > wall.position;
        if (result.touching)
            result.F = wall.K_VE * (sent.x - wall.position) + wall.B_VE * sent.v;
    }
    return result;
}
$mail
@if local
/* f_m = F_s + K_LM (x - x_ref) + B_LM (v - v_ref) with the held F_s and the samples that it was computed from. */
@else
/* f_m = F_s, held. */
@end
double ws_fast_tick(ws_state *s, double x, double v)
{
    double f_m;
@if difference
    v = (x - s->x_before) / WS_T;
    s->x_before = x;
@end
    s->waiting = 0;
@if !delay0
    collect(s);
@end
    if (s->phase == 0) {
        s->sent.frame = ++s->frame;
        s->sent.x = x;
        s->sent.v = v;
@if delay0
        if (s->late)
            s->waiting = 1;
        else
            s->held = ws_slow_frame(s, s->sent);
        s->late = 0;
@else
        s->waiting = 1;
@end
    }
    f_m = s->held.F;
@if local
    if (s->held.touching)
        f_m = f_m + K_LM * (x - s->held.x) + B_LM * (v - s->held.v);
@end
    s->f_m = f_m;
    s->touching = s->held.touching;
    count(s);
    return f_m;
}
