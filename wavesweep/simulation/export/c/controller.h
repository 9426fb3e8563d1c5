/* $title
 *
 * Written by wavesweep $version from the spec $name, SHA-256
 *   $digest
 *
@if single
 * C99, IEEE floats, no allocation and no mathematical library. Each operation is that of `wavesweep simulate`, in the same
 * order, rounded to floats; `make check` holds each tick against doubles. SI units.
@else
 * C99, IEEE doubles, no allocation and no mathematical library. Each operation is that of `wavesweep simulate`, in the same
 * order, so every number is the same to the last bit; `make check` compares it. SI units.
@end
 *
 * BUILD IT WITHOUT FUSED MULTIPLICATIONS. A fused a*b + c rounds once where the simulation rounds twice. gcc fuses by default
 * if the processor has such instructions, and with -march=native the vectoriser of gcc 12 has been seen to do so even with
 * -ffp-contract=off. controller.c refuses builds in which that can be seen, and says the way out. What it cannot see: a
 * processor that is set to flush small numbers to zero, or to round otherwise than to nearest.
 *
 * The device is the host's: $plants. Its outputs go in, and what acts on it comes out, to be held over the tick:
 *
 *   ws_init(&s);                     once, at rest
@if steps
 *   s.answered = 1;                  when the engine has answered: the slow blocks run in the next tick, $nominal
 *   out = ws_fast_tick(&s, in);      every $tick_ms ms
 *
 * The ticks from one slow step to the next are one of these:
 *   $lengths
 * An answer between two of these waits for the next; one after the longest steps at once, over the longest, and counts in
 * s.overlong: nothing was computed about such a frame. The results of a step are in place s.delay ticks after it, or, with
 * WS_NEXT, with the next step; s.delay is the spec's, and may be changed before a step, up to the shortest frame.
 *
 * Outputs leave out forces from outside, as the hand's.
@else
 *   out = ws_fast_tick(&s, in);      every $tick_ms ms, the slow blocks in their ticks among them
 *
 * The frame, after which all blocks are in step again, has $frame ticks. Outputs leave out forces from outside, as the hand's.
@end
@if amplifier
 * The amplifier's delay of $late ticks is the device's: out is what it is asked for.
@end
@if dead_times
 * Dead times are the device's, and computed nowhere here: $dead_times; out is what goes into them.
@end
@if wall
 * s.wall may be changed before any tick.
@end
 *
 * What enters each output, besides the hand:
$sums
@if late
 *
 * If the slow results that are shown in a tick cannot be there in time, set s.late[group] = 1 before it. What the tick computes is
 * then in s.sent[group]; ws_receive(&s, &result) before a later tick shows it from there on. Of several results the newest
 * counts; if one is lost, the one before stays. Groups are results that arrive together, in the order of their blocks.
@end
 */
#ifndef WS_CONTROLLER_H
#define WS_CONTROLLER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define WS_FAST_HZ $fast_hz /* $fast_hz_text Hz */
#define WS_T $T       /* s, the period of the tick */
@if steps
#define WS_LONGEST $longest   /* ticks, at most, from one slow step to the next */
#define WS_NEXT (-1)     /* s.delay of results that are in place with the next slow step */
@else
#define WS_FRAME $frame     /* ticks in a frame */
@end

/* The numbers of the controller: ports, states, and numbers in between, by the names that the spec has for blocks and ports. */
enum {
$places
    WS_PLACES
};

typedef struct {
$inputs
} ws_inputs;

typedef struct {
$outputs
} ws_outputs;

@if wall
/* The wall, F = K depth + B speed; a one-sided one fills the depths above `position`. */
typedef struct {
    double K;        /* $K_text */
    double B;        /* $B_text */
    double position; /* $position_text */
} ws_wall;

@end
@if late
enum { WS_RESULTS = $groups, WS_SIGNALS = $most };

/* What a tick of the slow blocks computes. */
typedef struct {
    int group;
    int touched;     /* whether it is of a wall that is touched */
    uint64_t number;
    double value[WS_SIGNALS];
} ws_result;

@end
typedef struct {
@if wall
    ws_wall wall;    /* the host's */
    int touching;    /* whether the force in use is that of a wall that is touched */
    int touched;     /* whether the last one that was computed is */
    int ill_posed;   /* 1 once the wall's force had no solution within a tick, or several */
@end
@if late
    int late[WS_RESULTS]; /* the host's: 1 if this group's result is not there in the next tick */
    ws_result sent[WS_RESULTS];
    uint64_t newest[WS_RESULTS];
@if zero
    unsigned char fresh[WS_RESULTS]; /* whether a message has arrived since the last tick */
@end
@end
@if tells
    uint64_t computed; /* forces of the wall so far */
    unsigned char contacts[$ring];
@end
@if steps
    int answered;    /* the host's: 1 if the engine has answered; 0 again once the step is taken */
    int delay;       /* the host's: ticks until the results of the next step are in place, or WS_NEXT */
    uint32_t overlong; /* steps later than WS_LONGEST ticks after the one before */
    uint32_t since;  /* ticks since the last step */
    int length;      /* number of the length of the frame before it */
@if late
    int wait[WS_RESULTS]; /* ticks until a result is in place, WS_NEXT, or 0 */
@end
@else
    uint32_t phase;  /* of the next tick in its frame */
@end
    double z[WS_PLACES];
} ws_state;

void ws_init(ws_state *s);
ws_outputs ws_fast_tick(ws_state *s, ws_inputs in);
@if late
void ws_receive(ws_state *s, const ws_result *result);
@end

#ifdef __cplusplus
}
#endif
#endif
