"""Words of this program and its messages that a user may not know: what each means, and what to do.

The documents have the same texts, see `docs/reference.py`. Columns are explained in
`tables.fields`, words of doubt in `doubts`, keys of a spec in `spec`. Synonyms stand together, with
a comma.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Word(NamedTuple):
    """What a message means, and what a user can do about it."""

    meaning: str
    advice: str


TERMS: Mapping[str, str] = MappingProxyType(
    {
        "absolutely stable": "of a loop with two ports: stable with every pair of passive terminations, one at each port, that hold "
        "their force over a tick",
        "admittance": "displacement of the device over the force of the hand (m/N), at the frequency of that force",
        "alias, image": "a frequency that a sampler cannot tell from another one",
        "avatar": "the point that represents the device in the slow environment",
        "certified": "verified in doubles within bounds on rounding, or in ball arithmetic: no crossing was missed, and no end "
        "is off by more than its accuracy",
        "channel": "the wave line with its filters, samplers and holds, from the user's side to the environments and back",
        "channel norm": "the largest factor by which the channel can amplify waves; passive up to 1",
        "counterexample": "numbers, or a pattern of frames, with which a loop is unstable although it was to be stable for all",
        "direct coupling": "the wall's force is computed from the device's position and velocity, without waves: `dc`, "
        "`dc-slow`",
        "doubt": "the one-word reason why a row is not certified",
        "drift, integrator mode": "a motion that nothing opposes, with an eigenvalue at exactly 1; set aside when stability "
        "is judged",
        "elapsed, nominal step": "the slow environment integrates over the time since its last frame, or always over the "
        "same time",
        "felt stiffness": "force over displacement that the hand meets when everything has come to rest (N/m)",
        "frame": "the time after which all rates are in step again, also called hyperperiod",
        "front": "the Pareto front of a search: designs none of which is better than another in every requirement",
        "hole": "a range of unstable values between two stable intervals",
        "impedance": "force of the controller over displacement of the device (N/m); not 1/admittance, which includes the "
        "device",
        "lifted system": "the loop from all inputs of a frame to all its outputs: one system with a single rate",
        "local model": "a simple wall at the fast rate, which answers at once while the slow one is computed",
        "monodromy matrix": "the matrix that takes the states from one frame to the next",
        "open place": "a stretch of values that is neither known to be stable nor known to be unstable",
        "passive": "never gives out more energy than it took in",
        "port": "a place where power is exchanged, as force and velocity or as two waves",
        "proved": "confirmed in ball arithmetic, as `verify --prove` does for certified rows; of a guarantee (for all numbers, "
        "frames, messages or hands), confirmed by the checker of its proof",
        "prev": "in the wires of a drawn loop, `prev(BLOCK.PORT)` is a signal as it was before the tick: what a program "
        "reads that has not yet computed the new value",
        "settled": "proof and counterexample are so close together that the gap between them does not matter",
        "slice, column": "one combination of the values of all axes other than the one along which intervals are computed",
        "spec": "the TOML file that describes the loop and the question",
        "spectral radius": "the largest modulus of an eigenvalue of the monodromy matrix; the loop is stable if it is below 1",
        "the spec's own": "the values that the spec sets, in contrast to those that a sweep or a search tries: the nominal "
        "design",
        "tick": "the period of the fast rate; all times are whole numbers of ticks",
        "unknown, varying": "of a number in `[for_all]`: constant but known only as a range; or different in every frame",
        "virtual coupling": "a spring and a damper between the device and its avatar, which limit what the hand can feel; "
        "`K_LM`, `B_LM` of `dc-lm` act like one about the last sample",
        "wall": "the spring `K_VE` and the damper `B_VE` of the virtual environment",
        "wave variables": "two combinations of force and velocity whose squares are power, so that a delay generates no energy",
        "wave impedance": "the ratio of force to velocity in a wave (N·s/m): the damper that is felt until the answer is back",
        "wish": "a requirement or an objective in `[design.wish]`: a quantity to be made large or small, with or without a "
        "bound",
        "Z-width": "all walls that a design renders stably",
    }
)
MESSAGES: Mapping[str, Word] = MappingProxyType(
    {
        # In verdicts and summaries.
        "default": Word(
            "behind a number in check: the spec does not give it, and the default of its key is taken",
            "Give the number in the spec, or --set it. `wavesweep keys KEY` says what the default stands for.",
        ),
        "assumes": Word(
            "how the wall is integrated, how late its force comes, and how the velocity is measured; an optimistic default is "
            "better than what engines do",
            'Give what your engine does: environment.integration = "explicit", environment.delay in ticks, '
            'device.velocity = "difference".',
        ),
        "acts continuously": Word(
            "in `assumes` of a drawn loop: a plant reads another plant through this number, which acts between ticks too, as a "
            "spring or a motor constant does",
            "If a program computes it, wire the sum to a block of type hold, and the plant to that block's output.",
        ),
        "at least, at most": Word(
            "before an end of a range in check: the range that was searched ends there, and stability does not",
            "stability-region with a longer range in [sweep] finds the end.",
        ),
        "swept range ends, range": Word(
            "the interval reaches the end of the range in [sweep]: stability may go on beyond it",
            "Make the range in [sweep] longer.",
        ),
        "not known": Word(
            "neither stable nor unstable could be shown; nothing is guessed, and the word of doubt in brackets is the reason",
            "`wavesweep explain WORD` with that word says what helps.",
        ),
        "unusual": Word(
            "a number lies far from those of devices and hands, as if it were given in another unit",
            "Lengths are in m, masses in kg, forces in N, angles in rad. If the number is right, ignore the line.",
        ),
        "solved within a tick, implicit": Word(
            "blocks read each other in the same tick, so their equations are solved together: part of a force acts implicitly",
            "If your program computes one after the other, read the older value with prev(BLOCK.PORT), or add a hold.",
        ),
        "not read": Word(
            "the controller does not use this key or axis: it changes nothing, and rows along it are repeated",
            "Leave it out, or choose a controller that reads it; `wavesweep check SPEC --all` lists what is not read.",
        ),
        "measured, dangerous side": Word(
            "walls that were unstable in an experiment though the model says that they are stable",
            "Correct the model before you rely on it: delay, velocity and mass of the device are the usual reasons.",
        ),
        # Refusals.
        "makes no loop, no solution, loops of direct terms": Word(
            "blocks read each other in the same tick, and their equations have no solution, or none that doubles can find",
            "Let one of them read a value of the tick before: prev(BLOCK.PORT) in a wire, or a hold or delay between them.",
        ),
        "along": Word(
            "stability-region needs one axis along which it looks for stable intervals",
            'Put a range without num into [sweep], as K = { start = 0, stop = 100 }, and name it: along = "K".',
        ),
        "ports": Word(
            "a drawn loop that names neither a hand nor inputs and outputs has no response, no port and nothing to simulate",
            "Name them in [ports]: hand = { force = ..., displacement = ... }, or inputs and outputs; `wavesweep keys ports`.",
        ),
        "not possible": Word(
            "this command cannot work with this spec, for the reason behind the words; other commands can",
            "Change what the reason names; `wavesweep keys KEY` explains a key.",
        ),
        "overwrite": Word(
            "the folder has results of another spec, for other hands or of unknown origin, which are not replaced unasked",
            "Name another folder with --out, or give --overwrite. Results of the same spec file are replaced without it.",
        ),
        "restart, checkpoint": Word(
            "a run that was stopped left its finished part, which is of another version of the spec or of the program",
            "Give --restart to begin anew, or undo the change, and the run goes on where it stopped.",
        ),
        "wait, another run": Word(
            "another process writes the same results",
            "Give --wait to begin when it has ended, or another folder with --out.",
        ),
        "did you mean": Word(
            "a name is not known; the nearest one that is known stands behind it",
            "`wavesweep keys` lists all keys, `wavesweep keys block` all types of blocks, `wavesweep --help` all commands.",
        ),
        "beyond double precision": Word(
            "a number of the spec, or what follows from it, is too large or too small to compute with",
            "Look for a slip in the powers of ten of the spec; check says which numbers are unusual.",
        ),
        "a fault of wavesweep": Word(
            "the program failed where it should have given a message",
            "Give --debug to see where, and report it with the spec.",
        ),
    }
)
