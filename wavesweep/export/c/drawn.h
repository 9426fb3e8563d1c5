/* $title
 *
 * Written by wavesweep $version from the spec $name, SHA-256
 *   $digest
 *
 * C99, IEEE doubles, no allocation and no mathematical library. Each tick is the product of the drawing's blocks and sums, whose
 * terms are added in the order of `wavesweep simulate`, so every number is the same to the last bit; `make check` compares it.
 *
 * BUILD IT WITHOUT FUSED MULTIPLICATIONS. A fused a*b + c rounds once where the simulation rounds twice. gcc fuses by default
 * if the processor has such instructions, and with -march=native the vectoriser of gcc 12 has been seen to do so even with
 * -ffp-contract=off. controller.c refuses builds in which that can be seen, and says the way out. What it cannot see: a
 * processor that is set to flush small numbers to zero, or to round otherwise than to nearest.
 *
 * The device is the host's: $plants. Its outputs go in, and what acts on it comes out, to be held over the tick:
 *
 *   ws_init(&s);                     once, at rest
 *   out = ws_fast_tick(&s, in);      every $tick_ms ms, the slow blocks in their ticks among them
 *
 * The frame, after which all blocks are in step again, has $frame ticks. Outputs leave out forces from outside, as the hand's.
 */
#ifndef WS_CONTROLLER_H
#define WS_CONTROLLER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define WS_FAST_HZ $fast_hz /* $fast_hz_text Hz */
#define WS_T $T       /* s, the period of the tick */
#define WS_FRAME $frame     /* ticks in a frame */

typedef struct {
$inputs
} ws_inputs;

typedef struct {
$outputs
} ws_outputs;

@if memory
/* z: the states of the blocks, then the outputs that hold between the ticks in which their blocks run. */
@end
typedef struct {
    uint32_t phase;  /* of the next tick in its frame */
@if memory
    double z[$kept];
@end
} ws_state;

void ws_init(ws_state *s);
ws_outputs ws_fast_tick(ws_state *s, ws_inputs in);

#ifdef __cplusplus
}
#endif
#endif
