"""Ends of a wave line: the avatar of the slow environment and the local model."""

import numpy as np

from wavesweep.loops.block import Block, matrix, numbers
from wavesweep.spec.keys import AHEAD

# (share of the new step in the spring's displacement, share of it in the position that is sent back)
_STEP = {"explicit": (0.0, 1.0), "implicit": (1.0, 1.0), "trapezoidal": (0.5, 0.5)}


def avatar(b, period, integration: str) -> Block:
    """Decoder and avatar of the slow environment, cut at the wall's force.

    `x_dot = (sqrt(2b) u - F)/b`, `v = u - sqrt(2/b) F`. The state `s` is the start of the step, so that all three
    integrations share `s+ = s + period x_dot`: explicit reads x_tilde = s, implicit s + period x_dot, trapezoidal
    s + period x_dot/2 (its s holds half of the last step already).
    b: wave impedance, N*s/m. period: of a slow step, s. Inputs: `u` (sqrt(W)), `F` (N). Outputs: `x_tilde` (m), `x_dot`
    (m/s), `v` (sqrt(W)), `x` (m).
    """
    read, sent = (share * period for share in _STEP[integration])
    along, against = np.sqrt(2 / b), -1 / b
    return Block(
        "avatar",
        ("u", "F"),
        ("x_tilde", "x_dot", "v", "x"),
        ("s",),
        E=matrix([[0]]),
        B=matrix([[period * along, period * against]]),
        C=matrix([[1], [0], [0], [1]]),
        D=matrix([[read * along, read * against], [along, against], [1, -along], [sent * along, sent * against]]),
        # Nothing moves, and the wave comes back with the other sign.
        at_rest=(
            matrix([[0]]),
            matrix([[along, against]]),
            matrix([[1], [0], [0], [1]]),
            matrix([[0, 0], [0, 0], [-1, 0], [0, 0]]),
        ),
        labels=("avatar position",),
    )


def local_model(b, stiffness, damping, period, integration: str) -> Block:
    """The local model of interaction with its own decoder, in a closed loop: `u` in, returned wave `v` out (sqrt(W)).

    b: wave impedance, N*s/m. stiffness: K_LM, N/m. damping: B_LM, N*s/m. period: of a tick, s. integration: of its velocity.

    `x_dot = (sqrt(2b) u - F)/b`, `F = K_LM x_tilde + B_LM x_dot`, `v = u - sqrt(2/b) F`, solved for the step.
    """
    read = AHEAD[integration] * period
    along = np.sqrt(2 * numbers(b))
    total = b + damping + stiffness * read
    # x_dot = (along u - K s)/total, and F = along u - b x_dot turns v into along x_dot - u.
    speed_u, speed_s = along / total, -stiffness / total
    return Block(
        "local",
        ("u",),
        ("v",),
        ("s",),
        E=matrix([[period * speed_s]]),
        B=matrix([[period * speed_u]]),
        C=matrix([[along * speed_s]]),
        D=matrix([[along * speed_u - 1]]),
        at_rest=(matrix([[-numbers(stiffness)]]), matrix([[along]]), matrix([[0]]), matrix([[-1]])),
        labels=("local model position",),
    )
