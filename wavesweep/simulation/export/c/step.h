/* $title
 *
 * Written by wavesweep $version from the spec $name, SHA-256
 *   $digest
 *
 * C99, IEEE doubles, no allocation and no mathematical library. Each operation is that of `wavesweep simulate`, in the same
 * order; SI units. Build it without fused multiplications: $stem.c refuses builds in which they can be seen, and says the way
 * out. `make check` runs it inside the whole loop, and compares every bit of what it reads and gives.
 *
 *   ws_${stem}_init(&s);      once, at rest
 *   ws_${stem}_step(&s, ...); every $period_ms ms: inputs as they are then, outputs to be held until the next step
 *
 * What was analysed is the whole loop:
$about
 */
#ifndef WS_${stem}_H
#define WS_${stem}_H

#ifdef __cplusplus
extern "C" {
#endif

#define WS_${stem}_PERIOD $period /* s: $period_ms ms */

typedef struct {
    unsigned int turn; /* of its next step, of those that are in step again after $count */
    double z[$size];
} ws_${stem}_state;

void ws_${stem}_init(ws_${stem}_state *s);
void ws_${stem}_step(ws_${stem}_state *s, $arguments);

#ifdef __cplusplus
}
#endif
#endif
