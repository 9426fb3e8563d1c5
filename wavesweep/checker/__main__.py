"""`python -m wavesweep.checker SPEC FILE`: a line for each claim of a proof file, proved or refused.

The last line says what they cover of what was asked. Exit code 0: all of it but what it leaves open; 3: less; 1: a claim is
refused; 2: the file is not about this spec, one of the two cannot be read, or they take more processor time than --seconds
allows, or more memory than --megabytes (600 and 900; 0 for any).
"""

import re
import signal
import sys
from pathlib import Path
from textwrap import wrap

from . import VERSION, coverage
from .channel import SENT
from .coverage import gain_in_words, plain, shares_in_words
from .file import LONGEST_SPEC, OF_WALLS, Claim, read
from .reader.loops import Unreadable

try:
    import resource
except ImportError:  # where no system limits memory
    resource = None  # type: ignore[assignment]

USAGE = f"usage: python -m {__package__} [--seconds N] [--megabytes N] SPEC.toml FILE.proof"
# processor time, of which the largest files of the documents take a tenth, and memory
LIMITS = {"--seconds": 600.0, "--megabytes": 900.0}
NUMBER = re.compile(r"[0-9]{1,9}(\.[0-9]{1,9})?")
SCOPES = {
    "modes": "the spec's own loop",
    "for all": "all that [for_all] and its channels allow",
    "refuted": "a member of [for_all] or of its channels",
    "mean square": "the chances of [for_all] and its channels",
    "contact": "any wall that pushes and never pulls",
    "goes on": "a wall that pushes and never pulls",
    "gain": "the spec's own loop",
    "port": "the spec's own loop",
}
WALLS = "function of stiffness times depth plus damping times speed that is 0 at 0 and has slopes from 0 to 1, the same in all frames"


def motions_in_words(claim: Claim) -> str:
    """What a claim says of the loop's motions: that they decay, grow, go on or keep a gain."""
    if claim.claim == "for all":
        return "every motion decays"
    if claim.claim == "mean square":
        return "the mean of all squares decays"
    if claim.claim == "contact":
        return f"every motion comes to rest, if its force is any {WALLS}"
    if claim.claim == "goes on":
        forces = ", ".join(map(plain, claim.forces))
        frames = f" in frames {', '.join(claim.word)}" * bool(claim.word)
        return f"its forces{frames} are {forces} and so on for ever, under a push that adds constants, if its force is a certain {WALLS}"
    if claim.claim == "port":
        return "stable, and the hand's port is passive if its force is held over a tick"
    if claim.gain:
        return "stable, and " * (claim.gain.source != SENT) + gain_in_words(claim.gain)
    return modes_in_words(claim)


def modes_in_words(claim: Claim) -> str:
    """How many modes are inside or outside the unit circle, or another one."""
    circle = "the unit circle"
    if claim.radius != 1:
        circle = f"the circle of radius {plain(claim.radius)} in each period of its rates"
    if claim.outside:
        modes = "1 mode is" if claim.outside == 1 else f"{claim.outside} modes are"
        words = f"{modes} outside {circle}{', unstable' if claim.radius == 1 else ''}"
        if claim.word:
            times = [plain(claim.times[letter][0]) for letter in claim.word if claim.times]
            words += f", with {'ticks of' if times else 'frames'} {', '.join(times or claim.word)}{' s' if times else ''} for ever"
        return words
    if not claim.states:
        return "there is no mode"
    modes = "the only mode is"
    if len(claim.states) > 1:
        modes = f"all {len(claim.states)} modes are"
    return f"{modes} inside {circle}{', stable' if claim.radius == 1 else ''}"


def in_words(claim: Claim) -> str:
    """What a claim says, from its data."""
    points = {name: low for name, (low, high) in claim.sides.items() if low == high}
    where = [
        f"{name} from {plain(low)} to {plain(high)}"
        for name, (low, high) in claim.sides.items()
        if name not in points
    ]
    where += [f"{name} = {plain(value)}" for name, value in (points | claim.numbers).items()]
    where += [f"at {claim.cut}"] * bool(claim.cut)
    words = f"{SCOPES[claim.claim]}, {', '.join(where) or 'its own numbers'}: "
    if claim.times and claim.claim == "for all":
        low, high = min(claim.times.values())[0], max(claim.times.values())[1]
        words += f"with ticks of any times from {plain(low)} to {plain(high)} s, "
    words += shares_in_words(claim.shares) if claim.shares else motions_in_words(claim)
    if claim.in_touch and claim.claim not in ("modes", *OF_WALLS):
        words += " (walls are always in touch, although [for_all] has contact)"
    if claim.drifts:
        words += f" ({len(claim.drifts)} {'drift' if len(claim.drifts) == 1 else 'drifts'} set aside, which nothing opposes)"
    return words


def main(arguments: list[str]) -> int:
    """Check a file; 0: all is proved, 1: a claim is refused, 2: it cannot be read, 3: less than was asked."""
    limits = dict(LIMITS)
    while arguments[:1] and arguments[0] in limits and NUMBER.fullmatch("".join(arguments[1:2])):
        limits[arguments[0]] = float(arguments[1])
        arguments = arguments[2:]
    if len(arguments) != 2:
        print(USAGE, file=sys.stderr)
        return 2
    print(f"wavesweep checker {VERSION}", flush=True)
    verdicts: list[bool] = []
    proved: list[Claim] = []
    try:
        limited(*limits.values())
        with Path(arguments[0]).open("rb") as spec, Path(arguments[1]).open("rb") as file:
            proof = read(spec.read(LONGEST_SPEC + 1), file)
            for claim, why in proof.claims:
                verdicts.append(not why)
                proved += [claim] * (not why)
                said = in_words(claim)
                words = f"REFUSED: {said}: {why}" if why else f"proved: {said}"
                print(lines_of(words), flush=True)
            covered, whole = coverage.in_words(proof.tables, proof.ran, proof.question, proved)
    except (Unreadable, OSError) as error:
        print(lines_of(f"not checked: {error}"), file=sys.stderr)
        return 2
    except MemoryError:
        size = f"{limits['--megabytes']:g} MB of memory; --megabytes N"
        words = f"not checked: the spec or the file takes more than {size} allows for more"
        print(words, file=sys.stderr)
        return 2
    finally:
        limited(0, 0)
    print(f"{sum(verdicts)} of {len(verdicts)} claims proved")
    print(lines_of(covered))
    if not all(verdicts):
        return 1
    return 0 if whole else 3


def limited(seconds: float, megabytes: float) -> None:
    """Raise Unreadable after so much processor time, and MemoryError beyond so much more memory than now, on a system
    that has such limits; never for 0."""

    def stop(*_):
        raise Unreadable(
            f"the spec or the file takes more than {seconds:g} s of processor time; --seconds N allows for more"
        )

    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGPROF, stop)
        signal.setitimer(signal.ITIMER_PROF, seconds, 1.0 if seconds else 0.0)
    pages = Path("/proc/self/statm")
    if resource and pages.exists():
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        used = int(pages.read_text().split()[0]) * resource.getpagesize()
        soft = used + int(megabytes * 2**20) if megabytes else hard
        resource.setrlimit(resource.RLIMIT_AS, (min(soft, hard) if hard > 0 else soft, hard))


def lines_of(text: str) -> str:
    """A sentence in lines of at most 119 letters, those after the first indented; names of a spec may have any characters."""
    printable = "".join(character if character.isprintable() else "?" for character in text)
    return "\n    ".join(wrap(printable, 115, break_on_hyphens=False))


def run():
    sys.setrecursionlimit(20_000)  # of long sums in a spec
    sys.exit(main(sys.argv[1:]))


if __name__ == "__main__":
    run()
