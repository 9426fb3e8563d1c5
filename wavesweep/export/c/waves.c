
static const double b = $b;          /* wave impedance, $b_text N s/m */
static const double Kp = $Kp;         /* position correction, $Kp_text N^(1/2) m^(-1/2) s^(-1/2) */
static const double ROOT_2B = $root_2b;    /* sqrt(2 b) */
static const double ROOT_2_B = $root_2_b;   /* sqrt(2 / b) */

/* A wall behind a wave port, and its integration: x~ = x + behind x_dot_before + ahead x_dot. */
typedef struct {
    ws_wall wall;
    double behind, ahead, step; /* s */
} port;

static port wall_port(const ws_state *s) /* $wall_integration, once a frame */
{
    port p = {{0.0, 0.0, 0.0, 0}, $wall_behind, $wall_ahead, $wall_step};
    p.wall = s->wall;
    return p;
}
@if local

/* The local model: K_LM = $K_LM_text N/m, B_LM = $B_LM_text N s/m; $local_integration, every tick. */
static const port LOCAL = {{$K_LM, $B_LM, 0.0, 0}, $local_behind, $local_ahead, $local_step};
@end
$filters
/* Inside the wall, solved for the velocity: x_dot (b + B + K ahead) = sqrt(2b) u - K (before - position). */
static ws_avatar pressed(const port *p, const ws_avatar *avatar, double u)
{
    const double K = p->wall.K_VE, B = p->wall.B_VE, position = p->wall.position;
    const double before = avatar->x + p->behind * avatar->x_dot;
    const double x_dot = (ROOT_2B * u - K * (before - position)) / (b + B + K * p->ahead);
    const double F = K * (before + p->ahead * x_dot - position) + B * x_dot;
    const ws_avatar after = {before + p->step * x_dot, x_dot, F, u - ROOT_2_B * F, 1};
    return after;
}

/* Off the wall: no force, and the wave comes back as it was. */
static ws_avatar apart(const port *p, const ws_avatar *avatar, double u)
{
    const double x_dot = ROOT_2_B * u;
    const ws_avatar after = {avatar->x + p->behind * avatar->x_dot + p->step * x_dot, x_dot, 0.0, u, 0};
    return after;
}

/* On the surface, with the part of the damper's force that keeps the avatar there. */
static ws_avatar grazing(const port *p, const ws_avatar *avatar, double u)
{
    const double before = avatar->x + p->behind * avatar->x_dot;
    const double x_dot = (p->wall.position - before) / p->ahead;
    const double F = ROOT_2B * u - b * x_dot;
    const ws_avatar after = {before + p->step * x_dot, x_dot, F, u - ROOT_2_B * F, 1};
    return after;
}

enum { LATER, PRESSED, APART, GRAZING }; /* ways of meeting the wall; LATER: not within this tick */

static ws_avatar meet(int way, const port *p, const ws_avatar *avatar, double u)
{
    return way == PRESSED ? pressed(p, avatar, u) : way == APART ? apart(p, avatar, u) : grazing(p, avatar, u);
}

static int way_of(const port *p, const ws_avatar *avatar, double u)
{
    const double gap = p->wall.position - avatar->x - p->behind * avatar->x_dot;
    const double push = p->ahead * ROOT_2B * u;
    if (!p->wall.one_sided || push > gap * (b + p->wall.B_VE))
        return PRESSED;
    return push <= gap * b ? APART : GRAZING;
}

void ws_init(ws_state *s, double x)
{
    static const ws_state rest = {0};
    *s = rest;
    s->wall.K_VE = $K_VE;      /* $K_VE_text N/m */
    s->wall.B_VE = $B_VE;      /* $B_VE_text N s/m */
    s->wall.position = $position;  /* $position_text m */
    s->wall.one_sided = $one_sided;
    s->slow.touching = !s->wall.one_sided || s->wall.position < 0.0;
    s->held.avatar = s->slow;
@if local
    s->local.touching = 1;
@end
@if difference
    s->x_before = x;
@else
    (void)x;
@end
}

/* The slow environment: x_dot = (sqrt(2b) u_s - F_s) / b, F_s = K_VE x~ + B_VE x_dot, v_s = u_s - sqrt(2/b) F_s. */
ws_result ws_slow_frame(ws_state *s, ws_sent sent)
{
    const port p = wall_port(s);
    ws_result result;
    result.frame = sent.frame;
    s->slow = meet(way_of(&p, &s->slow, sent.u_s), &p, &s->slow, sent.u_s);
    result.avatar = s->slow;
    return result;
}
$mail
@if local
/* The local model's answer to u_h; it is one of a contact, and moves freely while there is none. */
static ws_avatar local_answer(const ws_state *s, double u_h)
{
    if (s->held.avatar.touching) {
        return pressed(&LOCAL, &s->local, u_h);
    } else {
        const ws_avatar away = {0.0, ROOT_2_B * u_h, 0.0, u_h, 0};
        return away;
    }
}

@end
/* v_m = v_1 + v_2 + Kp (x_s - x) for an outgoing wave u_m; nothing is stored. */
static double returned(const ws_state *s, double x, double u_m, int way)
{
@if local
    double v_2 = s->y;
@else
    const double v_2 = 0.0;
@end
@if delay0
    ws_avatar held = s->held.avatar;
    if (way != LATER) {
        const port p = wall_port(s);
        held = meet(way, &p, &s->slow, lp1_output(s, u_m));
    }
@else
    const ws_avatar held = s->held.avatar;
    (void)way;
@end
@if local0
    v_2 = lp2_output(s, local_answer(s, hp_output(s, u_m)).v);
@end
@if !wave_loop
    (void)u_m;
@end
    return held.v + v_2 + Kp * (held.x - x);
}
@if wave_loop

/* The part of a unit wave u_m that comes back within the tick: the loop at rest, its wall at the avatar. */
static double slope(const ws_state *s, int way)
{
    ws_state rest = {0};
    rest.wall = s->wall;
    rest.wall.position = 0.0;
    rest.held.avatar.touching = s->held.avatar.touching;
    return returned(&rest, 0.0, 1.0, way);
}

/* u_m + v_m(u_m) = sqrt(2b) v, where v_m is affine in u_m for each way of meeting the wall; the first way that its own
 * solution allows is taken. There is exactly one if 1 + slope has the same sign for all ways. */
static double solved(ws_state *s, double x, double sent, int *way)
{
    const int several = *way != LATER && s->wall.one_sided;
    double u_m = 0.0;
@if delay0
    if (several && wall_port(s).ahead > 0.0) {
        const double in = 1.0 + slope(s, PRESSED), off = 1.0 + slope(s, APART);
        const double on = s->wall.B_VE == 0.0 ? off : 1.0 + slope(s, GRAZING);
        const int below = in < -1e-12 || off < -1e-12 || on < -1e-12; /* but for rounding */
        if (below && (in > 1e-12 || off > 1e-12 || on > 1e-12))
            s->ill_posed = 1;
    }
@end
    for (;; ++*way) {
        double part = slope(s, *way);
        if (part == -1.0) {
            if (*way == GRAZING)
                return u_m; /* u_m is open: that of free motion is its limit */
            s->ill_posed = 1;
            part = 0.0;
        }
        u_m = (sent - returned(s, x, 0.0, *way)) / (1.0 + part);
@if delay0
        if (several && *way != GRAZING) {
            const port p = wall_port(s);
            const double u_s = lp1_output(s, u_m);
            const double gap = p.wall.position - s->slow.x - p.behind * s->slow.x_dot;
            if (*way == APART ? !(p.ahead * ROOT_2B * u_s <= gap * b) : way_of(&p, &s->slow, u_s) != *way)
                continue;
        }
@else
        (void)several;
@end
        return u_m;
    }
}
@end

double ws_fast_tick(ws_state *s, double x, double v)
{
    const int event = s->phase == 0;
    double sent, u_m, v_m, low, f_m;
@if wave_loop
    int way = LATER;
@end
@if local
    ws_avatar local;
    double u_h;
@end
@if difference
    v = (x - s->x_before) / WS_T;
    s->x_before = x;
@end
    s->waiting = 0;
@if !delay0
    collect(s);
@end

    /* u_m = sqrt(2b) v - v_m, and v_m = v_1 + v_2 + Kp (x_s - x) */
    sent = ROOT_2B * v;
@if delay0
    if (event && !s->late)
        way = PRESSED;
@end
@if wave_loop
@if !local0
    if (way == LATER)
        u_m = sent - returned(s, x, 0.0, LATER);
    else
@end
    u_m = solved(s, x, sent, &way);
@else
    u_m = sent - returned(s, x, 0.0, LATER);
@end
    v_m = sent - u_m;

    /* the anti-aliasing filter, every tick */
    low = lp1_advance(s, u_m);
@if local
    /* the local model: u_h = HP(u_m), y = LP2(v_l) */
    u_h = hp_advance(s, u_m);
    local = local_answer(s, u_h);
@if local0
    s->v_2 = s->y = lp2_advance(s, local.v);
@else
    s->v_2 = s->y;
    s->y = lp2_advance(s, local.v);
@end
    s->local = local;
    s->u_h = u_h;
    s->v_l = local.v;
@end

    if (event) {
        s->sent.frame = ++s->frame;
        s->sent.u_s = s->u_s = low;
@if delay0
        if (way == LATER) {
            s->waiting = 1;
        } else {
            const port p = wall_port(s);
            s->slow = meet(way, &p, &s->slow, low);
            s->held.frame = s->frame;
            s->held.avatar = s->slow;
        }
        s->late = 0;
@else
        s->waiting = 1;
@end
    }
    f_m = b * v - ROOT_2B * v_m;
    s->u_m = u_m;
    s->v_m = v_m;
    s->f_m = f_m;
    s->touching = s->held.avatar.touching;
    count(s);
    return f_m;
}
