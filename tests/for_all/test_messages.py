"""Messages that are late or lost, against closed forms and the documents' own reading."""

from collections import defaultdict

import numpy as np
import pytest
from meaning.attacked import growth as growth_of
from support.messages import random_loop, spec_of

import wavesweep
from wavesweep.engine._drawing.drawing import path_of
from wavesweep.engine._sets.enclosed_loop import Side
from wavesweep.engine._switched.any_order import decide
from wavesweep.engine._switched.patterns import growth
from wavesweep.engine.errors import UsageError
from wavesweep.engine.switched import least_refuted, seems_refuted
from wavesweep.for_all.channel_families import Sent, channels_of, frames_with_messages, messages_over
from wavesweep.program.spec import load

PLANT = {"type": "mass", "mass": 10.0, "damping": 1.0}


def integrator(**channel):
    """An integrator, `x' = -K x`, whose input is sent in every tick of 1 s."""
    return {
        "rates": {"tick_hz": 1.0},
        "numbers": {"K": 0.1},
        "block": {"plant": {"type": "tf", "num": [1], "den": [1, 0]}, "net": {"type": "channel", **channel}},
        "wire": {"net.u": "-K*plant.y", "plant.u": "net.y"},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 3}},
    }


def family(spec, along=""):
    spec = load(spec)
    return frames_with_messages(spec.drawing, dict(spec.values), along)


def test_designs_rank_by_where_their_first_pattern_grows():
    """At 2/(n + 1) of an integrator, by losing as many as possible; if the best alone matters, others have bounds."""
    families = [[family(integrator(lost=lost), "K")] for lost in (1, 3)]
    limits = np.array([3.0, 3.0])
    found = least_refuted(families, limits, None, defaultdict(list))
    assert found == pytest.approx([1.0, 0.5], rel=1.1e-3)
    assert (found >= [1.0, 0.5]).all()
    assert least_refuted(families, limits / 5, None, defaultdict(list)) == pytest.approx([0.6, 0.5], rel=1.1e-3)
    best, other = least_refuted(families, limits, np.array([0, 1]), defaultdict(list))
    assert best == pytest.approx(1.0, rel=1.1e-3)
    assert 0.5 <= other <= best
    assert [seems_refuted(families[0][0], x, []) for x in (0.99, 1.01)] == [False, True]


@pytest.mark.slow
@pytest.mark.parametrize(("hz", "lost"), [(10, 16)])
def test_a_mass_holds_its_input_for_no_longer_than_a_constant_interval(hz, lost):
    """`x'' = -0.1 x' + 0.1 u`, `u = -(3.75, 11.5) x`: stable up to an interval of 1.7294 s (W. Zhang et al. 2001)."""
    spec = {
        "rates": {"tick_hz": float(hz)},
        "numbers": {"n": lost},
        "block": {"plant": PLANT, "net": {"type": "channel", "lost": "n"}},
        "wire": {"net.u": "-3.75*plant.x - 11.5*plant.v", "plant.f": "net.y"},
    }
    assert decide(family(spec)).verdict == "proved"
    found = decide(family(spec | {"numbers": {"n": lost + 1}}))
    assert found.verdict == "refuted"
    assert len(found.word) == lost + 2


@pytest.mark.parametrize("ticks", [1, 4, 10])
def test_messages_that_are_always_as_late_have_the_limit_of_that_delay(ticks):
    """K h < min(1/r, 1/(1/2 - r)) for a delay r h, as in sweeps/recipes/network.toml."""
    spec = integrator(every=20, late=ticks)
    spec["rates"] = {"tick_hz": 20.0}
    found = family(spec, "K")
    alone = next(i for i, each in enumerate(found.symbols) if each.late == (("net", ticks),))
    share = ticks / 20
    limit = min(1 / share, 1 / (0.5 - share) if share < 0.5 else np.inf)
    assert growth(found.at(limit * 0.999), (alone,)) < 1 < growth(found.at(limit * 1.001), (alone,))


@pytest.mark.slow
@pytest.mark.parametrize("channel", [{"lost": 1, "missing": "zero"}])
def test_messages_that_carry_what_drifts_are_refused(channel):
    """Two integrators that move together for ever: a message that is zero, or an empty register, would hold them back."""
    spec = integrator(lost=1)
    spec["block"] |= {"other": spec["block"]["plant"], "back": {"type": "channel", **channel}}
    spec["wire"] |= {"back.u": "other.y", "net.u": "K*(back.y - plant.y)", "other.u": "net.y"}
    with pytest.raises(UsageError, match="channels that carry nothing of what drifts"):
        family(spec)
    spec["block"]["back"] = {"type": "channel", "lost": 1}
    assert decide(family(spec)).verdict == "unknown"


def radius(loop, g, late):
    """What a pattern that is repeated for ever multiplies the motion by, by the documents' own reading."""
    return growth_of(spec_of(loop), dict(zip(("up", "down"), map(tuple, late), strict=True)), g=g)


def pattern(found, word):
    """What happens to the messages of both channels in a word."""
    late = Sent.by_channel([found.symbols[each] for each in word])
    return late["up"], late["down"]


def random_word(found, source):
    """A pattern that may be repeated for ever, and that begins and ends with a frame."""
    walk = [int(source.choice(np.flatnonzero([each.moment == 0 for each in found.symbols])))]
    while len(walk) < 4 or not (found.follows[walk[-1], walk[0]] and source.random() < 0.3):
        walk.append(int(source.choice(np.flatnonzero(found.follows[walk[-1]]))))
        if len(walk) > 60:
            return None
    return tuple(walk)


def test_messages_that_no_reader_tells_apart_are_looked_at_once():
    """In a march, those that are left out grow as those in place of them; all are looked at of what is read in every tick."""
    merged = 0
    for seed in range(30):
        source = np.random.default_rng(300 + seed)
        loop = random_loop(source)
        spec = load(spec_of(loop))
        late, alike = [], []
        for channel in channels_of(spec.drawing, dict(spec.values)):
            sent = range(channel.phase, 24, channel.every)
            late.append([int(source.integers(channel.late + 1)) for _ in sent])
            looked_at = [channel.different(tick) for tick in sent]
            alike.append([max(n for n in some if n <= own) for some, own in zip(looked_at, late[-1], strict=True)])
        assert alike[1] == late[1]  # the mass reads them in every tick
        merged += alike != late
        g = source.uniform(0, 3)
        assert radius(loop, g, tuple(alike)) == pytest.approx(radius(loop, g, tuple(late)), rel=1e-6, abs=1e-6)
    assert merged > 4


@pytest.mark.parametrize("seed", [0, 4, 7, 11])
def test_patterns_grow_as_they_do_tick_by_tick(seed):
    source = np.random.default_rng(seed)
    loop = random_loop(source)
    found = family(spec_of(loop), "g")
    words = [word for word in (random_word(found, source) for _ in range(60)) if word][:5]
    assert words
    for word in words:
        late = pattern(found, word)
        g = source.uniform(0, 3)
        assert growth(found.at(g), word) == pytest.approx(radius(loop, g, late), rel=1e-6, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 4, 8])
def test_frames_over_a_range_grow_as_those_of_each_of_its_numbers_do(seed):
    """A proof over a range is no better than these, whatever a search for its worst number finds."""
    source = np.random.default_rng(300 + seed)
    loop = random_loop(source)
    mass, *others = loop["numbers"]
    tables = spec_of(loop)
    tables["numbers"]["m"], tables["block"]["plant"]["mass"] = mass, "m"
    spec, found = load(tables), family(tables, "g")
    box = np.array([[0.1, 0.99 * mass], [0.11, 1.01 * mass]])
    sides = [Side(path_of("g")), Side(path_of("m"))]
    over = messages_over(spec.drawing, dict(spec.values), sides, box).over(box[None])[0].matrices
    word = next(filter(None, (random_word(found, source) for _ in range(60))))
    for s in ([-1, -1], [0.3, -0.5], [1, 1]):
        g, m = box.mean(0) + (box[1] - box[0]) / 2 * s
        frames, own = np.tensordot((s**over.exponents).prod(1), over.terms, (0, 0)), loop | {"numbers": [m, *others]}
        assert growth(frames, word) == pytest.approx(radius(own, g, pattern(found, word)), rel=1e-6)


@pytest.mark.slow
def test_a_range_beside_messages_that_are_lost_at_random():
    """`x' = -K x/d`, or what is held: the least d decides."""
    tables = integrator(loss=0.1, burst=0.05, burst_end=0.5)
    tables["numbers"]["d"], tables["block"]["plant"]["den"] = 1.0, ["d", 0]
    tables |= {"for_all": {"d": {"start": 0.5, "stop": 2.0}}, "sweep": {"along": "K", "K": {"start": 0, "stop": 3}}}
    (row,) = wavesweep.stability_region(tables).query("guarantee == 'mean_square'").itertuples()

    def moments(k):
        sent, held = np.array([[1 - k, 0], [1, 0]]), np.array([[1, -k], [0, 1]])
        kinds = [np.kron(each, each) for each in (sent, held)]
        alone, burst = 0.9 * kinds[0] + 0.1 * kinds[1], kinds[1]
        return np.abs(np.linalg.eigvals(np.block([[0.95 * alone, 0.5 * alone], [0.05 * burst, 0.5 * burst]]))).max()

    assert moments(row.high / 0.5) < 1 < moments(row.fails_from / 0.5)
    assert row.high == pytest.approx(row.fails_from, rel=0.01)
    assert (row.settled, row.certified) == (1, 1)
    assert row.counterexample == "d = 0.5, second moments that grow"
    tables["numbers"]["p"], tables["block"]["net"]["loss"] = 0.1, "p*d/2"
    with pytest.raises(UsageError, match="where probabilities of messages are read from one, found the range of d"):
        wavesweep.stability_region(tables)
