@if wall

/* The wall's force, from its depth and speed without it; with the force F these are depth + yields F and speed + slows F. */
static void meet(ws_state *s, double yields, double slows)
{
    enum { ONE_SIDED = $one_sided, PULLS = $pulls };
    const double K = s->wall.K, B = s->wall.B, speed = s->z[$wall_speed];
    const double gap = ONE_SIDED ? s->z[$wall_depth] - s->wall.position : s->z[$wall_depth];
    const double whole = 1.0 - K * yields - B * slows;
    s->touched = 1;
@if sizes
    {
        /* of sizes: what the rounding of `whole` does counts as seven roundings of its parts */
        const double parts = (yields < 0.0 ? -K * yields : K * yields) + (slows < 0.0 ? -B * slows : B * slows);
        const double size = whole < 0.0 ? -whole : whole;
        s->z[$wall_force] = (K * gap + B * speed) / size * (1.0 + 7.0 * (1.0 + parts) / size);
        return;
    }
@end
    if (ONE_SIDED && !(gap * (1.0 - B * slows) + yields * B * speed > 0.0)) {
        s->touched = gap > 0.0 && yields < 0.0;
        s->z[$wall_force] = s->touched ? -gap / yields : 0.0;
    } else {
        s->z[$wall_force] = (K * gap + B * speed) / whole;
    }
    if (!PULLS) {
        const double force = (K * gap + B * speed) / whole;
        s->touched = force > 0.0;
        s->z[$wall_force] = s->touched ? force : 0.0;
    }
    if (ONE_SIDED ? !(whole > 0.0) : !(whole < 0.0 || whole > 0.0))
        s->ill_posed = 1;
@if tells
    s->contacts[s->computed++ % $ring] = (unsigned char)s->touched;
@else
    s->touching = s->touched;
@end
}
@end

$programs
@if several
/* The kind of each tick of the frame, and the program of each kind: for the sets of results in time, without contact and with. */
enum { PHASES = $phases };
static const unsigned short KIND[] = {
    $kinds
};
static const unsigned short PROGRAM[] = {
    $table
};

@end
@if results
/* How many newer forces of the wall there are than that of the result which is shown, before the tick; -1: it is computed in
 * the tick, NONE: nothing is shown. TOLD: whether it tells the contact. */
enum { GROUPS = $groups, NONE = -2 };
static const short BEHIND[GROUPS][$phases] = {
    $behind
};
@if tells
static const unsigned char TOLD[GROUPS] = {$told};
@end
@if zero
static const unsigned char ZERO[GROUPS] = {$zero_groups}; /* whether a message that is not there is zero */
@end
@if late
static const int SIZE[GROUPS] = {$sizes};
static const int COMPUTED[GROUPS][WS_SIGNALS] = {$computed};
static const int ARRIVED[GROUPS][WS_SIGNALS] = {$arrived};
@end

@end
@if steps
/* The number of a length of a frame in ticks, -1 of one that no frame has. */
static const short LENGTH[WS_LONGEST + 1] = {
    $length_of
};

@end
void ws_init(ws_state *s)
{
    static const ws_state rest = {0};
    *s = rest;
@if steps
    s->delay = $usual;
    s->since = $before; /* as if a frame of the experiment had just ended */
@end
@if wall
    s->wall.K = $K;
    s->wall.B = $B;
    s->wall.position = $position;
    s->touching = $touching;
@end
}
@if late

void ws_receive(ws_state *s, const ws_result *result)
{
    const int g = result->group;
    int i;
    if (result->number <= s->newest[g])
        return;
    s->newest[g] = result->number;
@if zero
    s->fresh[g] = 1;
@end
    for (i = 0; i < SIZE[g]; i++)
        s->z[ARRIVED[g][i]] = result->value[i];
@if tells
    if (TOLD[g])
        s->touching = result->touched;
@end
}
@end
@if tells

/* Whether the wall was touched, in the result which is shown; as before if there is none yet. */
static int contact(const ws_state *s, uint64_t before, int behind)
{
    if (behind < 0)
        return s->touched;
    return (uint64_t)behind < before ? s->contacts[(before - 1 - (uint64_t)behind) % $ring] : s->touching;
}
@end

ws_outputs ws_fast_tick(ws_state *s, ws_inputs in)
{
    double *const z = s->z;
    ws_outputs out;
@if several
    unsigned int at;
@end
@if results
    unsigned int in_time = 0;
    int g;
@if tells
    const uint64_t before = s->computed;
@end
@end
@if steps
    int begins = 0;
    if (s->answered && (s->since > WS_LONGEST || LENGTH[s->since] >= 0)) {
        begins = 1;
        s->overlong += s->since > WS_LONGEST;
        s->length = LENGTH[s->since > WS_LONGEST ? WS_LONGEST : s->since];
        s->since = 0;
        s->answered = 0;
    }
@if late
    for (g = 0; g < GROUPS; g++) {
        if (s->wait[g] > 0 ? --s->wait[g] == 0 : (s->wait[g] == WS_NEXT && begins)) {
            s->wait[g] = 0;
            ws_receive(s, &s->sent[g]);
        }
    }
@else
    (void)begins;
@end
@end
@if several
@if steps
    at = s->since < PHASES - 1 ? s->since : PHASES - 1;
@else
    at = s->phase;
@end
@end
$given
@if results
    for (g = 0; g < GROUPS; g++) {
        const int behind = BEHIND[g][at];
@if late
@if zero
        if (ZERO[g] && behind != NONE && s->late[g] && !s->fresh[g])
            z[ARRIVED[g][0]] = 0.0;
        s->fresh[g] = 0;
@end
@if steps
        if (behind == NONE || s->late[g] || s->delay != 0)
            continue;
@else
        if (behind == NONE || s->late[g])
            continue;
@end
        in_time |= 1u << g;
@else
        if (behind == NONE)
            continue;
@end
@if tells
        if (TOLD[g] && behind >= 0)
            s->touching = contact(s, before, behind);
@end
    }
@end
@if several
@if steps
    switch (PROGRAM[(unsigned int)KIND[(unsigned int)s->length * PHASES + at] * $sets$place]) {
@else
    switch (PROGRAM[(unsigned int)KIND[at] * $sets$place]) {
@end
$cases
    }
@else
    tick_0(s);
@end
@if results
    for (g = 0; g < GROUPS; g++) {
        const int behind = BEHIND[g][at];
        int touched = 1;
        if (behind == NONE)
            continue;
@if tells
        touched = TOLD[g] ? contact(s, before, behind) : s->touching;
@end
@if late
        {
            ws_result *const sent = &s->sent[g];
            int i;
            sent->group = g;
            sent->touched = touched;
            sent->number++;
            for (i = 0; i < SIZE[g]; i++)
                sent->value[i] = z[COMPUTED[g][i]];
            if (s->late[g]) {
                s->late[g] = 0;
                continue;
            }
@if steps
            s->wait[g] = s->delay;
            if (s->delay != 0)
                continue;
@end
            s->newest[g] = sent->number;
        }
@end
@if tells
        s->touching = touched;
@else
        (void)touched;
@end
    }
@if !late
    (void)in_time;
@end
@end
$taken
@if steps
    s->since += s->since <= WS_LONGEST;
@else
    s->phase = s->phase + 1 == WS_FRAME ? 0 : s->phase + 1;
@end
    return out;
}
