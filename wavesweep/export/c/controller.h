/* $title
 *
 * Written by wavesweep $version from the spec $name, SHA-256
 *   $digest
 *
 * C99, IEEE doubles, no allocation and no mathematical library. Each operation is that of `wavesweep simulate`, in the same
 * order, so every number is the same to the last bit; `make check` compares it. SI units.
 *
 * BUILD IT WITHOUT FUSED MULTIPLICATIONS. A fused a*b + c rounds once where the simulation rounds twice. gcc fuses by default
 * if the processor has such instructions, and with -march=native the vectoriser of gcc 12 has been seen to do so even with
 * -ffp-contract=off. controller.c refuses builds in which that can be seen, and says the way out. What it cannot see: a
 * processor that is set to flush small numbers to zero, or to round otherwise than to nearest.
 *
 * The host owns the device and the wall:
 *
 *   ws_init(&s, x);                        once, at rest at the position x
 *   f_m = ws_fast_tick(&s, x, v);          every $tick_ms ms; $velocity
@if slow
 *   if (s.waiting) {                       a frame of $ratio ticks has begun, and the slow side has to answer
 *       result = ws_slow_frame(&s, s.sent);
 *       ws_receive(&s, result);
 *   }
 *
@if delay0
 * The delay is 0 ticks: ws_fast_tick makes the slow step itself, within the tick, and `waiting` stays 0. If a frame's step
 * cannot be made in time, set s.late = 1 before that tick; then `waiting` is 1 after it, and the result is held when it comes.
@else
 * The result is held from the tick $delay of its frame on (the first is tick 0), however early it is received. One that comes later is
 * held from the next tick on; one that comes after a newer one is not used; if one is lost, the one before stays.
 * ws_slow_frame reads s->wall and changes s->slow only, so it may run beside ws_fast_tick; ws_receive may not.
@end
@else
 *
 * The wall is computed in every tick. If that cannot be done in time, set s.late = 1 before the tick; then `waiting` is 1 after
 * it, and ws_receive(&s, ws_slow_frame(&s, s.sent)) gives the force that is held when it comes.
@end
 *
 * s.wall may be changed before any slow step.
 */
#ifndef WS_CONTROLLER_H
#define WS_CONTROLLER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define WS_FAST_HZ $fast_hz /* $fast_hz_text Hz */
#define WS_T $T       /* s, the period of the fast tick */
#define WS_RATIO $ratio     /* fast ticks in a frame */
#define WS_DELAY $delay     /* fast ticks until a slow result is held */

/* The virtual environment, F = K_VE x + B_VE v; if it is one-sided, it fills the positions above `position`. */
typedef struct {
    double K_VE;     /* N/m */
    double B_VE;     /* N s/m */
    double position; /* m */
    int one_sided;
} ws_wall;

@if waves
/* An avatar, a point behind a wave port that touches a wall. */
typedef struct {
    double x;     /* position x_s, m */
    double x_dot; /* velocity, m/s */
    double F;     /* force F_s, N */
    double v;     /* returned wave v_s, sqrt(W) */
    int touching;
} ws_avatar;

/* What a frame sends to the slow side, and what comes back. Frames count from 1. */
typedef struct {
    uint64_t frame;
    double u_s; /* the filtered wave, sqrt(W) */
} ws_sent;

typedef struct {
    uint64_t frame;
    ws_avatar avatar; /* the pair (v_1, x_s), and the rest of the avatar */
} ws_result;
@else
/* What a frame sends to the slow side, and what comes back. Frames count from 1. */
typedef struct {
    uint64_t frame;
    double x; /* m */
    double v; /* m/s */
} ws_sent;

typedef struct {
    uint64_t frame;
    double F; /* the wall's force F_s, N */
    double x; /* the position and velocity that it was computed from */
    double v;
    int touching;
} ws_result;
@end

typedef struct {
    ws_wall wall;    /* the host's */
    ws_sent sent;    /* what the slow side has to answer if `waiting` is 1 */
    int waiting;
@if delay0
    int late;        /* the host's: 1 if the next frame's slow step is not made within the tick */
@end
@if wave_loop
    int ill_posed;   /* 1 once the wave loop within a tick had no solution, or several */
@end
    /* signals of the last tick, to look at */
    double f_m;      /* control force, N */
    int touching;    /* whether the held slow result is of a contact */
@if waves
    double u_m;      /* wave that leaves the user's side, sqrt(W) */
    double v_m;      /* wave that comes back to it */
    double u_s;      /* LP1's output at the last slow event */
@end
@if local_waves
    double u_h;      /* HP's output, the wave to the local model */
    double v_l;      /* wave that the local model returns */
    double v_2;      /* LP2's output as the user's side used it */
@end
    /* what is kept from tick to tick */
    uint64_t tick, frame; /* ticks run, frames begun */
    uint32_t phase;       /* of the next tick in its frame */
@if difference
    double x_before;      /* position of the tick before */
@end
@if waves
    ws_avatar slow;       /* the avatar of the slow environment */
@end
    ws_result held;       /* the slow result in use */
@if !delay0
    ws_result next;       /* one that waits for its tick */
    int has_next;
@end
@if lp1
    double lp1[$lp1_states];
@end
@if hp
    double hp[$hp_states];
@end
@if lp2
    double lp2[$lp2_states];
@end
@if local_waves
    ws_avatar local;      /* the local model */
    double y;             /* LP2's output of the last tick */
@end
} ws_state;

void ws_init(ws_state *s, double x);
double ws_fast_tick(ws_state *s, double x, double v);
ws_result ws_slow_frame(ws_state *s, ws_sent sent);
void ws_receive(ws_state *s, ws_result result);

#ifdef __cplusplus
}
#endif
#endif
